// What an autopilot is to be told of the pad, made from what the camera sees frame by frame. Has
// neither clock nor link: the same frames give the same messages, so a record can be played again.
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>
#include <nlohmann/json_fwd.hpp>

#include "harco/filter.hpp"
#include "harco/mavlink.hpp"
#include "harco/mount.hpp"
#include "harco/pose.hpp"
#include "harco/sighting.hpp"
#include "harco/vehicle.hpp"

namespace harco::cli {

struct TargetOptions {
  Mount mount;
  int parent = 0;  ///< id
  double side_m = 1.0;
  Eigen::Vector3d point = Eigen::Vector3d::Zero();  ///< where to land, marker frame, metres

  Autopilot autopilot = Autopilot::ardupilot;
  bool angles_only = false;  ///< directions instead of positions
  bool relative = false;     ///< TARGET_RELATIVE, too
  /// A pad that moves is foretold while frames come that don't show it, for so many seconds after
  /// it was seen last: an autopilot that stops would lose it. 0: never.
  double coast_s = 2.5;
};

/// For records, and back.
nlohmann::ordered_json options_json(const TargetOptions& options);
TargetOptions target_options_from_json(const nlohmann::ordered_json& json);

/// A frame, as far as the pad goes.
struct TargetFrame {
  double time_s = 0.0;               ///< by the frames' clock
  std::optional<double> captured_s;  ///< by the clock that the autopilot is told
  std::optional<VehiclePose> vehicle;
  std::vector<Pose> poses;
};

/// What a frame says of the pad.
struct Target {
  std::optional<Pose> pose;            ///< as measured
  std::optional<Sighting> sighting;    ///< of the pose, or of the place foretold
  bool believed = false;               ///< the pose agrees with those before it
  bool foretold = false;               ///< the pad wasn't seen
  std::vector<mavlink::Message> news;  ///< to be told at once
};

class TargetTeller {
 public:
  explicit TargetTeller(const TargetOptions& options);

  /// Frames in the order of their times. A time far back means that the source has begun anew.
  Target take(const TargetFrame& frame);

  /// Where the pad should be seen at a time, if anything is known.
  std::vector<Track> tracks(double time_s) const;

 private:
  void measure(const TargetFrame& frame, Target& target);
  void foretell(const TargetFrame& frame, Target& target) const;
  std::vector<mavlink::Message> messages(const TargetFrame& frame, const Sighting& sighting);
  Sighting sighting_of(const Pose& pose, const TargetFrame& frame) const;

  TargetOptions options_;
  PoseFilter seen_;    ///< from the camera, of which nothing need be known: what to believe
  PoseFilter placed_;  ///< over the ground: where it will be
  bool moves_ = false;
  double last_time_s_ = -1e18;
  std::uint64_t last_usec_ = 0;
};

}  // namespace harco::cli
