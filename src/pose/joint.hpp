// The best pose of a set of markers of one parent, all corners together.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "pose/refine.hpp"

namespace harco {

/// One pose with everything that is known of it.
struct JointPose {
  Eigen::Isometry3d camera_T_marker = Eigen::Isometry3d::Identity();
  Matrix6d covariance = Matrix6d::Zero();  ///< widened where the residuals exceed the noise
  std::vector<bool> used;                  ///< for each observation: whether it agrees
  double misfit = 0.0;  ///< root mean square of the whitened residuals' coordinates

  /// The other solution, and the log-likelihood ratio of the first over it that the corners bear
  /// out.
  std::optional<Eigen::Isometry3d> second;
  Matrix6d second_covariance = Matrix6d::Zero();
  double log_likelihood_ratio = 0.0;
};

/// Both solutions of the plane's pose (planar.hpp), each refined; the one with the smaller loss.
/// Markers are weighted by their corners' covariances and, as a whole, by Huber's rule, so that one
/// bad marker can't spoil the pose; those that stay inconsistent are left out. Empty if no
/// pose puts the markers before the camera.
std::optional<JointPose> solve_joint(std::span<const Observation> observations);

}  // namespace harco
