// Which pixels tell where a marker is.
#pragma once

#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "harco/camera.hpp"
#include "harco/geometry.hpp"

namespace harco {

/// The pixels of the camera's image within `reach` pixels (in x and in y) of an outline of the
/// ink, row by row.
std::vector<Eigen::Vector2i> edge_band(const InkPlan& ink, const Camera& camera,
                                       const Eigen::Isometry3d& camera_T_marker, int reach);

}  // namespace harco
