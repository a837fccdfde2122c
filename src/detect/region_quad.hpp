// Third stage: regions that are quadrilaterals, to a part of a pixel.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "detect/convex_regions.hpp"
#include "detect/quad.hpp"
#include "detect/threshold.hpp"

namespace harco::detect {

/// Fits quadrilaterals to regions: a line to each side of their outline, where the grey passes the
/// threshold between pixels.
class RegionQuad {
 public:
  void start(const Threshold& threshold, std::size_t level);

  /// Empty if some side isn't straight, bays are open to it, which the ends of rows don't tell of,
  /// or less than `least_area` (square pixels) lies inside.
  std::optional<Quad> fit(const Region& region, double least_area = 0.0);

  /// Points of a region's border, each between a dark and a bright pixel, clockwise; not every one
  /// of a long border. They stay until the next region.
  const std::vector<Point>& border_of(const Region& region);

 private:
  class Ends;
  class SideReader;
  int outermost(int x, int y, int out) const;
  bool measure(int x, int y, int out_x, int out_y);
  bool read_side(const Region& region, std::size_t side);

  const Threshold* threshold_ = nullptr;
  const DarkMap* map_ = nullptr;
  std::size_t level_ = 0;
  bool dark_ = true;
  std::vector<Point> border_;
};

}  // namespace harco::detect
