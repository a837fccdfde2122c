#include "track/so3.hpp"

#include <cmath>

#include <Eigen/Geometry>
#include <Eigen/LU>

namespace harco::so3 {
namespace {

// Below this angle the series' first terms are exact to double precision.
constexpr double kSmall = 1e-4;

}  // namespace

Eigen::Matrix3d hat(const Eigen::Vector3d& v) {
  Eigen::Matrix3d matrix;
  matrix << 0.0, -v.z(), v.y(), v.z(), 0.0, -v.x(), -v.y(), v.x(), 0.0;
  return matrix;
}

Eigen::Matrix3d exp(const Eigen::Vector3d& v) {
  const double angle = v.norm();
  if (angle == 0.0) return Eigen::Matrix3d::Identity();
  return Eigen::AngleAxisd(angle, v / angle).toRotationMatrix();
}

Eigen::Vector3d log(const Eigen::Matrix3d& rotation) {
  Eigen::Quaterniond q(rotation);
  q.normalize();
  if (q.w() < 0.0) q.coeffs() = -q.coeffs();
  const double sine = q.vec().norm();  // of half the angle
  if (sine < kSmall) return 2.0 * q.vec();
  return 2.0 * std::atan2(sine, q.w()) / sine * q.vec();
}

Eigen::Matrix3d right_jacobian(const Eigen::Vector3d& v) {
  const double angle = v.norm();
  const Eigen::Matrix3d cross = hat(v);
  if (angle < kSmall) return Eigen::Matrix3d::Identity() - 0.5 * cross;
  const double square = angle * angle;
  return Eigen::Matrix3d::Identity() - (1.0 - std::cos(angle)) / square * cross +
         (angle - std::sin(angle)) / (square * angle) * cross * cross;
}

Eigen::Matrix3d right_jacobian_inverse(const Eigen::Vector3d& v) {
  const double angle = v.norm();
  const Eigen::Matrix3d cross = hat(v);
  if (angle < kSmall) return Eigen::Matrix3d::Identity() + 0.5 * cross;
  const double half = 0.5 * angle;
  const double square = angle * angle;
  return Eigen::Matrix3d::Identity() + 0.5 * cross +
         (1.0 - half * std::cos(half) / std::sin(half)) / square * cross * cross;
}

}  // namespace harco::so3
