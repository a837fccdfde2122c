#include "pilot.hpp"

#include <algorithm>

namespace harco::lab {
namespace {

using Eigen::Vector3d;

FilterOptions with_known_attitude(FilterOptions options) {
  options.camera_known = true;
  return options;
}

}  // namespace

Pilot::Pilot(const PilotOptions& options)
    : options_(options), filter_(with_known_attitude(options.filter)) {}

/// Without translation: only its attitude is known.
Eigen::Isometry3d Pilot::level_T_camera(const SensorReading& reading) const {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() = reading.level_R_body * options_.body_T_camera.linear();
  return pose;
}

void Pilot::see(const Pose& pose, double time_s, const SensorReading& then) {
  if (pose.covariance) filter_.add(pose, time_s, level_T_camera(then));
}

std::optional<Belief> Pilot::belief(double now_s, const SensorReading& now) const {
  const Eigen::Isometry3d level_T_camera_now = level_T_camera(now);
  const auto state = filter_.at(now_s, level_T_camera_now);
  if (!state || state->status == TrackStatus::searching || state->status == TrackStatus::lost)
    return std::nullopt;
  const Eigen::Matrix3d& level_R_camera = level_T_camera_now.linear();
  const Eigen::Matrix3d& camera_R_marker = state->camera_T_marker.linear();
  const Vector3d& point = options_.touchdown_point;
  Belief belief;
  belief.position = -(level_R_camera * (state->camera_T_marker * point));
  belief.velocity = -(level_R_camera * (state->velocity +
                                        camera_R_marker * Vector3d(state->turn_rate.cross(point))));
  belief.age_s = now_s - state->measured_s;
  return belief;
}

Vector3d Pilot::acceleration(const std::optional<Belief>& belief, const HeightCommand& command,
                             double deck_lift_mps2, double dt_s) {
  constexpr double kBlindClimb_mps2 = 0.25;
  Vector3d wanted = Vector3d::Zero();
  if (!belief) {
    wanted.head<2>() = wind_;
    wanted.z() = -kBlindClimb_mps2;
    return wanted;
  }
  const Eigen::Vector2d off = belief->position.head<2>();
  wind_ -= options_.level_i * dt_s * off;
  if (wind_.norm() > options_.most_level_mps2) wind_ *= options_.most_level_mps2 / wind_.norm();
  Eigen::Vector2d level =
      -options_.level_p * off - options_.level_d * belief->velocity.head<2>() + wind_;
  if (level.norm() > options_.most_level_mps2) level *= options_.most_level_mps2 / level.norm();
  wanted.head<2>() = level;
  wanted.z() =
      -options_.height.acceleration(command, height(*belief), climb(*belief)) - deck_lift_mps2;
  return wanted;
}

DeckSample Pilot::sample(const Pose& pose, double time_s, const SensorReading& then,
                         const VehicleOptions& vehicle, bool with_height) const {
  CameraState camera;
  camera.level_R_camera = level_T_camera(then).linear();
  camera.attitude_covariance =
      vehicle.attitude_noise_rad * vehicle.attitude_noise_rad * Eigen::Matrix3d::Identity();
  if (with_height) {
    camera.height_m = then.height_m;
    camera.height_sd_m = 0.01;
  }
  return deck_sample(pose, camera, time_s, options_.touchdown_point);
}

}  // namespace harco::lab
