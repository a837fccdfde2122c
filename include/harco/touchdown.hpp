// From a hover to the deck: how to come down, when, and when not to (paper, sections 4.4 and 4.6).
// Library harco::land.
//
// Heights are of the vehicle above the touchdown point, in metres, upwards, and move with the deck:
// 0 is contact. What comes out is the height to have and its rate of change; a vehicle that heaves
// with the deck adds the deck's own motion.
#pragma once

#include <optional>
#include <vector>

#include "harco/level.hpp"

namespace harco {

/// A height to have, at one time.
struct HeightCommand {
  double height_m = 0.0;
  double rate_mps = 0.0;           ///< its rate of change
  double acceleration_mps2 = 0.0;  ///< and that one's
};

// ---------------------------------------------------------------------------- the paper's landing

/// Section 4.4: target heights that fall at a constant speed from the height at the start to
/// `end_height_m`, which lies below the ground, so that the rotors stop after contact.
struct LinearDescent {
  double start_s = 0.0;
  double start_height_m = 0.0;
  double speed_mps = 0.5;  ///< downwards, positive
  double end_height_m = -0.2;

  /// The descent that meets the ground at `touchdown_s`.
  static LinearDescent to_touch_at(double touchdown_s, double start_height_m, double speed_mps);
  /// Before the start the first, after the end the last height.
  HeightCommand at(double time_s) const;
  /// When the target height is zero.
  double touchdown_s() const { return start_s + start_height_m / speed_mps; }
};

/// Section 4.4: proportional-differential control of the height.
struct HeightController {
  double p = 1.0;           ///< 1/s^2, the paper's
  double d = 0.8;           ///< 1/s, the paper's
  double limit_mps2 = 3.0;  ///< greatest size of what it asks for, positive

  /// Vertical acceleration to ask for, upwards, beyond what holds the weight: the command's own,
  /// and p and d times the errors of height and rate, within the limit. Throws
  /// std::invalid_argument for what isn't finite or a limit that isn't positive.
  double acceleration(const HeightCommand& command, double height_m, double rate_mps) const;
};

// -------------------------------------------------------------------------------------- profiles

/// Bounds of every planned motion.
struct MotionLimits {
  double speed_mps = 0.6;                ///< greatest, up or down, positive
  double acceleration_mps2 = 0.5;        ///< greatest of what is planned, positive
  double abort_acceleration_mps2 = 1.5;  ///< greatest when turning back; above acceleration_mps2
  double touch_speed_mps = 0.15;         ///< of the contact, downwards; positive, at most speed_mps
};

/// A motion of constant accelerations, piece by piece; afterwards the last rate goes on. Its bounds
/// hold from any start within them. Functions throw std::invalid_argument for limits out of range
/// and what isn't finite.
class Profile {
 public:
  /// The quickest to another height, at rest there.
  static Profile to_rest(double start_s, double height_m, double rate_mps, double target_m,
                         const MotionLimits& limits);
  /// Touches the deck at `touchdown_s` with touch_speed_mps, never earlier. If there is time to
  /// stop and wait first, it waits, then descends with the greatest speed; otherwise with the one
  /// that fits. Empty if it's too early for any, or the vehicle too fast and too near.
  static std::optional<Profile> to_touch(double start_s, double height_m, double rate_mps,
                                         double touchdown_s, const MotionLimits& limits);

  /// Before the start as at the start.
  HeightCommand at(double time_s) const;
  double start_s() const { return start_s_; }
  double descent_s() const { return descent_s_; }  ///< when waiting is over
  double end_s() const;                            ///< at rest, or touching
  /// The first time from which abort_acceleration_mps2 can't keep the vehicle off the deck any
  /// more; end_s() if there is none.
  double committed_s(const MotionLimits& limits) const;

 private:
  struct Piece {
    double duration_s;
    double acceleration_mps2;
  };
  Profile(double start_s, double height_m, double rate_mps)
      : start_s_(start_s), descent_s_(start_s), height_m_(height_m), rate_mps_(rate_mps) {}
  HeightCommand end() const { return at(end_s()); }
  void go_on(double duration_s) { pieces_.push_back({duration_s, 0.0}); }
  void change_rate(double to_mps, double acceleration_mps2);
  bool descend(double cruise_mps, const MotionLimits& limits);

  double start_s_, descent_s_, height_m_, rate_mps_;
  std::vector<Piece> pieces_;
};

// --------------------------------------------------------------------------------------- planner

/// What a landing is allowed to do.
struct TouchdownOptions {
  MotionLimits motion;
  LevelLimits level;
  WindowOptions windows;       ///< what windows count
  double hold_height_m = 2.0;  ///< to wait at, and to climb to after an abort; positive
  double look_ahead_s = 20.0;  ///< windows are sought this far from now, positive
  /// The deck must be level from this long before the planned contact to this long after it.
  double contact_s = 0.5;  ///< positive, at most half of windows.min_duration_s
  /// On the way down: below this probability of a level deck about the contact, the landing is
  /// aborted; 0 … 1, at most windows.min_probability.
  double abort_probability = 0.85;
  double max_forecast_age_s = 1.5;  ///< without a younger forecast a landing is aborted, positive
  double max_deviation_m = 0.4;  ///< nor does it go on farther off the command than this, positive
  /// Nor farther beside the touchdown point than this, positive, and so much more for each metre of
  /// height, not negative.
  double max_beside_m = 0.25;
  double beside_slope = 0.3;
  double settle_m =
      0.2;  ///< after contact, commands sink on to this far below the deck, not negative
};

enum class TouchdownPhase {
  holding,     ///< at, or on the way to, hold_height_m; no window in reach
  waiting,     ///< a window is chosen; the descent to it begins later
  descending,  ///< on the way down, still able to turn back
  committed,   ///< contact can't be avoided any more, or has been made
  aborting     ///< climbing back to hold_height_m
};

/// The landing that is planned.
struct TouchdownPlan {
  LevelWindow window;
  double touchdown_s = 0.0;  ///< the window's middle
  double probability = 0.0;  ///< of a level deck about the contact, by the newest forecast
  Profile profile;
};

/// Chooses a window that can be reached, brings the vehicle down in its middle, and gives up while
/// that is still possible if the forecast gets worse. Has no clock; the same calls give the same
/// commands.
class TouchdownPlanner {
 public:
  /// Throws std::invalid_argument, naming the field, for options out of range.
  explicit TouchdownPlanner(const TouchdownOptions& options = {});

  /// Thinks anew, with the vehicle's height and its rate as measured, and the newest forecast, if
  /// there is one that is to be trusted (DeckPhase::ready). To be called whenever there is a new
  /// forecast, and at least every max_forecast_age_s. Times must not run backwards.
  void update(double now_s, double height_m, double rate_mps, const DeckForecast* forecast);

  /// Gives a descent up that has come off its way, in height or beside the touchdown point (level
  /// distance, not negative). Costs nothing: to be called whenever the vehicle's place is known, in
  /// between updates, after the first one. Times must not run backwards.
  void watch(double now_s, double height_m, double rate_mps, double beside_m);

  /// What to fly at a time from the last update on.
  HeightCommand command(double time_s) const;
  TouchdownPhase phase(double time_s) const;
  /// Empty while holding or aborting.
  const std::optional<TouchdownPlan>& plan() const { return plan_; }
  int aborts() const { return aborts_; }  ///< landings given up on the way down so far

 private:
  std::optional<TouchdownPlan> plan_for(const LevelWindow& window, double now_s,
                                        const HeightCommand& from) const;
  void review(double now_s, const HeightCommand& from, const DeckForecast& forecast,
              const std::vector<LevelWindow>& windows);
  void hold(double now_s, const HeightCommand& from, bool climbing);
  bool astray(double now_s, double height_m) const;

  TouchdownOptions options_;
  std::optional<TouchdownPlan> plan_;
  std::optional<Profile> hold_;  ///< what is flown without a plan, and before its profile starts
  bool climbing_ = false;        ///< after an abort
  double now_s_ = 0.0;
  int aborts_ = 0;
};

}  // namespace harco
