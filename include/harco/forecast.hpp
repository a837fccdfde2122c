// What a deck will do, and how sure that is (paper, section 4.6). Library harco::land.
//
// Eq. 19 holds for a deck that oscillates for ever as it does now. A ship's deck doesn't: its
// sinusoids wander. So each of their amplitudes is taken for a random process that stays what it is
// for about 1 / fade_rate seconds. With fade_rate 0 that is Eq. 19 itself, and the forecast's
// uncertainty that of the fitted parameters; otherwise old samples count less, the forecast fades
// towards the mean, and its uncertainty grows with the horizon up to that of a deck about which
// nothing is known but its sea. Order and fade rate are those that best foretell samples held back;
// where several do about as well, each has its share in the forecast.
#pragma once

#include <array>
#include <deque>
#include <memory>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "harco/deck.hpp"

namespace harco {

/// What one axis does at a time. Standard deviations are of the deck's true motion about it.
struct AxisState {
  double value = 0.0;
  double value_sd = 0.0;
  double rate = 0.0;  ///< of change, per second
  double rate_sd = 0.0;
};

/// The future of one axis. A cheap value: copies share what they know.
class AxisForecast {
 public:
  /// Learns from at least 16 samples in any order of time. Throws as fit_orders does.
  static AxisForecast learn(const std::vector<SeriesSample>& samples,
                            const OscillationOptions& options = {});
  /// The same orders and fade rates, moved on to other samples: far quicker than to learn anew.
  AxisForecast moved_to(const std::vector<SeriesSample>& samples,
                        const OscillationOptions& options = {}) const;

  double as_of_s() const;             ///< time of the newest sample that it knows
  const OscillationFit& fit() const;  ///< Eq. 19 and its covariance, of the likeliest order
  double fade_rate() const;           ///< 1/s, the likeliest
  double noise_scale() const;  ///< noise measured between neighbouring samples, over their sd

  /// At any time from as_of_s on; earlier ones throw std::invalid_argument.
  AxisState at(double time_s) const;

  /// Courses that the axis may take: its value, or rate, at ascending times from as_of_s on
  /// (columns) in each of `draws` possible futures (rows). The same seed draws the same. Throws
  /// std::invalid_argument for earlier or descending times and for no draws.
  Eigen::MatrixXd draw_values(const std::vector<double>& times_s, int draws, int seed = 0) const;
  Eigen::MatrixXd draw_rates(const std::vector<double>& times_s, int draws, int seed = 0) const;

  struct Knowledge;

 private:
  explicit AxisForecast(std::shared_ptr<const Knowledge> knowledge);
  std::shared_ptr<const Knowledge> knowledge_;
};

/// The future of the deck: roll, pitch, heave (DeckAxis). The axes' errors count as independent.
struct DeckForecast {
  double as_of_s = 0.0;  ///< time of the newest sample that it knows
  std::vector<AxisForecast> axes;
};

/// A forecast against the samples that came after it, by medians, so that outliers don't count.
struct Validation {
  double from_s = 0.0, to_s = 0.0;  ///< the samples compared, none of which the forecast knew
  std::array<double, 3> error{};    ///< standard deviation of its error: rad, rad, m
  /// Squared errors over their foretold variance, noise included: around 1 if the forecast is as
  /// good as it says.
  std::array<double, 3> normalised{};
};

/// What a DeckModel keeps and when it works.
struct DeckOptions {
  double window_s = 60.0;  ///< samples older than this before the newest are forgotten
  double fit_s = 30.0;     ///< the first fit waits until the samples span this (the paper's 30 s)
  int min_samples = 60;    ///< and for this many, at least 16
  /// Samples must follow the first forecast for this long, and agree with it, before the model is
  /// ready; afterwards every forecast is judged when it is this old. 0 does without.
  double validate_s = 6.0;
  double max_normalised = 9.0;  ///< Validation::normalised above which a forecast has failed
  double refit_s = 0.5;         ///< least time between two forecasts: bounds the load
  double relearn_s = 10.0;      ///< time after which order and fade rate are chosen anew
  int max_samples =
      2000;  ///< most that a fit takes, evenly chosen: bounds its time, at least 60 and min_samples
  OscillationOptions oscillation;
};

/// Where a DeckModel stands.
enum class DeckPhase {
  collecting,  ///< too few samples for a fit
  validating,  ///< there is a forecast, but it hasn't proved itself, or has failed
  ready
};

/// Keeps a forecast of the deck up to date while samples come: late, irregular, out of order, some
/// missing. Has no clock; the same calls give the same answers.
class DeckModel {
 public:
  /// Throws std::invalid_argument, naming the field, for options out of range.
  explicit DeckModel(const DeckOptions& options = {});

  /// Takes a sample, in any order of time. False if it was one that came before, or older than the
  /// window. Throws std::invalid_argument if it isn't finite or a variance isn't positive.
  bool add(const DeckSample& sample);

  /// Brings the forecast up to the samples, if options say it's time (counted in the samples' own
  /// times). True if there is a new one.
  bool update();

  DeckPhase phase() const { return phase_; }
  /// The newest; empty while collecting.
  const std::optional<DeckForecast>& forecast() const { return forecast_; }
  /// The last one; empty until a forecast was old enough to be judged.
  const std::optional<Validation>& validation() const { return validation_; }

 private:
  std::vector<SeriesSample> series(DeckAxis axis) const;
  Validation judge(const DeckForecast& forecast) const;
  void validate();

  DeckOptions options_;
  std::deque<DeckSample> samples_;  ///< ascending in time
  std::deque<DeckForecast> on_trial_;
  std::optional<DeckForecast> forecast_;
  std::optional<Validation> validation_;
  DeckPhase phase_ = DeckPhase::collecting;
  double learnt_s_ = 0.0;
};

}  // namespace harco
