#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <random>
#include <stdexcept>
#include <tuple>
#include <utility>

#include <Eigen/Cholesky>

#include "harco/forecast.hpp"
#include "land/input.hpp"
#include "land/wander.hpp"

namespace harco {

/// One belief about the axis: an order and a fade rate, and what the samples say then.
struct Belief {
  double weight;
  OscillationFit fit;
  Wander wander;
  Wander::State state;  ///< after the newest sample
};

struct AxisForecast::Knowledge {
  std::vector<Belief> beliefs;  ///< weights sum to one; the first is the greatest
  double noise_scale;
  double span_s;  ///< of the samples
};

namespace {

constexpr double kHorizons_s[] = {0.5, 1.0, 2.0, 4.0, 8.0};
constexpr double kOriginEvery_s = 0.7;
// 0: for ever as it is. The others: what it was is forgotten after 1 / rate seconds.
constexpr double kFadeRates[] = {0.0,      1 / 200., 1 / 100., 1 / 50., 1 / 30., 1 / 20.,
                                 1 / 14.0, 1 / 10.0, 1 / 7.0,  1 / 5.0, 1 / 3.0, 1 / 2.0};
// Held-back samples are worth one independent trial each so many seconds: errors of forecasts last.
constexpr double kTrialEvery_s = 7.0;
constexpr double kLeastFreedom = 5.0;
constexpr double kMuchFreedom = 30.0;  // with which a t distribution is as good as normal
constexpr double kLeastWeight = 0.03;  // over the greatest
constexpr std::size_t kMostBeliefs = 6;
constexpr int kTrialSamples = 600;
constexpr std::size_t kLeastSamples = 16;

/// How much samples scatter about the straight line between their neighbours, over what their
/// standard deviations ask for. Motion hardly shows in this.
double measured_noise(const std::vector<SeriesSample>& samples) {
  constexpr double kLeast = 1e-6;
  std::vector<double> scatter;
  for (std::size_t i = 1; i + 1 < samples.size(); ++i) {
    const SeriesSample& before = samples[i - 1];
    const SeriesSample& after = samples[i + 1];
    const double span_s = after.time_s - before.time_s;
    if (span_s <= 0.0) continue;
    const double share = (samples[i].time_s - before.time_s) / span_s;
    const double error = samples[i].value - (1.0 - share) * before.value - share * after.value;
    const double sd = std::hypot(samples[i].sd, (1.0 - share) * before.sd, share * after.sd);
    scatter.push_back(std::abs(error) / sd);
  }
  return scatter.empty() ? 1.0 : std::max(kLeast, kMadToSd * median(std::move(scatter)));
}

/// Error and variance of a forecast for the sample `later` (its own noise included).
struct Miss {
  double error;
  double variance;
};
Miss miss(const Wander& wander, const Wander::State& now, const SeriesSample& later) {
  const double h = later.time_s - now.time_s;
  const Eigen::VectorXd row = wander.value_row(later.time_s);
  const Eigen::VectorXd here = wander.seen_before(row, h);
  return {later.value - here.dot(now.mean),
          here.dot(now.covariance * here) + wander.gained_variance(row, h) + later.sd * later.sd};
}

/// Mean log-likelihood of forecasts over several horizons, made from every time past the first
/// `known` samples. Of three neighbouring samples the middle error counts, so outliers don't.
double foretold(const Wander& wander, const std::vector<SeriesSample>& samples, std::size_t known) {
  Wander::State state = wander.before_all(samples.front().time_s);
  double sum = 0.0;
  int count = 0;
  double next_s = samples[known - 1].time_s;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    wander.advance(state, samples[i].time_s);
    wander.learn(state, samples[i].value, samples[i].sd);
    if (samples[i].time_s < next_s) continue;
    next_s = samples[i].time_s + kOriginEvery_s;
    for (double horizon_s : kHorizons_s) {
      const auto later = std::lower_bound(
          samples.begin() + static_cast<std::ptrdiff_t>(i), samples.end(),
          samples[i].time_s + horizon_s,
          [](const SeriesSample& sample, double time_s) { return sample.time_s < time_s; });
      if (samples.end() - later < 3) break;
      std::array<Miss, 3> misses{miss(wander, state, later[0]), miss(wander, state, later[1]),
                                 miss(wander, state, later[2])};
      std::sort(misses.begin(), misses.end(),
                [](const Miss& a, const Miss& b) { return a.error < b.error; });
      const Miss& middle = misses[1];
      sum -= 0.5 * (std::log(middle.variance) + middle.error * middle.error / middle.variance);
      ++count;
    }
  }
  return count > 0 ? sum / count : 0.0;
}

std::vector<SeriesSample> reversed(std::vector<SeriesSample> samples) {
  std::reverse(samples.begin(), samples.end());
  for (SeriesSample& sample : samples) sample.time_s = -sample.time_s;
  return samples;
}

/// Variance of samples about their mean, less that of their noise.
double motion_variance(const std::vector<SeriesSample>& samples) {
  double sum = 0.0;
  double squares = 0.0;
  double noise = 0.0;
  for (const SeriesSample& sample : samples) sum += sample.value;
  const auto count = static_cast<double>(samples.size());
  for (const SeriesSample& sample : samples) {
    squares += (sample.value - sum / count) * (sample.value - sum / count);
    noise += sample.sd * sample.sd;
  }
  return std::max(0.0, (squares - noise) / count);
}

struct Choice {
  int order;
  double fade_rate;
  double weight;
};

/// Weights of what is left sum to one, the greatest first.
std::vector<Choice> greatest(std::vector<Choice> all) {
  std::stable_sort(all.begin(), all.end(),
                   [](const Choice& a, const Choice& b) { return a.weight > b.weight; });
  if (all.size() > kMostBeliefs) all.resize(kMostBeliefs);
  while (all.back().weight < kLeastWeight * all.front().weight) all.pop_back();
  double sum = 0.0;
  for (const Choice& choice : all) sum += choice.weight;
  for (Choice& choice : all) choice.weight /= sum;
  return all;
}

/// How well orders 1 … `most` with each fade rate foretell what was held back: the last part of the
/// samples, from a fit to the others, and the first part likewise, back in time (an oscillation's
/// statistics don't know which way time runs). Weights are likelihoods.
std::vector<Choice> choose(const std::vector<SeriesSample>& samples, int most,
                           OscillationOptions options) {
  if (most == 0) return {{0, 0.0, 1.0}};
  options.max_order = most;
  std::vector<Choice> choices;
  for (int order = 1; order <= most; ++order)
    for (double fade_rate : kFadeRates) choices.push_back({order, fade_rate, 0.0});
  const std::vector<SeriesSample> backwards = reversed(samples);
  for (double share : {0.6, 0.8})
    for (const auto* all : {&samples, &backwards}) {
      const auto known = static_cast<std::size_t>(share * static_cast<double>(all->size()));
      const double held_back_s = all->back().time_s - (*all)[known - 1].time_s;
      const auto fits =
          fit_orders({all->begin(), all->begin() + static_cast<std::ptrdiff_t>(known)}, options);
      const double motion = motion_variance(*all);
      for (Choice& choice : choices) {
        const auto order = std::min(static_cast<std::size_t>(choice.order), fits.size() - 1);
        choice.weight += held_back_s / kTrialEvery_s *
                         foretold(Wander(fits[order], choice.fade_rate, motion), *all, known);
      }
    }
  const double best =
      std::max_element(choices.begin(), choices.end(), [](const auto& a, const auto& b) {
        return a.weight < b.weight;
      })->weight;
  for (Choice& choice : choices) choice.weight = std::exp(choice.weight - best);
  return greatest(std::move(choices));
}

std::vector<SeriesSample> scaled(std::vector<SeriesSample> samples, double factor) {
  for (SeriesSample& sample : samples) sample.sd *= factor;
  return samples;
}

Wander::State filtered(const Wander& wander, const std::vector<SeriesSample>& samples) {
  Wander::State state = wander.before_all(samples.front().time_s);
  for (const SeriesSample& sample : samples) {
    wander.advance(state, sample.time_s);
    wander.learn(state, sample.value, sample.sd);
  }
  return state;
}

}  // namespace

namespace {

/// A sea's variance is known from few waves: each independent stretch of the samples tells an
/// amplitude and a phase. The less amplitudes wander within the samples, the less that matters.
double freedom_of(const Belief& belief, double span_s) {
  const double wandered = 1.0 - std::exp(-belief.wander.fade_rate() * span_s);
  return std::max(kLeastFreedom, 2.0 * span_s / kTrialEvery_s / std::max(1e-9, wandered));
}

}  // namespace

AxisForecast::AxisForecast(std::shared_ptr<const Knowledge> knowledge)
    : knowledge_(std::move(knowledge)) {}

AxisForecast AxisForecast::learn(const std::vector<SeriesSample>& samples,
                                 const OscillationOptions& options) {
  std::vector<SeriesSample> known = sorted(samples);
  if (known.size() < kLeastSamples)
    throw std::invalid_argument("deck forecast: needs at least 16 samples");
  const double noise = measured_noise(known);
  known = scaled(std::move(known), noise);
  const std::vector<OscillationFit> fits = fit_orders(known, options);
  const auto likeliest = std::min_element(
      fits.begin(), fits.end(), [](const auto& a, const auto& b) { return a.bic < b.bic; });
  auto knowledge = std::make_shared<Knowledge>();
  knowledge->noise_scale = noise;
  knowledge->span_s = known.back().time_s - known.front().time_s;
  for (const Choice& choice :
       choose(thinned(known, kTrialSamples), likeliest->oscillation.order(), options)) {
    const OscillationFit& fit = fits[static_cast<std::size_t>(choice.order)];
    const Wander wander(fit, choice.fade_rate, motion_variance(known));
    knowledge->beliefs.push_back({choice.weight, fit, wander, filtered(wander, known)});
  }
  return AxisForecast(std::move(knowledge));
}

AxisForecast AxisForecast::moved_to(const std::vector<SeriesSample>& samples,
                                    const OscillationOptions& options) const {
  std::vector<SeriesSample> known = sorted(samples);
  const double noise = measured_noise(known);
  known = scaled(std::move(known), noise);
  auto knowledge = std::make_shared<Knowledge>();
  knowledge->noise_scale = noise;
  knowledge->span_s = known.back().time_s - known.front().time_s;
  std::map<int, OscillationFit> fits;  // by order
  for (const Belief& belief : knowledge_->beliefs) {
    const Oscillation& start = belief.fit.oscillation;
    const auto [fit, missing] = fits.try_emplace(start.order());
    if (missing) fit->second = refit_oscillation(known, start, options);
    const Wander wander(fit->second, belief.wander.fade_rate(), motion_variance(known));
    knowledge->beliefs.push_back({belief.weight, fit->second, wander, filtered(wander, known)});
  }
  return AxisForecast(std::move(knowledge));
}

double AxisForecast::as_of_s() const { return knowledge_->beliefs.front().state.time_s; }
const OscillationFit& AxisForecast::fit() const { return knowledge_->beliefs.front().fit; }
double AxisForecast::fade_rate() const { return knowledge_->beliefs.front().wander.fade_rate(); }
double AxisForecast::noise_scale() const { return knowledge_->noise_scale; }

namespace {

void require_future(double as_of_s, double time_s) {
  if (!(time_s >= as_of_s) || !std::isfinite(time_s))
    throw std::invalid_argument("deck forecast: times must not lie before the newest sample");
}

using RowAt = Eigen::VectorXd (Wander::*)(double) const;

/// Mean and standard deviation over all beliefs of what a row reads.
std::pair<double, double> moments(const std::vector<Belief>& beliefs, double span_s, double time_s,
                                  RowAt row_at) {
  double mean = 0.0;
  double square = 0.0;
  for (const Belief& belief : beliefs) {
    const Eigen::VectorXd row = (belief.wander.*row_at)(time_s);
    const double h = time_s - belief.state.time_s;
    const Eigen::VectorXd now = belief.wander.seen_before(row, h);
    const double value = now.dot(belief.state.mean);
    const double freedom = freedom_of(belief, span_s);
    const double variance = freedom / (freedom - 2.0) *
                            (std::max(0.0, now.dot(belief.state.covariance * now)) +
                             belief.wander.gained_variance(row, h));
    mean += belief.weight * value;
    square += belief.weight * (value * value + variance);
  }
  return {mean, std::sqrt(std::max(0.0, square - mean * mean))};
}

}  // namespace

AxisState AxisForecast::at(double time_s) const {
  require_future(as_of_s(), time_s);
  AxisState then;
  std::tie(then.value, then.value_sd) =
      moments(knowledge_->beliefs, knowledge_->span_s, time_s, &Wander::value_row);
  std::tie(then.rate, then.rate_sd) =
      moments(knowledge_->beliefs, knowledge_->span_s, time_s, &Wander::rate_row);
  return then;
}

namespace {

/// Normal numbers, the second half of the rows the first with the other sign, so that means are
/// exact. Own arithmetic on the engine's numbers: standard libraries differ in theirs.
Eigen::MatrixXd normal_numbers(Eigen::Index rows, Eigen::Index columns, std::mt19937_64& engine) {
  const auto uniform = [&] {  // above 0, at most 1
    return (static_cast<double>(engine() >> 11) + 1.0) * 0x1p-53;
  };
  Eigen::MatrixXd numbers(rows, columns);
  const Eigen::Index half = rows / 2;
  for (Eigen::Index row = 0; row < half; ++row)
    for (Eigen::Index column = 0; column < columns; column += 2) {
      const double radius = std::sqrt(-2.0 * std::log(uniform()));
      const double angle = kTwoPi * uniform();
      numbers(row, column) = radius * std::cos(angle);
      if (column + 1 < columns) numbers(row, column + 1) = radius * std::sin(angle);
    }
  numbers.middleRows(half, half) = -numbers.topRows(half);
  if (rows % 2 == 1) numbers.row(rows - 1).setZero();
  return numbers;
}

/// L with L L^T = covariance, which may be singular: where few parameters make many times, it is.
Eigen::MatrixXd root(const Eigen::MatrixXd& covariance) {
  constexpr double kLeastRidge = 1e-10;
  const double typical = covariance.trace() / static_cast<double>(covariance.rows());
  if (!(typical > 0.0)) return Eigen::MatrixXd::Zero(covariance.rows(), covariance.cols());
  for (double ridge = kLeastRidge; ridge < 1.0; ridge *= 10.0) {
    Eigen::MatrixXd raised = covariance;
    raised.diagonal().array() += ridge * typical;
    const Eigen::LLT<Eigen::MatrixXd> cholesky(raised);
    if (cholesky.info() == Eigen::Success) return cholesky.matrixL();
  }
  return covariance.diagonal().cwiseMax(0.0).cwiseSqrt().asDiagonal();
}

/// Deviations become those of a t distribution, row by row: what a variance that isn't known for
/// sure does to them. Rows whose deviations are opposite stay so.
void widen(Eigen::MatrixXd& deviations, double freedom, std::mt19937_64& engine) {
  const auto degrees = static_cast<Eigen::Index>(std::llround(freedom));
  const Eigen::Index half = deviations.rows() / 2;
  const Eigen::MatrixXd squares = normal_numbers(2 * half, degrees, engine).cwiseAbs2();
  for (Eigen::Index row = 0; row < half; ++row) {
    const double scale = std::sqrt(static_cast<double>(degrees) / squares.row(row).sum());
    deviations.row(row) *= scale;
    deviations.row(row + half) *= scale;
  }
}

/// Courses, one a row, of what rows read at ascending times.
Eigen::MatrixXd drawn(const Belief& belief, double span_s, const std::vector<double>& times_s,
                      RowAt row_at, Eigen::Index draws, std::mt19937_64& engine) {
  const Wander& wander = belief.wander;
  const auto size = static_cast<Eigen::Index>(times_s.size());
  std::vector<Eigen::VectorXd> rows;
  rows.reserve(times_s.size());
  for (double time_s : times_s) rows.push_back((wander.*row_at)(time_s));
  Eigen::RowVectorXd mean(size);
  Eigen::MatrixXd covariance(size, size);
  Wander::State state = belief.state;
  for (Eigen::Index i = 0; i < size; ++i) {
    const auto at = static_cast<std::size_t>(i);
    wander.advance(state, times_s[at]);
    mean[i] = rows[at].dot(state.mean);
    const Eigen::VectorXd shared = state.covariance * rows[at];
    for (Eigen::Index k = i; k < size; ++k) {
      const auto later = static_cast<std::size_t>(k);
      covariance(i, k) = covariance(k, i) =
          wander.seen_before_dot(rows[later], times_s[later] - times_s[at], shared);
    }
  }
  const Eigen::MatrixXd lower = root(covariance);
  Eigen::MatrixXd courses =
      normal_numbers(draws, size, engine) * lower.triangularView<Eigen::Lower>().transpose();
  if (const double freedom = freedom_of(belief, span_s); freedom < kMuchFreedom)
    widen(courses, freedom, engine);
  return courses.rowwise() + mean;
}

/// Courses of all beliefs, as many of each as its weight asks for.
Eigen::MatrixXd drawn(const std::vector<Belief>& beliefs, double span_s,
                      const std::vector<double>& times_s, RowAt row_at, int draws, int seed) {
  if (draws < 1) throw std::invalid_argument("deck forecast: draws must be positive");
  double last_s = beliefs.front().state.time_s;
  for (double time_s : times_s) {
    require_future(last_s, time_s);
    last_s = time_s;
  }
  std::mt19937_64 engine(static_cast<std::uint64_t>(seed));
  Eigen::MatrixXd courses(draws, static_cast<Eigen::Index>(times_s.size()));
  Eigen::Index done = 0;
  double weight = 0.0;
  for (const Belief& belief : beliefs) {
    weight += belief.weight;
    const bool last = &belief == &beliefs.back();
    const Eigen::Index until = last ? draws : std::llround(weight * draws);
    if (until == done) continue;
    courses.middleRows(done, until - done) =
        drawn(belief, span_s, times_s, row_at, until - done, engine);
    done = until;
  }
  // Axes are combined row by row: which belief a row comes from must not be the same for all.
  for (Eigen::Index row = draws - 1; row > 0; --row) {
    const auto other = static_cast<Eigen::Index>(engine() % static_cast<std::uint64_t>(row + 1));
    courses.row(row).swap(courses.row(other));
  }
  return courses;
}

}  // namespace

Eigen::MatrixXd AxisForecast::draw_values(const std::vector<double>& times_s, int draws,
                                          int seed) const {
  return drawn(knowledge_->beliefs, knowledge_->span_s, times_s, &Wander::value_row, draws, seed);
}

Eigen::MatrixXd AxisForecast::draw_rates(const std::vector<double>& times_s, int draws,
                                         int seed) const {
  return drawn(knowledge_->beliefs, knowledge_->span_s, times_s, &Wander::rate_row, draws, seed);
}

}  // namespace harco
