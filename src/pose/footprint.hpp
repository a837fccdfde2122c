// Where a pixel lies on a marker.
#pragma once

#include <optional>

#include <Eigen/Core>

namespace harco {

/// Where a pixel's ray meets the marker's plane, and what that depends on.
struct Footprint {
  Eigen::Vector2d point;                ///< in the plane, metres
  Eigen::Matrix2d by_pixel;             ///< d point / d pixel
  Eigen::Matrix<double, 2, 6> by_pose;  ///< d point / d (dt, w), the ray kept
  Eigen::Vector2d bend;                 ///< Laplacian of the point over the pixel's coordinates,
                                        ///< without the lens's own small part
};

/// For the ray through a pixel (normalised image coordinates X/Z, Y/Z), its derivative by the
/// pixel, and a pose (R Exp(w), t + dt). Empty if the ray doesn't meet the plane's front.
std::optional<Footprint> footprint(const Eigen::Vector2d& ray, const Eigen::Matrix2d& ray_by_pixel,
                                   const Eigen::Matrix3d& rotation,
                                   const Eigen::Vector3d& translation);

}  // namespace harco
