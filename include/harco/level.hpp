// When a deck will be level for long enough, and how sure that is (paper, section 4.6). Library
// harco::land.
#pragma once

#include <vector>

#include "harco/forecast.hpp"

namespace harco {

/// What counts as level. An infinite limit asks nothing.
struct LevelLimits {
  double roll_rad = 0.05;       ///< greatest size of roll, positive
  double pitch_rad = 0.05;      ///< of pitch, positive
  double heave_rate_mps = 0.5;  ///< of the deck's vertical speed, m/s, positive
};

/// How the future is sampled: many possible courses of roll, pitch and vertical speed are drawn
/// from the forecast's joint distribution; a probability is the share of them that does it.
struct LevelOptions {
  double step_s = 0.1;  ///< between the times looked at, positive; also the windows' resolution
  int draws = 2000;     ///< even, at least 100; a probability of 0.95 is then known to 0.005
  int seed = 0;         ///< the same seed draws the same courses
  /// Standard deviation of an error of roll and pitch that lasts, radians, not negative: of the
  /// attitude sensor's bias and the camera's mount. A forecast can't see it in its samples.
  double tilt_sd_rad = 0.0;
};

/// A time in which the deck is level throughout.
struct LevelWindow {
  double begin_s = 0.0, end_s = 0.0;
  double probability = 0.0;  ///< that it is level from begin to end

  double middle_s() const { return 0.5 * (begin_s + end_s); }
  double duration_s() const { return end_s - begin_s; }
};

/// What windows are sought.
struct WindowOptions {
  double min_duration_s = 1.5;  ///< shorter ones don't count; positive
  double min_probability =
      0.95;  ///< a window ends where it would fall below this; 0 … 1, exclusive
  LevelOptions level;
};

/// Disjoint windows between two times, in their order: from every beginning as far as the least
/// probability allows, the longest first. Throws std::invalid_argument for a forecast without all
/// axes, a time before its as_of_s, an end before the beginning, more than 2000 steps, and limits
/// or options out of range.
std::vector<LevelWindow> level_windows(const DeckForecast& forecast, const LevelLimits& limits,
                                       double from_s, double to_s,
                                       const WindowOptions& options = {});

/// Probability that the deck is level from `begin_s` to `end_s`, without a break. Throws as above.
double level_probability(const DeckForecast& forecast, const LevelLimits& limits, double begin_s,
                         double end_s, const LevelOptions& options = {});

}  // namespace harco
