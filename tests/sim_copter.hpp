// A small multicopter that lands by LANDING_TARGET as ArduPilot does, and the pictures that its
// camera takes of a pad. NED: the pad's landing point is the origin, its top to the north.
#pragma once

#include <cmath>
#include <deque>
#include <optional>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "harco/mavlink.hpp"
#include "harco/mount.hpp"
#include "lab/render.hpp"

namespace harco::test {

/// A point mass under a thrust that tilts: to accelerate sideways it must lean, and its camera with
/// it. Its position controller flies to where the last measurements say that the target is.
class SimCopter {
 public:
  struct State {
    double time_s = 0.0;
    Eigen::Vector3d position = Eigen::Vector3d::Zero();  ///< NED
    Eigen::Vector3d velocity = Eigen::Vector3d::Zero();
    Eigen::Quaterniond ned_R_body = Eigen::Quaterniond::Identity();
  };

  SimCopter(const Eigen::Vector3d& start, double yaw_rad) : yaw_rad_(yaw_rad) {
    state_.position = start;
    lean();
  }

  const State& state() const { return state_; }
  bool has_target(double now_s) const { return target_ && now_s - heard_s_ < 1.0; }
  double lag_s = 0.06;            ///< PLND_LAG: measurements are of so long ago
  Eigen::Vector3d wind{0, 0, 0};  ///< acceleration that nobody measures

  /// A measurement: its direction and distance are turned by the attitude of a moment ago.
  void hear(const mavlink::LandingTarget& message) {
    const State& then = before(state_.time_s - lag_s);
    const Eigen::Vector3d measured =
        then.position +
        then.ned_R_body * Eigen::Vector3f(message.x, message.y, message.z).cast<double>();
    target_ =
        has_target(state_.time_s) ? Eigen::Vector3d(0.7 * *target_ + 0.3 * measured) : measured;
    heard_s_ = state_.time_s;
  }

  /// Flies on. Without a target it hovers where it is.
  void step(double dt) {
    Eigen::Vector3d wanted = Eigen::Vector3d::Zero();
    if (has_target(state_.time_s)) {
      wanted = 1.2 * (*target_ - state_.position);
      const double aside = std::hypot(wanted.x(), wanted.y());
      if (aside > 2.5) wanted.head<2>() *= 2.5 / aside;
      const double height = target_->z() - state_.position.z();
      const bool centred = aside < 0.4 + 0.3 * height;
      wanted.z() = centred ? (height > 4.0 ? 2.0 : 0.6) : 0.0;
    }
    const Eigen::Vector3d too_slow = wanted - state_.velocity;
    against_wind_ += 3.0 * dt * too_slow;
    Eigen::Vector3d asked = 3.0 * too_slow + against_wind_;
    asked = asked.cwiseMax(-2.0).cwiseMin(2.0);
    acceleration_ += (asked - acceleration_) * std::min(1.0, dt / 0.12);  // it takes time to lean
    state_.velocity += dt * (acceleration_ + wind);
    state_.position += dt * state_.velocity;
    state_.time_s += dt;
    lean();
  }

 private:
  static constexpr double kGravity = 9.81;

  /// The thrust's direction is the body's up.
  void lean() {
    const Eigen::Vector3d down = (Eigen::Vector3d(0, 0, kGravity) - acceleration_).normalized();
    const Eigen::Vector3d nose(std::cos(yaw_rad_), std::sin(yaw_rad_), 0.0);
    const Eigen::Vector3d right = down.cross(nose).normalized();
    Eigen::Matrix3d axes;
    axes << right.cross(down), right, down;
    state_.ned_R_body = axes;
    past_.push_back(state_);
    if (past_.size() > 1000) past_.pop_front();
  }

  const State& before(double time_s) const {
    for (auto entry = past_.rbegin(); entry != past_.rend(); ++entry)
      if (entry->time_s <= time_s + 1e-9) return *entry;
    return past_.front();
  }

  State state_;
  double yaw_rad_;
  Eigen::Vector3d acceleration_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d against_wind_ = Eigen::Vector3d::Zero();  ///< what the controller has learnt
  std::optional<Eigen::Vector3d> target_;
  double heard_s_ = -1e9;
  std::deque<State> past_;
};

/// What the vehicle's camera sees of a pad. `pad_T_ned` may move it.
class SimCamera {
 public:
  SimCamera(MarkerSet pad, const Camera& camera, const Mount& mount)
      : pad_(std::move(pad)), mount_(mount) {
    scene_.camera = camera;
    scene_.oversampling = 2;
    scene_.psf_sigma_px = 0.7;
    scene_.noise_sigma = 3.0;
  }

  /// Marker's x is east, its y south, its z down; its middle is at `ned_T_pad`'s origin.
  Image shoot(const SimCopter::State& vehicle,
              const Eigen::Isometry3d& ned_T_pad = Eigen::Isometry3d::Identity()) {
    const double half = 0.5 * pad_.parents[0].side_m;
    Eigen::Isometry3d pad_T_marker = Eigen::Isometry3d::Identity();
    pad_T_marker.linear() << 0, -1, 0, 1, 0, 0, 0, 0, 1;
    pad_T_marker.translation() = pad_T_marker.linear() * Eigen::Vector3d(-half, -half, 0.0);
    Eigen::Isometry3d ned_T_body = Eigen::Isometry3d::Identity();
    ned_T_body.linear() = vehicle.ned_R_body.toRotationMatrix();
    ned_T_body.translation() = vehicle.position;
    scene_.parents = {
        {0, (ned_T_body * mount_.body_T_camera).inverse() * ned_T_pad * pad_T_marker}};
    return lab::render(scene_, pad_, ++shots_);
  }

  /// Something is in the way.
  Image shoot_nothing() {
    scene_.parents.clear();
    return lab::render(scene_, pad_, ++shots_);
  }

 private:
  MarkerSet pad_;
  Mount mount_;
  lab::Scene scene_;
  std::uint64_t shots_ = 0;
};

}  // namespace harco::test
