#include <algorithm>
#include <cmath>

#include "harco/vehicle.hpp"

namespace harco {
namespace {

constexpr std::size_t kKept = 10;
constexpr double kLongestRoundTrip = 1.0;
/// Clocks that differ less in speed than this count as equally fast: what is measured is jitter.
constexpr double kSameSpeed = 0.02;
/// A clock that jumps so far has been set anew.
constexpr double kJump = 2.0;

}  // namespace

void RemoteClock::answered(double asked_s, double remote_s, double received_s) {
  const double round_trip = received_s - asked_s;
  if (!(round_trip >= 0.0 && round_trip < kLongestRoundTrip) || !std::isfinite(remote_s)) return;
  add(answers_, {0.5 * (asked_s + received_s), remote_s, round_trip});
}

void RemoteClock::stamped(double remote_s, double received_s) {
  if (!std::isfinite(remote_s)) return;
  add(stamps_, {received_s, remote_s, 0.0});
}

void RemoteClock::add(std::deque<Pair>& pairs, const Pair& pair) {
  if (!pairs.empty()) {
    const Pair& last = pairs.back();
    const double step = pair.ours_s - last.ours_s;
    if (step < 0.0) return;  // overtaken by a later one
    if (std::abs(pair.remote_s - last.remote_s - step) > kJump + 20.0 * step) pairs.clear();
    if (pair.remote_s < last.remote_s - kJump) pairs.clear();
  }
  pairs.push_back(pair);
  if (pairs.size() > kKept) pairs.pop_front();
}

std::optional<RemoteClock::Line> RemoteClock::line() const {
  const std::deque<Pair>& pairs = answers_.empty() ? stamps_ : answers_;
  if (pairs.empty()) return std::nullopt;
  // The speed from the first to the last; where it is ours, that of the quickest answer is the best
  // offset, and of stamps the one that was least delayed.
  const Pair& first = pairs.front();
  const Pair& last = pairs.back();
  const double span = last.ours_s - first.ours_s;
  const double speed = span > 0.5 ? (last.remote_s - first.remote_s) / span : 1.0;
  if (std::abs(speed - 1.0) > kSameSpeed) return Line{last, speed};
  const auto worse = [](const Pair& a, const Pair& b) {
    if (a.round_trip_s != b.round_trip_s) return a.round_trip_s > b.round_trip_s;
    return a.remote_s - a.ours_s < b.remote_s - b.ours_s;
  };
  return Line{*std::max_element(pairs.begin(), pairs.end(), worse), 1.0};
}

std::optional<double> RemoteClock::remote(double ours_s) const {
  const auto line = this->line();
  if (!line) return std::nullopt;
  return line->at.remote_s + line->speed * (ours_s - line->at.ours_s);
}

std::optional<double> RemoteClock::ours(double remote_s) const {
  const auto line = this->line();
  if (!line || !(line->speed > 0.0)) return std::nullopt;
  return line->at.ours_s + (remote_s - line->at.remote_s) / line->speed;
}

std::optional<double> RemoteClock::round_trip_s() const {
  if (answers_.empty()) return std::nullopt;
  const auto quickest = std::min_element(
      answers_.begin(), answers_.end(),
      [](const Pair& a, const Pair& b) { return a.round_trip_s < b.round_trip_s; });
  return quickest->round_trip_s;
}

}  // namespace harco
