#include "land/least_squares.hpp"

#include <algorithm>
#include <cmath>

#include <ceres/ceres.h>

#include "land/input.hpp"

namespace harco {
namespace {

// Parameters while solving: A_0, then (a, b, alpha) of a cos + b sin for each part. They are smooth
// where an amplitude is zero; amplitude and phase aren't.
class Residual : public ceres::CostFunction {
 public:
  Residual(double since_s, double value, double sd, int order)
      : since_s_(since_s), value_(value), sd_(sd), order_(order) {
    set_num_residuals(1);
    mutable_parameter_block_sizes()->push_back(1 + 3 * order);
  }

  /// False where numbers overflow: Ceres then takes a shorter step, or none. What isn't finite it
  /// prints.
  bool Evaluate(const double* const* blocks, double* residual, double** jacobians) const override {
    const double* p = blocks[0];
    double* slope = jacobians != nullptr ? jacobians[0] : nullptr;
    double sum = p[0];
    if (slope != nullptr) slope[0] = 1.0 / sd_;
    for (int i = 0; i < order_; ++i) {
      const double* part = p + 1 + 3 * i;
      const double c = std::cos(part[2] * since_s_);
      const double s = std::sin(part[2] * since_s_);
      sum += part[0] * c + part[1] * s;
      if (slope == nullptr) continue;
      double* at = slope + 1 + 3 * i;
      at[0] = c / sd_;
      at[1] = s / sd_;
      at[2] = since_s_ * (part[1] * c - part[0] * s) / sd_;
    }
    residual[0] = (sum - value_) / sd_;
    if (!std::isfinite(residual[0])) return false;
    return slope == nullptr ||
           std::all_of(slope, slope + 1 + 3 * order_, [](double of) { return std::isfinite(of); });
  }

 private:
  double since_s_, value_, sd_;
  int order_;
};

}  // namespace

Oscillation least_squares(const std::vector<SeriesSample>& samples, const Oscillation& start,
                          double scale, const OscillationOptions& options) {
  constexpr double kHuber = 3.0;
  const int order = start.order();
  std::vector<double> p(1 + 3 * static_cast<std::size_t>(order));
  p[0] = start.mean;
  for (std::size_t i = 0; i < start.parts.size(); ++i) {
    const Sinusoid& part = start.parts[i];
    p[1 + 3 * i] = part.amplitude * std::sin(part.phase);
    p[2 + 3 * i] = part.amplitude * std::cos(part.phase);
    p[3 + 3 * i] = part.rate;
  }

  ceres::HuberLoss loss(kHuber);
  ceres::Problem::Options ownership;
  ownership.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::Problem problem(ownership);
  for (const SeriesSample& sample : samples)
    problem.AddResidualBlock(
        new Residual(sample.time_s - start.epoch_s, sample.value, sample.sd * scale, order), &loss,
        p.data());
  for (int i = 0; i < order; ++i) {
    problem.SetParameterLowerBound(p.data(), 3 + 3 * i, kTwoPi / options.max_period_s);
    problem.SetParameterUpperBound(p.data(), 3 + 3 * i, kTwoPi / options.min_period_s);
  }

  // From where nothing can be computed there is no way on; Ceres would print that, too.
  std::vector<double> gradient;
  if (!problem.Evaluate({}, nullptr, nullptr, &gradient, nullptr)) return start;

  ceres::Solver::Options solving;
  // A Cholesky factor of normal equations that are nearly singular fails, and Ceres prints so.
  solving.linear_solver_type = ceres::DENSE_QR;
  solving.max_num_iterations = options.max_iterations;
  solving.function_tolerance = 1e-9;
  solving.num_threads = 1;
  solving.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(solving, &problem, &summary);

  Oscillation found;
  found.epoch_s = start.epoch_s;
  found.mean = p[0];
  for (int i = 0; i < order; ++i) {
    const double* part = p.data() + 1 + 3 * i;
    found.parts.push_back({std::hypot(part[0], part[1]), part[2], std::atan2(part[0], part[1])});
  }
  return found;
}

}  // namespace harco
