#include "harco/forecast.hpp"

#include <algorithm>
#include <limits>
#include <stdexcept>

#include <gtest/gtest.h>

#include "harco/level.hpp"
#include "sample_decks.hpp"

namespace harco {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kAny = std::numeric_limits<double>::infinity();

OscillationOptions two_at_most() {
  OscillationOptions options;
  options.max_order = 2;
  return options;
}

TEST(AxisForecast, ForetellsEq19WithinItsUncertainty) {
  constexpr int kSeeds = 12;
  double squares = 0.0;
  int count = 0;
  for (int seed = 0; seed < kSeeds; ++seed) {
    std::mt19937_64 random(static_cast<std::uint64_t>(seed));
    const Oscillation truth = two_sinusoids();
    const auto samples = samples_of(truth, 0.0, 30.0, 10.0, 0.005, random);
    const AxisForecast forecast = AxisForecast::learn(samples, two_at_most());
    EXPECT_EQ(forecast.fit().oscillation.order(), 2);
    EXPECT_NEAR(forecast.noise_scale(), 1.0, 0.2);
    EXPECT_EQ(forecast.as_of_s(), samples.back().time_s);
    for (double h : {0.0, 1.0, 3.0, 8.0}) {
      const double time_s = forecast.as_of_s() + h;
      const AxisState then = forecast.at(time_s);
      const double error = (then.value - truth.value(time_s)) / then.value_sd;
      const double rate_error = (then.rate - truth.rate(time_s)) / then.rate_sd;
      squares += error * error + rate_error * rate_error;
      count += 2;
      EXPECT_LT(then.value_sd, 0.03);
    }
  }
  EXPECT_GT(squares / count, 0.15);  // rather cautious
  EXPECT_LT(squares / count, 1.6);
}

TEST(AxisForecast, GrowsUncertainWithItsHorizonInASeaway) {
  std::mt19937_64 random(7);
  const auto samples = samples_of(seaway(8.0, 0.05, random), 0.0, 40.0, 10.0, 0.002, random);
  const AxisForecast forecast = AxisForecast::learn(samples, two_at_most());
  EXPECT_GT(forecast.fade_rate(), 0.0);
  double before = 0.0;
  for (double h : {0.0, 2.0, 8.0, 40.0}) {
    const AxisState then = forecast.at(forecast.as_of_s() + h);
    EXPECT_GT(then.value_sd, before);
    before = then.value_sd;
  }
  // At last nothing is known but the sea: its own standard deviation.
  const AxisState far = forecast.at(forecast.as_of_s() + 1e4);
  EXPECT_GT(far.value_sd, 0.03);
  EXPECT_LT(far.value_sd, 0.12);
}

TEST(AxisForecast, UncertaintyInASeawayAgreesWithErrors) {
  constexpr int kSeeds = 14;
  int inside = 0;
  int count = 0;
  for (int seed = 0; seed < kSeeds; ++seed) {
    std::mt19937_64 random(static_cast<std::uint64_t>(100 + seed));
    const Oscillation truth = seaway(7.0, 0.05, random);
    const AxisForecast forecast =
        AxisForecast::learn(samples_of(truth, 0.0, 40.0, 10.0, 0.002, random), two_at_most());
    for (double h : {0.5, 1.5, 4.0, 9.0}) {
      const double time_s = forecast.as_of_s() + h;
      const AxisState then = forecast.at(time_s);
      inside += std::abs(then.value - truth.value(time_s)) < 1.96 * then.value_sd ? 1 : 0;
      ++count;
    }
  }
  EXPECT_GE(inside, count * 84 / 100);
}

TEST(AxisForecast, CoursesHaveItsMeanAndSpreadAndGoTogether) {
  std::mt19937_64 random(8);
  const AxisForecast forecast = AxisForecast::learn(
      samples_of(seaway(8.0, 0.05, random), 0.0, 40.0, 10.0, 0.002, random), two_at_most());
  const double now_s = forecast.as_of_s();
  const std::vector<double> times_s{now_s, now_s + 0.01, now_s + 3.0, now_s + 6.0};
  constexpr int kDraws = 4000;
  const Eigen::MatrixXd values = forecast.draw_values(times_s, kDraws, 3);
  const Eigen::MatrixXd rates = forecast.draw_rates(times_s, kDraws, 3);
  for (int i = 0; i < 4; ++i) {
    const AxisState then = forecast.at(times_s[static_cast<std::size_t>(i)]);
    const auto spread = [&](const Eigen::VectorXd& of) {
      return std::sqrt((of.array() - of.mean()).square().mean());
    };
    EXPECT_NEAR(values.col(i).mean(), then.value, 0.06 * then.value_sd + 1e-9);
    EXPECT_NEAR(spread(values.col(i)), then.value_sd, 0.08 * then.value_sd + 1e-9);
    EXPECT_NEAR(rates.col(i).mean(), then.rate, 0.06 * then.rate_sd + 1e-9);
    EXPECT_NEAR(spread(rates.col(i)), then.rate_sd, 0.08 * then.rate_sd + 1e-9);
  }
  // Courses are smooth: a hundredth of a second later each is where it was.
  EXPECT_LT((values.col(1) - values.col(0)).cwiseAbs().maxCoeff(), 0.01);
  EXPECT_EQ(values, forecast.draw_values(times_s, kDraws, 3));
  EXPECT_NE(values, forecast.draw_values(times_s, kDraws, 4));
  EXPECT_THROW(forecast.draw_values(times_s, 0), std::invalid_argument);
  EXPECT_THROW(forecast.draw_values({now_s + 1.0, now_s}, 10), std::invalid_argument);
  EXPECT_THROW(forecast.at(now_s - 0.1), std::invalid_argument);
  EXPECT_THROW(forecast.at(kNaN), std::invalid_argument);
}

TEST(AxisForecast, KnowsADeckThatLiesStill) {
  std::mt19937_64 random(9);
  Oscillation still;
  still.mean = 0.02;
  const AxisForecast forecast =
      AxisForecast::learn(samples_of(still, 0.0, 30.0, 10.0, 0.003, random), two_at_most());
  const AxisState then = forecast.at(forecast.as_of_s() + 5.0);
  EXPECT_NEAR(then.value, 0.02, 0.002);
  EXPECT_LT(then.value_sd, 0.002);
}

TEST(AxisForecast, ADriftIsNoGreatOscillation) {
  // Fits of what wanders slowly may have large sinusoids that cancel within the samples.
  for (int seed = 0; seed < 6; ++seed) {
    std::mt19937_64 random(static_cast<std::uint64_t>(40 + seed));
    std::normal_distribution<double> normal;
    std::vector<SeriesSample> samples;
    double drift = 0.0;
    for (int i = 0; i < 225; ++i) {
      drift += 0.005 * normal(random);
      samples.push_back({0.2 * i, drift + 0.003 * normal(random), 0.003});
    }
    const AxisForecast forecast = AxisForecast::learn(samples, two_at_most());
    const AxisState then = forecast.at(forecast.as_of_s() + 6.0);
    EXPECT_LT(then.value_sd, 0.25) << seed;
    EXPECT_LT(then.rate_sd, 0.25) << seed;
  }
}

TEST(AxisForecast, RefusesTooFewSamples) {
  std::mt19937_64 random(10);
  const auto samples = samples_of(two_sinusoids(), 0.0, 1.0, 12.0, 0.003, random);
  ASSERT_LT(samples.size(), 16U);
  EXPECT_THROW(AxisForecast::learn(samples), std::invalid_argument);
}

// ------------------------------------------------------------------------------------ the windows

/// Roll by the forecast, a deck that neither pitches nor heaves.
DeckForecast only_roll(const AxisForecast& roll) {
  DeckForecast forecast;
  forecast.as_of_s = roll.as_of_s();
  forecast.axes = {roll, roll, roll};
  return forecast;
}

LevelLimits roll_within(double limit) {
  LevelLimits limits;
  limits.roll_rad = limit;
  limits.pitch_rad = kAny;
  limits.heave_rate_mps = kAny;
  return limits;
}

bool is_level(const Oscillation& roll, double limit, double begin_s, double end_s) {
  for (double time_s = begin_s; time_s <= end_s; time_s += 0.02)
    if (std::abs(roll.value(time_s)) > limit) return false;
  return true;
}

TEST(LevelWindows, AreThoseOfEq19) {
  std::mt19937_64 random(11);
  Oscillation truth;
  truth.parts = {{0.10, 2.0 * kPi / 8.0, 0.0}};
  const AxisForecast roll =
      AxisForecast::learn(samples_of(truth, 0.0, 30.0, 10.0, 0.002, random), two_at_most());
  WindowOptions options;
  options.min_duration_s = 0.9;
  const auto windows = level_windows(only_roll(roll), roll_within(0.05), 33.0, 49.0, options);
  // |sin| < 1/2 for a sixth of the half period of 4 s on both sides of every zero: 36, 40, 44, 48.
  ASSERT_EQ(windows.size(), 4U);
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_NEAR(windows[i].middle_s(), 36.0 + 4.0 * static_cast<double>(i), 0.15);
    EXPECT_NEAR(windows[i].duration_s(), 8.0 / 6.0, 0.4);
    EXPECT_GE(windows[i].probability, 0.95);
    EXPECT_TRUE(is_level(truth, 0.05, windows[i].begin_s, windows[i].end_s));
  }
  options.min_duration_s = 1.5;
  EXPECT_TRUE(level_windows(only_roll(roll), roll_within(0.05), 33.0, 49.0, options).empty());
}

TEST(LevelWindows, RollPitchAndVerticalSpeedAllCount) {
  std::mt19937_64 random(12);
  Oscillation truth;
  truth.parts = {{0.10, 2.0 * kPi / 8.0, 0.0}};
  const AxisForecast axis =
      AxisForecast::learn(samples_of(truth, 0.0, 30.0, 10.0, 0.002, random), two_at_most());
  const DeckForecast forecast = only_roll(axis);
  // At 36 s the value is zero and its rate greatest, 0.0785; at 38 s the other way round.
  const auto probability = [&](double time_s, double roll, double pitch, double heave_rate) {
    LevelLimits limits{roll, pitch, heave_rate};
    return level_probability(forecast, limits, time_s, time_s + 0.1);
  };
  EXPECT_GT(probability(36.0, 0.05, kAny, kAny), 0.99);
  EXPECT_LT(probability(38.0, 0.05, kAny, kAny), 0.01);
  EXPECT_GT(probability(36.0, kAny, 0.05, kAny), 0.99);
  EXPECT_LT(probability(38.0, kAny, 0.05, kAny), 0.01);
  EXPECT_LT(probability(36.0, kAny, kAny, 0.05), 0.01);
  EXPECT_GT(probability(38.0, kAny, kAny, 0.05), 0.99);
  EXPECT_EQ(probability(38.0, kAny, kAny, kAny), 1.0);
}

TEST(LevelWindows, CountTiltsThatLast) {
  std::mt19937_64 random(16);
  Oscillation still;
  still.mean = 0.02;
  const DeckForecast forecast = only_roll(
      AxisForecast::learn(samples_of(still, 0.0, 30.0, 10.0, 0.001, random), two_at_most()));
  const auto probability = [&](double tilt_sd_rad) {
    LevelOptions options;
    options.tilt_sd_rad = tilt_sd_rad;
    return level_probability(forecast, roll_within(0.05), 31.0, 32.0, options);
  };
  EXPECT_EQ(probability(0.0), 1.0);
  // |0.02 + 0.03 z| < 0.05: Phi(1) - Phi(-7/3).
  EXPECT_NEAR(probability(0.03), 0.8315, 0.025);
  EXPECT_THROW(probability(-0.1), std::invalid_argument);
}

TEST(LevelWindows, ProbabilitiesAreFrequencies) {
  constexpr int kSeeds = 24;
  double foretold = 0.0;
  double happened = 0.0;
  double squares = 0.0;  // Brier's score
  double windows_foretold = 0.0;
  double windows_happened = 0.0;
  int count = 0;
  int windows = 0;
  for (int seed = 0; seed < kSeeds; ++seed) {
    std::mt19937_64 random(static_cast<std::uint64_t>(500 + seed));
    const Oscillation truth = seaway(7.0, 0.05, random);
    const AxisForecast roll =
        AxisForecast::learn(samples_of(truth, 0.0, 40.0, 10.0, 0.002, random), two_at_most());
    const DeckForecast forecast = only_roll(roll);
    std::uniform_real_distribution<double> limit(0.02, 0.12);
    for (double h : {0.5, 2.0, 4.0, 7.0, 11.0}) {
      const double wide = limit(random);
      const double begin_s = roll.as_of_s() + h;
      const double p = level_probability(forecast, roll_within(wide), begin_s, begin_s + 1.5);
      const double did = is_level(truth, wide, begin_s, begin_s + 1.5) ? 1.0 : 0.0;
      foretold += p;
      happened += did;
      squares += (p - did) * (p - did);
      ++count;
    }
    WindowOptions options;
    options.min_probability = 0.8;
    for (const LevelWindow& window : level_windows(forecast, roll_within(0.05), roll.as_of_s(),
                                                   roll.as_of_s() + 12.0, options)) {
      windows_foretold += window.probability;
      windows_happened += is_level(truth, 0.05, window.begin_s, window.end_s) ? 1.0 : 0.0;
      ++windows;
    }
  }
  EXPECT_NEAR(foretold / count, happened / count, 0.08);
  EXPECT_LT(squares / count, 0.17);  // 0.25: knows nothing
  ASSERT_GE(windows, 8);
  EXPECT_NEAR(windows_foretold / windows, windows_happened / windows, 0.15);
}

TEST(LevelWindows, RefuseBadInput) {
  std::mt19937_64 random(13);
  const AxisForecast roll = AxisForecast::learn(
      samples_of(two_sinusoids(), 0.0, 20.0, 10.0, 0.002, random), two_at_most());
  const DeckForecast good = only_roll(roll);
  EXPECT_THROW(level_windows({}, {}, 30.0, 40.0), std::invalid_argument);
  EXPECT_THROW(level_windows(good, {}, 10.0, 40.0), std::invalid_argument);
  EXPECT_THROW(level_windows(good, {}, 40.0, 30.0), std::invalid_argument);
  EXPECT_THROW(level_windows(good, {}, 30.0, kNaN), std::invalid_argument);
  EXPECT_THROW(level_windows(good, {}, 30.0, 1e6), std::invalid_argument);
  EXPECT_THROW(level_windows(good, roll_within(0.0), 30.0, 40.0), std::invalid_argument);
  WindowOptions sure;
  sure.min_probability = 1.0;
  EXPECT_THROW(level_windows(good, {}, 30.0, 40.0, sure), std::invalid_argument);
  LevelOptions few;
  few.draws = 10;
  EXPECT_THROW(level_probability(good, {}, 30.0, 31.0, few), std::invalid_argument);
}

// -------------------------------------------------------------------------------------- DeckModel

struct Deck {
  Oscillation roll = two_sinusoids();
  Oscillation pitch;
  Oscillation heave;
  Deck() {
    pitch.parts = {{0.06, 2.0 * kPi / 5.0, 1.0}};
    heave.parts = {{0.3, 2.0 * kPi / 7.0, 2.0}};
  }
};

DeckSample sample_of(const Deck& deck, double time_s, std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  const Eigen::Vector3d sd(0.003, 0.003, 0.01);
  DeckSample sample;
  sample.time_s = time_s;
  sample.covariance = sd.cwiseAbs2().asDiagonal();
  sample.motion = {deck.roll.value(time_s), deck.pitch.value(time_s), deck.heave.value(time_s)};
  for (int i = 0; i < 3; ++i) sample.motion[i] += sd[i] * normal(random);
  return sample;
}

DeckOptions quick() {
  DeckOptions options;
  options.fit_s = 20.0;
  options.window_s = 30.0;
  options.validate_s = 4.0;
  options.refit_s = 2.0;
  options.relearn_s = 100.0;
  options.oscillation.max_order = 2;
  return options;
}

TEST(DeckModel, CollectsValidatesAndIsReady) {
  std::mt19937_64 random(14);
  const Deck deck;
  DeckModel model(quick());
  EXPECT_FALSE(model.update());
  double ready_s = 0.0;
  for (int i = 0; i < 300; ++i) {
    const double time_s = 0.1 * i;
    model.add(sample_of(deck, time_s, random));
    model.update();
    if (time_s < 19.9) {
      EXPECT_EQ(model.phase(), DeckPhase::collecting);
      EXPECT_FALSE(model.forecast());
    }
    if (model.phase() == DeckPhase::ready && ready_s == 0.0) ready_s = time_s;
  }
  EXPECT_NEAR(ready_s, 24.0, 0.3);
  ASSERT_TRUE(model.validation());
  for (std::size_t axis = 0; axis < 3; ++axis) {
    EXPECT_GT(model.validation()->normalised[axis], 0.4);
    EXPECT_LT(model.validation()->normalised[axis], 2.5);
  }
  const double later_s = model.forecast()->as_of_s + 5.0;
  EXPECT_NEAR(model.forecast()->axes[kRoll].at(later_s).value, deck.roll.value(later_s), 0.01);
  EXPECT_NEAR(model.forecast()->axes[kPitch].at(later_s).value, deck.pitch.value(later_s), 0.01);
  EXPECT_NEAR(model.forecast()->axes[kHeave].at(later_s).rate, deck.heave.rate(later_s), 0.03);
}

TEST(DeckModel, OrderOfArrivalDoesntMatterNorDoCopies) {
  std::mt19937_64 random(15);
  const Deck deck;
  std::vector<DeckSample> samples;
  for (int i = 0; i < 250; ++i)
    if (i % 7 != 0 && (i < 100 || i > 130)) samples.push_back(sample_of(deck, 0.1 * i, random));
  DeckModel ordered(quick());
  for (const DeckSample& sample : samples) EXPECT_TRUE(ordered.add(sample));
  std::shuffle(samples.begin(), samples.end(), random);
  DeckModel shuffled(quick());
  for (const DeckSample& sample : samples) EXPECT_TRUE(shuffled.add(sample));
  for (const DeckSample& sample : samples) EXPECT_FALSE(shuffled.add(sample));
  ASSERT_TRUE(ordered.update());
  ASSERT_TRUE(shuffled.update());
  for (std::size_t axis = 0; axis < 3; ++axis)
    EXPECT_EQ(ordered.forecast()->axes[axis].at(30.0).value,
              shuffled.forecast()->axes[axis].at(30.0).value);
  EXPECT_FALSE(shuffled.update());                             // nothing new
  EXPECT_FALSE(shuffled.add(sample_of(deck, -10.0, random)));  // older than the window
}

TEST(DeckModel, NoticesThatTheDeckHasChanged) {
  std::mt19937_64 random(16);
  Deck deck;
  DeckModel model(quick());
  bool was_ready = false;
  bool failed = false;
  for (int i = 0; i < 340; ++i) {
    const double time_s = 0.1 * i;
    if (i == 270) deck.roll.parts = {{0.15, 2.0 * kPi / 2.9, 0.0}};
    model.add(sample_of(deck, time_s, random));
    model.update();
    was_ready = was_ready || (i < 270 && model.phase() == DeckPhase::ready);
    failed = failed || (i > 270 && model.phase() == DeckPhase::validating);
  }
  EXPECT_TRUE(was_ready);
  EXPECT_TRUE(failed);
  EXPECT_GT(model.validation()->normalised[kRoll], 9.0);
}

TEST(DeckModel, RefusesBadSamplesAndOptions) {
  std::mt19937_64 random(17);
  DeckModel model;
  DeckSample bad = sample_of({}, 0.0, random);
  bad.motion[kHeave] = kNaN;
  EXPECT_THROW(model.add(bad), std::invalid_argument);
  bad = sample_of({}, kNaN, random);
  EXPECT_THROW(model.add(bad), std::invalid_argument);
  bad = sample_of({}, 0.0, random);
  bad.covariance.setZero();
  EXPECT_THROW(model.add(bad), std::invalid_argument);
  const auto refused = [](auto change) {
    DeckOptions options;
    change(options);
    EXPECT_THROW(DeckModel{options}, std::invalid_argument);
  };
  refused([](auto& options) { options.fit_s = 0.0; });
  refused([](auto& options) { options.window_s = 10.0; });
  refused([](auto& options) { options.min_samples = 3; });
  refused([](auto& options) { options.max_samples = 20; });
  refused([](auto& options) { options.validate_s = -1.0; });
  refused([](auto& options) { options.max_normalised = 0.0; });
  refused([](auto& options) { options.refit_s = kNaN; });
  refused([](auto& options) { options.oscillation.max_order = -1; });
}

}  // namespace
}  // namespace harco
