#include <cmath>

#include "harco/deck.hpp"

namespace harco {

double Oscillation::value(double time_s) const {
  double sum = mean;
  for (const Sinusoid& part : parts)
    sum += part.amplitude * std::sin(part.rate * (time_s - epoch_s) + part.phase);
  return sum;
}

double Oscillation::rate(double time_s) const {
  double sum = 0.0;
  for (const Sinusoid& part : parts)
    sum += part.amplitude * part.rate * std::cos(part.rate * (time_s - epoch_s) + part.phase);
  return sum;
}

Eigen::VectorXd Oscillation::gradient(double time_s) const {
  Eigen::VectorXd slope(1 + 3 * order());
  slope[0] = 1.0;
  Eigen::Index at = 1;
  for (const Sinusoid& part : parts) {
    const double since = time_s - epoch_s;
    const double angle = part.rate * since + part.phase;
    slope[at++] = std::sin(angle);
    slope[at++] = part.amplitude * since * std::cos(angle);
    slope[at++] = part.amplitude * std::cos(angle);
  }
  return slope;
}

}  // namespace harco
