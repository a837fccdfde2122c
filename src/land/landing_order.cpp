#include "harco/landing_order.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

namespace harco {
namespace {

void require(bool holds, const char* what) {
  if (!holds) throw std::invalid_argument(std::string("LandingOrderOptions: ") + what);
}

}  // namespace

LandingOrder::LandingOrder(const LandingOrderOptions& options) : options_(options) {
  require(options.look_ahead_s > 0.0, "look_ahead_s must be positive");
  require(options.reaction_s >= 0.0, "reaction_s must not be negative");
  require(options.speed_mps > 0.0, "speed_mps must be positive");
  require(options.contact_s > 0.0, "contact_s must be positive");
  require(options.abort_probability >= 0.0 &&
              options.abort_probability <= options.windows.min_probability,
          "abort_probability must be from 0 to windows.min_probability");
  require(options.commit_height_m > 0.0, "commit_height_m must be positive");
  require(options.max_forecast_age_s > 0.0, "max_forecast_age_s must be positive");
}

bool LandingOrder::trusted(double now_s, const DeckForecast* forecast) const {
  return forecast != nullptr && now_s - forecast->as_of_s <= options_.max_forecast_age_s;
}

LandingAdvice LandingOrder::update(double now_s, double height_m, const DeckForecast* forecast) {
  if (!std::isfinite(now_s) || !std::isfinite(height_m))
    throw std::invalid_argument("LandingOrder: time and height must be finite");
  if (landing_) return review(now_s, height_m, forecast);
  window_.reset();
  touchdown_s_.reset();
  return trusted(now_s, forecast) ? choose(now_s, height_m, *forecast) : LandingAdvice::hold;
}

/// The first window whose middle can still be met; the order is given when it is time.
LandingAdvice LandingOrder::choose(double now_s, double height_m, const DeckForecast& forecast) {
  const double needed_s = options_.reaction_s + std::max(height_m, 0.0) / options_.speed_mps;
  const double from_s = std::max(now_s, forecast.as_of_s);
  const auto windows = level_windows(forecast, options_.level, from_s,
                                     from_s + options_.look_ahead_s, options_.windows);
  for (const LevelWindow& window : windows) {
    // From the middle on, contact may be as late as leaves time for it.
    const double contact_s = std::max(window.middle_s(), now_s + needed_s);
    if (contact_s > std::max(window.middle_s(), window.end_s - options_.contact_s)) continue;
    window_ = window;
    touchdown_s_ = contact_s;
    if (contact_s - needed_s > now_s) return LandingAdvice::wait;
    landing_ = true;
    ordered_s_ = now_s;
    return LandingAdvice::land;
  }
  return LandingAdvice::hold;
}

LandingAdvice LandingOrder::review(double now_s, double height_m, const DeckForecast* forecast) {
  if (height_m <= options_.commit_height_m) return LandingAdvice::land;
  const double reaction_s = std::max(0.0, ordered_s_ + options_.reaction_s - now_s);
  touchdown_s_ = now_s + reaction_s + height_m / options_.speed_mps;
  if (trusted(now_s, forecast)) {
    const double begin_s = std::max(*touchdown_s_ - options_.contact_s, forecast->as_of_s);
    const double probability =
        level_probability(*forecast, options_.level, begin_s, *touchdown_s_ + options_.contact_s,
                          options_.windows.level);
    if (probability >= options_.abort_probability) return LandingAdvice::land;
  }
  landing_ = false;
  window_.reset();
  touchdown_s_.reset();
  ++called_off_;
  return LandingAdvice::call_off;
}

}  // namespace harco
