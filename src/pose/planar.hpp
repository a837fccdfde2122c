// What the solvers of a plane's pose share: points as the columns of a 2 x N matrix, so that four
// corners need no allocation.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "harco/pose.hpp"

namespace harco {

using Points = Eigen::Ref<const Eigen::Matrix2Xd>;

/// Points as the columns of a matrix; a view, valid as long as the list.
inline Eigen::Map<const Eigen::Matrix2Xd> columns(const std::vector<Eigen::Vector2d>& points) {
  return {points.empty() ? nullptr : points.front().data(), 2,
          static_cast<Eigen::Index>(points.size())};
}

/// Throws std::invalid_argument unless both lists hold the same number, at least four, of finite
/// points.
void require_correspondences(const Points& plane, const Points& image);

/// fit_homography and solve_planar_pose of pose.hpp, on matrices.
Eigen::Matrix3d homography(const Points& plane, const Points& image);
PlanarPoses planar_poses(const Points& plane, const Points& image);

}  // namespace harco
