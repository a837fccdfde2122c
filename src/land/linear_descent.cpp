#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "harco/touchdown.hpp"

namespace harco {

LinearDescent LinearDescent::to_touch_at(double touchdown_s, double start_height_m,
                                         double speed_mps) {
  if (!(speed_mps > 0.0) || !std::isfinite(speed_mps) || !std::isfinite(touchdown_s) ||
      !(start_height_m > 0.0) || !std::isfinite(start_height_m))
    throw std::invalid_argument("linear descent: height and speed must be positive, all finite");
  LinearDescent descent;
  descent.start_s = touchdown_s - start_height_m / speed_mps;
  descent.start_height_m = start_height_m;
  descent.speed_mps = speed_mps;
  return descent;
}

HeightCommand LinearDescent::at(double time_s) const {
  const double height_m = start_height_m - speed_mps * std::max(0.0, time_s - start_s);
  if (time_s < start_s) return {start_height_m, 0.0, 0.0};
  if (height_m <= end_height_m) return {end_height_m, 0.0, 0.0};
  return {height_m, -speed_mps, 0.0};
}

double HeightController::acceleration(const HeightCommand& command, double height_m,
                                      double rate_mps) const {
  const double wanted = command.acceleration_mps2 + p * (command.height_m - height_m) +
                        d * (command.rate_mps - rate_mps);
  if (!std::isfinite(wanted) || !(limit_mps2 > 0.0))
    throw std::invalid_argument("height controller: needs finite heights and a positive limit");
  return std::clamp(wanted, -limit_mps2, limit_mps2);
}

}  // namespace harco
