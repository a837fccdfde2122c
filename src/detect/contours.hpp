// Second stage: the borders between dark and bright, to a part of a pixel.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "detect/threshold.hpp"

namespace harco::detect {

using Point = Eigen::Vector2d;

/// A closed border, in pixels.
struct Contour {
  std::vector<Point> points;   ///< one for every pair of a dark and a bright pixel that it parts
  double area = 0.0;           ///< square pixels, positive
  bool hole = false;           ///< bright inside dark; otherwise dark inside bright
  bool at_image_edge = false;  ///< part of it is only where the image ends
};

/// Contours that are not worth their time.
struct ContourLimits {
  std::size_t min_points = 4;
  double min_extent = 0.0;     ///< of the bounding box's both sides, in pixels
  bool holes = true;           ///< take bright regions inside dark
  bool islands = true;         ///< take dark regions inside bright
  bool at_image_edge = false;  ///< take what the image's edge cuts off
};

/// Follows borders of a dark map along the pixels' edges. Dark pixels that touch at a corner hang
/// together if the grey between them is dark.
class BorderFollower {
 public:
  /// Gets ready for next_convex() or next().
  void start(const Threshold& threshold, std::size_t level, const ContourLimits& limits);

  /// The next contour within the limits that may belong to a convex shape that lies within the
  /// image, or null. A contour is followed from where its region begins as seen from above, and
  /// given up where it turns as none does that runs around something convex. So most of what
  /// texture consists of costs some steps only, and nothing has to be remembered of it.
  const Contour* next_convex();

  /// The next contour within the limits of any shape, or null.
  const Contour* next();

 private:
  /// A corner of pixels, the one between (x-1, y-1) and (x, y), and the way on from there: the
  /// pixel on the right-hand side is dark, the one on the left-hand side is bright.
  struct Place {
    int x, y;
    int direction;
  };
  void find_tops();
  void find_upper_edges();
  std::size_t ask(std::size_t direction, std::ptrdiff_t at) const;
  bool follow_convex(const Place& from);
  void follow(const Place& from);
  bool take(const Place& from);

  const Threshold* threshold_ = nullptr;
  const DarkMap* map_ = nullptr;
  std::size_t level_ = 0;
  ContourLimits limits_;

  int row_ = 0;
  std::vector<Place> starts_;  // in this row
  std::size_t next_start_ = 0;
  DarkMap visited_;  // for next(): dark pixels whose upper edge has been followed

  std::vector<std::uint8_t> way_;  // the directions that were gone,
  std::size_t length_ = 0;         // of which there are so many
  Contour contour_;
};

}  // namespace harco::detect
