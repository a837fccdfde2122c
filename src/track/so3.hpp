// Rotations as exponentials of rotation vectors, with the Jacobians of error states on the right.
#pragma once

#include <Eigen/Core>

namespace harco::so3 {

/// v × x = hat(v) x.
Eigen::Matrix3d hat(const Eigen::Vector3d& v);

/// Rotation by |v| radians about v.
Eigen::Matrix3d exp(const Eigen::Vector3d& v);

/// The rotation vector of length up to π.
Eigen::Vector3d log(const Eigen::Matrix3d& rotation);

/// exp(v + d) = exp(v) exp(right_jacobian(v) d), to first order in d.
Eigen::Matrix3d right_jacobian(const Eigen::Vector3d& v);

/// log(exp(v) exp(d)) = v + right_jacobian_inverse(v) d, to first order in d.
Eigen::Matrix3d right_jacobian_inverse(const Eigen::Vector3d& v);

}  // namespace harco::so3
