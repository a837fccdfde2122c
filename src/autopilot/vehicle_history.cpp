#include <algorithm>
#include <array>
#include <cmath>

#include "harco/vehicle.hpp"

namespace harco {
namespace {

using Eigen::Quaterniond;
using Eigen::Vector3d;

constexpr std::size_t kKept = 300;
constexpr double kLongestGap = 0.6;     // between two messages, to interpolate
constexpr double kFarthestAhead = 0.3;  // after the last one
/// Stamps are whole milliseconds of 32 bits; a message from so far back begins a new life.
constexpr double kRestart = 1.0;

template <typename... Float>
bool all_finite(Float... values) {
  return (std::isfinite(values) && ...);
}

/// Appends, if it is newer. A list of another life is forgotten.
template <typename T>
bool append(std::deque<T>& list, const T& entry) {
  if (!list.empty() && entry.time_s < list.back().time_s - kRestart) list.clear();
  if (!list.empty() && entry.time_s <= list.back().time_s) return false;
  list.push_back(entry);
  if (list.size() > kKept) list.pop_front();
  return true;
}

/// What stands around a time: the entry before it, and the one after it where there is one. Null
/// where nothing near is known.
template <typename T>
struct Around {
  const T* before = nullptr;
  const T* after = nullptr;
};

template <typename T>
Around<T> around(const std::deque<T>& list, double time_s) {
  const auto after = std::upper_bound(list.begin(), list.end(), time_s,
                                      [](double t, const T& entry) { return t < entry.time_s; });
  if (after == list.begin()) return {};
  const T* const before = &*std::prev(after);
  if (after == list.end())
    return time_s - before->time_s <= kFarthestAhead ? Around<T>{before, nullptr} : Around<T>{};
  return after->time_s - before->time_s <= kLongestGap ? Around<T>{before, &*after} : Around<T>{};
}

Quaterniond turn(const Vector3d& angle) {
  const double size = angle.norm();
  if (size < 1e-12) return Quaterniond::Identity();
  return Quaterniond(Eigen::AngleAxisd(size, angle / size));
}

double seconds(std::uint32_t milliseconds) { return 1e-3 * milliseconds; }

}  // namespace

bool VehicleHistory::add(const Turned& turned) { return append(turned_, turned); }

bool VehicleHistory::add(const mavlink::Attitude& m) {
  if (!all_finite(m.roll, m.pitch, m.yaw, m.rollspeed, m.pitchspeed, m.yawspeed)) return false;
  const Vector3d angles = Eigen::Vector3f(m.roll, m.pitch, m.yaw).cast<double>();
  const Vector3d rates = Eigen::Vector3f(m.rollspeed, m.pitchspeed, m.yawspeed).cast<double>();
  const Quaterniond ned_R_body = Eigen::AngleAxisd(angles.z(), Vector3d::UnitZ()) *
                                 Eigen::AngleAxisd(angles.y(), Vector3d::UnitY()) *
                                 Eigen::AngleAxisd(angles.x(), Vector3d::UnitX());
  return add(Turned{seconds(m.time_boot_ms), ned_R_body, rates});
}

bool VehicleHistory::add(const mavlink::AttitudeQuaternion& m) {
  const Quaterniond q = Eigen::Quaternionf(m.q1, m.q2, m.q3, m.q4).cast<double>();
  const Vector3d rates = Eigen::Vector3f(m.rollspeed, m.pitchspeed, m.yawspeed).cast<double>();
  if (!all_finite(m.q1, m.q2, m.q3, m.q4, m.rollspeed, m.pitchspeed, m.yawspeed) ||
      std::abs(q.norm() - 1.0) > 0.01)
    return false;
  return add(Turned{seconds(m.time_boot_ms), q.normalized(), rates});
}

bool VehicleHistory::add(const mavlink::LocalPositionNed& m) {
  if (!all_finite(m.x, m.y, m.z, m.vx, m.vy, m.vz)) return false;
  const Vector3d place = Eigen::Vector3f(m.x, m.y, m.z).cast<double>();
  const Vector3d velocity = Eigen::Vector3f(m.vx, m.vy, m.vz).cast<double>();
  return append(moved_, Moved{seconds(m.time_boot_ms), place, velocity});
}

std::optional<Quaterniond> VehicleHistory::ned_R_body(double remote_s) const {
  const auto [before, after] = around(turned_, remote_s);
  if (before == nullptr) return std::nullopt;
  const double since = remote_s - before->time_s;
  if (after == nullptr) return before->ned_R_body * turn(before->body_rates * since);
  return before->ned_R_body.slerp(since / (after->time_s - before->time_s), after->ned_R_body);
}

std::optional<Vector3d> VehicleHistory::ned_p_body(double remote_s) const {
  const auto [before, after] = around(moved_, remote_s);
  if (before == nullptr) return std::nullopt;
  const double since = remote_s - before->time_s;
  if (after == nullptr) return Vector3d(before->ned_p_body + since * before->velocity);
  const double share = since / (after->time_s - before->time_s);
  return Vector3d(before->ned_p_body + share * (after->ned_p_body - before->ned_p_body));
}

std::optional<Vector3d> VehicleHistory::ned_v_body(double remote_s) const {
  const auto [before, after] = around(moved_, remote_s);
  if (before == nullptr) return std::nullopt;
  if (after == nullptr) return before->velocity;
  const double share = (remote_s - before->time_s) / (after->time_s - before->time_s);
  return Vector3d(before->velocity + share * (after->velocity - before->velocity));
}

}  // namespace harco
