#include "harco/filter.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <stdexcept>
#include <vector>

#include <gtest/gtest.h>
#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "track/chain.hpp"
#include "track/so3.hpp"

namespace harco {
namespace {

using Eigen::AngleAxisd;
using Eigen::Matrix3d;
using Eigen::Vector3d;
using Vector6d = Eigen::Matrix<double, 6, 1>;
using Vector12d = Eigen::Matrix<double, 12, 1>;

Matrix6d covariance(double metres, double radians) {
  Matrix6d matrix = Matrix6d::Zero();
  matrix.diagonal() << Vector3d::Constant(metres * metres), Vector3d::Constant(radians * radians);
  return matrix;
}

Pose pose(const Vector3d& translation, const Matrix3d& rotation = Matrix3d::Identity(),
          double metres = 0.01, double radians = 0.01) {
  Pose p;
  p.camera_T_marker.translation() = translation;
  p.camera_T_marker.linear() = rotation;
  p.covariance = covariance(metres, radians);
  return p;
}

/// A camera of which only the attitude is known.
CameraPose turned(const Matrix3d& reference_R_camera) {
  return Eigen::Isometry3d(reference_R_camera);
}

/// Standard normal numbers, the same ones for the same seed.
class Noise {
 public:
  explicit Noise(unsigned seed) : engine_(seed) {}
  Vector3d vector(double sd) {
    return sd * Vector3d(normal_(engine_), normal_(engine_), normal_(engine_));
  }
  Vector6d of(const Matrix6d& covariance) {
    Vector6d unit;
    unit << vector(1.0), vector(1.0);
    return covariance.llt().matrixL() * unit;
  }

 private:
  std::mt19937 engine_;
  std::normal_distribution<double> normal_;
};

// --- the mathematics ---------------------------------------------------------------------------

TEST(So3, ExpAndLogAreInverse) {
  for (const Vector3d& v : {Vector3d(0.0, 0.0, 0.0), Vector3d(1e-7, -2e-7, 0.0),
                            Vector3d(0.3, -1.0, 0.5), Vector3d(0.0, 3.14, 0.0)})
    EXPECT_TRUE(so3::log(so3::exp(v)).isApprox(v, 1e-9) || v.norm() == 0.0) << v.transpose();
  const Matrix3d quarter = so3::exp({0.0, 0.0, std::acos(-1.0) / 2.0});
  EXPECT_TRUE((quarter * Vector3d::UnitX()).isApprox(Vector3d::UnitY(), 1e-12));
}

TEST(So3, JacobiansAgreeWithDifferences) {
  constexpr double kStep = 1e-6;
  for (const Vector3d& v :
       {Vector3d(1e-5, 0.0, 2e-5), Vector3d(0.3, -1.0, 0.5), Vector3d(-2.0, 1.0, 1.5)}) {
    Matrix3d differences, inverse;
    for (int i = 0; i < 3; ++i) {
      const Vector3d d = kStep * Vector3d::Unit(i);
      differences.col(i) = so3::log(so3::exp(v).transpose() * so3::exp(v + d)) / kStep;
      inverse.col(i) = (so3::log(so3::exp(v) * so3::exp(d)) - v) / kStep;
    }
    EXPECT_TRUE(so3::right_jacobian(v).isApprox(differences, 1e-5)) << v.transpose();
    EXPECT_TRUE(so3::right_jacobian_inverse(v).isApprox(inverse, 1e-5)) << v.transpose();
  }
}

TEST(ChiSquared, HasItsTabulatedQuantiles) {
  EXPECT_NEAR(track::chi_squared_six(0.05), 12.592, 1e-3);
  EXPECT_NEAR(track::chi_squared_six(0.001), 22.458, 1e-3);
}

/// What an error `e` turns the estimate into.
track::Estimate with_error(track::Estimate estimate, const track::ErrorState& e) {
  estimate.translation += e.segment<3>(0);
  estimate.rotation = estimate.rotation * so3::exp(e.segment<3>(3));
  estimate.rate += e.segment<6>(6);
  if (e.size() == track::kMostStates) {
    estimate.sway += e.segment<6>(12);
    estimate.sway_rate += e.segment<6>(18);
  }
  return estimate;
}

/// The error that leads from one estimate to the other.
track::ErrorState error_between(const track::Estimate& from, const track::Estimate& to, long size) {
  track::ErrorState e(size);
  e.segment<3>(0) = to.translation - from.translation;
  e.segment<3>(3) = so3::log(from.rotation.transpose() * to.rotation);
  e.segment<6>(6) = to.rate - from.rate;
  if (size == track::kMostStates) {
    e.segment<6>(12) = to.sway - from.sway;
    e.segment<6>(18) = to.sway_rate - from.sway_rate;
  }
  return e;
}

track::Estimate moving_estimate(const track::Motion& motion) {
  track::Estimate estimate =
      motion.start(0.0, pose({0.4, -0.3, 4.0}, so3::exp({0.2, -0.4, 1.0})).camera_T_marker,
                   covariance(0.01, 0.01));
  estimate.rate << 0.5, -1.0, 0.2, 0.4, -0.3, 0.9;
  if (estimate.has_swell()) {
    estimate.sway << 0.1, 0.0, 0.3, -0.05, 0.08, 0.0;
    estimate.sway_rate << 0.0, 0.2, -0.3, 0.1, 0.0, 0.05;
  }
  return estimate;
}

TEST(Motion, ItsCovarianceFollowsTheJacobian) {
  FilterOptions options;
  options.camera_known = true;  // the noise then doesn't depend on the pose
  Swell swell;
  swell.period_s = 5.0;
  for (const bool with_swell : {false, true}) {
    const track::Motion motion(options, with_swell ? std::optional<Swell>(swell) : std::nullopt);
    track::Estimate start = moving_estimate(motion);
    const auto size = start.covariance.rows();
    start.covariance.setZero();
    const track::Estimate end = motion.advance(start, 0.3);
    for (long i = 0; i < size; ++i) {
      constexpr double kStep = 1e-6;
      track::Estimate certain = start;
      certain.covariance(i, i) = 1.0;  // an error of this part alone: F e e' F' + noise
      const track::Covariance grown = motion.advance(certain, 0.3).covariance - end.covariance;
      track::ErrorState e = track::ErrorState::Zero(size);
      e(i) = kStep;
      const track::ErrorState moved =
          error_between(end, motion.advance(with_error(start, e), 0.3), size) / kStep;
      EXPECT_TRUE(grown.isApprox(moved * moved.transpose(), 1e-4)) << "part " << i;
    }
  }
}

TEST(Motion, StepsAddUp) {
  FilterOptions options;
  options.camera_known = true;
  Swell swell;
  swell.period_s = 4.0;
  const track::Motion motion(options, swell);
  track::Estimate start = moving_estimate(motion);
  start.rate.tail<3>().setZero();  // a rotation's steps add up only roughly
  start.sway.tail<3>().setZero();
  start.sway_rate.tail<3>().setZero();
  const track::Estimate at_once = motion.advance(start, 1.0);
  const track::Estimate in_two = motion.advance(motion.advance(start, 0.37), 1.0);
  EXPECT_LT(error_between(at_once, in_two, track::kMostStates).norm(), 1e-9);
  EXPECT_TRUE(at_once.covariance.isApprox(in_two.covariance, 1e-3));
}

TEST(Motion, SwellKeepsItsAmplitudeAndPeriod) {
  FilterOptions options;
  options.camera_known = true;
  Swell swell{8.0, 0.05, 0.4, 0.1};
  const track::Motion motion(options, swell);
  track::Estimate estimate = moving_estimate(motion);
  const track::Estimate later = motion.advance(estimate, 5.0);
  EXPECT_NEAR(later.covariance(14, 14), 0.16, 1e-9);  // 0.4²
  EXPECT_NEAR(later.covariance(15, 15), 0.01, 1e-9);  // 0.1²
  const double rate = 2.0 * std::acos(-1.0) / 8.0;
  EXPECT_NEAR(later.covariance(20, 20), 0.16 * rate * rate, 1e-9);

  // Half a damped period later it stands on the other side, smaller by exp(-π ζ / √(1 - ζ²)).
  estimate.sway.setZero();
  estimate.sway_rate.setZero();
  estimate.sway(2) = 1.0;
  const double slowed = std::sqrt(1.0 - 0.05 * 0.05);
  const track::Estimate half = motion.advance(estimate, 4.0 / slowed);
  EXPECT_NEAR(half.sway(2), -std::exp(-std::acos(-1.0) * 0.05 / slowed), 1e-9);
  EXPECT_NEAR(half.sway_rate(2), 0.0, 1e-9);
}

TEST(PoseFilter, OneDimensionAgreesWithPaperAndPencil) {
  FilterOptions options;
  options.acceleration = 2.0;
  options.speed = 3.0;
  PoseFilter filter(options);
  // Straight ahead, where neither the camera's nor the marker's turning counts.
  EXPECT_EQ(filter.add(pose({0.0, 0.0, 5.0}, Matrix3d::Identity(), 0.1, 0.01), 10.0),
            Verdict::started);
  const double dt = 0.5, q = 4.0, r = 0.01;
  const TrackState foretold = filter.at(10.0 + dt).value();
  EXPECT_NEAR(foretold.covariance(2, 2), r + 9.0 * dt * dt + q * dt * dt * dt / 3.0, 1e-9);
  EXPECT_NEAR(foretold.covariance(2, 8), 9.0 * dt + q * dt * dt / 2.0, 1e-9);
  EXPECT_NEAR(foretold.covariance(8, 8), 9.0 + q * dt, 1e-9);

  EXPECT_EQ(filter.add(pose({0.0, 0.0, 6.0}, Matrix3d::Identity(), 0.1, 0.01), 10.0 + dt),
            Verdict::accepted);
  const double pzz = foretold.covariance(2, 2), pzv = foretold.covariance(2, 8);
  const TrackState state = filter.at(10.0 + dt).value();
  EXPECT_NEAR(state.camera_T_marker.translation().z(), 5.0 + pzz / (pzz + r), 1e-9);
  EXPECT_NEAR(state.velocity.z(), pzv / (pzz + r), 1e-9);
  EXPECT_NEAR(state.covariance(2, 2), pzz * r / (pzz + r), 1e-9);
  EXPECT_NEAR(state.covariance(8, 8), foretold.covariance(8, 8) - pzv * pzv / (pzz + r), 1e-9);
  EXPECT_DOUBLE_EQ(state.measured_s, 10.5);
}

TEST(PoseFilter, ATurningCameraSwingsTheMarkerOnItsDistance) {
  FilterOptions options;
  options.speed = 1e-3;
  options.marker_turn_rate = 1e-3;
  options.camera_turn_rate = 0.5;
  PoseFilter filter(options);
  filter.add(pose({0.0, 0.0, 8.0}), 0.0);
  const Matrix12d c = filter.at(0.0)->covariance;
  EXPECT_NEAR(std::sqrt(c(6, 6)), 8.0 * 0.5, 1e-3);
  EXPECT_NEAR(std::sqrt(c(8, 8)), 1e-3, 1e-6);  // along the axis it does nothing
  // Turning to the right about y moves the marker to the left and turns it the other way.
  EXPECT_NEAR(c(6, 10) / std::sqrt(c(6, 6) * c(10, 10)), 1.0, 1e-3);
  EXPECT_NEAR(c(7, 9) / std::sqrt(c(7, 7) * c(9, 9)), -1.0, 1e-3);
}

// --- consistency -------------------------------------------------------------------------------

/// A marker whose velocity is changed by white accelerations, as the filter takes it to be.
class Wanderer {
 public:
  Wanderer(const FilterOptions& options, unsigned seed) : options_(options), noise_(seed) {
    velocity = noise_.vector(0.5);
    turn_rate = noise_.vector(0.1);
    camera_rate_ = noise_.vector(0.2);
  }

  void step(double dt) {
    const double root = std::sqrt(dt);
    own_velocity_ += noise_.vector(options_.acceleration * root);
    own_turn_ += noise_.vector(options_.marker_turning * root);
    if (options_.camera_known) {
      // The camera turns as it likes; the marker is told in axes that don't.
      camera_rate_ += -0.5 * dt * camera_rate_ + noise_.vector(2.0 * root);
      attitude = attitude * so3::exp(camera_rate_ * dt);
    }
    velocity = own_velocity_;
    turn_rate = own_turn_;
    truth.translation() += velocity * dt;
    truth.linear() = truth.linear() * so3::exp(turn_rate * dt);
  }

  Eigen::Isometry3d camera_T_marker() const {
    return Eigen::Isometry3d(attitude.transpose()) * truth;
  }

  Pose measured(const Matrix6d& covariance) {
    const Vector6d error = noise_.of(covariance);
    Pose p;
    p.camera_T_marker = camera_T_marker();
    p.camera_T_marker.translation() -= error.head<3>();
    p.camera_T_marker.linear() = p.camera_T_marker.linear() * so3::exp(-error.tail<3>());
    p.covariance = covariance;
    return p;
  }

  Eigen::Isometry3d truth = Eigen::Translation3d(0.3, -0.2, 6.0) * Eigen::Isometry3d::Identity();
  Matrix3d attitude = Matrix3d::Identity();  ///< of the camera, reference axes
  Vector3d velocity, turn_rate;              ///< reference axes, marker's axes

 private:
  FilterOptions options_;
  Noise noise_;
  Vector3d own_velocity_ = Vector3d::Zero(), own_turn_ = Vector3d::Zero(), camera_rate_;
};

/// Normalised estimation error squared, twelve degrees of freedom.
double nees(const TrackState& state, const Wanderer& wanderer) {
  Vector12d error;
  const Eigen::Isometry3d truth = wanderer.camera_T_marker();
  error << truth.translation() - state.camera_T_marker.translation(),
      so3::log(state.camera_T_marker.linear().transpose() * truth.linear()),
      wanderer.attitude.transpose() * wanderer.velocity - state.velocity,
      wanderer.turn_rate - state.turn_rate;
  return error.dot(state.covariance.ldlt().solve(error));
}

Matrix6d uneven_covariance() {
  Matrix6d root = Matrix6d::Zero();
  root.diagonal() << 0.004, 0.005, 0.03, 0.02, 0.015, 0.005;
  root(3, 1) = 0.01;
  root(4, 0) = -0.008;
  return root * root.transpose();
}

TEST(PoseFilter, IsAsSureAsItIsRight) {
  constexpr int kFlights = 60, kFrames = 60;
  for (const bool attitude_known : {false, true}) {
    FilterOptions options;
    options.camera_known = attitude_known;
    options.camera_turning = 0.0;
    options.camera_turn_rate = 0.0;
    double seen = 0.0, blind = 0.0;
    for (unsigned flight = 0; flight < kFlights; ++flight) {
      Wanderer wanderer(options, 100 + flight);
      PoseFilter filter(options);
      const auto attitude = [&] {
        return attitude_known ? turned(wanderer.attitude) : std::nullopt;
      };
      double time = 0.0;
      const auto fly = [&](double duration) {
        for (int i = 0; i < 4; ++i) wanderer.step(duration / 4.0);
        time += duration;
      };
      for (int frame = 0; frame < kFrames; ++frame) {
        fly(frame % 7 == 3 ? 0.15 : 0.03);  // some frames are missing
        filter.add(wanderer.measured(uneven_covariance()), time, attitude());
      }
      seen += nees(filter.at(time, attitude()).value(), wanderer);
      fly(0.5);
      blind += nees(filter.at(time, attitude()).value(), wanderer);
    }
    // The mean of kFlights χ² of twelve degrees, within four standard deviations.
    const double spread = 4.0 * std::sqrt(2.0 * 12.0 / kFlights);
    EXPECT_NEAR(seen / kFlights, 12.0, spread) << attitude_known;
    EXPECT_NEAR(blind / kFlights, 12.0, spread) << attitude_known;
  }
}

TEST(PoseFilter, IsHonestAboutADroneOverAMovingDeck) {
  // No white accelerations here: a vehicle that comes down in curves, its camera rocking, over a
  // deck that heaves and rolls. The filter must not be surer than it is right.
  for (const bool attitude_known : {false, true})
    for (const bool with_swell : {false, true}) {
      FilterOptions options;
      options.camera_known = attitude_known;
      if (with_swell) options.swell = Swell{6.0, 0.05, 0.3, 0.07};
      Noise noise(7);
      PoseFilter filter(options);
      double worst = 0.0, sum = 0.0;
      int count = 0;
      for (int frame = 0; frame < 600; ++frame) {
        const double t = frame / 30.0;
        const auto state_at = [](double s) {
          const double swing = 2.0 * std::acos(-1.0) / 6.0;
          const Matrix3d attitude =
              so3::exp({0.1 * std::sin(1.7 * s), 0.12 * std::sin(2.3 * s + 1.0), 0.2 * s});
          Eigen::Isometry3d marker = Eigen::Isometry3d::Identity();
          marker.translation() = Vector3d(0.5 * std::sin(0.8 * s), 0.4 * std::cos(0.6 * s),
                                          10.0 - 0.4 * s + 0.3 * std::sin(swing * s));
          marker.linear() = so3::exp({0.08 * std::sin(swing * s + 0.5), 0.0, 0.0});
          return std::pair{attitude, marker};
        };
        const auto [attitude, marker] = state_at(t);
        Pose seen;
        seen.camera_T_marker = Eigen::Isometry3d(attitude.transpose()) * marker;
        const Eigen::Isometry3d truth = seen.camera_T_marker;
        const Vector6d error = noise.of(uneven_covariance());
        seen.camera_T_marker.translation() -= error.head<3>();
        seen.camera_T_marker.linear() = seen.camera_T_marker.linear() * so3::exp(-error.tail<3>());
        seen.covariance = uneven_covariance();
        const CameraPose given = attitude_known ? turned(attitude) : std::nullopt;
        // Two seconds of blocked view.
        if (frame < 300 || frame >= 360) {
          const Verdict verdict = filter.add(seen, t, given);
          EXPECT_TRUE(verdict == Verdict::accepted || verdict == Verdict::refused || frame == 0);
        }
        if (frame < 30) continue;
        const TrackState state = filter.at(t, given).value();
        Vector6d off;
        off << truth.translation() - state.camera_T_marker.translation(),
            so3::log(state.camera_T_marker.linear().transpose() * truth.linear());
        const double six = off.dot(state.covariance.topLeftCorner<6, 6>().ldlt().solve(off));
        worst = std::max(worst, six);
        sum += six;
        ++count;
      }
      EXPECT_LT(sum / count, 7.0) << attitude_known << with_swell;  // six on average if exact
      EXPECT_LT(worst, 35.0) << attitude_known << with_swell;
    }
}

// --- gaps, late and wrong measurements -----------------------------------------------------------

/// A marker that comes nearer at 1 m/s, seen 30 times a second without error.
Pose approaching(double time_s) { return pose({0.1, 0.0, 5.0 - time_s}); }

PoseFilter tracked(double until_s, const FilterOptions& options = {}) {
  PoseFilter filter(options);
  for (int frame = 0; frame / 30.0 <= until_s; ++frame)
    filter.add(approaching(frame / 30.0), frame / 30.0);
  return filter;
}

TEST(PoseFilter, CoastsEverLessSurelyAndThenIsLost) {
  PoseFilter filter;
  EXPECT_EQ(filter.status(0.0), TrackStatus::searching);
  EXPECT_FALSE(filter.at(0.0));
  filter.add(approaching(0.0), 0.0);
  EXPECT_EQ(filter.at(0.0)->status, TrackStatus::searching);

  filter = tracked(1.0);
  EXPECT_EQ(filter.status(1.0), TrackStatus::tracking);
  EXPECT_EQ(filter.at(1.1)->status, TrackStatus::tracking);
  double before = 0.0;
  for (const double later : {1.5, 2.0, 3.0}) {
    const TrackState state = filter.at(later).value();
    EXPECT_EQ(state.status, TrackStatus::coasting);
    EXPECT_NEAR(state.camera_T_marker.translation().z(), 5.0 - later, 0.05);
    EXPECT_NEAR(state.velocity.z(), -1.0, 0.03);
    EXPECT_GT(state.covariance(2, 2), before);
    EXPECT_EQ(state.measured_s, 1.0);
    before = state.covariance(2, 2);
  }
  EXPECT_EQ(filter.status(4.1), TrackStatus::lost);
  EXPECT_FALSE(filter.at(4.1));
  // Anywhere it comes back, it is taken up again.
  EXPECT_EQ(filter.add(pose({3.0, 1.0, 20.0}), 5.0), Verdict::started);
  EXPECT_EQ(filter.status(5.0), TrackStatus::searching);
}

TEST(PoseFilter, LateMeasurementsCountAsIfTheyHadComeInTime) {
  std::vector<double> times;
  for (int frame = 0; frame < 24; ++frame) times.push_back(frame / 30.0);
  FilterOptions options;
  options.swell = Swell{6.0, 0.05, 0.3, 0.07};
  PoseFilter in_order(options), shuffled(options);
  const auto measured = [](double time) {
    Noise noise(static_cast<unsigned>(time * 1000.0));
    return pose(Vector3d(0.1, 0.0, 5.0 - time) + noise.vector(0.01), so3::exp(noise.vector(0.01)));
  };
  for (const double time : times) in_order.add(measured(time), time);
  std::mt19937 engine(3);
  std::shuffle(times.begin(), times.end(), engine);
  for (const double time : times) shuffled.add(measured(time), time);
  for (const double time : {0.4, 0.9}) {
    const TrackState a = in_order.at(time).value(), b = shuffled.at(time).value();
    EXPECT_TRUE(a.camera_T_marker.matrix() == b.camera_T_marker.matrix());
    EXPECT_TRUE(a.covariance == b.covariance);
    EXPECT_TRUE(a.velocity == b.velocity);
  }
}

TEST(PoseFilter, AnswersForThePastByWhatWasKnownThen) {
  PoseFilter filter = tracked(1.0);
  const TrackState then = filter.at(0.7).value();
  const PoseFilter until = tracked(0.7);
  EXPECT_TRUE(then.camera_T_marker.matrix() == until.at(0.7)->camera_T_marker.matrix());
  EXPECT_FALSE(filter.at(-5.0));
}

TEST(PoseFilter, RefusesOutliers) {
  PoseFilter filter = tracked(1.0);
  const TrackState before = filter.at(1.05).value();
  EXPECT_EQ(filter.add(pose({1.5, 0.0, 4.0}), 1.03), Verdict::refused);
  EXPECT_EQ(filter.add(pose({0.1, 0.0, 3.96}, so3::exp({1.2, 0.0, 0.0})), 1.04), Verdict::refused);
  const TrackState after = filter.at(1.05).value();
  EXPECT_TRUE(after.camera_T_marker.isApprox(before.camera_T_marker, 1e-12));
  EXPECT_EQ(filter.add(approaching(1.05), 1.05), Verdict::accepted);
}

TEST(PoseFilter, GivesUpATrackThatEverythingContradicts) {
  FilterOptions options;
  PoseFilter filter = tracked(1.0, options);
  for (int i = 1; i < options.replace; ++i)
    EXPECT_EQ(filter.add(pose({2.0, 0.0, 9.0}), 1.0 + 0.03 * i), Verdict::refused) << i;
  EXPECT_EQ(filter.add(pose({2.0, 0.0, 9.0}), 1.3), Verdict::replaced);
  EXPECT_EQ(filter.status(1.3), TrackStatus::tracking);
  EXPECT_NEAR(filter.at(1.3)->camera_T_marker.translation().z(), 9.0, 0.1);
  // Outliers that agree on nothing replace nothing.
  Noise noise(5);
  for (int i = 0; i < 40; ++i)
    EXPECT_EQ(filter.add(pose(Vector3d(0.0, 0.0, 30.0) + noise.vector(5.0)), 1.31 + 0.01 * i),
              Verdict::refused);
}

TEST(PoseFilter, AFalseStartIsSoonCorrected) {
  PoseFilter filter;
  filter.add(pose({2.0, 0.0, 50.0}), 0.0);
  Verdict verdict = Verdict::refused;
  for (int frame = 1; frame <= 3; ++frame)
    verdict = filter.add(approaching(frame / 30.0), frame / 30.0);
  EXPECT_EQ(verdict, Verdict::replaced);
  EXPECT_EQ(filter.status(0.1), TrackStatus::tracking);
}

TEST(PoseFilter, OutlivesAClockThatJumps) {
  for (const double jump : {-1000.0, 1000.0}) {
    FilterOptions options;
    PoseFilter filter = tracked(1.0, options);
    Verdict verdict = Verdict::refused;
    for (int i = 0; i < options.replace; ++i)
      verdict = filter.add(approaching(1.0 + i / 30.0), jump + i / 30.0);
    EXPECT_EQ(verdict, jump < 0.0 ? Verdict::replaced : Verdict::accepted);
    const double now = jump + 0.3;
    ASSERT_TRUE(filter.at(now));
    EXPECT_EQ(filter.at(now)->status, TrackStatus::tracking);
    // A single time stamp from the future must not blind it either.
    filter.add(approaching(1.3), now + 1e6);
    for (int i = 0; i < 4; ++i) verdict = filter.add(approaching(1.3 + i / 30.0), now + i / 30.0);
    EXPECT_EQ(filter.at(now + 0.1)->status, TrackStatus::tracking);
  }
}

TEST(PoseFilter, TooLateIsToldAndChangesNothing) {
  PoseFilter filter = tracked(3.0);
  const TrackState before = filter.at(3.0).value();
  EXPECT_EQ(filter.add(approaching(1.5), 1.5), Verdict::too_late);
  EXPECT_TRUE(filter.at(3.0)->camera_T_marker.matrix() == before.camera_T_marker.matrix());
}

// --- two solutions -------------------------------------------------------------------------------

/// A marker tilted by `tilt` about x whose mirrored tilt is possible as well, at odds of e^ratio.
Pose open(double tilt, double ratio) {
  Pose p = pose({0.0, 0.0, 10.0}, so3::exp({tilt, 0.0, 0.0}));
  p.alternative = pose({0.0, 0.0, 10.0}, so3::exp({-tilt, 0.0, 0.0})).camera_T_marker;
  p.log_likelihood_ratio = ratio;
  Vector6d apart = Vector6d::Zero();
  apart(3) = -2.0 * tilt;
  *p.covariance += apart * apart.transpose() / (1.0 + std::exp(ratio));
  return p;
}

double tilt_of(const TrackState& state) { return so3::log(state.camera_T_marker.linear()).x(); }

TEST(PoseFilter, ThePastChoosesAmongTwoSolutions) {
  PoseFilter filter;
  int frame = 0;
  for (; frame < 10; ++frame)
    filter.add(pose({0.0, 0.0, 10.0}, so3::exp({0.5, 0.0, 0.0})), frame / 30.0);
  // The image takes the mirrored one for likelier, now and then.
  for (; frame < 20; ++frame)
    EXPECT_EQ(filter.add(frame % 2 == 0 ? open(-0.5, 0.5) : open(0.5, 1.0), frame / 30.0),
              Verdict::accepted);
  EXPECT_NEAR(tilt_of(*filter.at(19 / 30.0)), 0.5, 0.01);
}

TEST(PoseFilter, LeavesAWrongBranchWhenImagesKeepSayingSo) {
  PoseFilter filter;
  int frame = 0;
  for (; frame < 10; ++frame) filter.add(open(0.5, 3.0), frame / 30.0);
  EXPECT_NEAR(tilt_of(*filter.at(9 / 30.0)), 0.5, 0.02);
  bool replaced = false;
  for (; frame < 40 && !replaced; ++frame)
    replaced = filter.add(open(-0.5, 2.0), frame / 30.0) == Verdict::replaced;
  EXPECT_TRUE(replaced);
  EXPECT_NEAR(tilt_of(*filter.at((frame - 1) / 30.0)), -0.5, 0.05);
}

// --- attitude, misuse, several parents -----------------------------------------------------------

TEST(PoseFilter, WithItsAttitudeKnownACameraMayTurnAsItLikes) {
  FilterOptions options;
  options.camera_known = true;
  PoseFilter still(options), turning(options);
  for (int frame = 0; frame < 30; ++frame) {
    const double t = frame / 30.0;
    const Matrix3d attitude = so3::exp({std::sin(9.0 * t), 0.7 * std::cos(5.0 * t), 3.0 * t});
    still.add(approaching(t), t, turned(Matrix3d::Identity()));
    Pose seen = approaching(t);
    seen.camera_T_marker = Eigen::Isometry3d(attitude.transpose()) * seen.camera_T_marker;
    turning.add(seen, t, turned(attitude));
  }
  const Matrix3d attitude = so3::exp({0.4, -0.8, 0.3});
  const TrackState a = still.at(1.5, turned(Matrix3d::Identity())).value();
  const TrackState b = turning.at(1.5, turned(attitude)).value();
  EXPECT_TRUE((Eigen::Isometry3d(attitude) * b.camera_T_marker).isApprox(a.camera_T_marker, 1e-9));
  EXPECT_TRUE((attitude * b.velocity).isApprox(a.velocity, 1e-9));
  EXPECT_TRUE((attitude * b.covariance.block<3, 3>(6, 6) * attitude.transpose())
                  .isApprox(a.covariance.block<3, 3>(6, 6), 1e-9));
}

TEST(PoseFilter, WithItsPoseKnownACameraMayFlyAsItLikes) {
  FilterOptions options;
  options.camera_known = true;
  options.acceleration = 0.1;  // of the marker alone
  PoseFilter filter(options);
  const auto camera_at = [](double t) {
    Eigen::Isometry3d pose(so3::exp({0.3 * std::sin(3.0 * t), 0.0, 2.0 * t}));
    pose.translation() = Vector3d(3.0 * std::sin(2.0 * t), 2.0 * std::cos(3.0 * t), 100.0 - t);
    return pose;
  };
  const auto marker_at = [](double t) {
    Eigen::Isometry3d pose(so3::exp({0.1, 0.2, 0.3}));
    pose.translation() = Vector3d(2.0 * t, 0.0, 110.0);
    return pose;
  };
  for (int frame = 0; frame < 60; ++frame) {
    const double t = frame / 30.0;
    Pose seen = pose(Vector3d::Zero());
    seen.camera_T_marker = camera_at(t).inverse() * marker_at(t);
    EXPECT_NE(filter.add(seen, t, camera_at(t)), Verdict::refused);
  }
  const TrackState state = filter.at(4.0, camera_at(4.0)).value();
  EXPECT_LT((state.camera_T_marker.translation() -
             (camera_at(4.0).inverse() * marker_at(4.0)).translation())
                .norm(),
            0.05);
  EXPECT_LT((camera_at(4.0).linear() * state.velocity - Vector3d(2.0, 0.0, 0.0)).norm(), 0.05);
}

TEST(PoseFilter, FindsTheSwellsPeriodAndForetellsByIt) {
  FilterOptions options;
  options.camera_known = true;
  options.acceleration = 0.05;  // a deck that moves steadily but for its swell
  options.swell = Swell{0.0, 0.05, 0.4, 0.07};
  FilterOptions steady = options;
  steady.swell.reset();
  steady.acceleration = 0.5;
  PoseFilter with(options), without(steady);
  const CameraPose level = turned(Matrix3d::Identity());
  const auto height = [](double t) {
    return 8.0 + 0.4 * std::sin(2.0 * std::acos(-1.0) * t / 7.0);
  };
  Noise noise(11);
  double off_with = 0.0, off_without = 0.0;
  for (int frame = 0; frame < 450; ++frame) {
    const double t = frame / 15.0;
    const Pose seen =
        pose(Vector3d(0.0, 0.0, height(t)) + noise.vector(0.01), so3::exp(noise.vector(0.01)));
    with.add(seen, t, level);
    without.add(seen, t, level);
    if (frame < 300 || frame % 10 != 0) continue;
    const double ahead = t + 2.0;
    off_with += std::abs(with.at(ahead, level)->camera_T_marker.translation().z() - height(ahead));
    off_without +=
        std::abs(without.at(ahead, level)->camera_T_marker.translation().z() - height(ahead));
  }
  EXPECT_GE(with.swell_period_s(), 6.0);
  EXPECT_LE(with.swell_period_s(), 8.0);
  EXPECT_FALSE(without.swell_period_s());
  EXPECT_LT(off_with, 0.4 * off_without);
}

TEST(PoseFilter, RefusesMisuse) {
  const auto rejects = [](auto change) {
    FilterOptions options;
    options.swell = Swell{};
    change(options);
    EXPECT_THROW(PoseFilter{options}, std::invalid_argument);
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  rejects([](FilterOptions& o) { o.acceleration = 0.0; });
  rejects([&](FilterOptions& o) { o.speed = nan; });
  rejects([](FilterOptions& o) { o.gate = 1.0; });
  rejects([](FilterOptions& o) { o.confirm = 0; });
  rejects([](FilterOptions& o) { o.coast_s = -1.0; });
  rejects([](FilterOptions& o) { o.swell->damping = 1.0; });
  rejects([&](FilterOptions& o) { o.swell->period_s = nan; });

  PoseFilter filter;
  EXPECT_THROW(filter.add(approaching(0.0), nan), std::invalid_argument);
  EXPECT_THROW(filter.add(approaching(0.0), 0.0, turned(Matrix3d::Identity())),
               std::invalid_argument);
  Pose unknown = approaching(0.0);
  unknown.covariance.reset();
  EXPECT_THROW(filter.add(unknown, 0.0), std::invalid_argument);
  Pose skewed = approaching(0.0);
  skewed.camera_T_marker.linear() *= 1.1;
  EXPECT_THROW(filter.add(skewed, 0.0), std::invalid_argument);
  EXPECT_THROW(filter.at(nan), std::invalid_argument);
  FilterOptions known;
  known.camera_known = true;
  EXPECT_THROW(PoseFilter(known).add(approaching(0.0), 0.0), std::invalid_argument);
}

TEST(Tracker, KeepsParentsApart) {
  Tracker tracker;
  for (int frame = 0; frame < 10; ++frame) {
    const double t = frame / 30.0;
    Pose one = approaching(t), other = pose({1.0, 0.0, 3.0});
    one.parent = 7;
    other.parent = 2;
    Pose unweighed = pose({0.0, 0.0, 1.0});
    unweighed.parent = 9;
    unweighed.covariance.reset();
    tracker.add({one, other, unweighed}, t);
  }
  const std::vector<Track> tracks = tracker.at(0.3);
  ASSERT_EQ(tracks.size(), 2U);
  EXPECT_EQ(tracks[0].parent, 2);
  EXPECT_NEAR(tracks[0].state.velocity.norm(), 0.0, 0.01);
  EXPECT_EQ(tracks[1].parent, 7);
  EXPECT_NEAR(tracks[1].state.velocity.z(), -1.0, 0.05);
  EXPECT_EQ(tracker.filter(9), nullptr);
  EXPECT_EQ(tracker.filter(7)->status(0.3), TrackStatus::tracking);
}

TEST(Tracker, OfAParentSeenTwiceTakesTheOneExpected) {
  Tracker tracker;
  for (int frame = 0; frame < 10; ++frame) tracker.add({approaching(frame / 30.0)}, frame / 30.0);
  tracker.add({pose({1.0, 1.0, 8.0}), approaching(1.0 / 3.0)}, 1.0 / 3.0);
  EXPECT_EQ(tracker.at(1.0 / 3.0)[0].state.measured_s, 1.0 / 3.0);
}

}  // namespace
}  // namespace harco
