#include "land/spectrum.hpp"

#include <cmath>

#include <Eigen/Cholesky>

#include "land/input.hpp"

namespace harco {
namespace {

/// Sum of weighted squares that a mean and one sinusoid explain.
double explained(const std::vector<SeriesSample>& samples, const std::vector<double>& weights,
                 double rate, double epoch_s) {
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const double angle = rate * (samples[i].time_s - epoch_s);
    const Eigen::Vector3d row(1.0, std::cos(angle), std::sin(angle));
    normal += weights[i] * row * row.transpose();
    right += weights[i] * samples[i].value * row;
  }
  const Eigen::LDLT<Eigen::Matrix3d> solver(normal);
  return solver.info() == Eigen::Success ? right.dot(solver.solve(right)) : 0.0;
}

}  // namespace

double strongest_rate(const std::vector<SeriesSample>& samples, const std::vector<double>& weights,
                      const OscillationOptions& options) {
  constexpr double kStepsPerLine = 5.0;  // a spectral line is 2 pi / span wide
  const double epoch_s = samples.back().time_s;
  const double span_s = epoch_s - samples.front().time_s;
  const double lowest = kTwoPi / options.max_period_s;
  const double highest = kTwoPi / options.min_period_s;
  const double step = kTwoPi / (kStepsPerLine * span_s);
  double best_rate = 0.0;
  double most = 0.0;
  for (double rate = lowest; rate <= highest; rate += step) {
    const double power = explained(samples, weights, rate, epoch_s);
    if (!(power > most)) continue;
    most = power;
    best_rate = rate;
  }
  return best_rate;
}

}  // namespace harco
