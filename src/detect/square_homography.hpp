// The homography of a unit square, in closed form.
#pragma once

#include <Eigen/Geometry>

#include "detect/quad.hpp"

namespace harco::detect {

/// Maps (0,0), (1,0), (1,1), (0,1) to the four corners (Heckbert 1989). Scaled so that the third
/// coordinate is positive on the square of any convex quad.
inline Eigen::Matrix3d square_homography(const Quad& quad) {
  const Point sum = quad[0] - quad[1] + quad[2] - quad[3];
  const Point d1 = quad[1] - quad[2];
  const Point d2 = quad[3] - quad[2];
  const double det = d1.x() * d2.y() - d1.y() * d2.x();
  const double g = (sum.x() * d2.y() - sum.y() * d2.x()) / det;
  const double h = (d1.x() * sum.y() - d1.y() * sum.x()) / det;
  Eigen::Matrix3d H;
  H.col(0) << quad[1] - quad[0] + g * quad[1], g;
  H.col(1) << quad[3] - quad[0] + h * quad[3], h;
  H.col(2) << quad[0], 1.0;
  return H;
}

/// The quad around that of a square whose sides are moved outwards by `share` of their length.
inline Quad grown(const Quad& quad, double share) {
  if (share == 0.0) return quad;
  const Eigen::Matrix3d H = square_homography(quad);
  const double low = -share, high = 1.0 + share;
  const auto at = [&](double x, double y) {
    return Point((H * Eigen::Vector3d(x, y, 1.0)).hnormalized());
  };
  return {at(low, low), at(high, low), at(high, high), at(low, high)};
}

}  // namespace harco::detect
