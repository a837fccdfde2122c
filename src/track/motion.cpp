#include "track/motion.hpp"

#include <algorithm>
#include <cmath>

#include "track/so3.hpp"

namespace harco::track {
namespace {

using Matrix2d = Eigen::Matrix2d;

// Rotations don't add up; steps are so short that it doesn't matter. Seconds.
constexpr double kLongestStep = 0.05;
// What lies farther ahead than this is anybody's guess, at the price of fewer steps.
constexpr double kMostSteps = 200.0;

double rate_of(const Swell& swell) { return 2.0 * std::acos(-1.0) / swell.period_s; }

/// exp(A dt) of x'' = -ω² x - 2 ζ ω x'.
Matrix2d oscillator(const Swell& swell, double dt) {
  const double w = rate_of(swell);
  const double decay = swell.damping * w;
  const double damped = std::sqrt(w * w - decay * decay);
  const double sine = std::sin(damped * dt) / damped;
  const double cosine = std::cos(damped * dt);
  Matrix2d transition;
  transition << cosine + decay * sine, sine, -w * w * sine, cosine - decay * sine;
  return std::exp(-decay * dt) * transition;
}

/// Covariance that the oscillator has once it has gone on for long, for unit displacement.
Matrix2d stationary(const Swell& swell) {
  const double w = rate_of(swell);
  return Eigen::Vector2d(1.0, w * w).asDiagonal();
}

/// Variances of the swell's displacements: three shifts, three turns.
Vector6d variances(const Swell& swell) {
  Vector6d all;
  all << Eigen::Vector3d::Constant(swell.shift_sd_m * swell.shift_sd_m),
      Eigen::Vector3d::Constant(swell.turn_sd_rad * swell.turn_sd_rad);
  return all;
}

}  // namespace

Motion::Motion(const FilterOptions& options, const std::optional<Swell>& swell)
    : options_(options), swell_(swell) {}

/// Covariance of velocity and turn rate, or their growth in a second, for standard deviations of
/// the marker's straight motion, its turning and the camera's. A camera that turns by w moves the
/// marker by -w × t and turns it by -R' w, so both are one error.
Matrix6d Motion::spread(const Estimate& estimate, double shift, double marker,
                        double camera) const {
  Matrix6d covariance = Matrix6d::Zero();
  covariance.diagonal() << Eigen::Vector3d::Constant(shift * shift),
      Eigen::Vector3d::Constant(marker * marker);
  if (options_.camera_known) return covariance;
  Eigen::Matrix<double, 6, 3> turned;
  turned << so3::hat(estimate.translation), -estimate.rotation.transpose();
  return covariance + camera * camera * turned * turned.transpose();
}

Estimate Motion::start(double time_s, const Eigen::Isometry3d& pose,
                       const Matrix6d& covariance) const {
  Estimate estimate;
  estimate.time_s = time_s;
  estimate.translation = pose.translation();
  estimate.rotation = pose.linear();
  const int states = swell_ ? kMostStates : kSway;
  estimate.covariance = Covariance::Zero(states, states);
  estimate.covariance.block<6, 6>(kPose, kPose) = covariance;
  estimate.covariance.block<6, 6>(kRate, kRate) =
      spread(estimate, options_.speed, options_.marker_turn_rate, options_.camera_turn_rate);
  if (swell_) {
    const Matrix2d unit = stationary(*swell_);
    const Vector6d variance = variances(*swell_);
    estimate.covariance.diagonal().segment<6>(kSway) = unit(0, 0) * variance;
    estimate.covariance.diagonal().segment<6>(kSwayRate) = unit(1, 1) * variance;
  }
  return estimate;
}

Vector6d Motion::move(Estimate& estimate, double dt) const {
  Vector6d moved = estimate.rate * dt;
  if (swell_) {
    const Matrix2d swings = oscillator(*swell_, dt);
    const Vector6d before = estimate.sway;
    estimate.sway = swings(0, 0) * before + swings(0, 1) * estimate.sway_rate;
    estimate.sway_rate = swings(1, 0) * before + swings(1, 1) * estimate.sway_rate;
    moved += estimate.sway - before;
  }
  estimate.translation += moved.head<3>();
  estimate.rotation = estimate.rotation * so3::exp(moved.tail<3>());
  estimate.time_s += dt;
  return moved;
}

void Motion::spread_error(Estimate& estimate, const Vector6d& moved, double dt) const {
  using Eigen::Vector3d;
  const auto states = estimate.covariance.rows();
  const Matrix2d swings = swell_ ? oscillator(*swell_, dt) : Matrix2d::Identity();

  // The error's way: what a part adds to the pose goes through `into_pose`.
  const Vector3d turned = moved.tail<3>();
  Matrix6d into_pose = Matrix6d::Identity();
  into_pose.bottomRightCorner<3, 3>() = so3::right_jacobian(turned);
  Covariance transition = Covariance::Identity(states, states);
  transition.block<3, 3>(kPose + 3, kPose + 3) = so3::exp(-turned);
  transition.block<6, 6>(kPose, kRate) = dt * into_pose;
  if (swell_) {
    transition.block<6, 6>(kPose, kSway) = (swings(0, 0) - 1.0) * into_pose;
    transition.block<6, 6>(kPose, kSwayRate) = swings(0, 1) * into_pose;
    transition.block<6, 6>(kSway, kSway) *= swings(0, 0);
    transition.block<6, 6>(kSway, kSwayRate) = swings(0, 1) * Matrix6d::Identity();
    transition.block<6, 6>(kSwayRate, kSway) = swings(1, 0) * Matrix6d::Identity();
    transition.block<6, 6>(kSwayRate, kSwayRate) *= swings(1, 1);
  }

  // What the accelerations of this step add.
  const Matrix6d density =
      spread(estimate, options_.acceleration, options_.marker_turning, options_.camera_turning);
  Covariance noise = Covariance::Zero(states, states);
  noise.block<6, 6>(kPose, kPose) = dt * dt * dt / 3.0 * density;
  noise.block<6, 6>(kPose, kRate) = dt * dt / 2.0 * density;
  noise.block<6, 6>(kRate, kPose) = dt * dt / 2.0 * density;
  noise.block<6, 6>(kRate, kRate) = dt * density;
  if (swell_) {
    // What keeps the oscillators at their standard deviations. Their displacement moves the pose.
    const Matrix2d unit = stationary(*swell_);
    const Matrix2d kept = unit - swings * unit * swings.transpose();
    const Matrix6d variance = variances(*swell_).asDiagonal();
    for (const int row : {kPose, kSway, kSwayRate})
      for (const int column : {kPose, kSway, kSwayRate})
        noise.block<6, 6>(row, column) += kept(row == kSwayRate, column == kSwayRate) * variance;
  }
  estimate.covariance = transition * estimate.covariance * transition.transpose() + noise;
}

Estimate Motion::advance(Estimate estimate, double time_s) const {
  const double dt = time_s - estimate.time_s;
  const double steps = std::clamp(std::ceil(dt / kLongestStep), 1.0, kMostSteps);
  if (dt > 0.0)
    for (int i = 0; i < static_cast<int>(steps); ++i) {
      spread_error(estimate, move(estimate, dt / steps), dt / steps);
    }
  estimate.time_s = time_s;
  return estimate;
}

Estimate Motion::foretell(Estimate estimate, double time_s) const {
  if (time_s > estimate.time_s) move(estimate, time_s - estimate.time_s);
  estimate.time_s = time_s;
  return estimate;
}

}  // namespace harco::track
