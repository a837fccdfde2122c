#include "harco/touchdown.hpp"

#include <algorithm>
#include <array>
#include <limits>
#include <stdexcept>

#include <gtest/gtest.h>

#include "sample_decks.hpp"

namespace harco {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kAny = std::numeric_limits<double>::infinity();

// ---------------------------------------------------------------------------- the paper's landing

TEST(LinearDescent, IsThePapers) {
  const LinearDescent descent = LinearDescent::to_touch_at(72.0, 4.0, 0.5);
  EXPECT_EQ(descent.start_s, 64.0);
  EXPECT_EQ(descent.touchdown_s(), 72.0);
  EXPECT_EQ(descent.at(60.0).height_m, 4.0);
  EXPECT_EQ(descent.at(60.0).rate_mps, 0.0);
  EXPECT_NEAR(descent.at(68.0).height_m, 2.0, 1e-12);
  EXPECT_EQ(descent.at(68.0).rate_mps, -0.5);
  EXPECT_NEAR(descent.at(72.0).height_m, 0.0, 1e-12);
  EXPECT_EQ(descent.at(80.0).height_m, -0.2);
  EXPECT_EQ(descent.at(80.0).rate_mps, 0.0);
  EXPECT_THROW(LinearDescent::to_touch_at(72.0, 4.0, 0.0), std::invalid_argument);
  EXPECT_THROW(LinearDescent::to_touch_at(kNaN, 4.0, 0.5), std::invalid_argument);
}

TEST(HeightController, IsThePapersAndBounded) {
  const HeightController pd;
  // 1 * (3 - 2.5) + 0.8 * (-0.5 - 0.1) + 0.2
  EXPECT_NEAR(pd.acceleration({3.0, -0.5, 0.2}, 2.5, 0.1), 0.5 - 0.48 + 0.2, 1e-12);
  EXPECT_EQ(pd.acceleration({30.0, 0.0, 0.0}, 0.0, 0.0), 3.0);
  EXPECT_EQ(pd.acceleration({-30.0, 0.0, 0.0}, 0.0, 0.0), -3.0);
  EXPECT_THROW(pd.acceleration({}, kNaN, 0.0), std::invalid_argument);
}

// -------------------------------------------------------------------------------------- profiles

/// Speeds and accelerations keep to their bounds, and the motion has no jump.
void expect_bounded(const Profile& profile, double speed_mps, double acceleration_mps2) {
  constexpr double kStep_s = 0.01;
  constexpr double kRounding = 1e-9;
  HeightCommand before = profile.at(profile.start_s());
  for (double time_s = profile.start_s(); time_s < profile.end_s(); time_s += kStep_s) {
    const HeightCommand now = profile.at(time_s);
    ASSERT_LE(std::abs(now.rate_mps), speed_mps + kRounding);
    ASSERT_LE(std::abs(now.acceleration_mps2), acceleration_mps2 + kRounding);
    ASSERT_LE(std::abs(now.height_m - before.height_m), (speed_mps + kRounding) * kStep_s);
    ASSERT_LE(std::abs(now.rate_mps - before.rate_mps), (acceleration_mps2 + kRounding) * kStep_s);
    before = now;
  }
}

TEST(Profile, ComesToRestWithinItsBounds) {
  std::mt19937_64 random(1);
  const MotionLimits limits;
  std::uniform_real_distribution<double> height(0.0, 5.0);
  std::uniform_real_distribution<double> rate(-limits.speed_mps, limits.speed_mps);
  for (int i = 0; i < 300; ++i) {
    const double from = height(random);
    const double target = i % 10 == 0 ? from : height(random);
    const double at_rate = i % 7 == 0 ? 0.0 : rate(random);
    const Profile profile = Profile::to_rest(10.0, from, at_rate, target, limits);
    expect_bounded(profile, limits.speed_mps, limits.acceleration_mps2);
    EXPECT_EQ(profile.at(10.0).height_m, from);
    EXPECT_EQ(profile.at(10.0).rate_mps, at_rate);
    EXPECT_NEAR(profile.at(profile.end_s()).height_m, target, 1e-9);
    EXPECT_NEAR(profile.at(profile.end_s() + 5.0).height_m, target, 1e-8);
    EXPECT_NEAR(profile.at(profile.end_s()).rate_mps, 0.0, 1e-9);
  }
}

TEST(Profile, TouchesInTimeWithinItsBoundsAndNeverBefore) {
  std::mt19937_64 random(2);
  const MotionLimits limits;
  std::uniform_real_distribution<double> height(0.05, 5.0);
  std::uniform_real_distribution<double> rate(-limits.speed_mps, limits.speed_mps);
  std::uniform_real_distribution<double> time_left(0.5, 25.0);
  int found = 0;
  for (int i = 0; i < 500; ++i) {
    const double touchdown_s = 10.0 + time_left(random);
    const double from = height(random);
    const double at_rate = i % 5 == 0 ? 0.0 : rate(random);
    const auto profile = Profile::to_touch(10.0, from, at_rate, touchdown_s, limits);
    if (!profile) continue;
    ++found;
    expect_bounded(*profile, limits.speed_mps, limits.acceleration_mps2);
    EXPECT_EQ(profile->at(10.0).height_m, from);
    EXPECT_NEAR(profile->end_s(), touchdown_s, 1e-5);
    const HeightCommand contact = profile->at(touchdown_s);
    EXPECT_NEAR(contact.height_m, 0.0, 1e-5);
    EXPECT_NEAR(contact.rate_mps, -limits.touch_speed_mps, 1e-9);
    for (double time_s = 10.0; time_s < touchdown_s - 1e-3; time_s += 0.01)
      ASSERT_GT(profile->at(time_s).height_m, 0.0);
  }
  EXPECT_GT(found, 300);
}

TEST(Profile, FindsEveryTouchdownThatARestingVehicleCanReach) {
  const MotionLimits limits;
  // From rest at 2 m: 1.2 s to 0.6 m/s over 0.36 m, 0.9 s down to 0.15 m/s over 0.3375 m, the rest
  // at 0.6 m/s.
  const double least_s = 1.2 + 0.9 + (2.0 - 0.36 - 0.3375) / 0.6;
  EXPECT_FALSE(Profile::to_touch(0.0, 2.0, 0.0, least_s - 0.01, limits));
  for (double time_s = least_s + 0.001; time_s < 20.0; time_s += 0.37) {
    const auto profile = Profile::to_touch(0.0, 2.0, 0.0, time_s, limits);
    ASSERT_TRUE(profile) << time_s;
    EXPECT_NEAR(profile->descent_s(), time_s - least_s, 1e-6);  // as late as it can
    EXPECT_EQ(profile->at(profile->descent_s()).height_m, 2.0);
  }
  EXPECT_FALSE(Profile::to_touch(0.0, 0.05, -0.6, 0.2, limits));  // too fast, too near
  EXPECT_FALSE(Profile::to_touch(0.0, -0.1, 0.0, 5.0, limits));
}

TEST(Profile, CanTurnBackUntilItIsCommitted) {
  std::mt19937_64 random(3);
  const MotionLimits limits;
  MotionLimits turning = limits;
  turning.acceleration_mps2 = limits.abort_acceleration_mps2;
  turning.abort_acceleration_mps2 *= 2.0;
  std::uniform_real_distribution<double> height(0.1, 4.0);
  std::uniform_real_distribution<double> share(0.0, 1.0);
  for (int i = 0; i < 100; ++i) {
    const auto profile = Profile::to_touch(0.0, height(random), 0.0, 15.0, limits);
    ASSERT_TRUE(profile);
    const double committed_s = profile->committed_s(limits);
    EXPECT_LT(committed_s, 15.0);
    EXPECT_GT(committed_s, 15.0 - 0.2);  // not before the last moment
    for (double at : {share(random) * committed_s, committed_s - 1e-6}) {
      const HeightCommand from = profile->at(at);
      const Profile back = Profile::to_rest(at, from.height_m, from.rate_mps, 2.0, turning);
      for (double time_s = at; time_s < back.end_s(); time_s += 0.005)
        ASSERT_GT(back.at(time_s).height_m, -1e-6);
    }
    const HeightCommand late = profile->at(committed_s + 0.01);
    EXPECT_LT(late.height_m, 0.5 * late.rate_mps * late.rate_mps / limits.abort_acceleration_mps2);
  }
}

TEST(Profile, RefusesBadInput) {
  const auto refused = [](auto change) {
    MotionLimits limits;
    change(limits);
    EXPECT_THROW(Profile::to_rest(0.0, 1.0, 0.0, 2.0, limits), std::invalid_argument);
    EXPECT_THROW(Profile::to_touch(0.0, 1.0, 0.0, 20.0, limits), std::invalid_argument);
  };
  refused([](auto& limits) { limits.speed_mps = 0.0; });
  refused([](auto& limits) { limits.acceleration_mps2 = kNaN; });
  refused([](auto& limits) { limits.abort_acceleration_mps2 = limits.acceleration_mps2; });
  refused([](auto& limits) { limits.touch_speed_mps = 1.0; });
  EXPECT_THROW(Profile::to_rest(0.0, kNaN, 0.0, 2.0, {}), std::invalid_argument);
  EXPECT_THROW(Profile::to_touch(0.0, 1.0, kNaN, 2.0, {}), std::invalid_argument);
}

// --------------------------------------------------------------------------------------- planner

TouchdownOptions only_roll() {
  TouchdownOptions options;
  options.level = {0.05, kAny, kAny};
  options.windows.min_duration_s = 0.9;
  options.windows.level.draws = 300;
  options.contact_s = 0.3;
  options.hold_height_m = 1.0;
  options.max_forecast_age_s = 100.0;
  return options;
}

/// Flies the commands exactly, from 0 s, and thinks twice a second. Ends on contact, at `until_s`,
/// or when `stop` says so.
template <typename Stop>
double fly(TouchdownPlanner& planner, double height_m, const DeckForecast& forecast, double from_s,
           double until_s, Stop stop) {
  double rate_mps = 0.0;
  if (from_s > 0.0) {
    height_m = planner.command(from_s).height_m;
    rate_mps = planner.command(from_s).rate_mps;
  }
  for (double time_s = from_s; time_s < until_s; time_s += 0.05) {
    const bool think = std::fmod(time_s - from_s + 0.01, 0.5) < 0.05;
    if (think) planner.update(time_s, height_m, rate_mps, &forecast);
    if (stop(time_s)) return time_s;
    height_m = planner.command(time_s + 0.05).height_m;
    rate_mps = planner.command(time_s + 0.05).rate_mps;
    if (height_m <= 0.0) return time_s + 0.05;
  }
  return until_s;
}

const auto kNever = [](double) { return false; };

TEST(TouchdownPlanner, LandsInTheMiddleOfTheFirstWindowInReach) {
  TouchdownPlanner planner(only_roll());
  // From 3 m it takes 6.6 s to come down: 4 s is out of reach, 8 s isn't.
  const double contact_s = fly(planner, 3.0, rolling(), 0.0, 60.0, kNever);
  EXPECT_NEAR(contact_s, 8.0, 0.2);
  ASSERT_TRUE(planner.plan());
  EXPECT_EQ(planner.plan()->touchdown_s, planner.plan()->window.middle_s());
  EXPECT_NEAR(planner.plan()->touchdown_s, contact_s, 0.06);
  EXPECT_GE(planner.plan()->probability, 0.95);
  EXPECT_EQ(planner.phase(contact_s), TouchdownPhase::committed);
  EXPECT_EQ(planner.aborts(), 0);
  EXPECT_NEAR(planner.command(contact_s + 10.0).height_m, -0.2, 1e-12);
}

TEST(TouchdownPlanner, LandsOnADeckThatIsAlwaysLevel) {
  TouchdownPlanner planner(only_roll());
  const double contact_s = fly(planner, 3.0, rolling(0.0, 0.01), 0.0, 60.0, kNever);
  EXPECT_LT(contact_s, 15.0);
  EXPECT_EQ(planner.aborts(), 0);
}

TEST(TouchdownPlanner, HoldsWhereThereIsNoWindow) {
  TouchdownOptions options = only_roll();
  options.windows.min_duration_s = 3.0;
  TouchdownPlanner planner(options);
  EXPECT_EQ(fly(planner, 3.0, rolling(), 0.0, 20.0, kNever), 20.0);
  EXPECT_EQ(planner.phase(20.0), TouchdownPhase::holding);
  EXPECT_FALSE(planner.plan());
  EXPECT_NEAR(planner.command(20.0).height_m, options.hold_height_m, 1e-9);
  // Nor without a forecast.
  TouchdownPlanner blind(options);
  blind.update(0.0, 3.0, 0.0, nullptr);
  EXPECT_EQ(blind.phase(0.0), TouchdownPhase::holding);
}

TEST(TouchdownPlanner, FollowsAWindowThatSlips) {
  TouchdownPlanner planner(only_roll());
  const auto low = [&](double time_s) {
    return planner.phase(time_s) == TouchdownPhase::descending &&
           planner.command(time_s).height_m < 0.7;
  };
  const double now_s = fly(planner, 1.0, rolling(), 0.0, 60.0, low);
  const double before_s = planner.plan()->touchdown_s;
  const DeckForecast slipped = rolling(-0.4);  // everything is later
  const double contact_s = fly(planner, 0.0, slipped, now_s, 60.0, kNever);
  EXPECT_NEAR(contact_s, before_s + 0.4, 0.2);
  EXPECT_EQ(planner.aborts(), 0);
}

TEST(TouchdownPlanner, AbortsWhenTheForecastGetsWorseAndLandsLater) {
  TouchdownPlanner planner(only_roll());
  const auto low = [&](double time_s) {
    return planner.phase(time_s) == TouchdownPhase::descending &&
           planner.command(time_s).height_m < 0.5;
  };
  const double now_s = fly(planner, 1.0, rolling(), 0.0, 60.0, low);
  EXPECT_EQ(planner.phase(now_s), TouchdownPhase::descending);
  const DeckForecast other = rolling(2.0);  // steepest where it was level
  const double height_m = planner.command(now_s).height_m;
  planner.update(now_s, height_m, planner.command(now_s).rate_mps, &other);
  EXPECT_EQ(planner.phase(now_s), TouchdownPhase::aborting);
  EXPECT_EQ(planner.aborts(), 1);
  EXPECT_FALSE(planner.plan());
  double highest_m = 0.0;
  const double contact_s = fly(planner, 0.0, other, now_s, 60.0, [&](double time_s) {
    highest_m = std::max(highest_m, planner.command(time_s).height_m);
    return false;
  });
  EXPECT_NEAR(highest_m, 1.0, 1e-6);
  // Level when 8 s k + 2 s or that half a period later.
  EXPECT_NEAR(std::remainder(contact_s - 2.0, 4.0), 0.0, 0.2);
  EXPECT_EQ(planner.aborts(), 1);
}

TEST(TouchdownPlanner, AbortsWithoutAForecastOrOffItsWay) {
  for (int cause = 0; cause < 3; ++cause) {
    TouchdownOptions options = only_roll();
    options.max_forecast_age_s = 30.0;
    TouchdownPlanner planner(options);
    const DeckForecast forecast = rolling();
    const auto low = [&](double time_s) {
      return planner.phase(time_s) == TouchdownPhase::descending &&
             planner.command(time_s).height_m < 0.6;
    };
    const double now_s = fly(planner, 1.0, forecast, 0.0, 30.0, low);
    const HeightCommand flown = planner.command(now_s);
    DeckForecast old = forecast;
    old.as_of_s = now_s - 31.0;
    if (cause == 0) planner.update(now_s, flown.height_m, flown.rate_mps, nullptr);
    if (cause == 1) planner.update(now_s, flown.height_m, flown.rate_mps, &old);
    if (cause == 2) planner.update(now_s, flown.height_m + 0.5, flown.rate_mps, &forecast);
    EXPECT_EQ(planner.phase(now_s), TouchdownPhase::aborting) << cause;
    EXPECT_EQ(planner.aborts(), 1) << cause;
  }
}

TEST(TouchdownPlanner, GivesADescentUpThatIsCarriedOffBesideTheTarget) {
  const TouchdownOptions options = only_roll();
  const DeckForecast forecast = rolling();
  for (const double height_m : {0.9, 0.6, 0.3}) {
    TouchdownPlanner planner(options);
    const double now_s = fly(planner, 1.0, forecast, 0.0, 30.0, [&](double time_s) {
      return planner.phase(time_s) == TouchdownPhase::descending &&
             planner.command(time_s).height_m < height_m;
    });
    const HeightCommand flown = planner.command(now_s);
    const double bearable_m = 0.25 + 0.3 * flown.height_m;
    planner.watch(now_s, flown.height_m, flown.rate_mps, bearable_m - 1e-6);
    EXPECT_EQ(planner.phase(now_s), TouchdownPhase::descending) << height_m;
    planner.watch(now_s, flown.height_m, flown.rate_mps, bearable_m + 1e-6);
    EXPECT_EQ(planner.phase(now_s), TouchdownPhase::aborting) << height_m;
    EXPECT_EQ(planner.aborts(), 1) << height_m;
    // It turns back from where it is, without a jump, and lands later.
    EXPECT_NEAR(planner.command(now_s).height_m, flown.height_m, 1e-9);
    EXPECT_NEAR(planner.command(now_s).rate_mps, flown.rate_mps, 1e-9);
    const double contact_s = fly(planner, 0.0, forecast, now_s, 60.0, kNever);
    EXPECT_NEAR(std::remainder(contact_s, 4.0), 0.0, 0.2) << height_m;
    EXPECT_EQ(planner.aborts(), 1) << height_m;
  }
}

TEST(TouchdownPlanner, WatchesHeightAndLeavesEverythingElseAlone) {
  TouchdownPlanner planner(only_roll());
  const DeckForecast forecast = rolling();
  planner.update(0.0, 1.0, 0.0, &forecast);
  ASSERT_NE(planner.phase(0.0), TouchdownPhase::descending);
  planner.watch(0.0, 1.0, 0.0, 5.0);  // there is time to come back before the descent
  EXPECT_TRUE(planner.plan());
  const auto descends = [&](double time_s) {
    return planner.phase(time_s) == TouchdownPhase::descending;
  };
  const double now_s = fly(planner, 1.0, forecast, 0.0, 30.0, descends);
  const HeightCommand flown = planner.command(now_s);
  planner.watch(now_s, flown.height_m + 0.39, flown.rate_mps, 0.0);
  EXPECT_EQ(planner.phase(now_s), TouchdownPhase::descending);
  planner.watch(now_s, flown.height_m + 0.41, flown.rate_mps, 0.0);
  EXPECT_EQ(planner.phase(now_s), TouchdownPhase::aborting);
  EXPECT_NEAR(planner.command(now_s).height_m, flown.height_m + 0.41, 1e-9);
}

/// However gusts carry the vehicle to and fro, it touches down no farther off than it may be, plus
/// what it drifts while contact can't be avoided any more.
TEST(TouchdownPlanner, NeverTouchesDownFarBesideTheTarget) {
  constexpr double kStep_s = 0.02;
  const DeckForecast forecast = rolling();
  std::mt19937_64 random(7);
  std::uniform_real_distribution<double> share(0.0, 1.0);
  int contacts = 0, aborts = 0;
  for (int flight = 0; flight < 20; ++flight) {
    const double amplitude_m = share(random);
    const double rate = 0.3 * share(random) / amplitude_m;  // at most 0.3 m/s
    const double phase = 2.0 * kPi * share(random);
    const auto beside_m = [&](double time_s) {
      return std::abs(amplitude_m * std::sin(rate * time_s + phase));
    };
    TouchdownPlanner planner(only_roll());
    HeightCommand flown{1.0, 0.0, 0.0};
    for (int i = 0; i * kStep_s < 40.0 && flown.height_m > 0.0; ++i) {
      const double time_s = i * kStep_s;
      if (i % 50 == 0) planner.update(time_s, flown.height_m, flown.rate_mps, &forecast);
      planner.watch(time_s, flown.height_m, flown.rate_mps, beside_m(time_s));
      flown = planner.command(time_s + kStep_s);
      if (flown.height_m > 0.0) continue;
      const Profile& profile = planner.plan()->profile;
      const double committed_s = time_s + kStep_s - profile.committed_s(only_roll().motion);
      const double height_m = profile.at(time_s - committed_s).height_m;
      EXPECT_LE(beside_m(time_s), 0.25 + 0.3 * height_m + 0.3 * (committed_s + 2.0 * kStep_s))
          << flight;
      ++contacts;
    }
    aborts += planner.aborts();
  }
  EXPECT_GT(contacts, 5);
  EXPECT_GT(aborts, 10);
}

TEST(TouchdownPlanner, LetsACommittedLandingEnd) {
  TouchdownPlanner planner(only_roll());
  const double now_s = fly(planner, 1.0, rolling(), 0.0, 60.0, [&](double time_s) {
    return planner.phase(time_s) == TouchdownPhase::committed;
  });
  const double touchdown_s = planner.plan()->touchdown_s;
  planner.update(now_s, planner.command(now_s).height_m, 0.0, nullptr);
  EXPECT_EQ(planner.phase(now_s), TouchdownPhase::committed);
  EXPECT_NEAR(planner.command(touchdown_s).height_m, 0.0, 1e-6);
}

TEST(TouchdownPlanner, CommandsHaveNoJumps) {
  TouchdownPlanner planner(only_roll());
  double before_m = 3.0;
  double time_before_s = 0.0;
  const DeckForecast first = rolling();
  const DeckForecast second = rolling(1.5);
  for (int i = 0; i < 1200; ++i) {
    const double time_s = 0.02 * i;
    if (i % 25 == 0) {
      const HeightCommand flown = i == 0 ? HeightCommand{3.0, 0.0, 0.0} : planner.command(time_s);
      if (flown.height_m <= 0.0) break;
      planner.update(time_s, flown.height_m, flown.rate_mps, i / 150 % 2 == 0 ? &first : &second);
    }
    const double now_m = planner.command(time_s).height_m;
    ASSERT_LE(std::abs(now_m - before_m), 0.6 * (time_s - time_before_s) + 1e-6) << time_s;
    before_m = now_m;
    time_before_s = time_s;
  }
}

TEST(TouchdownPlanner, RefusesBadInput) {
  const auto refused = [](auto change) {
    TouchdownOptions options;
    change(options);
    EXPECT_THROW(TouchdownPlanner{options}, std::invalid_argument);
  };
  refused([](auto& options) { options.hold_height_m = 0.0; });
  refused([](auto& options) { options.look_ahead_s = kNaN; });
  refused([](auto& options) { options.contact_s = 1.0; });
  refused([](auto& options) { options.abort_probability = 0.99; });
  refused([](auto& options) { options.max_forecast_age_s = 0.0; });
  refused([](auto& options) { options.max_deviation_m = 0.0; });
  refused([](auto& options) { options.max_beside_m = 0.0; });
  refused([](auto& options) { options.beside_slope = -0.1; });
  refused([](auto& options) { options.settle_m = -1.0; });
  refused([](auto& options) { options.motion.touch_speed_mps = 0.0; });
  TouchdownPlanner planner;
  EXPECT_THROW(planner.command(0.0), std::invalid_argument);
  EXPECT_THROW(planner.update(0.0, kNaN, 0.0, nullptr), std::invalid_argument);
  EXPECT_THROW(planner.watch(0.0, 2.0, 0.0, 0.0), std::invalid_argument);
  planner.update(1.0, 2.0, 0.0, nullptr);
  EXPECT_THROW(planner.update(0.0, 2.0, 0.0, nullptr), std::invalid_argument);
  EXPECT_THROW(planner.watch(0.0, 2.0, 0.0, 0.0), std::invalid_argument);
  EXPECT_THROW(planner.watch(1.0, 2.0, 0.0, -1.0), std::invalid_argument);
  EXPECT_THROW(planner.watch(1.0, 2.0, 0.0, kNaN), std::invalid_argument);
}

// ----------------------------------------------------------------------------------- section 4.6

/// The paper's landing: roll and pitch of some degrees, 30 s of fitting at 30 Hz, validation, level
/// windows, touchdown in the middle of one with the paper's PD controller. The noise of the samples
/// is that which the paper reports for its angles.
TEST(Landing, OnTheOscillatingPlatformOfThePaper) {
  constexpr double kLimit = 0.06;
  for (int seed = 0; seed < 3; ++seed) {
    std::mt19937_64 random(static_cast<std::uint64_t>(seed));
    std::normal_distribution<double> normal;
    std::uniform_real_distribution<double> share(0.0, 1.0);
    std::array<Oscillation, 3> deck;
    deck[kRoll].parts = {{0.09, 2.0 * kPi / (5.0 + share(random)), 6.0 * share(random)},
                         {0.03, 2.0 * kPi / (2.8 + 0.5 * share(random)), 6.0 * share(random)}};
    deck[kPitch].parts = {{0.07, 2.0 * kPi / (6.5 + share(random)), 6.0 * share(random)}};
    deck[kHeave].parts = {{0.1, 2.0 * kPi / (7.0 + share(random)), 6.0 * share(random)}};
    const Eigen::Vector3d sd(0.035, 0.035, 0.01);

    DeckOptions fitting;
    fitting.refit_s = 3.0;
    fitting.relearn_s = 1e3;
    fitting.window_s = 45.0;
    fitting.oscillation.max_order = 2;
    DeckModel model(fitting);
    TouchdownOptions landing;
    landing.level = {kLimit, kLimit, 0.3};
    landing.windows.min_duration_s = 0.8;
    landing.windows.level.draws = 400;
    landing.contact_s = 0.25;
    landing.max_forecast_age_s = 3.5;
    TouchdownPlanner planner(landing);
    const HeightController pd;
    const auto level = [&](double time_s) {
      return std::abs(deck[kRoll].value(time_s)) < kLimit &&
             std::abs(deck[kPitch].value(time_s)) < kLimit;
    };

    double height_m = 4.0;
    double rate_mps = 0.0;
    double time_s = 0.0;
    for (int i = 0; height_m > 0.0 && time_s < 150.0; ++i) {
      time_s = i / 30.0;
      DeckSample sample;
      sample.time_s = time_s;
      sample.covariance = sd.cwiseAbs2().asDiagonal();
      for (int k = 0; k < 3; ++k)
        sample.motion[k] = deck[static_cast<std::size_t>(k)].value(time_s) + sd[k] * normal(random);
      model.add(sample);
      const bool anew = model.update();
      if (i == 0 || anew)
        planner.update(time_s, height_m, rate_mps,
                       model.phase() == DeckPhase::ready ? &*model.forecast() : nullptr);
      const double lift = pd.acceleration(planner.command(time_s), height_m, rate_mps);
      height_m += rate_mps / 30.0 + 0.5 * lift / 900.0;
      rate_mps += lift / 30.0;
    }
    ASSERT_LE(height_m, 0.0) << "seed " << seed << " didn't land";
    EXPECT_GT(time_s, 30.0);
    ASSERT_TRUE(planner.plan());
    EXPECT_NEAR(time_s, planner.plan()->window.middle_s(), 0.25) << seed;
    EXPECT_TRUE(level(time_s)) << "seed " << seed;
    EXPECT_TRUE(level(planner.plan()->window.begin_s)) << "seed " << seed;
    EXPECT_TRUE(level(planner.plan()->window.end_s)) << "seed " << seed;
    EXPECT_LT(std::abs(rate_mps), 0.3) << "seed " << seed;
  }
}

}  // namespace
}  // namespace harco
