// Second stage: the borders between dark and bright, to a part of a pixel.
#pragma once

#include <functional>
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

/// Follows every border of a threshold map once. Dark pixels that touch at a corner hang together
/// if the grey between them is dark.
class BorderFollower {
 public:
  /// Calls `visit` with every contour of at least `min_points` points whose bounding box is at
  /// least `min_extent` pixels long on both sides. The contour is valid during the call.
  void follow(const ThresholdMap& map, std::size_t min_points, double min_extent,
              const std::function<void(const Contour&)>& visit);

 private:
  void trace(const ThresholdMap& map, int x, int y);

  std::vector<std::uint8_t> visited_;  // borders on the upper side of dark pixels
  Contour contour_;
};

}  // namespace harco::detect
