#include "harco/landing_order.hpp"

#include <limits>
#include <stdexcept>

#include <gtest/gtest.h>

#include "sample_decks.hpp"

namespace harco {
namespace {

constexpr double kAny = std::numeric_limits<double>::infinity();

/// The deck of rolling() is level about every whole multiple of 4 s.
LandingOrderOptions only_roll() {
  LandingOrderOptions options;
  options.level = {0.05, kAny, kAny};
  options.windows.min_duration_s = 0.7;
  options.windows.level.draws = 300;
  options.contact_s = 0.2;
  options.max_forecast_age_s = 100.0;
  return options;
}

/// An autopilot that needs a second to begin, then comes down with half a metre a second.
struct Descent {
  double height_m;
  double ordered_s = kAny;

  double at(double time_s) const {
    return height_m - 0.5 * std::max(0.0, time_s - (ordered_s + 1.0));
  }
};

/// Asks five times a second, from 0 s, and obeys. When it touches, or `until_s`.
double obey(LandingOrder& order, Descent& descent, const DeckForecast& forecast, double from_s,
            double until_s) {
  for (double time_s = from_s; time_s < until_s; time_s += 0.2) {
    if (descent.at(time_s) <= 0.0) return time_s;
    const LandingAdvice advice = order.update(time_s, descent.at(time_s), &forecast);
    if (advice == LandingAdvice::land && descent.ordered_s == kAny) descent.ordered_s = time_s;
    if (advice == LandingAdvice::call_off) return time_s;
  }
  return until_s;
}

TEST(LandingOrder, MeetsTheFirstWindowInReach) {
  LandingOrder order(only_roll());
  Descent descent{3.0};
  // The descent takes 1 s and 6 s: the window about 4 s is out of reach, that about 8 s isn't.
  EXPECT_EQ(order.update(0.0, 3.0, nullptr), LandingAdvice::hold) << "nothing is foretold";
  const DeckForecast forecast = rolling();
  EXPECT_EQ(order.update(0.0, 3.0, &forecast), LandingAdvice::wait);
  EXPECT_NEAR(*order.touchdown_s(), 8.0, 0.15);
  const double contact_s = obey(order, descent, forecast, 0.0, 30.0);
  EXPECT_NEAR(descent.ordered_s, 1.0, 0.3);
  EXPECT_NEAR(contact_s, 8.0, 0.4);
  EXPECT_EQ(order.called_off(), 0);
}

TEST(LandingOrder, HoldsWhereTheDeckIsNeverLevelForLongEnough) {
  LandingOrderOptions options = only_roll();
  options.windows.min_duration_s = 3.0;
  LandingOrder order(options);
  Descent descent{3.0};
  EXPECT_EQ(obey(order, descent, rolling(), 0.0, 20.0), 20.0);
  EXPECT_EQ(descent.ordered_s, kAny);
  EXPECT_FALSE(order.window());
}

TEST(LandingOrder, CallsOffWhenTheForecastTurns) {
  LandingOrder order(only_roll());
  Descent descent{3.0};
  obey(order, descent, rolling(), 0.0, 4.0);
  ASSERT_NEAR(descent.ordered_s, 1.0, 0.3);
  const DeckForecast turned = rolling(2.0);  // at 8 s it will tilt most
  EXPECT_EQ(order.update(4.0, descent.at(4.0), &turned), LandingAdvice::call_off);
  EXPECT_EQ(order.called_off(), 1);
  EXPECT_FALSE(order.touchdown_s());
  // It plans again from where it is then.
  EXPECT_EQ(order.update(4.2, 1.5, &turned), LandingAdvice::wait);
}

TEST(LandingOrder, CallsOffWithoutAForecastButNotCloseToTheDeck) {
  for (const double height_m : {1.5, 0.4}) {
    LandingOrder order(only_roll());
    Descent descent{3.0};
    obey(order, descent, rolling(), 0.0, 4.0);
    EXPECT_EQ(order.update(4.0, height_m, nullptr),
              height_m > 0.5 ? LandingAdvice::call_off : LandingAdvice::land);
  }
}

TEST(LandingOrder, OldForecastsOrderNothing) {
  LandingOrderOptions options = only_roll();
  options.max_forecast_age_s = 1.5;
  LandingOrder order(options);
  const DeckForecast forecast = rolling();
  EXPECT_EQ(order.update(0.5, 3.0, &forecast), LandingAdvice::wait);
  EXPECT_EQ(order.update(1.6, 3.0, &forecast), LandingAdvice::hold);
}

TEST(LandingOrder, RefusesBadInput) {
  const auto refused = [](auto change) {
    LandingOrderOptions options;
    change(options);
    EXPECT_THROW(LandingOrder{options}, std::invalid_argument);
  };
  refused([](auto& options) { options.speed_mps = 0.0; });
  refused([](auto& options) { options.reaction_s = -1.0; });
  refused([](auto& options) { options.contact_s = 0.0; });
  refused([](auto& options) { options.abort_probability = 0.99; });
  refused([](auto& options) { options.commit_height_m = 0.0; });
  refused([](auto& options) { options.look_ahead_s = 0.0; });
  LandingOrder order;
  EXPECT_THROW(order.update(0.0, kAny, nullptr), std::invalid_argument);
}

}  // namespace
}  // namespace harco
