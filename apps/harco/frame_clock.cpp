#include "frame_clock.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>

namespace harco::cli {
namespace {

/// A first stamp so near to a clock is of that clock, seconds.
constexpr double kNear = 10.0;
/// Delays are compared over so long: a clock that runs faster or slower than ours is followed.
constexpr double kWindow = 1.0;

double unix_less_monotonic_s() {
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  return std::chrono::duration<double>(now).count() - monotonic_s();
}

StampClock guess(double stamp_s, double received_s) {
  if (std::abs(received_s - stamp_s) < kNear) return StampClock::monotonic;
  if (std::abs(received_s + unix_less_monotonic_s() - stamp_s) < kNear)
    return StampClock::unix_time;
  return StampClock::own;
}

}  // namespace

std::optional<double> FrameClock::captured_s(
    const Frame& frame, const std::function<std::optional<double>(double)>& ours) {
  absolute_ = true;
  if (frame.captured_s) return *frame.captured_s;
  absolute_ = false;
  if (!frame.timed) return frame.received_s - options_.latency_s;
  if (options_.stamps == StampClock::automatic)
    options_.stamps = guess(frame.timestamp_s, frame.received_s);
  switch (options_.stamps) {
    case StampClock::monotonic:
      absolute_ = true;
      return frame.timestamp_s;
    case StampClock::unix_time:
      absolute_ = true;
      return frame.timestamp_s - unix_less_monotonic_s();
    case StampClock::autopilot:  // a simulator's, as a rule, which may not keep pace with ours
      return ours(frame.timestamp_s);
    default:
      return least_delayed(frame.timestamp_s, frame.received_s) - options_.latency_s;
  }
}

/// The stamp on our clock, if the least delayed frame of the last second came without delay.
double FrameClock::least_delayed(double stamp_s, double received_s) {
  while (!arrivals_.empty() && arrivals_.front().received_s < received_s - kWindow)
    arrivals_.pop_front();
  arrivals_.push_back({received_s, received_s - stamp_s});
  const auto least =
      std::min_element(arrivals_.begin(), arrivals_.end(),
                       [](const Arrival& a, const Arrival& b) { return a.delay_s < b.delay_s; });
  return stamp_s + least->delay_s;
}

}  // namespace harco::cli
