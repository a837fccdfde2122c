// A camera's mount in words and in pictures, so that a wrong one is seen before it flies.
#pragma once

#include <string>
#include <vector>

#include "harco/camera.hpp"
#include "harco/marker.hpp"
#include "harco/mount.hpp"
#include "harco/pose.hpp"
#include "media.hpp"

namespace harco::cli {

/// A direction in the body's frame by the name of the nearest of nose, tail, right, left, down and
/// up, and how far it is off towards the next: "down", "down, 12 degrees towards the nose".
std::string name_of_direction(const Eigen::Vector3d& body_direction);

/// Where the camera looks, what the image's sides point to and where the camera sits, in a few
/// lines.
std::string mount_text(const Mount& mount);

/// Where the middle of a pose's marker is, seen from the vehicle: "parent 0 is 2.31 m below, 0.12 m
/// ahead and 0.05 m to the left of the vehicle".
std::string place_text(const Pose& pose, const MarkerSet& markers, const Mount& mount);

/// The body's axes (nose red, right green, down blue), an arrow from the middle towards the nose,
/// the horizon of a level vehicle, the point straight below it, and what the image's sides point
/// to.
Overlay mount_overlay(const Mount& mount, const Camera& camera);

}  // namespace harco::cli
