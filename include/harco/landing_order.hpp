// When to order a landing that an autopilot flies by itself, and when to call it off (paper,
// section 4.6). Library harco::land.
//
// TouchdownPlanner flies every metre itself. Here the autopilot descends, at a speed that is known,
// once its landing mode is ordered; all there is to choose is the moment.
#pragma once

#include <optional>

#include "harco/level.hpp"

namespace harco {

struct LandingOrderOptions {
  LevelLimits level;
  WindowOptions windows;
  double look_ahead_s = 20.0;  ///< windows are sought this far from now, positive
  double reaction_s = 1.0;     ///< from the order until the descent has its speed, not negative
  double speed_mps = 0.5;      ///< of the descent, positive (ArduPilot: LAND_SPEED)
  /// The deck must be level from this long before contact to this long after it, positive.
  double contact_s = 0.5;
  /// On the way down, a probability of that below this one calls the landing off; 0 … 1, at most
  /// windows.min_probability.
  double abort_probability = 0.8;
  /// Below this height the landing goes on whatever comes: to turn back needs room. Positive.
  double commit_height_m = 0.5;
  double max_forecast_age_s = 1.5;  ///< nothing is ordered by an older forecast, positive
};

enum class LandingAdvice {
  hold,     ///< no window can be reached
  wait,     ///< one can; the order comes later
  land,     ///< order the landing, or let it go on
  call_off  ///< the deck won't be level: order to stop
};

/// Has no clock; the same calls give the same advice. Throws std::invalid_argument, naming the
/// field, for options out of range.
class LandingOrder {
 public:
  explicit LandingOrder(const LandingOrderOptions& options = {});

  /// To be called whenever there is something new. `height_m` of the vehicle above the deck;
  /// `forecast` is null while there is none to be trusted.
  LandingAdvice update(double now_s, double height_m, const DeckForecast* forecast);

  /// The window aimed at; empty while holding.
  const std::optional<LevelWindow>& window() const { return window_; }
  /// When contact is expected, if `land` has been advised, or will be.
  std::optional<double> touchdown_s() const { return touchdown_s_; }
  int called_off() const { return called_off_; }  ///< landings so far

 private:
  LandingAdvice review(double now_s, double height_m, const DeckForecast* forecast);
  LandingAdvice choose(double now_s, double height_m, const DeckForecast& forecast);
  bool trusted(double now_s, const DeckForecast* forecast) const;

  LandingOrderOptions options_;
  std::optional<LevelWindow> window_;
  std::optional<double> touchdown_s_;
  bool landing_ = false;
  double ordered_s_ = 0.0;
  int called_off_ = 0;
};

}  // namespace harco
