#include "track/measurement.hpp"

#include <cmath>

#include <Eigen/Cholesky>

#include "pose/ambiguity.hpp"
#include "track/so3.hpp"

namespace harco::track {

double Innovation::distance() const { return residual.dot(covariance.llt().solve(residual)); }

double Innovation::log_likelihood() const {
  const Eigen::LLT<Matrix6d> llt(covariance);
  const Matrix6d root = llt.matrixL();
  return -0.5 * residual.dot(llt.solve(residual)) - root.diagonal().array().log().sum();
}

Innovation innovation(const Estimate& expected, const Eigen::Isometry3d& pose,
                      const Matrix6d& covariance) {
  Innovation seen;
  seen.residual << pose.translation() - expected.translation,
      so3::log(expected.rotation.transpose() * pose.linear());
  // The measurement's error turns about the measured pose, the state's about the expected one.
  Matrix6d moved = Matrix6d::Identity();
  moved.bottomRightCorner<3, 3>() = so3::right_jacobian_inverse(seen.residual.tail<3>());
  seen.noise = moved * covariance * moved.transpose();
  seen.covariance = expected.covariance.block<6, 6>(kPose, kPose) + seen.noise;
  return seen;
}

Estimate improved(Estimate expected, const Innovation& seen) {
  Covariance& p = expected.covariance;
  const auto states = p.rows();
  using Gain = Eigen::Matrix<double, Eigen::Dynamic, 6, 0, kMostStates, 6>;
  const Gain gain = seen.covariance.llt().solve(p.topRows<6>()).transpose();
  const ErrorState error = gain * seen.residual;

  // Joseph's form: stays symmetric and positive.
  Covariance kept = Covariance::Identity(states, states);
  kept.leftCols<6>() -= gain;
  p = kept * p * kept.transpose() + gain * seen.noise * gain.transpose();

  expected.translation += error.head<3>();
  const Eigen::Vector3d turned = error.segment<3>(3);
  expected.rotation =
      Eigen::Quaterniond(expected.rotation * so3::exp(turned)).normalized().toRotationMatrix();
  expected.rate += error.segment<6>(kRate);
  if (expected.has_swell()) {
    expected.sway += error.segment<6>(kSway);
    expected.sway_rate += error.segment<6>(kSwayRate);
  }
  // The error that is left turns about the new rotation.
  const Eigen::Matrix3d reset = so3::right_jacobian(turned);
  p.middleRows<3>(3) = (reset * p.middleRows<3>(3)).eval();
  p.middleCols<3>(3) = (p.middleCols<3>(3) * reset.transpose()).eval();
  p = (0.5 * (p + p.transpose())).eval();
  return expected;
}

Pose weighed(const Estimate& expected, Pose pose) {
  if (!pose.alternative) return pose;
  Pose alone = pose;  // with the covariance of one solution
  change_ratio(alone, kDecidedLogRatio);
  const double past =
      innovation(expected, pose.camera_T_marker, *alone.covariance).log_likelihood() -
      innovation(expected, *pose.alternative, *alone.covariance).log_likelihood();
  change_ratio(pose, *pose.log_likelihood_ratio + past);
  return pose;
}

}  // namespace harco::track
