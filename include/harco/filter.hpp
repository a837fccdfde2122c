// Poses over time: where a marker is, how it moves, and how sure that is, between and after its
// measurements.
//
// An error-state Kalman filter on SE(3) with velocity. The marker moves against the camera at a
// velocity that white accelerations change; a deck may oscillate on top of it (Swell). The
// equations are in docs/tracking.md.
//
// Axes. By default nothing is known of the camera: it may turn as it likes, which costs certainty.
// Who knows its attitude sets FilterOptions::camera_known and gives it with every call, as a
// reference_T_camera without translation, in any axes that don't turn (north-east-down, or those in
// which a gyroscope started): a turning camera then costs nothing. Who knows its position as well
// gives that too, from any origin, and what remains to be foretold is the marker's own motion.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "harco/pose.hpp"

namespace harco {

using Matrix12d = Eigen::Matrix<double, 12, 12>;

/// Where the camera is in reference axes, which don't turn, if that is known. The translation stays
/// zero where only the attitude is.
using CameraPose = std::optional<Eigen::Isometry3d>;

/// A deck's oscillation about its steady motion: six damped oscillators, three that shift and three
/// that turn it, of one period, kept going by white noise.
struct Swell {
  /// Seconds. 0: not known; none and several from 3.5 to 14 s are tried side by side, and the one
  /// that foretells the measurements best is believed.
  double period_s = 0.0;
  double damping = 0.05;    ///< of the critical one, 0 … 1 exclusive: how fast the phase is lost
  double shift_sd_m = 0.3;  ///< standard deviation along each axis
  double turn_sd_rad = 0.07;  ///< about each axis
};

struct FilterOptions {
  /// Whether reference_T_camera is given with every call. Calls that don't agree throw
  /// std::invalid_argument.
  bool camera_known = false;

  /// White accelerations that change the velocity, as the roots of their spectral densities: after
  /// one second alone they leave so much standard deviation in it.
  double acceleration = 1.5;    ///< marker against camera (or the reference), m/s² per √Hz
  double marker_turning = 0.2;  ///< of the marker, rad/s² per √Hz
  /// Of the camera, rad/s² per √Hz; counts where it isn't known. It swings the marker on a lever as
  /// long as its distance.
  double camera_turning = 1.5;

  /// What is expected of velocities at the start, standard deviations.
  double speed = 3.0;             ///< m/s along each axis
  double marker_turn_rate = 0.3;  ///< rad/s
  double camera_turn_rate = 0.5;  ///< rad/s; counts where it isn't known

  std::optional<Swell> swell = std::nullopt;  ///< for a deck that oscillates

  /// Share of good measurements that are refused as outliers: those whose squared Mahalanobis
  /// distance from the prediction exceeds the χ² quantile of six degrees of freedom.
  double gate = 0.001;

  int confirm = 3;  ///< measurements in agreement that make a track
  int replace = 8;  ///< refused measurements in a row that, agreeing among themselves, replace it
  double tracking_s = 0.15;  ///< without a measurement for longer, a track is coasting
  double coast_s = 3.0;      ///< and after this, lost
  double history_s = 1.0;    ///< how late a measurement may come
};

enum class TrackStatus {
  searching,  ///< nothing seen yet, or too few measurements in agreement
  tracking,   ///< measured a moment ago
  coasting,   ///< not measured for a while: foretold, ever less surely
  lost        ///< not measured for too long: nothing is told any more
};
const char* to_string(TrackStatus status);

/// What became of a measurement.
enum class Verdict {
  started,   ///< first of a track, or those before it were too long ago
  accepted,  ///< agrees with the prediction and has improved it
  refused,   ///< an outlier, for now
  replaced,  ///< one refused too many: the track was wrong and starts anew from the refused ones
  too_late   ///< older than history_s
};
const char* to_string(Verdict verdict);

/// What is believed of a marker at a time.
struct TrackState {
  double time_s = 0.0;
  double measured_s = 0.0;  ///< time of the last measurement that counted
  TrackStatus status = TrackStatus::searching;

  Eigen::Isometry3d camera_T_marker = Eigen::Isometry3d::Identity();
  /// Metres a second, camera frame: how the marker's origin moves past the camera. With
  /// reference_T_camera: how it moves in the reference, less the camera's velocity only where that
  /// has no translation.
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();
  /// Radians a second, marker frame: R' = R [turn_rate]×, in the same sense.
  Eigen::Vector3d turn_rate = Eigen::Vector3d::Zero();

  /// Covariance of (dt, w, dv, dr): dt and w as in Pose::covariance; dv of the velocity (camera
  /// frame), dr of the turn rate (marker frame).
  Matrix12d covariance = Matrix12d::Zero();
};

/// One marker over time. The same calls give the same answers.
class PoseFilter {
 public:
  /// Throws std::invalid_argument, naming the field, for options out of range.
  explicit PoseFilter(const FilterOptions& options = {});
  ~PoseFilter();
  PoseFilter(PoseFilter&&) noexcept;
  PoseFilter& operator=(PoseFilter&&) noexcept;

  /// Takes a pose measured at `time_s`, the time of its image. It may come late, in any order: what
  /// came after it is filtered again. Where the pose has an alternative, the prediction helps to
  /// choose. Throws std::invalid_argument for a pose without covariance and for what isn't finite
  /// or no rotation.
  Verdict add(const Pose& pose, double time_s, const CameraPose& reference_T_camera = std::nullopt);

  /// What is believed of the marker at a time, of the future too, for a camera that then is at
  /// `reference_T_camera`. Times before the newest measurement are answered by what was
  /// known up to them. Empty if nothing is known: before the first measurement, farther back than
  /// the history, and once the track is lost.
  std::optional<TrackState> at(double time_s,
                               const CameraPose& reference_T_camera = std::nullopt) const;

  TrackStatus status(double time_s) const;

  /// Squared Mahalanobis distance of a pose from what is believed at its time, six degrees of
  /// freedom: how little it is a surprise. Empty where nothing is known.
  std::optional<double> distance(const Pose& pose, double time_s,
                                 const CameraPose& reference_T_camera = std::nullopt) const;

  /// Period of the swell that is believed in, seconds; empty without one.
  std::optional<double> swell_period_s() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// One parent of a set over time.
struct Track {
  int parent = 0;  ///< id
  TrackState state;
};

/// A filter for every parent that is seen.
class Tracker {
 public:
  /// Throws as PoseFilter.
  explicit Tracker(const FilterOptions& options = {});

  /// Takes all poses of one frame. Those without covariance are left out; of a parent seen twice,
  /// the pose nearest to what is expected counts. Throws as PoseFilter::add.
  void add(const std::vector<Pose>& poses, double time_s,
           const CameraPose& reference_T_camera = std::nullopt);

  /// All parents of which something is known, by id.
  std::vector<Track> at(double time_s, const CameraPose& reference_T_camera = std::nullopt) const;

  /// The filter of a parent; null if it was never seen.
  const PoseFilter* filter(int parent) const;

 private:
  struct Entry {
    int parent;
    PoseFilter filter;
  };
  FilterOptions options_;
  std::vector<Entry> entries_;  ///< by parent
};

}  // namespace harco
