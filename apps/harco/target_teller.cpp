#include "target_teller.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <nlohmann/json.hpp>

namespace harco::cli {
namespace {

using Json = nlohmann::ordered_json;

/// A pad over the ground changes its velocity slowly: it lies still, or on a ship.
constexpr double kPadAcceleration = 0.2;  // m/s² per √Hz
/// Over the ground it is known as well as the vehicle's attitude and place at the image's time.
constexpr double kAttitudeSd = 0.01, kPlaceSd = 0.02;  // rad, m
/// It counts as moving above this speed, m/s, if that is so many standard deviations.
constexpr double kMoves = 0.3, kMovesSurely = 3.0;
/// A time that is so much earlier than the one before it begins a new sequence, seconds.
constexpr double kBack = 1.0;

FilterOptions ground_options() {
  FilterOptions options;
  options.camera_known = true;
  options.acceleration = kPadAcceleration;
  return options;
}

double turn_between(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b) {
  return Eigen::AngleAxisd(a.linear().transpose() * b.linear()).angle();
}

/// Whether a pad whose state is known in the camera's axes moves over the ground.
bool moves(const TrackState& state) {
  const double speed = state.velocity.norm();
  const double sd = std::sqrt(state.covariance.block<3, 3>(6, 6).trace());
  return speed > kMoves && speed > kMovesSurely * sd;
}

/// A pose as well as it is known over the ground.
Pose over_the_ground(Pose pose) {
  const double sd = kAttitudeSd * pose.camera_T_marker.translation().norm() + kPlaceSd;
  pose.covariance->topLeftCorner<3, 3>() += sd * sd * Eigen::Matrix3d::Identity();
  pose.covariance->bottomRightCorner<3, 3>() +=
      kAttitudeSd * kAttitudeSd * Eigen::Matrix3d::Identity();
  return pose;
}

/// Where the camera is over the ground, if the vehicle knows where it is.
CameraPose camera_over_ground(const std::optional<VehiclePose>& vehicle, const Mount& mount) {
  if (!vehicle || !vehicle->ned_p_body) return std::nullopt;
  const Eigen::Isometry3d ned_T_body =
      Eigen::Translation3d(*vehicle->ned_p_body) * vehicle->ned_R_body;
  return ned_T_body * mount.body_T_camera;
}

}  // namespace

Json options_json(const TargetOptions& options) {
  Json rows = Json::array();
  const auto& m = options.mount.body_T_camera;
  for (int i = 0; i < 3; ++i) rows.push_back({m(i, 0), m(i, 1), m(i, 2), m(i, 3)});
  return {{"body_T_camera", rows},
          {"parent", options.parent},
          {"side_m", options.side_m},
          {"point", {options.point.x(), options.point.y(), options.point.z()}},
          {"autopilot", options.autopilot == Autopilot::px4 ? "px4" : "ardupilot"},
          {"angles_only", options.angles_only},
          {"target_relative", options.relative},
          {"coast_s", options.coast_s}};
}

TargetOptions target_options_from_json(const Json& json) {
  TargetOptions options;
  const auto rows = json.at("body_T_camera").get<std::array<std::array<double, 4>, 3>>();
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 4; ++j)
      options.mount.body_T_camera(static_cast<int>(i), static_cast<int>(j)) = rows[i][j];
  json.at("parent").get_to(options.parent);
  json.at("side_m").get_to(options.side_m);
  const auto point = json.at("point").get<std::array<double, 3>>();
  options.point = Eigen::Vector3d(point[0], point[1], point[2]);
  if (json.at("autopilot").get<std::string>() == "px4") options.autopilot = Autopilot::px4;
  json.at("angles_only").get_to(options.angles_only);
  json.at("target_relative").get_to(options.relative);
  json.at("coast_s").get_to(options.coast_s);
  return options;
}

TargetTeller::TargetTeller(const TargetOptions& options)
    : options_(options), placed_(ground_options()) {}

Target TargetTeller::take(const TargetFrame& frame) {
  if (frame.time_s < last_time_s_ - kBack) {
    seen_ = PoseFilter();
    placed_ = PoseFilter(ground_options());
    moves_ = false;
  }
  last_time_s_ = frame.time_s;
  Target target;
  measure(frame, target);
  if (!target.pose) foretell(frame, target);
  if (frame.captured_s && (target.believed || target.foretold))
    target.news = messages(frame, *target.sighting);
  return target;
}

std::vector<Track> TargetTeller::tracks(double time_s) const {
  const auto state = seen_.at(time_s);
  if (!state) return {};
  return {{options_.parent, *state}};
}

/// What is told is the measurement: the autopilot has a filter of its own, which knows the
/// vehicle's motion. Ours says whether it is to be believed.
void TargetTeller::measure(const TargetFrame& frame, Target& target) {
  const auto found = std::find_if(frame.poses.begin(), frame.poses.end(), [&](const Pose& pose) {
    return pose.parent == options_.parent && pose.covariance;
  });
  if (found == frame.poses.end()) return;
  Pose& pose = target.pose.emplace(*found);
  const Verdict verdict = seen_.add(pose, frame.time_s);
  const auto state = seen_.at(frame.time_s);
  target.believed = verdict == Verdict::accepted && state && state->status == TrackStatus::tracking;
  if (target.believed && pose.alternative &&
      turn_between(*pose.alternative, state->camera_T_marker) <
          turn_between(pose.camera_T_marker, state->camera_T_marker))
    std::swap(pose.camera_T_marker, *pose.alternative);
  target.sighting = sighting_of(pose, frame);
  if (const CameraPose ned_T_camera = camera_over_ground(frame.vehicle, options_.mount);
      ned_T_camera && target.believed) {
    placed_.add(over_the_ground(pose), frame.time_s, ned_T_camera);
    const auto placed = placed_.at(frame.time_s, ned_T_camera);
    moves_ = placed && placed->status == TrackStatus::tracking && moves(*placed);
  }
}

/// A pad that moves goes on over the ground as it did. One that lies still needn't be foretold: an
/// autopilot that doesn't hear of it stays over it.
void TargetTeller::foretell(const TargetFrame& frame, Target& target) const {
  const CameraPose ned_T_camera = camera_over_ground(frame.vehicle, options_.mount);
  if (!ned_T_camera || !moves_) return;
  const auto state = placed_.at(frame.time_s, ned_T_camera);
  if (!state || frame.time_s - state->measured_s > options_.coast_s) return;
  Pose pose;
  pose.parent = options_.parent;
  pose.camera_T_marker = state->camera_T_marker;
  pose.covariance = state->covariance.topLeftCorner<6, 6>();
  target.sighting = sighting_of(pose, frame);
  target.foretold = true;
}

Sighting TargetTeller::sighting_of(const Pose& pose, const TargetFrame& frame) const {
  return sight(pose, options_.mount, options_.point, options_.side_m,
               frame.captured_s.value_or(0.0));
}

std::vector<mavlink::Message> TargetTeller::messages(const TargetFrame& frame,
                                                     const Sighting& sighting) {
  std::optional<mavlink::LandingTarget> target;
  if (options_.angles_only) {
    target = landing_target_angles(sighting);
  } else if (options_.autopilot == Autopilot::ardupilot) {
    target = landing_target_body(sighting);
  } else if (frame.vehicle) {
    target = landing_target_ned(sighting, *frame.vehicle);
  }
  if (!target) return {};
  // Two frames never have the same time: ArduPilot takes that for the same measurement.
  last_usec_ = target->time_usec = std::max(target->time_usec, last_usec_ + 1);
  std::vector<mavlink::Message> news{*target};
  if (options_.relative && frame.vehicle)
    if (const auto relative = target_relative(sighting, *frame.vehicle))
      news.emplace_back(*relative);
  return news;
}

}  // namespace harco::cli
