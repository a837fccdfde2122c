#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "harco/track.hpp"

namespace harco {
namespace {

/// From `from` the share `gain` of the way to `to`: translations on the straight line, rotations on
/// the shortest arc.
Eigen::Isometry3d between(const Eigen::Isometry3d& from, const Eigen::Isometry3d& to, double gain) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  const Eigen::Quaterniond turned =
      Eigen::Quaterniond(from.linear()).slerp(gain, Eigen::Quaterniond(to.linear()));
  pose.linear() = turned.normalized().toRotationMatrix();
  pose.translation() = from.translation() + gain * (to.translation() - from.translation());
  return pose;
}

}  // namespace

LowPass::LowPass(double time_constant_s) : time_constant_s_(time_constant_s) {
  if (!(time_constant_s >= 0.0) || !std::isfinite(time_constant_s))
    throw std::invalid_argument("low-pass: the time constant must be zero or positive seconds");
}

std::vector<Pose> LowPass::filter(const std::vector<Pose>& poses, double time_s) {
  constexpr double kForgetAfter = 10.0;  // time constants
  if (!std::isfinite(time_s)) throw std::invalid_argument("low-pass: the time must be finite");
  if (std::any_of(states_.begin(), states_.end(),
                  [&](const State& state) { return state.time_s > time_s; }))
    throw std::invalid_argument("low-pass: time must not run backwards");
  if (time_constant_s_ == 0.0) return poses;
  states_.erase(std::remove_if(states_.begin(), states_.end(),
                               [&](const State& state) {
                                 return time_s - state.time_s > kForgetAfter * time_constant_s_;
                               }),
                states_.end());

  std::vector<Pose> filtered = poses;
  std::vector<State> next;
  for (Pose& pose : filtered) {
    // A parent seen twice has two states: each pose goes on from the nearest one still free.
    auto nearest = states_.end();
    double least = std::numeric_limits<double>::infinity();
    for (auto state = states_.begin(); state != states_.end(); ++state) {
      const double distance =
          (state->camera_T_marker.translation() - pose.camera_T_marker.translation()).norm();
      if (state->parent != pose.parent || !(distance < least)) continue;
      nearest = state;
      least = distance;
    }
    if (nearest != states_.end()) {
      // The exact step response of a first-order low-pass.
      const double gain = 1.0 - std::exp(-(time_s - nearest->time_s) / time_constant_s_);
      pose.camera_T_marker = between(nearest->camera_T_marker, pose.camera_T_marker, gain);
      states_.erase(nearest);
    }
    pose.covariance.reset();
    pose.alternative.reset();
    pose.log_likelihood_ratio.reset();
    next.push_back({pose.parent, time_s, pose.camera_T_marker});
  }
  states_.insert(states_.end(), next.begin(), next.end());
  return filtered;
}

}  // namespace harco
