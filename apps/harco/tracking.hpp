// What the command makes of poses over time: all that `--track` does behind the detector.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "harco/filter.hpp"
#include "harco/pose.hpp"
#include "harco/track.hpp"

namespace harco::cli {

enum class FilterKind {
  kalman,   ///< PoseFilter: tracks beside the poses as measured
  low_pass  ///< the paper's: the poses themselves are smoothed
};

struct TrackingOptions {
  FilterKind kind = FilterKind::kalman;
  double time_constant_s = 0.1;  ///< of the low-pass
  FilterOptions filter;
};

/// For records, and back.
nlohmann::ordered_json tracking_json(const TrackingOptions& options);
TrackingOptions tracking_from_json(const nlohmann::ordered_json& json);

/// The poses of one sequence of frames, in order. The same calls give the same answers.
class Tracking {
 public:
  /// Throws std::invalid_argument for options out of range.
  explicit Tracking(const TrackingOptions& options);

  /// Takes the poses of a frame and turns them into what is told of it: two solutions decided by
  /// the past, smoothed by the low-pass.
  void take(std::vector<Pose>& poses, double time_s, const CameraPose& camera = std::nullopt);

  /// All tracks at a time; empty with the low-pass.
  std::optional<std::vector<Track>> tracks(double time_s,
                                           const CameraPose& camera = std::nullopt) const;

 private:
  Continuity continuity_;
  std::optional<LowPass> low_pass_;
  std::optional<Tracker> tracker_;
};

}  // namespace harco::cli
