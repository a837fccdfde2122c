// The pose as the paper takes it (section 3.4 d, Algorithm 2).
#pragma once

#include <span>

#include "pose/observation.hpp"

namespace harco {

/// The pose of one marker from its homography H ~ (r1 r2 t), relative to the marker's own top-left
/// corner.
Eigen::Isometry3d homography_pose(const Observation& seen);

/// The average of the markers' poses, each taken to the parent's frame, weighted by the area of
/// its polygon in the image.
Eigen::Isometry3d average_of_homography_poses(std::span<const Observation> observations);

}  // namespace harco
