// Second stage: the borders between dark and bright, to a part of a pixel.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "detect/convex_regions.hpp"
#include "detect/threshold.hpp"

namespace harco::detect {

using Point = Eigen::Vector2d;

/// A closed border, in pixels.
struct Contour {
  /// Each between a dark and a bright pixel that it parts; not every one of a long border.
  std::vector<Point> points;
  double area = 0.0;  ///< square pixels, positive
  bool hole = false;  ///< bright inside dark; otherwise dark inside bright
};

/// Follows borders of a dark map along the pixels' edges. Dark pixels that touch at a corner hang
/// together if the grey between them is dark.
class BorderFollower {
 public:
  void start(const Threshold& threshold, std::size_t level);

  /// The contour of one region, or null if it doesn't begin there or is far from convex.
  const Contour* around(const RegionTop& top);

 private:
  /// A corner of pixels, the one between (x-1, y-1) and (x, y), and the way on from there: the
  /// pixel on the right-hand side is dark, the one on the left-hand side is bright.
  struct Place {
    int x, y;
    std::size_t direction;
  };

  /// On a way: the bit of the pixel on the upper left of the corner, see DarkMap::origin, and where
  /// to go on to.
  struct Step {
    std::ptrdiff_t at;
    std::size_t direction;
    bool operator==(const Step&) const = default;
  };

  struct Ground;
  std::size_t ask(std::size_t direction, std::ptrdiff_t at) const;
  Step first_step(const Place& from) const;
  void go_on(const Ground& ground, Step& step) const;
  bool follow_from_top(const Place& from, std::size_t most_steps);
  const Contour* measure(const Place& from);

  const Threshold* threshold_ = nullptr;
  const DarkMap* map_ = nullptr;
  std::size_t level_ = 0;

  std::vector<std::uint8_t> way_;  // the directions that were gone,
  std::size_t length_ = 0;         // of which there are so many
  Contour contour_;
};

}  // namespace harco::detect
