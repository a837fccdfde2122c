// What an autopilot is told of a landing target: a pose, seen from the vehicle, as messages.
// Library harco::autopilot.
//
// Body frame: x to the nose, y to the right, z down. NED: north, east, down. The target's frame is
// the marker's, so it lies like NED where the marker lies face up with its top to the north.
#pragma once

#include <cstdint>
#include <optional>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "harco/mavlink.hpp"
#include "harco/mount.hpp"
#include "harco/pose.hpp"

namespace harco {

/// A target seen from the vehicle.
struct Sighting {
  double time_s = 0.0;  ///< when the image was taken, by the clock that TIMESYNC tells others
  int target = 0;       ///< id of the layer-1 marker
  /// Origin at the target point; axes of the marker.
  Eigen::Isometry3d body_T_target = Eigen::Isometry3d::Identity();
  /// Of the target point in the body frame, square metres; empty where unknown.
  std::optional<Eigen::Matrix3d> position_covariance;
  double yaw_sd_rad = 0.0;  ///< of the marker about its normal; counts with the covariance
  double side_m = 0.0;      ///< of the marker

  double distance() const { return body_T_target.translation().norm(); }
};

/// `target_point` is where to land, in the marker frame, metres. Throws std::invalid_argument for
/// what isn't finite.
Sighting sight(const Pose& pose, const Mount& mount, const Eigen::Vector3d& target_point,
               double side_m, double time_s);

/// The vehicle's place and attitude at the time of a sighting.
struct VehiclePose {
  Eigen::Quaterniond ned_R_body = Eigen::Quaterniond::Identity();
  std::optional<Eigen::Vector3d> ned_p_body;  ///< from the autopilot's origin, metres
};

/// For ArduPilot: position in the body frame (MAV_FRAME_BODY_FRD), distance along the line of
/// sight. The camera's place on the vehicle is in it already: PLND_CAM_POS stays zero.
mavlink::LandingTarget landing_target_body(const Sighting& sighting);

/// For PX4: position in its own NED frame (MAV_FRAME_LOCAL_NED), which takes the vehicle's pose at
/// the time of the image. Empty where its position isn't known.
std::optional<mavlink::LandingTarget> landing_target_ned(const Sighting& sighting,
                                                         const VehiclePose& vehicle);

/// For autopilots of either kind that take no positions: two angles and the distance. Angles are
/// those of a camera that looks straight down with its image's top to the nose. Empty for a target
/// that isn't under the vehicle.
std::optional<mavlink::LandingTarget> landing_target_angles(const Sighting& sighting);

/// The sighting with its standard deviations, in the body frame. Empty where these aren't known.
std::optional<mavlink::TargetRelative> target_relative(const Sighting& sighting,
                                                       const VehiclePose& vehicle);

}  // namespace harco
