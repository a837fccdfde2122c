#include "land/wander.hpp"

#include <algorithm>
#include <cmath>

namespace harco {
namespace {

constexpr double kAlphaSd = 0.1;    // rad/s, how far the fit may be off before all samples
constexpr double kMeanShare = 9.0;  // variance of the mean before all samples, over the motion's
constexpr double kLeastVariance = 1e-18;
// Of what is fitted to a few waves, noise and what the model lacks have a part: with all of it,
// fewer intervals were foretold to be level than were (docs/experiments.md, 4.6).
constexpr double kSeaShare = 0.7;
constexpr double kMostSwell = 2.0;      // variance of sinusoids over the samples' own
constexpr double kContradiction = 4.0;  // standard deviations

}  // namespace

/// What h seconds do to a coefficient of variance one and its rate.
struct Wander::Step {
  Eigen::Matrix2d transition;
  Eigen::Matrix2d noise;
};

Wander::Step Wander::step(double h) const {
  const double l = fade_rate_;
  Step made;
  made.transition << 1.0 + l * h, h, -l * l * h, 1.0 - l * h;
  made.transition *= std::exp(-l * h);
  const Eigen::Matrix2d lasting = Eigen::Vector2d(1.0, l * l).asDiagonal();
  made.noise = lasting - made.transition * lasting * made.transition.transpose();
  return made;
}

Wander::Wander(const OscillationFit& fit, double fade_rate, double motion_variance)
    : base_(fit.oscillation), fade_rate_(fade_rate) {
  double explained = kLeastVariance;
  for (const Sinusoid& part : base_.parts) explained += 0.5 * part.amplitude * part.amplitude;
  // What the fit leaves over beyond the noise is motion too: amplitudes that wandered within the
  // samples look smaller to the fit than they are.
  const double noise = fit.rms / std::max(1.0, fit.scale);
  const double left_over = fit.rms * fit.rms - noise * noise;
  swell_ = kSeaShare * std::min(1.0 + left_over / explained,
                                kMostSwell * std::max(kLeastVariance, motion_variance) / explained);
  mean_variance_ = kMeanShare * (explained + fit.rms * fit.rms);
}

double Wander::variance(int coefficient) const {
  const double amplitude = base_.parts[static_cast<std::size_t>(coefficient / 2)].amplitude;
  return std::max(kLeastVariance, 0.5 * swell_ * amplitude * amplitude);
}

Wander::State Wander::before_all(double time_s) const {
  const Eigen::Index size = 1 + 5 * order();
  State state;
  state.time_s = time_s;
  state.mean = Eigen::VectorXd::Zero(size);
  state.mean[0] = base_.mean;
  Eigen::VectorXd variances(size);
  variances[0] = mean_variance_;
  for (int i = 0; i < 2 * order(); ++i) {
    variances[coefficient(i)] = variance(i);
    variances[coefficient(i) + 1] = variance(i) * fade_rate_ * fade_rate_;
  }
  variances.tail(order()).setConstant(kAlphaSd * kAlphaSd);
  state.covariance = variances.asDiagonal();
  return state;
}

void Wander::advance(State& state, double time_s) const {
  const double h = time_s - state.time_s;
  state.time_s = time_s;
  if (fade_rate_ == 0.0 || h == 0.0) return;
  const Step made = step(h);
  for (int i = 0; i < 2 * order(); ++i) {
    const Eigen::Index at = coefficient(i);
    state.mean.segment<2>(at) = (made.transition * state.mean.segment<2>(at)).eval();
    state.covariance.middleRows<2>(at) =
        (made.transition * state.covariance.middleRows<2>(at)).eval();
  }
  for (int i = 0; i < 2 * order(); ++i) {
    const Eigen::Index at = coefficient(i);
    state.covariance.middleCols<2>(at) =
        (state.covariance.middleCols<2>(at) * made.transition.transpose()).eval();
    state.covariance.block<2, 2>(at, at) += variance(i) * made.noise;
  }
}

void Wander::learn(State& state, double value, double sd) const {
  const Eigen::VectorXd row = value_row(state.time_s);
  const Eigen::VectorXd gain = state.covariance * row;
  const double error = value - row.dot(state.mean);
  const double bound = error / kContradiction;
  const double expected = std::max(row.dot(gain) + sd * sd, bound * bound);
  state.mean += gain * (error / expected);
  state.covariance -= gain * gain.transpose() / expected;
}

/// How much of an amplitude is left after the epoch, and its change: with it goes what an error of
/// its alpha does.
Wander::Left Wander::left(double since_s) const {
  if (since_s <= 0.0) return {1.0, 0.0};
  const double l = fade_rate_;
  const double decay = std::exp(-l * since_s);
  return {(1.0 + l * since_s) * decay, -l * l * since_s * decay};
}

Eigen::VectorXd Wander::value_row(double time_s) const {
  const double since = time_s - base_.epoch_s;
  Eigen::VectorXd row = Eigen::VectorXd::Zero(1 + 5 * order());
  row[0] = 1.0;
  for (int i = 0; i < order(); ++i) {
    const Sinusoid& part = base_.parts[static_cast<std::size_t>(i)];
    const double angle = part.rate * since;
    row[coefficient(2 * i)] = std::cos(angle);
    row[coefficient(2 * i + 1)] = std::sin(angle);
    row[alpha(i)] = part.amplitude * since * std::cos(angle + part.phase) * left(since).value;
  }
  return row;
}

Eigen::VectorXd Wander::rate_row(double time_s) const {
  const double since = time_s - base_.epoch_s;
  Eigen::VectorXd row = Eigen::VectorXd::Zero(1 + 5 * order());
  for (int i = 0; i < order(); ++i) {
    const Sinusoid& part = base_.parts[static_cast<std::size_t>(i)];
    const double angle = part.rate * since;
    row[coefficient(2 * i)] = -part.rate * std::sin(angle);
    row[coefficient(2 * i) + 1] = std::cos(angle);
    row[coefficient(2 * i + 1)] = part.rate * std::cos(angle);
    row[coefficient(2 * i + 1) + 1] = std::sin(angle);
    const double cosine = std::cos(angle + part.phase);
    const double sine = std::sin(angle + part.phase);
    const Left now = left(since);
    row[alpha(i)] = part.amplitude *
                    ((cosine - part.rate * since * sine) * now.value + since * cosine * now.rate);
  }
  return row;
}

Eigen::VectorXd Wander::seen_before(const Eigen::VectorXd& row, double h) const {
  Eigen::VectorXd earlier = row;
  if (fade_rate_ == 0.0) return earlier;
  const Step made = step(h);
  for (int i = 0; i < 2 * order(); ++i)
    earlier.segment<2>(coefficient(i)) =
        made.transition.transpose() * row.segment<2>(coefficient(i));
  return earlier;
}

double Wander::seen_before_dot(const Eigen::VectorXd& row, double h,
                               const Eigen::VectorXd& by) const {
  if (fade_rate_ == 0.0) return row.dot(by);
  const double l = fade_rate_;
  const double decay = std::exp(-l * h);
  double sum = row[0] * by[0] + row.tail(order()).dot(by.tail(order()));
  for (int i = 0; i < 2 * order(); ++i) {
    const Eigen::Index at = coefficient(i);
    const double value = (1.0 + l * h) * row[at] - l * l * h * row[at + 1];
    const double rate = h * row[at] + (1.0 - l * h) * row[at + 1];
    sum += decay * (value * by[at] + rate * by[at + 1]);
  }
  return sum;
}

double Wander::gained_variance(const Eigen::VectorXd& row, double h) const {
  if (fade_rate_ == 0.0) return 0.0;
  const Step made = step(h);
  double gained = 0.0;
  for (int i = 0; i < 2 * order(); ++i) {
    const Eigen::Vector2d part = row.segment<2>(coefficient(i));
    gained += variance(i) * part.dot(made.noise * part);
  }
  return gained;
}

}  // namespace harco
