// Poses of other people's markers, each at its best documented settings, in our conventions. Those
// of ArUco are in lab/aruco.hpp.
#pragma once

#include <optional>

#include <Eigen/Geometry>

#include "lab/aruco.hpp"

namespace harco::bench {

/// One marker of AprilTag's family 36h11; `side_m` from edge to edge of its black square.
lab::Sheet apriltag_sheet(double side_m);

/// libapriltag on the full resolution with its edges refined, its half-pixel convention corrected;
/// then the pose from its corners as lab::aruco_pose's.
std::optional<Eigen::Isometry3d> apriltag_pose(const Image& image, const Camera& camera,
                                               double side_m);

}  // namespace harco::bench
