#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

#include "harco/deck.hpp"
#include "land/input.hpp"
#include "land/least_squares.hpp"
#include "land/spectrum.hpp"

namespace harco {
namespace {

constexpr double kOutlier = 4.0;      // robust standard deviations
constexpr double kLeastScale = 1e-9;  // a perfect fit has a scale too

/// Residuals over their standard deviations.
std::vector<double> residuals(const std::vector<SeriesSample>& samples, const Oscillation& o) {
  std::vector<double> all;
  all.reserve(samples.size());
  for (const SeriesSample& sample : samples)
    all.push_back((sample.value - o.value(sample.time_s)) / sample.sd);
  return all;
}

/// Their standard deviation, were there no outliers.
double robust_scale(const std::vector<double>& residuals) {
  std::vector<double> sizes;
  sizes.reserve(residuals.size());
  for (double residual : residuals) sizes.push_back(std::abs(residual));
  return std::max(kLeastScale, kMadToSd * median(std::move(sizes)));
}

/// Covariance of the parameters where residuals have variance one.
Eigen::MatrixXd unit_covariance(const std::vector<SeriesSample>& samples,
                                const std::vector<bool>& outlier, const Oscillation& o) {
  const Eigen::Index parameters = 1 + 3 * o.order();
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(parameters, parameters);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    if (outlier[i]) continue;
    const Eigen::VectorXd slope = o.gradient(samples[i].time_s) / samples[i].sd;
    information += slope * slope.transpose();
  }
  return information.ldlt().solve(Eigen::MatrixXd::Identity(parameters, parameters));
}

/// All that a fit says, from its parameters.
OscillationFit judged(const std::vector<SeriesSample>& samples, const Oscillation& oscillation) {
  OscillationFit fit;
  fit.oscillation = oscillation;
  const std::vector<double> errors = residuals(samples, oscillation);
  const double limit = kOutlier * robust_scale(errors);
  double squares = 0.0;     // of values
  double normalised = 0.0;  // over their variances
  double bounded = 0.0;     // the same, outliers as if they stood at the limit
  int used = 0;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const double square = errors[i] * errors[i];
    bounded += std::min(square, limit * limit);
    fit.outlier.push_back(std::abs(errors[i]) > limit);
    if (fit.outlier.back()) continue;
    ++used;
    normalised += square;
    squares += square * samples[i].sd * samples[i].sd;
  }
  const double parameters = 1.0 + 3.0 * oscillation.order();
  const double count = static_cast<double>(samples.size());
  fit.scale = std::max(kLeastScale, std::sqrt(normalised / std::max(1.0, used - parameters)));
  fit.rms = std::sqrt(squares / std::max(1, used));
  fit.bic = count * std::log(std::max(bounded / count, kLeastScale * kLeastScale)) +
            parameters * std::log(count);
  fit.covariance = fit.scale * fit.scale * unit_covariance(samples, fit.outlier, oscillation);
  return fit;
}

/// The strongest line in what a fit leaves over, outliers aside; zero if there is none.
double next_rate(const std::vector<SeriesSample>& samples, const OscillationFit& fit,
                 const OscillationOptions& options) {
  std::vector<SeriesSample> rest = samples;
  std::vector<double> weights;
  for (std::size_t i = 0; i < rest.size(); ++i) {
    rest[i].value -= fit.oscillation.value(rest[i].time_s);
    weights.push_back(fit.outlier[i] ? 0.0 : 1.0 / (rest[i].sd * rest[i].sd));
  }
  return strongest_rate(rest, weights, options);
}

/// Mean, amplitudes and phases for the rates that stand in `o`, by linear least squares.
Oscillation with_amplitudes(const std::vector<SeriesSample>& samples,
                            const std::vector<bool>& outlier, Oscillation o) {
  constexpr double kStiffness = 1e-6;  // rates that nearly coincide shall not fight each other
  const Eigen::Index parameters = 1 + 2 * o.order();
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(parameters, parameters);
  Eigen::VectorXd right = Eigen::VectorXd::Zero(parameters);
  Eigen::VectorXd row(parameters);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    if (outlier[i]) continue;
    Eigen::Index at = 0;
    row[at++] = 1.0;
    for (const Sinusoid& part : o.parts) {
      const double angle = part.rate * (samples[i].time_s - o.epoch_s);
      row[at++] = std::sin(angle);
      row[at++] = std::cos(angle);
    }
    const double weight = 1.0 / (samples[i].sd * samples[i].sd);
    normal += weight * row * row.transpose();
    right += weight * samples[i].value * row;
  }
  normal.diagonal() *= 1.0 + kStiffness;
  const Eigen::VectorXd found = normal.ldlt().solve(right);
  Eigen::Index at = 0;
  o.mean = found[at++];
  for (Sinusoid& part : o.parts) {
    const double sine = found[at++];
    const double cosine = found[at++];
    part.amplitude = std::hypot(sine, cosine);
    part.phase = std::atan2(cosine, sine);
  }
  return o;
}

OscillationFit solved(const std::vector<SeriesSample>& samples, const Oscillation& start,
                      const OscillationOptions& options) {
  const double scale = robust_scale(residuals(samples, start));
  return judged(samples, least_squares(samples, start, scale, options));
}

OscillationFit constant(const std::vector<SeriesSample>& samples,
                        const OscillationOptions& options) {
  Oscillation start;
  start.epoch_s = samples.back().time_s;
  std::vector<double> values;
  for (const SeriesSample& sample : samples) values.push_back(sample.value);
  start.mean = median(std::move(values));
  return solved(samples, start, options);
}

}  // namespace

std::vector<OscillationFit> fit_orders(std::vector<SeriesSample> samples,
                                       const OscillationOptions& options) {
  check(options);
  samples = sorted(std::move(samples));
  std::vector<OscillationFit> fits{constant(samples, options)};
  for (int order = 1; order <= options.max_order; ++order) {
    if (static_cast<int>(samples.size()) < 2 * (1 + 3 * order)) break;
    const OscillationFit& last = fits.back();
    const double rate = next_rate(samples, last, options);
    if (rate == 0.0) break;
    Oscillation start = last.oscillation;
    start.parts.push_back({0.0, rate, 0.0});
    fits.push_back(solved(samples, with_amplitudes(samples, last.outlier, start), options));
  }
  return fits;
}

OscillationFit fit_oscillation(const std::vector<SeriesSample>& samples,
                               const OscillationOptions& options) {
  const std::vector<OscillationFit> fits = fit_orders(samples, options);
  return *std::min_element(fits.begin(), fits.end(),
                           [](const auto& a, const auto& b) { return a.bic < b.bic; });
}

OscillationFit refit_oscillation(std::vector<SeriesSample> samples, const Oscillation& start,
                                 const OscillationOptions& options) {
  check(options);
  samples = sorted(std::move(samples));
  Oscillation moved = start;
  moved.epoch_s = samples.back().time_s;
  for (Sinusoid& part : moved.parts)
    part.phase = std::remainder(part.phase + part.rate * (moved.epoch_s - start.epoch_s), kTwoPi);
  return solved(samples, moved, options);
}

}  // namespace harco
