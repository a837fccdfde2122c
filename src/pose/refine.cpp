#include "pose/refine.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Cholesky>

namespace harco {
namespace {

using Eigen::Isometry3d;
using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Matrix26d = Eigen::Matrix<double, 2, 6>;
using Vector6d = Eigen::Matrix<double, 6, 1>;

/// Pose of a frame at the points' centre, where rotation and translation hardly mix: for a small
/// marker far from the parent's corner they would otherwise cancel each other in most digits.
struct Centred {
  Matrix3d rotation;
  Vector3d translation;
};

struct Linearised {
  double cost = std::numeric_limits<double>::infinity();
  Matrix6d information = Matrix6d::Zero();  ///< J^T J
  Vector6d gradient = Vector6d::Zero();     ///< J^T r
};

Vector3d in_space(const Vector2d& point) { return {point.x(), point.y(), 0.0}; }

/// `chi2`, where asked for, takes each observation's share.
Linearised linearise(std::span<const Observation> observations, std::span<const double> weights,
                     const Vector2d& centre, const Centred& pose,
                     std::vector<double>* chi2 = nullptr) {
  Linearised result;
  double cost = 0.0;
  for (std::size_t k = 0; k < observations.size(); ++k) {
    const Observation& seen = observations[k];
    Eigen::Matrix<double, 8, 1> residuals;
    Eigen::Matrix<double, 8, 6> jacobian;
    bool in_front = true;
    for (Eigen::Index i = 0; i < 4 && in_front; ++i) {
      const Vector3d p = in_space(seen.plane.col(i) - centre);
      const Vector3d point = pose.rotation * p + pose.translation;
      in_front = point.z() > 0.0;
      Matrix26d of_corner;
      const Vector2d image = project(pose.rotation, p, point, of_corner);
      residuals.segment<2>(2 * i) = image - seen.image.col(i);
      jacobian.middleRows<2>(2 * i) = of_corner;
    }
    double own = std::numeric_limits<double>::infinity();
    if (in_front) {
      residuals = seen.whitening.triangularView<Eigen::Lower>() * residuals;
      jacobian = seen.whitening.triangularView<Eigen::Lower>() * jacobian;
      own = residuals.squaredNorm();
      result.information.noalias() += weights[k] * jacobian.transpose() * jacobian;
      result.gradient.noalias() += weights[k] * jacobian.transpose() * residuals;
    }
    if (chi2 != nullptr) chi2->push_back(own);
    if (weights[k] > 0.0) cost += weights[k] * own;
  }
  result.cost = cost;
  return result;
}

Vector2d weighted_centre(std::span<const Observation> observations,
                         std::span<const double> weights) {
  Vector2d sum = Vector2d::Zero();
  double count = 0.0;
  for (std::size_t k = 0; k < observations.size(); ++k)
    if (weights[k] > 0.0) {
      sum += observations[k].plane.rowwise().mean();
      count += 1.0;
    }
  return sum / std::max(count, 1.0);
}

}  // namespace

Matrix3d skew(const Vector3d& v) {
  Matrix3d m;
  m << 0.0, -v.z(), v.y(), v.z(), 0.0, -v.x(), -v.y(), v.x(), 0.0;
  return m;
}

Matrix3d rotation_exp(const Vector3d& w) {
  const double angle = w.norm();
  if (angle < 1e-12) return Matrix3d::Identity() + skew(w);
  return Eigen::AngleAxisd(angle, w / angle).toRotationMatrix();
}

Vector2d project(const Matrix3d& rotation, const Vector3d& p, const Vector3d& point,
                 Matrix26d& jacobian) {
  // d(R Exp(w) p)/dw = -R [p]x.
  const double inverse_z = 1.0 / point.z();
  const Vector2d image = point.head<2>() * inverse_z;
  Eigen::Matrix<double, 2, 3> perspective;
  perspective << inverse_z, 0.0, -image.x() * inverse_z, 0.0, inverse_z, -image.y() * inverse_z;
  jacobian.leftCols<3>() = perspective;
  jacobian.rightCols<3>() = -(perspective * rotation) * skew(p);
  return image;
}

Matrix6d moved(const Matrix6d& covariance, const Matrix3d& rotation, const Vector3d& centre) {
  Matrix6d move = Matrix6d::Identity();
  move.topRightCorner<3, 3>() = rotation * skew(centre);
  return move * covariance * move.transpose();
}

std::optional<Refined> refine(std::span<const Observation> observations,
                              std::span<const double> weights, const Isometry3d& start) {
  constexpr int kIterations = 50;
  constexpr double kMostDamping = 1e8;
  const Vector2d centre = weighted_centre(observations, weights);
  Centred pose{start.linear(), start * in_space(centre)};
  Linearised at = linearise(observations, weights, centre, pose);
  if (!std::isfinite(at.cost)) return std::nullopt;

  double damping = 1e-4;
  for (int i = 0; i < kIterations && damping < kMostDamping; ++i) {
    Matrix6d damped = at.information;
    damped.diagonal() *= 1.0 + damping;
    const Vector6d step = -damped.ldlt().solve(at.gradient);
    const double promised = -at.gradient.dot(step);  // about the decrease of the cost
    if (!(promised > 1e-10 * at.cost + 1e-16)) break;
    Centred next{pose.rotation * rotation_exp(step.tail<3>()), pose.translation + step.head<3>()};
    const Linearised there = linearise(observations, weights, centre, next);
    if (there.cost < at.cost) {
      pose = next;
      at = there;
      damping *= 0.1;
    } else {
      damping *= 10.0;
    }
  }

  Refined refined;
  pose.rotation = Eigen::Quaterniond(pose.rotation).normalized().toRotationMatrix();
  refined.camera_T_marker.linear() = pose.rotation;
  refined.camera_T_marker.translation() = pose.translation - pose.rotation * in_space(centre);
  refined.camera_T_marker.makeAffine();
  refined.chi2.reserve(observations.size());
  at = linearise(observations, weights, centre, pose, &refined.chi2);
  const Eigen::LDLT<Matrix6d> factored(at.information);
  if (!(factored.vectorD().minCoeff() > 0.0)) return std::nullopt;
  const Matrix6d covariance =
      moved(factored.solve(Matrix6d::Identity()), pose.rotation, in_space(centre));
  refined.covariance = 0.5 * (covariance + covariance.transpose());
  if (!refined.covariance.allFinite() || !refined.camera_T_marker.matrix().allFinite())
    return std::nullopt;
  return refined;
}

std::optional<Prediction> predict(const Isometry3d& pose, const Matrix6d& covariance,
                                  const Vector2d& plane_point) {
  const Vector3d p = in_space(plane_point);
  const Vector3d point = pose * p;
  if (!(point.z() > 0.0)) return std::nullopt;
  Matrix26d jacobian;
  const Vector2d image = project(pose.linear(), p, point, jacobian);
  return Prediction{image, jacobian * covariance * jacobian.transpose()};
}

}  // namespace harco
