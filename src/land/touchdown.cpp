#include "harco/touchdown.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "land/motion_limits.hpp"

namespace harco {
namespace {

constexpr double kSlip_s = 0.1;  // by which a window's middle may move unheeded

void require(bool holds, const char* what) {
  if (!holds) throw std::invalid_argument(std::string("touchdown planner: ") + what);
}

bool positive(double value) { return value > 0.0 && std::isfinite(value); }

}  // namespace

TouchdownPlanner::TouchdownPlanner(const TouchdownOptions& options) : options_(options) {
  const MotionLimits& motion = options.motion;
  check(motion);
  require(
      positive(options.hold_height_m) && options.hold_height_m * 2.0 * motion.acceleration_mps2 >
                                             motion.touch_speed_mps * motion.touch_speed_mps,
      "hold_height_m must be positive, and enough to reach the touch speed");
  require(positive(options.look_ahead_s), "look_ahead_s must be positive");
  require(positive(options.contact_s) && 2.0 * options.contact_s <= options.windows.min_duration_s,
          "contact_s must be positive and at most half of the windows' min_duration_s");
  require(options.abort_probability >= 0.0 &&
              options.abort_probability <= options.windows.min_probability,
          "abort_probability must be 0 … min_probability");
  require(positive(options.max_forecast_age_s), "max_forecast_age_s must be positive");
  require(positive(options.max_deviation_m), "max_deviation_m must be positive");
  require(positive(options.max_beside_m), "max_beside_m must be positive");
  require(options.beside_slope >= 0.0 && std::isfinite(options.beside_slope),
          "beside_slope must not be negative");
  require(options.settle_m >= 0.0 && std::isfinite(options.settle_m),
          "settle_m must not be negative");
}

HeightCommand TouchdownPlanner::command(double time_s) const {
  require(hold_.has_value(), "update must come before command");
  if (!plan_ || time_s < plan_->profile.start_s()) return hold_->at(time_s);
  const HeightCommand command = plan_->profile.at(time_s);
  if (command.height_m <= -options_.settle_m) return {-options_.settle_m, 0.0, 0.0};
  return command;
}

TouchdownPhase TouchdownPlanner::phase(double time_s) const {
  if (!plan_)
    return climbing_ && time_s < hold_->end_s() ? TouchdownPhase::aborting
                                                : TouchdownPhase::holding;
  if (time_s < plan_->profile.descent_s()) return TouchdownPhase::waiting;
  return time_s < plan_->profile.committed_s(options_.motion) ? TouchdownPhase::descending
                                                              : TouchdownPhase::committed;
}

void TouchdownPlanner::hold(double now_s, const HeightCommand& from, bool climbing) {
  MotionLimits limits = options_.motion;
  plan_.reset();
  climbing_ = climbing;
  if (!climbing) {
    hold_ = Profile::to_rest(now_s, from.height_m, from.rate_mps, options_.hold_height_m, limits);
    return;
  }
  ++aborts_;
  limits.acceleration_mps2 = limits.abort_acceleration_mps2;
  limits.abort_acceleration_mps2 *= 2.0;
  hold_ = Profile::to_rest(now_s, from.height_m, from.rate_mps,
                           std::max(options_.hold_height_m, from.height_m), limits);
}

/// To the window's middle: by way of the height to hold, if there is time for that.
std::optional<TouchdownPlan> TouchdownPlanner::plan_for(const LevelWindow& window, double now_s,
                                                        const HeightCommand& from) const {
  const double touchdown_s = window.middle_s();
  const bool holding = !plan_ || now_s < plan_->profile.start_s();
  std::optional<Profile> profile;
  if (const double held_s = hold_->end_s(); holding && held_s > now_s)
    profile =
        Profile::to_touch(held_s, hold_->at(held_s).height_m, 0.0, touchdown_s, options_.motion);
  if (!profile)
    profile = Profile::to_touch(now_s, from.height_m, from.rate_mps, touchdown_s, options_.motion);
  if (!profile) return std::nullopt;
  return TouchdownPlan{window, touchdown_s, window.probability, *profile};
}

/// Follows the window if it slips; gives the plan up if the deck may not be level at its contact.
void TouchdownPlanner::review(double now_s, const HeightCommand& from, const DeckForecast& forecast,
                              const std::vector<LevelWindow>& windows) {
  const bool descending = phase(now_s) == TouchdownPhase::descending;
  // Windows that reach the ends of the time looked at have their middles anywhere.
  const double first_s = now_s + options_.windows.level.step_s;
  const double last_s = now_s + options_.look_ahead_s - options_.windows.level.step_s;
  const auto shared_s = [&](const LevelWindow& window) {
    if (window.begin_s < first_s || window.end_s > last_s) return 0.0;
    return std::min(window.end_s, plan_->window.end_s) -
           std::max(window.begin_s, plan_->window.begin_s);
  };
  const auto same = std::max_element(
      windows.begin(), windows.end(),
      [&](const LevelWindow& a, const LevelWindow& b) { return shared_s(a) < shared_s(b); });
  if (same != windows.end() && shared_s(*same) > 0.0 &&
      std::abs(same->middle_s() - plan_->touchdown_s) > kSlip_s)
    if (auto moved = plan_for(*same, now_s, from)) plan_ = std::move(moved);

  plan_->probability = level_probability(
      forecast, options_.level, std::max(now_s, plan_->touchdown_s - options_.contact_s),
      plan_->touchdown_s + options_.contact_s, options_.windows.level);
  if (plan_->probability >=
      (descending ? options_.abort_probability : options_.windows.min_probability))
    return;
  hold(now_s, from, descending);
}

bool TouchdownPlanner::astray(double now_s, double height_m) const {
  return std::abs(height_m - command(now_s).height_m) > options_.max_deviation_m;
}

void TouchdownPlanner::watch(double now_s, double height_m, double rate_mps, double beside_m) {
  require(std::isfinite(now_s) && std::isfinite(height_m) && std::isfinite(rate_mps),
          "time, height and rate must be finite");
  require(beside_m >= 0.0 && std::isfinite(beside_m), "beside_m must be finite, not negative");
  require(hold_.has_value(), "update must come before watch");
  require(now_s >= now_s_, "time must not run backwards");
  now_s_ = now_s;
  if (phase(now_s) != TouchdownPhase::descending) return;
  const double bearable_m = options_.max_beside_m + options_.beside_slope * std::max(0.0, height_m);
  if (astray(now_s, height_m)) return hold(now_s, {height_m, rate_mps, 0.0}, true);
  if (beside_m > bearable_m) hold(now_s, command(now_s), true);
}

void TouchdownPlanner::update(double now_s, double height_m, double rate_mps,
                              const DeckForecast* forecast) {
  require(std::isfinite(now_s) && std::isfinite(height_m) && std::isfinite(rate_mps),
          "time, height and rate must be finite");
  require(!hold_ || now_s >= now_s_, "time must not run backwards");
  now_s_ = now_s;
  HeightCommand from{height_m, rate_mps, 0.0};
  if (!hold_) hold(now_s, from, false);
  const TouchdownPhase before = phase(now_s);
  if (before == TouchdownPhase::committed) return;

  const bool fresh = forecast != nullptr && forecast->as_of_s <= now_s &&
                     now_s - forecast->as_of_s <= options_.max_forecast_age_s;
  const bool off = astray(now_s, height_m);
  if (!off) from = command(now_s);
  if (before == TouchdownPhase::descending && (off || !fresh)) return hold(now_s, from, true);
  if (before == TouchdownPhase::aborting) return;
  if (off || (plan_ && !fresh)) hold(now_s, from, false);
  if (!fresh) return;

  const std::vector<LevelWindow> windows = level_windows(
      *forecast, options_.level, now_s, now_s + options_.look_ahead_s, options_.windows);
  if (plan_) review(now_s, from, *forecast, windows);
  if (plan_ || phase(now_s) == TouchdownPhase::aborting) return;
  for (const LevelWindow& window : windows)
    if ((plan_ = plan_for(window, now_s, from))) return;
}

}  // namespace harco
