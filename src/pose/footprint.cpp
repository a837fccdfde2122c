#include "pose/footprint.hpp"

#include <Eigen/LU>

#include "pose/refine.hpp"

namespace harco {

using Eigen::Matrix2d;
using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

std::optional<Footprint> footprint(const Vector2d& ray, const Matrix2d& ray_by_pixel,
                                   const Matrix3d& rotation, const Vector3d& translation) {
  const Vector3d direction = ray.homogeneous();
  const double facing = rotation.col(2).dot(direction);
  const double depth = rotation.col(2).dot(translation) / facing;
  if (!(facing > 1e-6 && depth > 0.0)) return std::nullopt;
  const Vector3d point = depth * direction;
  Vector3d p = rotation.transpose() * (point - translation);
  p.z() = 0.0;
  Eigen::Matrix<double, 2, 6> ray_by_pose;
  project(rotation, p, point, ray_by_pose);
  Matrix2d ray_by_point;
  for (Eigen::Index i = 0; i < 2; ++i)
    ray_by_point.col(i) = (rotation.block<2, 1>(0, i) - ray * rotation(2, i)) / point.z();
  const Matrix2d inverse = ray_by_point.inverse();

  // The depth is c / (n . d): along a step a of the ray, its derivatives are those of 1 / (n . d).
  Vector3d bend = Vector3d::Zero();
  for (Eigen::Index i = 0; i < 2; ++i) {
    const Vector3d a(ray_by_pixel(0, i), ray_by_pixel(1, i), 0.0);
    const double slope = rotation.col(2).dot(a) / facing;
    bend += 2.0 * depth * (slope * slope * direction - slope * a);
  }
  return Footprint{p.head<2>(), inverse * ray_by_pixel, -inverse * ray_by_pose,
                   (rotation.transpose() * bend).head<2>()};
}

}  // namespace harco
