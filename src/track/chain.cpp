#include "track/chain.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <vector>

namespace harco::track {
namespace {

// Errors of neighbouring frames have causes in common: so much of the odds is kept.
constexpr double kBranchKept = 0.9;

/// What a frame's own evidence makes of the odds that the track is on the right branch. `chosen` is
/// what the past chose among the two solutions of `seen`.
double branch_after(double before, const Pose& seen, const Pose& chosen) {
  if (!seen.alternative) return kDecidedLogRatio;
  if (chosen.alternative) return before;  // which one it is remains open
  const bool first = chosen.camera_T_marker.matrix() == seen.camera_T_marker.matrix();
  const double ratio = first ? *seen.log_likelihood_ratio : -*seen.log_likelihood_ratio;
  return std::min(kBranchKept * before + ratio, kDecidedLogRatio);
}

bool earlier(const Measurement& a, const Measurement& b) { return a.time_s < b.time_s; }

}  // namespace

double chi_squared_six(double probability) {
  // With an even number of degrees of freedom the tail is a polynomial times an exponential.
  const auto tail = [](double x) { return std::exp(-0.5 * x) * (1.0 + 0.5 * x + 0.125 * x * x); };
  double low = 0.0, high = 1500.0;
  for (int i = 0; i < 100; ++i) {
    const double middle = 0.5 * (low + high);
    (tail(middle) > probability ? low : high) = middle;
  }
  return high;
}

Chain::Chain(const FilterOptions& options, const std::optional<Swell>& swell)
    : options_(options), motion_(options, swell), gate_(chi_squared_six(options.gate)) {}

Belief Chain::first(const Measurement& measurement) const {
  const Pose& pose = measurement.pose;
  Belief belief;
  belief.estimate = motion_.start(measurement.time_s, pose.camera_T_marker, *pose.covariance);
  belief.accepted = 1;
  belief.measured_s = measurement.time_s;
  belief.branch = pose.alternative ? *pose.log_likelihood_ratio : kDecidedLogRatio;
  return belief;
}

/// The prediction, improved by the measurement unless that is an outlier.
Belief Chain::next(const Belief& before, const Measurement& measurement) const {
  Belief belief = before;
  belief.estimate = motion_.advance(before.estimate, measurement.time_s);
  const Pose pose = weighed(belief.estimate, measurement.pose);
  const Innovation seen = innovation(belief.estimate, pose.camera_T_marker, *pose.covariance);
  if (!(seen.distance() <= gate_)) return belief;
  belief.estimate = improved(belief.estimate, seen);
  belief.branch = branch_after(before.branch, measurement.pose, pose);
  belief.measured_s = measurement.time_s;
  ++belief.accepted;
  return belief;
}

void Chain::restart(const Measurement& measurement, int accepted) {
  links_.clear();
  refused_.clear();
  links_.push_back({measurement, first(measurement)});
  links_.back().after.accepted = accepted;
}

/// Refused measurements that agree among themselves replace a track that they contradict.
Verdict Chain::refuse(const Measurement& measurement, Verdict verdict) {
  refused_.push_back(measurement);
  const bool confirmed = newest()->accepted >= options_.confirm;
  const auto needed = static_cast<std::size_t>(confirmed ? options_.replace : options_.confirm);
  while (refused_.size() > needed) refused_.pop_front();
  if (refused_.size() < needed) return verdict;

  std::vector<Measurement> rivals(refused_.begin(), refused_.end());
  std::stable_sort(rivals.begin(), rivals.end(), earlier);
  std::deque<Link> links{{rivals[0], first(rivals[0])}};
  for (std::size_t i = 1; i < rivals.size(); ++i) {
    const Belief belief = next(links.back().after, rivals[i]);
    if (belief.accepted == links.back().after.accepted) return verdict;
    links.push_back({rivals[i], belief});
  }
  links_ = std::move(links);
  refused_.clear();
  return Verdict::replaced;
}

Verdict Chain::add(const Measurement& measurement) {
  const double time_s = measurement.time_s;
  if (links_.empty() || time_s - newest()->measured_s > options_.coast_s) {
    restart(measurement, 1);
    return Verdict::started;
  }
  if (time_s < newest()->estimate.time_s - options_.history_s)
    return refuse(measurement, Verdict::too_late);

  auto place = std::upper_bound(
      links_.begin(), links_.end(), measurement,
      [](const Measurement& m, const Link& link) { return earlier(m, link.measurement); });
  place = links_.insert(place, {measurement, {}});
  const auto index = static_cast<std::size_t>(place - links_.begin());
  // What came later is filtered again.
  for (std::size_t i = index; i < links_.size(); ++i)
    links_[i].after =
        i == 0 ? first(links_[i].measurement) : next(links_[i - 1].after, links_[i].measurement);
  const bool accepted =
      index == 0 || links_[index].after.accepted > links_[index - 1].after.accepted;
  if (!accepted) return refuse(measurement, Verdict::refused);

  refused_.clear();
  if (newest()->branch < -kDecidedLogRatio) {
    const Measurement latest = links_.back().measurement;
    restart(latest, newest()->accepted);
    return Verdict::replaced;
  }
  forget();
  return Verdict::accepted;
}

/// All but what late measurements need.
void Chain::forget() {
  const double oldest = newest()->estimate.time_s - options_.history_s;
  while (links_.size() > 1 && links_[1].measurement.time_s <= oldest) links_.pop_front();
}

std::optional<Belief> Chain::at(double time_s) const {
  const auto after = std::upper_bound(
      links_.begin(), links_.end(), time_s,
      [](double time, const Link& link) { return time < link.measurement.time_s; });
  if (after == links_.begin()) return std::nullopt;
  Belief belief = std::prev(after)->after;
  belief.estimate = motion_.advance(belief.estimate, time_s);
  return belief;
}

}  // namespace harco::track
