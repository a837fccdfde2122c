// When frames were taken, on the machine's monotonic clock.
#pragma once

#include <deque>
#include <functional>
#include <optional>
#include <string>

#include "frame_source.hpp"

namespace harco::cli {

/// The clock by which a source stamps its frames.
enum class StampClock {
  automatic,  ///< the monotonic one or Unix time if its first stamp is near to that, else its own
  monotonic,  ///< the machine's
  unix_time,
  autopilot,  ///< since the autopilot's start, as a simulator's camera may have it
  own         ///< another one: only how much later a frame comes than others do is known
};

struct FrameClockOptions {
  StampClock stamps = StampClock::automatic;
  /// From the image to its arrival at least, seconds; counts where stamps don't tell.
  double latency_s = 0.0;
};

class FrameClock {
 public:
  explicit FrameClock(const FrameClockOptions& options) : options_(options) {}

  /// Monotonic time of the image; empty for a stamp of the autopilot's clock while that isn't
  /// known. `ours` turns the autopilot's time into ours.
  std::optional<double> captured_s(const Frame& frame,
                                   const std::function<std::optional<double>(double)>& ours);

  /// Whether the stamp of the last frame says how old it is. Else its age counts from its arrival:
  /// a simulator's clock may run slower than ours.
  bool absolute() const { return absolute_; }

 private:
  double least_delayed(double stamp_s, double received_s);

  FrameClockOptions options_;
  bool absolute_ = false;
  struct Arrival {
    double received_s, delay_s;
  };
  std::deque<Arrival> arrivals_;  ///< of the last seconds; delay: arrival less stamp
};

}  // namespace harco::cli
