// How a measured pose improves what is believed.
#pragma once

#include <Eigen/Geometry>

#include "harco/pose.hpp"
#include "track/motion.hpp"

namespace harco::track {

/// A pose against what was expected: r = measured - expected (dt; w), and its covariance.
struct Innovation {
  Vector6d residual = Vector6d::Zero();
  Matrix6d noise = Matrix6d::Zero();       ///< the measurement's share of the covariance
  Matrix6d covariance = Matrix6d::Zero();  ///< of the residual

  double distance() const;        ///< squared Mahalanobis
  double log_likelihood() const;  ///< of the residual, but for a constant
};

/// `pose` is in reference axes, so is the covariance of its dt.
Innovation innovation(const Estimate& expected, const Eigen::Isometry3d& pose,
                      const Matrix6d& covariance);

/// What is believed afterwards.
Estimate improved(Estimate expected, const Innovation& seen);

/// The pose with the odds of its alternative, if it has one, as the expectation changes them.
Pose weighed(const Estimate& expected, Pose pose);

}  // namespace harco::track
