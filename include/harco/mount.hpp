// How a camera sits on its vehicle, and the file that says so.
//
// Body frame of the vehicle, as autopilots have it: x to the nose, y to the right, z down; origin
// where the autopilot takes the vehicle to be. Camera frame: x right and y down in the image, z
// forward along the optical axis.
#pragma once

#include <filesystem>
#include <string>

#include <Eigen/Geometry>

namespace harco {

struct Mount {
  /// X_body = R X_camera + t. The default looks straight down, image top to the nose, from the
  /// origin.
  Eigen::Isometry3d body_T_camera = looking_down();

  static Eigen::Isometry3d looking_down();
};

/// Reads a mount file (YAML):
///
///     looks: down                # nose, tail, right, left, up or down
///     image_top: nose            # what the image's upper side points to; square to `looks`
///     roll_pitch_yaw_deg: [0, 0, 0]   # then turned so about the body's axes
///     offset_m: [0.1, 0, 0.05]   # where the camera's optical centre is, body frame
///
/// Every field but `looks` may be left out. roll_pitch_yaw_deg are the usual angles of flight
/// (about x, then y, then z of the body, axes fixed, right-handed), all zero if left out; without
/// `looks` they turn a camera that looks to the nose with the image's top up, so that pitch -90
/// looks down. image_top is, if left out, up for a camera that looks level, and the nose for one
/// that looks up or down. In their place `quaternion_wxyz` may give body_R_camera directly; its
/// length must be 1 to a thousandth. Unknown fields are errors: they are misspelt ones. Throws
/// Error.
Mount load_mount(const std::filesystem::path& file);

/// The text form of the same, and back. parse_mount throws Error; `name` stands in its message.
Mount parse_mount(const std::string& yaml, const std::string& name = "mount");

/// Text that parse_mount takes, to the last digit. Throws std::invalid_argument for a mount that
/// isn't finite or no rotation.
std::string format_mount(const Mount& mount);

/// Writes a mount file; it appears whole or not at all. Throws Error.
void save_mount(const Mount& mount, const std::filesystem::path& file);

}  // namespace harco
