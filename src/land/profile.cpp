#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "harco/touchdown.hpp"
#include "land/motion_limits.hpp"

namespace harco {
namespace {

void require(bool holds, const char* what) {
  if (!holds) throw std::invalid_argument(what);
}

}  // namespace

void check(const MotionLimits& limits) {
  require(limits.speed_mps > 0.0 && std::isfinite(limits.speed_mps),
          "motion limits: speed_mps must be positive");
  require(limits.acceleration_mps2 > 0.0 && std::isfinite(limits.acceleration_mps2),
          "motion limits: acceleration_mps2 must be positive");
  require(limits.abort_acceleration_mps2 > limits.acceleration_mps2 &&
              std::isfinite(limits.abort_acceleration_mps2),
          "motion limits: abort_acceleration_mps2 must be above acceleration_mps2");
  require(limits.touch_speed_mps > 0.0 && limits.touch_speed_mps <= limits.speed_mps,
          "motion limits: touch_speed_mps must be positive and at most speed_mps");
}

HeightCommand Profile::at(double time_s) const {
  HeightCommand now{height_m_, rate_mps_, 0.0};
  double left_s = std::max(0.0, time_s - start_s_);
  const auto move = [&now](double duration_s, double acceleration_mps2) {
    now.height_m += duration_s * (now.rate_mps + 0.5 * acceleration_mps2 * duration_s);
    now.rate_mps += acceleration_mps2 * duration_s;
  };
  for (const Piece& piece : pieces_) {
    if (left_s < piece.duration_s) {
      move(left_s, piece.acceleration_mps2);
      now.acceleration_mps2 = piece.acceleration_mps2;
      return now;
    }
    move(piece.duration_s, piece.acceleration_mps2);
    left_s -= piece.duration_s;
  }
  move(left_s, 0.0);
  return now;
}

double Profile::end_s() const {
  double end_s = start_s_;
  for (const Piece& piece : pieces_) end_s += piece.duration_s;
  return end_s;
}

void Profile::change_rate(double to_mps, double acceleration_mps2) {
  const double change_mps = to_mps - end().rate_mps;
  if (change_mps == 0.0) return;
  pieces_.push_back(
      {std::abs(change_mps) / acceleration_mps2, std::copysign(acceleration_mps2, change_mps)});
}

Profile Profile::to_rest(double start_s, double height_m, double rate_mps, double target_m,
                         const MotionLimits& limits) {
  check(limits);
  require(std::isfinite(start_s) && std::isfinite(height_m) && std::isfinite(rate_mps) &&
              std::isfinite(target_m),
          "profile: times, heights and rates must be finite");
  const double a = limits.acceleration_mps2;
  Profile profile(start_s, height_m, rate_mps);
  // Where it would come to rest if it braked at once says which way to go.
  const double missing_m = target_m - height_m - 0.5 * rate_mps * std::abs(rate_mps) / a;
  const double way = missing_m < 0.0 ? -1.0 : 1.0;
  const double distance_m = way * (target_m - height_m);
  const double peak_mps = std::sqrt(std::max(0.0, a * distance_m + 0.5 * rate_mps * rate_mps));
  const double cruise_mps = std::min(limits.speed_mps, peak_mps);
  profile.change_rate(way * cruise_mps, a);
  const double braking_m = 0.5 * cruise_mps * cruise_mps / a;
  const double cruise_m = way * (target_m - profile.end().height_m) - braking_m;
  if (cruise_mps > 0.0 && cruise_m > 0.0) profile.go_on(cruise_m / cruise_mps);
  profile.change_rate(0.0, a);
  return profile;
}

/// From where the profile stands: to the cruise speed, on with it, and down to the touch speed at
/// height zero. False if there is not enough height for that.
bool Profile::descend(double cruise_mps, const MotionLimits& limits) {
  constexpr double kRounding_m = 1e-9;
  const double a = limits.acceleration_mps2;
  const double touch_mps = limits.touch_speed_mps;
  change_rate(-cruise_mps, a);
  const double slowing_m = 0.5 * (cruise_mps * cruise_mps - touch_mps * touch_mps) / a;
  const double cruise_m = end().height_m - slowing_m;
  if (cruise_m < -kRounding_m) return false;
  go_on(std::max(0.0, cruise_m) / cruise_mps);
  change_rate(-touch_mps, a);
  return true;
}

std::optional<Profile> Profile::to_touch(double start_s, double height_m, double rate_mps,
                                         double touchdown_s, const MotionLimits& limits) {
  constexpr int kHalvings = 60;
  constexpr double kPunctual_s = 1e-6;
  check(limits);
  require(std::isfinite(start_s) && std::isfinite(height_m) && std::isfinite(rate_mps) &&
              std::isfinite(touchdown_s),
          "profile: times, heights and rates must be finite");
  if (!(height_m > 0.0) || touchdown_s <= start_s) return std::nullopt;

  const auto with_cruise = [&](const Profile& before, double cruise_mps) -> std::optional<Profile> {
    Profile profile = before;
    if (!profile.descend(cruise_mps, limits)) return std::nullopt;
    return profile;
  };
  // The greatest speed for which the height suffices. The least, the touch speed, must.
  const auto quickest = [&](const Profile& before) -> std::optional<Profile> {
    if (const auto profile = with_cruise(before, limits.speed_mps)) return profile;
    if (!with_cruise(before, limits.touch_speed_mps)) return std::nullopt;
    double fits = limits.touch_speed_mps;
    double too_fast = limits.speed_mps;
    for (int i = 0; i < kHalvings; ++i) {
      const double middle = 0.5 * (fits + too_fast);
      (with_cruise(before, middle) ? fits : too_fast) = middle;
    }
    return with_cruise(before, fits);
  };

  const Profile now(start_s, height_m, rate_mps);
  Profile stopped = now;
  stopped.change_rate(0.0, limits.acceleration_mps2);
  if (stopped.end().height_m > 0.0) {
    const std::optional<Profile> after = quickest(stopped);
    if (after && after->end_s() <= touchdown_s) {
      stopped.go_on(touchdown_s - after->end_s());
      stopped.descent_s_ = stopped.end_s();
      return quickest(stopped);
    }
  }
  const std::optional<Profile> earliest = quickest(now);
  if (!earliest || earliest->end_s() > touchdown_s + kPunctual_s) return std::nullopt;
  // The slower the cruise, the later the touchdown.
  double slow = limits.touch_speed_mps;
  double fast = limits.speed_mps;
  for (int i = 0; i < kHalvings; ++i) {
    const double middle = 0.5 * (slow + fast);
    const std::optional<Profile> profile = with_cruise(now, middle);
    (profile && profile->end_s() >= touchdown_s ? slow : fast) = middle;
  }
  std::optional<Profile> profile = with_cruise(now, slow);
  if (!profile || std::abs(profile->end_s() - touchdown_s) > kPunctual_s) return std::nullopt;
  return profile;
}

double Profile::committed_s(const MotionLimits& limits) const {
  const double brake = limits.abort_acceleration_mps2;
  // Height left after braking, h - v^2 / (2 brake), changes over a piece of acceleration A by
  // (1 - A / brake) (v t + A t^2 / 2): it falls throughout while v < 0, since A < brake.
  double begin_s = start_s_;
  for (const Piece& piece : pieces_) {
    const HeightCommand state = at(begin_s);
    const double end_rate = state.rate_mps + piece.acceleration_mps2 * piece.duration_s;
    const auto left_m = [&](double t) {
      const double rate = state.rate_mps + piece.acceleration_mps2 * t;
      const double height =
          state.height_m + t * (state.rate_mps + 0.5 * piece.acceleration_mps2 * t);
      return height - 0.5 * rate * rate / brake;
    };
    if (std::min(state.rate_mps, end_rate) < 0.0 && left_m(piece.duration_s) <= 0.0 &&
        end_rate < 0.0) {
      double free_s = 0.0;
      double late_s = piece.duration_s;
      if (state.rate_mps <= 0.0 && left_m(0.0) <= 0.0) return begin_s;
      for (int i = 0; i < 60; ++i) {
        const double middle = 0.5 * (free_s + late_s);
        (left_m(middle) <= 0.0 ? late_s : free_s) = middle;
      }
      return begin_s + free_s;
    }
    begin_s += piece.duration_s;
  }
  return end_s();
}

}  // namespace harco
