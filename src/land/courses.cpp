#include "land/courses.hpp"

#include <cmath>

namespace harco {

LevelTable draw_level(const DeckForecast& forecast, const LevelLimits& limits,
                      const std::vector<double>& times_s, const LevelOptions& options) {
  const int seed = 3 * options.seed;  // one a axis
  LevelTable level =
      LevelTable::Constant(options.draws, static_cast<Eigen::Index>(times_s.size()), true);
  const auto hold = [&](const Eigen::MatrixXd& courses, double limit) {
    level = level && (courses.array().abs() <= limit);
  };
  if (!std::isinf(limits.roll_rad))
    hold(forecast.axes[kRoll].draw_values(times_s, options.draws, seed), limits.roll_rad);
  if (!std::isinf(limits.pitch_rad))
    hold(forecast.axes[kPitch].draw_values(times_s, options.draws, seed + 1), limits.pitch_rad);
  if (!std::isinf(limits.heave_rate_mps))
    hold(forecast.axes[kHeave].draw_rates(times_s, options.draws, seed + 2), limits.heave_rate_mps);
  return level;
}

}  // namespace harco
