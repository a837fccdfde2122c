// A small multicopter that lands by LANDING_TARGET as ArduCopter does, and the pictures that its
// camera takes of a pad. NED: at the start the pad's landing point is the origin, its top to the
// north.
#pragma once

#include <algorithm>
#include <cmath>
#include <deque>
#include <optional>
#include <utility>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "harco/mavlink.hpp"
#include "harco/mount.hpp"
#include "lab/render.hpp"

namespace harco::test {

/// Where ArduCopter's precision landing takes the target to be (PLND_EST_TYPE 1): for north and
/// east a Kalman filter of its position and velocity relative to the vehicle, PLND_LAG ago, which
/// the accelerometers drive and messages correct. It is used two seconds after the first message;
/// without one for two seconds the target is lost.
class TargetEstimate {
 public:
  explicit TargetEstimate(double lag_s) : lag_s_(lag_s) {}

  /// The vehicle's change of velocity over a step, its attitude and how fast that turns.
  void step(double dt, const Eigen::Vector3d& change, const Eigen::Quaterniond& ned_R_body,
            double turn_rate) {
    time_s_ += dt;
    past_.push_back({dt, change.head<2>(), ned_R_body, turn_rate});
    while (past_.size() > static_cast<std::size_t>(std::max(1.0, std::round(lag_s_ / dt))))
      past_.pop_front();
    if (started_) {
      north_.predict(past_.front().dt, -past_.front().change.x());
      east_.predict(past_.front().dt, -past_.front().change.y());
    }
    if (started_ && !acquired_ && time_s_ - started_s_ > kSettling) acquired_ = true;
    if (time_s_ - heard_s_ > (acquired_ ? kLost : kStartLost)) started_ = acquired_ = false;
  }

  void hear(const Eigen::Vector3d& body_p, const Eigen::Vector2d& vehicle_velocity) {
    const Eigen::Vector3d p = past_.front().ned_R_body * body_p;
    height_m_ = p.z();
    const double variance = std::pow(p.z() * (0.01 + 0.01 * past_.front().turn_rate) + 0.02, 2);
    if (!std::exchange(started_, true)) {
      started_s_ = time_s_;
      north_.start(p.x(), variance, -vehicle_velocity.x());
      east_.start(p.y(), variance, -vehicle_velocity.y());
    } else if (std::max(north_.surprise(p.x(), variance), east_.surprise(p.y(), variance)) >=
                   kGate &&
               refused_ < kMostRefused) {
      ++refused_;
      return;
    } else {
      north_.improve(p.x(), variance);
      east_.improve(p.y(), variance);
    }
    refused_ = 0;
    heard_s_ = time_s_;
  }

  bool acquired() const { return acquired_; }
  double unheard_s() const { return time_s_ - heard_s_; }
  double height_m() const { return height_m_; }  ///< by the last message

  /// Relative to the vehicle, now: position, velocity.
  std::pair<Eigen::Vector2d, Eigen::Vector2d> now() const {
    Eigen::Vector2d p(north_.position, east_.position);
    Eigen::Vector2d v(north_.velocity, east_.velocity);
    for (std::size_t i = 1; i < past_.size(); ++i) {
      v -= past_[i].change;
      p += v * past_[i].dt;
    }
    return {p, v};
  }

 private:
  static constexpr double kSettling = 2.0, kStartLost = 0.5, kLost = 2.0;
  static constexpr double kGate = 3.0;
  static constexpr int kMostRefused = 3;
  static constexpr double kAccelerationNoise = 2.5;  // PLND_ACC_P_NSE
  static constexpr double kStartSpeed = 2.0;

  struct Axis {
    double position = 0.0, velocity = 0.0;
    Eigen::Matrix2d covariance = Eigen::Matrix2d::Zero();

    void start(double p, double variance, double v) {
      position = p;
      velocity = v;
      covariance = Eigen::Vector2d(variance, kStartSpeed * kStartSpeed).asDiagonal();
    }
    void predict(double dt, double change) {
      position += dt * velocity;
      velocity += change;
      Eigen::Matrix2d step;
      step << 1.0, dt, 0.0, 1.0;
      covariance = step * covariance * step.transpose();
      covariance(1, 1) += std::pow(kAccelerationNoise * dt, 2);
    }
    double surprise(double p, double variance) const {
      return std::pow(p - position, 2) / (covariance(0, 0) + variance);
    }
    void improve(double p, double variance) {
      const Eigen::Vector2d gain = covariance.col(0) / (covariance(0, 0) + variance);
      const double off = p - position;
      position += gain[0] * off;
      velocity += gain[1] * off;
      covariance -= gain * covariance.row(0).eval();
    }
  };
  struct Step {
    double dt;
    Eigen::Vector2d change;
    Eigen::Quaterniond ned_R_body;
    double turn_rate;
  };

  double lag_s_;
  double time_s_ = 0.0, heard_s_ = -1e9, started_s_ = 0.0;
  bool started_ = false, acquired_ = false;
  int refused_ = 0;
  double height_m_ = 0.0;
  Axis north_, east_;
  std::deque<Step> past_{{0.0, Eigen::Vector2d::Zero(), Eigen::Quaterniond::Identity(), 0.0}};
};

/// A point mass under a thrust that tilts: to accelerate sideways it must lean, and its camera with
/// it. In LAND it flies to where the estimate says, with the target's velocity fed forward
/// (PLND_OPTIONS 1), and descends while it is near enough; without a target it stays where it is,
/// and stops descending when that lasts.
class SimCopter {
 public:
  struct State {
    double time_s = 0.0;
    Eigen::Vector3d position = Eigen::Vector3d::Zero();  ///< NED
    Eigen::Vector3d velocity = Eigen::Vector3d::Zero();
    Eigen::Quaterniond ned_R_body = Eigen::Quaterniond::Identity();
  };
  struct Parameters {
    double lag_s = 0.06;          ///< PLND_LAG
    bool moving_target = false;   ///< PLND_OPTIONS 1
    double off_most_m = 1.0;      ///< PLND_XY_DIST_MAX: farther off it doesn't descend
    double land_speed_mps = 0.5;  ///< LAND_SPEED, below 10 m
    double retry_s = 4.0;         ///< PLND_TIMEOUT
  };

  SimCopter(const Eigen::Vector3d& start, double yaw_rad, const Parameters& parameters)
      : parameters_(parameters), yaw_rad_(yaw_rad), target_(parameters.lag_s) {
    state_.position = start;
    lean();
  }

  const State& state() const { return state_; }
  bool has_target() const { return target_.acquired(); }
  Eigen::Vector3d wind{0, 0, 0};  ///< acceleration that nobody foresees

  void hear(const mavlink::LandingTarget& message) {
    target_.hear(Eigen::Vector3f(message.x, message.y, message.z).cast<double>(),
                 state_.velocity.head<2>());
  }

  void step(double dt) {
    Eigen::Vector2d wanted = Eigen::Vector2d::Zero();
    double off = 0.0;
    if (target_.acquired()) {
      const auto [p, v] = target_.now();
      off = p.norm();
      // PSC_POSXY_P is 1; far off, the speed is one from which it can still stop.
      const double speed = std::min(off, std::sqrt(2.0 * 0.5 * kAcceleration * off));
      if (off > 0.0) wanted = speed * p / off;
      if (parameters_.moving_target) wanted += v + state_.velocity.head<2>();
    }
    fly({wanted.x(), wanted.y(), descent(off)}, dt);
  }

 private:
  static constexpr double kGravity = 9.81, kAcceleration = 2.5;

  double descent(double off) const {
    const double height = -state_.position.z();
    double speed = height > 10.0 ? 1.5 : parameters_.land_speed_mps;
    if (!target_.acquired()) return target_.unheard_s() < parameters_.retry_s ? speed : 0.0;
    if (off > parameters_.off_most_m) return 0.0;
    if (target_.height_m() > 0.35 && target_.height_m() < 2.0) {
      const double half = 0.5 * parameters_.land_speed_mps;
      speed = std::max(0.1, half - off * half / 0.15);
    }
    return speed;
  }

  /// PSC_VELXY_P 2, I 1; it takes time to lean.
  void fly(const Eigen::Vector3d& wanted, double dt) {
    const Eigen::Vector3d too_slow = wanted - state_.velocity;
    against_wind_ += 1.0 * dt * too_slow;
    Eigen::Vector3d asked = 2.0 * too_slow + against_wind_;
    const double aside = asked.head<2>().norm();
    if (aside > kAcceleration) asked.head<2>() *= kAcceleration / aside;
    asked.z() = std::clamp(asked.z(), -kAcceleration, kAcceleration);
    acceleration_ += (asked - acceleration_) * std::min(1.0, dt / 0.12);
    const Eigen::Vector3d change = dt * (acceleration_ + wind);
    state_.velocity += change;
    state_.position += dt * state_.velocity;
    state_.time_s += dt;
    const Eigen::Quaterniond before = state_.ned_R_body;
    lean();
    target_.step(dt, change, state_.ned_R_body, before.angularDistance(state_.ned_R_body) / dt);
  }

  /// The thrust's direction is the body's up.
  void lean() {
    const Eigen::Vector3d down = (Eigen::Vector3d(0, 0, kGravity) - acceleration_).normalized();
    const Eigen::Vector3d nose(std::cos(yaw_rad_), std::sin(yaw_rad_), 0.0);
    const Eigen::Vector3d right = down.cross(nose).normalized();
    Eigen::Matrix3d axes;
    axes << right.cross(down), right, down;
    state_.ned_R_body = axes;
  }

  Parameters parameters_;
  State state_;
  double yaw_rad_;
  TargetEstimate target_;
  Eigen::Vector3d acceleration_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d against_wind_ = Eigen::Vector3d::Zero();  ///< what the controller has learnt
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
