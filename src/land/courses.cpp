#include "land/courses.hpp"

#include <cmath>
#include <cstdint>
#include <random>

#include "land/input.hpp"

namespace harco {
namespace {

/// One lasting error for each draw.
Eigen::VectorXd lasting_errors(Eigen::Index draws, double sd, int seed) {
  std::mt19937_64 engine(static_cast<std::uint64_t>(seed) + 0x74696C74U);
  const auto uniform = [&] { return (static_cast<double>(engine() >> 11) + 1.0) * 0x1p-53; };
  Eigen::VectorXd errors(draws);
  for (double& error : errors)
    error = sd * std::sqrt(-2.0 * std::log(uniform())) * std::cos(kTwoPi * uniform());
  return errors;
}

}  // namespace

LevelTable draw_level(const DeckForecast& forecast, const LevelLimits& limits,
                      const std::vector<double>& times_s, const LevelOptions& options) {
  const int seed = 3 * options.seed;  // one a axis
  LevelTable level =
      LevelTable::Constant(options.draws, static_cast<Eigen::Index>(times_s.size()), true);
  const auto hold = [&](const Eigen::MatrixXd& courses, double limit) {
    level = level && (courses.array().abs() <= limit);
  };
  const auto tilted = [&](DeckAxis axis, int axis_seed) -> Eigen::MatrixXd {
    Eigen::MatrixXd courses = forecast.axes[axis].draw_values(times_s, options.draws, axis_seed);
    if (options.tilt_sd_rad > 0.0)
      courses.colwise() += lasting_errors(options.draws, options.tilt_sd_rad, axis_seed);
    return courses;
  };
  if (!std::isinf(limits.roll_rad)) hold(tilted(kRoll, seed), limits.roll_rad);
  if (!std::isinf(limits.pitch_rad)) hold(tilted(kPitch, seed + 1), limits.pitch_rad);
  if (!std::isinf(limits.heave_rate_mps))
    hold(forecast.axes[kHeave].draw_rates(times_s, options.draws, seed + 2), limits.heave_rate_mps);
  return level;
}

}  // namespace harco
