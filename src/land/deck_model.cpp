#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "harco/forecast.hpp"
#include "land/input.hpp"

namespace harco {
namespace {

constexpr double kMedianChiSquared = 0.454936;  // of one degree of freedom
constexpr std::array<DeckAxis, 3> kAxes{kRoll, kPitch, kHeave};

void require(bool holds, const char* what) {
  if (!holds) throw std::invalid_argument(std::string("deck model: ") + what);
}

bool not_negative(double value) { return value >= 0.0 && std::isfinite(value); }

}  // namespace

DeckModel::DeckModel(const DeckOptions& options) : options_(options) {
  require(options.fit_s > 0.0 && std::isfinite(options.fit_s), "fit_s must be positive");
  require(options.window_s >= options.fit_s && std::isfinite(options.window_s),
          "window_s must be at least fit_s");
  require(options.min_samples >= 16, "min_samples must be at least 16");
  require(options.max_samples >= std::max(60, options.min_samples),
          "max_samples must be at least 60 and min_samples");
  require(not_negative(options.validate_s), "validate_s must not be negative");
  require(options.validate_s < options.window_s, "validate_s must be less than window_s");
  require(options.max_normalised > 0.0, "max_normalised must be positive");
  require(not_negative(options.refit_s), "refit_s must not be negative");
  require(not_negative(options.relearn_s), "relearn_s must not be negative");
  check(options.oscillation);
}

bool DeckModel::add(const DeckSample& sample) {
  require(
      std::isfinite(sample.time_s) && sample.motion.allFinite() && sample.covariance.allFinite(),
      "a sample must be finite");
  require((sample.covariance.diagonal().array() > 0.0).all(),
          "a sample's variances must be positive");
  if (!samples_.empty() && sample.time_s < samples_.back().time_s - options_.window_s) return false;
  const auto place = std::upper_bound(
      samples_.begin(), samples_.end(), sample,
      [](const DeckSample& a, const DeckSample& b) { return a.time_s < b.time_s; });
  for (auto same = place; same != samples_.begin() && (same - 1)->time_s == sample.time_s; --same)
    if ((same - 1)->motion == sample.motion) return false;
  samples_.insert(place, sample);
  while (samples_.front().time_s < samples_.back().time_s - options_.window_s) samples_.pop_front();
  return true;
}

std::vector<SeriesSample> DeckModel::series(DeckAxis axis) const {
  std::vector<SeriesSample> all;
  all.reserve(samples_.size());
  for (const DeckSample& sample : samples_)
    all.push_back({sample.time_s, sample.motion[axis], std::sqrt(sample.covariance(axis, axis))});
  return thinned(all, options_.max_samples);
}

bool DeckModel::update() {
  if (static_cast<int>(samples_.size()) < options_.min_samples ||
      samples_.back().time_s - samples_.front().time_s < options_.fit_s) {
    forecast_.reset();
    on_trial_.clear();
    phase_ = DeckPhase::collecting;
    return false;
  }
  const double newest_s = samples_.back().time_s;
  if (forecast_ && newest_s - forecast_->as_of_s < options_.refit_s) return false;
  validate();

  const bool failed = validation_ && phase_ == DeckPhase::validating;
  const double keep_s =
      failed ? std::min(options_.validate_s, options_.relearn_s) : options_.relearn_s;
  const bool learn = !forecast_ || newest_s - learnt_s_ >= keep_s;
  DeckForecast next;
  next.as_of_s = newest_s;
  for (DeckAxis axis : kAxes)
    next.axes.push_back(learn ? AxisForecast::learn(series(axis), options_.oscillation)
                              : forecast_->axes[axis].moved_to(series(axis), options_.oscillation));
  if (learn) learnt_s_ = newest_s;
  on_trial_.push_back(next);
  forecast_ = std::move(next);
  if (phase_ == DeckPhase::collecting) phase_ = DeckPhase::validating;
  if (options_.validate_s == 0.0) phase_ = DeckPhase::ready;
  return true;
}

/// Judges the newest forecast that is old enough, and forgets those before it.
void DeckModel::validate() {
  if (options_.validate_s == 0.0) return;
  bool judging = false;
  while (!on_trial_.empty() &&
         on_trial_.front().as_of_s + options_.validate_s <= samples_.back().time_s) {
    const DeckForecast judged = on_trial_.front();
    on_trial_.pop_front();
    judging = on_trial_.empty() ||
              on_trial_.front().as_of_s + options_.validate_s > samples_.back().time_s;
    if (judging) validation_ = judge(judged);
  }
  if (!judging) return;
  const bool good =
      std::all_of(validation_->normalised.begin(), validation_->normalised.end(),
                  [&](double normalised) { return normalised <= options_.max_normalised; });
  phase_ = good ? DeckPhase::ready : DeckPhase::validating;
}

Validation DeckModel::judge(const DeckForecast& forecast) const {
  Validation made;
  made.from_s = forecast.as_of_s;
  made.to_s = samples_.back().time_s;
  for (DeckAxis axis : kAxes) {
    std::vector<double> errors;
    std::vector<double> normalised;
    const AxisForecast& foretold = forecast.axes[axis];
    for (const DeckSample& sample : samples_) {
      if (sample.time_s <= forecast.as_of_s) continue;
      const AxisState then = foretold.at(sample.time_s);
      const double error = sample.motion[axis] - then.value;
      const double noise_sd = foretold.noise_scale() * std::sqrt(sample.covariance(axis, axis));
      errors.push_back(std::abs(error));
      normalised.push_back(error * error / (then.value_sd * then.value_sd + noise_sd * noise_sd));
    }
    made.error[axis] = kMadToSd * median(std::move(errors));
    made.normalised[axis] = median(std::move(normalised)) / kMedianChiSquared;
  }
  return made;
}

}  // namespace harco
