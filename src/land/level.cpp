#include "harco/level.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <stdexcept>
#include <string>

#include "land/courses.hpp"

namespace harco {
namespace {

void require(bool holds, const char* what) {
  if (!holds) throw std::invalid_argument(std::string("level windows: ") + what);
}

void check(const DeckForecast& forecast, const LevelLimits& limits, double from_s, double to_s,
           const LevelOptions& options) {
  constexpr double kMostSteps = 2000.0;
  constexpr int kLeastDraws = 100;
  require(forecast.axes.size() == 3, "a forecast must have roll, pitch and heave");
  require(limits.roll_rad > 0.0, "roll_rad must be positive");
  require(limits.pitch_rad > 0.0, "pitch_rad must be positive");
  require(limits.heave_rate_mps > 0.0, "heave_rate_mps must be positive");
  require(options.step_s > 0.0 && std::isfinite(options.step_s), "step_s must be positive");
  require(options.tilt_sd_rad >= 0.0 && std::isfinite(options.tilt_sd_rad),
          "tilt_sd_rad must not be negative");
  require(options.draws >= kLeastDraws && options.draws % 2 == 0,
          "draws must be even and at least 100");
  require(std::isfinite(from_s) && std::isfinite(to_s) && from_s <= to_s,
          "times must be finite, the end not before the beginning");
  require(from_s >= forecast.as_of_s, "times must not lie before the forecast's newest sample");
  require((to_s - from_s) / options.step_s <= kMostSteps, "at most 2000 steps");
}

/// From one time to the other in equal steps, as near to the step wanted as they fit.
std::vector<double> ticks(double from_s, double to_s, double step_s) {
  const int steps = std::max(1, static_cast<int>(std::ceil((to_s - from_s) / step_s - 1e-9)));
  std::vector<double> times_s;
  for (int i = 0; i <= steps; ++i) times_s.push_back(from_s + (to_s - from_s) * i / steps);
  return times_s;
}

/// How far courses stay level from each beginning, with the least probability wanted.
struct Reach {
  std::size_t last = 0;      ///< index of the last time
  double probability = 0.0;  ///< of being level until then; 0: not even at the beginning
};

std::vector<Reach> reaches(const LevelTable& level, double min_probability) {
  const auto draws = static_cast<std::size_t>(level.rows());
  const auto times = static_cast<std::size_t>(level.cols());
  const auto wanted = static_cast<std::size_t>(
      std::max(1.0, std::ceil(min_probability * static_cast<double>(draws) - 1e-9)));
  std::vector<std::size_t> run(draws, 0);  // times that a draw stays level from here on
  std::vector<Reach> all(times);
  std::vector<std::size_t> longest;
  for (std::size_t begin = times; begin-- > 0;) {
    for (std::size_t draw = 0; draw < draws; ++draw)
      run[draw] = level(static_cast<Eigen::Index>(draw), static_cast<Eigen::Index>(begin))
                      ? run[draw] + 1
                      : 0;
    longest = run;
    std::nth_element(longest.begin(), longest.begin() + static_cast<std::ptrdiff_t>(wanted - 1),
                     longest.end(), std::greater<>());
    const std::size_t reach = longest[wanted - 1];
    if (reach == 0) continue;
    const auto level_draws =
        std::count_if(run.begin(), run.end(), [&](std::size_t r) { return r >= reach; });
    all[begin] = {begin + reach - 1, static_cast<double>(level_draws) / static_cast<double>(draws)};
  }
  return all;
}

/// The longest window between two indices, then the longest ones before and after it.
void collect(const std::vector<Reach>& all, const std::vector<double>& times_s, std::size_t first,
             std::size_t last, double min_duration_s, std::vector<LevelWindow>& windows) {
  constexpr double kRounding = 1e-9;
  std::size_t best = first;
  double longest_s = -1.0;
  for (std::size_t begin = first; begin <= last; ++begin) {
    const Reach& reach = all[begin];
    if (reach.probability == 0.0 || reach.last > last) continue;
    const double duration_s = times_s[reach.last] - times_s[begin];
    if (duration_s <= longest_s + kRounding) continue;
    longest_s = duration_s;
    best = begin;
  }
  if (longest_s < min_duration_s - kRounding) return;
  const Reach& reach = all[best];
  if (best > first) collect(all, times_s, first, best - 1, min_duration_s, windows);
  windows.push_back({times_s[best], times_s[reach.last], reach.probability});
  if (reach.last < last) collect(all, times_s, reach.last + 1, last, min_duration_s, windows);
}

}  // namespace

std::vector<LevelWindow> level_windows(const DeckForecast& forecast, const LevelLimits& limits,
                                       double from_s, double to_s, const WindowOptions& options) {
  check(forecast, limits, from_s, to_s, options.level);
  require(options.min_duration_s > 0.0, "min_duration_s must be positive");
  require(options.min_probability > 0.0 && options.min_probability < 1.0,
          "min_probability must lie between 0 and 1");
  const std::vector<double> times_s = ticks(from_s, to_s, options.level.step_s);
  const LevelTable level = draw_level(forecast, limits, times_s, options.level);
  std::vector<LevelWindow> windows;
  collect(reaches(level, options.min_probability), times_s, 0, times_s.size() - 1,
          options.min_duration_s, windows);
  return windows;
}

double level_probability(const DeckForecast& forecast, const LevelLimits& limits, double begin_s,
                         double end_s, const LevelOptions& options) {
  check(forecast, limits, begin_s, end_s, options);
  const LevelTable level =
      draw_level(forecast, limits, ticks(begin_s, end_s, options.step_s), options);
  return static_cast<double>(level.rowwise().all().count()) / options.draws;
}

}  // namespace harco
