#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "harco/track.hpp"
#include "pose/ambiguity.hpp"

namespace harco {
namespace {

// The tilt of a small marker is uncertain by about this, radians, however still it stands.
constexpr double kLeastSpread = 0.05;
// The past may be wrong: no step counts for more than this, in log-likelihood.
constexpr double kMostRatio = 6.0;
// Errors of neighbouring frames have causes in common: so much of what was known is kept.
constexpr double kMemory = 0.8;
constexpr double kForgetAfter = 1.0;  // seconds

}  // namespace

Continuity::Continuity(double rate_rad_s) : rate_rad_s_(rate_rad_s) {
  if (!(rate_rad_s > 0.0) || !std::isfinite(rate_rad_s))
    throw std::invalid_argument("continuity: the rate must be positive");
}

/// Log-likelihood of a pose after what was believed, but for a constant.
double Continuity::expected(const Belief& belief, const Eigen::Isometry3d& pose,
                            double time_s) const {
  const double turned = rate_rad_s_ * (time_s - belief.time_s);
  const double variance = kLeastSpread * kLeastSpread + turned * turned;
  const auto likelihood = [&](const Eigen::Isometry3d& before) {
    const double angle = angle_between(before, pose);
    return std::exp(-0.5 * angle * angle / variance);
  };
  double sum = likelihood(belief.pose.camera_T_marker);
  if (belief.pose.alternative) {
    const double other = 1.0 / (1.0 + std::exp(*belief.pose.log_likelihood_ratio));
    sum = (1.0 - other) * sum + other * likelihood(*belief.pose.alternative);
  }
  return std::log(sum + std::numeric_limits<double>::min());
}

void Continuity::decide(std::vector<Pose>& poses, double time_s) {
  if (!std::isfinite(time_s)) throw std::invalid_argument("continuity: the time must be finite");
  beliefs_.erase(std::remove_if(beliefs_.begin(), beliefs_.end(),
                                [&](const Belief& belief) {
                                  const double age = time_s - belief.time_s;
                                  return age < 0.0 || age > kForgetAfter;
                                }),
                 beliefs_.end());

  std::vector<Belief> next;
  for (Pose& pose : poses) {
    // A parent seen twice has two beliefs: each pose goes on from the nearest one.
    const Belief* nearest = nullptr;
    double least = std::numeric_limits<double>::infinity();
    for (const Belief& belief : beliefs_) {
      const double distance =
          (belief.pose.camera_T_marker.translation() - pose.camera_T_marker.translation()).norm();
      if (belief.pose.parent != pose.parent || !(distance < least)) continue;
      least = distance;
      nearest = &belief;
    }
    if (pose.alternative && nearest != nullptr) {
      const double past = expected(*nearest, pose.camera_T_marker, time_s) -
                          expected(*nearest, *pose.alternative, time_s);
      change_ratio(
          pose, *pose.log_likelihood_ratio + kMemory * std::clamp(past, -kMostRatio, kMostRatio));
    }
    next.push_back({time_s, pose});
  }
  // Who isn't seen in this frame is not forgotten at once.
  for (const Belief& belief : beliefs_)
    if (std::none_of(poses.begin(), poses.end(),
                     [&](const Pose& pose) { return pose.parent == belief.pose.parent; }))
      next.push_back(belief);
  beliefs_ = std::move(next);
}

}  // namespace harco
