// Levenberg-Marquardt on one pose.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include <Eigen/Geometry>

#include "pose/observation.hpp"

namespace harco {

/// [v]x, the matrix of the cross product.
Eigen::Matrix3d skew(const Eigen::Vector3d& v);

/// Exp of a rotation vector.
Eigen::Matrix3d rotation_exp(const Eigen::Vector3d& w);

/// Image (X/Z, Y/Z) of `point` = R p + t with its derivative by (dt, w), where R Exp(w) and t + dt.
Eigen::Vector2d project(const Eigen::Matrix3d& rotation, const Eigen::Vector3d& p,
                        const Eigen::Vector3d& point, Eigen::Matrix<double, 2, 6>& jacobian);

/// The covariance of a pose (dt, w) from that of the same pose with its origin moved to `centre`:
/// t = t_centre - R centre, hence dt = dt_centre + R [centre]x w.
Matrix6d moved(const Matrix6d& covariance, const Eigen::Matrix3d& rotation,
               const Eigen::Vector3d& centre);

/// A local minimum of the weighted chi-square.
struct Refined {
  Eigen::Isometry3d camera_T_marker = Eigen::Isometry3d::Identity();
  Matrix6d covariance = Matrix6d::Zero();  ///< of (dt, w) as in Pose, for the noise as given
  std::vector<double> chi2;                ///< of each observation, without its weight
};

/// Minimises sum over observations of weight * |W (projection - image)|^2 over its four corners,
/// from `start`. One weight for each observation, not all zero. Empty if the start has a corner
/// behind the camera, or the corners don't determine a pose.
std::optional<Refined> refine(std::span<const Observation> observations,
                              std::span<const double> weights, const Eigen::Isometry3d& start);

/// Where a pose sees a point of the plane, and how far its covariance lets that be wrong
/// (normalised image coordinates).
struct Prediction {
  Eigen::Vector2d image;
  Eigen::Matrix2d covariance;
};

/// Empty for points behind the camera.
std::optional<Prediction> predict(const Eigen::Isometry3d& pose, const Matrix6d& covariance,
                                  const Eigen::Vector2d& plane_point);

}  // namespace harco
