#include "track/foresight.hpp"

#include <algorithm>
#include <cmath>

#include "track/so3.hpp"

namespace harco::track {
namespace {

constexpr double kAhead = 1.5;     // seconds
constexpr double kInterval = 0.1;  // seconds between promises
constexpr double kKept = 0.995;    // of the weight of older promises, with each new one: 20 s

}  // namespace

Foresight::Foresight(const Swell& swell) : swell_(swell) {}

void Foresight::compare(const Motion& motion, double time_s, const Eigen::Isometry3d& pose) {
  while (!promises_.empty() && promises_.front().time_s <= time_s) {
    const double overdue = time_s - promises_.front().time_s;
    const Estimate promised = motion.foretell(promises_.front(), time_s);
    promises_.pop_front();
    if (overdue > kInterval) continue;  // nothing was seen when it was due
    const double shift = (pose.translation() - promised.translation).norm() / swell_.shift_sd_m;
    const double turn =
        so3::log(promised.rotation.transpose() * pose.linear()).norm() / swell_.turn_sd_rad;
    sum_ = kKept * sum_ + std::min(shift * shift + turn * turn, 1.0);
    weight_ = kKept * weight_ + 1.0;
  }
}

void Foresight::promise(const Motion& motion, const Estimate& now) {
  const double then = now.time_s + kAhead;
  if (!promises_.empty() && then < promises_.back().time_s + kInterval) {
    if (then < promises_.front().time_s - kAhead) promises_.clear();  // time has run backwards
    return;
  }
  promises_.push_back(motion.foretell(now, then));
}

double Foresight::error() const { return weight_ > 0.0 ? sum_ / weight_ : 1.0; }

}  // namespace harco::track
