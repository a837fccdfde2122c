#include "harco/deck.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include <gtest/gtest.h>
#include <Eigen/Dense>

#include "sample_decks.hpp"

namespace harco {
namespace {

using Eigen::AngleAxisd;
using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

Matrix3d turn(double roll, double pitch, double yaw) {
  return (AngleAxisd(yaw, Vector3d::UnitZ()) * AngleAxisd(pitch, Vector3d::UnitY()) *
          AngleAxisd(roll, Vector3d::UnitX()))
      .toRotationMatrix();
}

/// A tilted camera above a tilted deck.
Pose seen(const CameraState& camera, const Matrix3d& level_R_marker) {
  Pose pose;
  pose.camera_T_marker.linear() = camera.level_R_camera.transpose() * level_R_marker;
  pose.camera_T_marker.translation() = Vector3d(0.3, -0.2, 3.0);
  pose.covariance = Matrix6d::Identity();
  return pose;
}

TEST(DeckSample, IsRollPitchAndHeaveOfTheDeckWhereverTheCameraLooks) {
  CameraState camera;
  camera.level_R_camera = turn(0.2, -0.3, 1.0);
  camera.height_m = 5.0;
  Pose pose = seen(camera, turn(0.05, -0.08, 2.5));
  const Vector3d middle(0.35, 0.35, 0.0);
  // The deck's middle 4.2 m below the camera, whatever lies between.
  const Vector3d down(0.1, 0.4, 4.2);
  pose.camera_T_marker.translation() =
      camera.level_R_camera.transpose() * down - pose.camera_T_marker.linear() * middle;
  const DeckSample sample = deck_sample(pose, camera, 12.0, middle);
  EXPECT_EQ(sample.time_s, 12.0);
  EXPECT_NEAR(sample.motion[kRoll], 0.05, 1e-12);
  EXPECT_NEAR(sample.motion[kPitch], -0.08, 1e-12);
  EXPECT_NEAR(sample.motion[kHeave], 0.8, 1e-12);
}

TEST(DeckSample, CovarianceFollowsFromPoseAndCamera) {
  CameraState camera;
  camera.level_R_camera = turn(0.2, -0.3, 1.0);
  const Pose pose = seen(camera, turn(0.15, -0.28, 2.5));
  const Vector3d middle(0.35, 0.2, 0.0);
  const auto exp = [](const Vector3d& w) {
    return w.norm() > 0.0 ? AngleAxisd(w.norm(), w.normalized()).toRotationMatrix()
                          : Matrix3d::Identity().eval();
  };
  // Differences by each of: dt, w of the pose, w of the attitude, the height.
  constexpr double kStep = 1e-6;
  Eigen::Matrix<double, 3, 10> slope;
  for (int i = 0; i < 10; ++i) {
    const auto moved = [&](double step) {
      Eigen::Matrix<double, 10, 1> d = Eigen::Matrix<double, 10, 1>::Zero();
      d[i] = step;
      Pose p = pose;
      p.camera_T_marker.translation() += d.head<3>();
      p.camera_T_marker.linear() = (pose.camera_T_marker.linear() * exp(d.segment<3>(3))).eval();
      CameraState c = camera;
      c.level_R_camera = (camera.level_R_camera * exp(d.segment<3>(6))).eval();
      c.height_m += d[9];
      return deck_sample(p, c, 0.0, middle).motion;
    };
    slope.col(i) = (moved(kStep) - moved(-kStep)) / (2.0 * kStep);
  }
  Eigen::Matrix<double, 10, 10> given = Eigen::Matrix<double, 10, 10>::Zero();
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  const auto some = [&](auto block) {
    Eigen::MatrixXd half(block.rows(), block.cols());
    for (double& value : half.reshaped()) value = normal(random);
    block = half * half.transpose();
  };
  some(given.topLeftCorner<6, 6>());
  some(given.block<3, 3>(6, 6));
  given(9, 9) = 0.49;
  Pose known = pose;
  known.covariance = given.topLeftCorner<6, 6>();
  CameraState state = camera;
  state.attitude_covariance = given.block<3, 3>(6, 6);
  state.height_sd_m = 0.7;
  const Matrix3d expected = slope * given * slope.transpose();
  EXPECT_LT((deck_sample(known, state, 0.0, middle).covariance - expected).norm(),
            1e-6 * expected.norm());
}

TEST(DeckSample, RefusesWhatItCantUse) {
  Pose pose = seen({}, Matrix3d::Identity());
  EXPECT_THROW(deck_sample(pose, {}, kNaN), std::invalid_argument);
  CameraState lost;
  lost.height_m = kNaN;
  EXPECT_THROW(deck_sample(pose, lost, 0.0), std::invalid_argument);
  pose.covariance.reset();
  EXPECT_THROW(deck_sample(pose, {}, 0.0), std::invalid_argument);
}

TEST(Oscillation, IsEq19) {
  Oscillation o;
  o.epoch_s = 100.0;
  o.mean = 0.5;
  o.parts = {{2.0, kPi / 2.0, 0.0}, {1.0, kPi, kPi / 2.0}};
  // At t = 1: sin(pi/2) = 1 and sin(3 pi/2) = -1; slopes cos(pi/2) = cos(3 pi/2) = 0.
  EXPECT_NEAR(o.value(101.0), 0.5 + 2.0 - 1.0, 1e-12);
  EXPECT_NEAR(o.rate(101.0), 0.0, 1e-12);
  EXPECT_NEAR(o.rate(100.0), kPi, 1e-12);
}

TEST(Oscillation, GradientIsThatOfDifferences) {
  const Oscillation o = two_sinusoids(3.0);
  constexpr double kStep = 1e-6;
  const Eigen::VectorXd gradient = o.gradient(7.3);
  const auto parameter = [](Oscillation& of, int i) -> double& {
    if (i == 0) return of.mean;
    Sinusoid& part = of.parts[static_cast<std::size_t>((i - 1) / 3)];
    return (i - 1) % 3 == 0 ? part.amplitude : (i - 1) % 3 == 1 ? part.rate : part.phase;
  };
  ASSERT_EQ(gradient.size(), 7);
  for (int i = 0; i < 7; ++i) {
    Oscillation more = o;
    Oscillation less = o;
    parameter(more, i) += kStep;
    parameter(less, i) -= kStep;
    EXPECT_NEAR(gradient[i], (more.value(7.3) - less.value(7.3)) / (2.0 * kStep), 1e-8) << i;
  }
}

/// Parameters in the order of a fit's covariance; parts by rate, epoch as in `like`.
Eigen::VectorXd parameters(Oscillation o, const Oscillation& like) {
  std::sort(o.parts.begin(), o.parts.end(),
            [](const Sinusoid& a, const Sinusoid& b) { return a.rate < b.rate; });
  Eigen::VectorXd p(1 + 3 * o.order());
  p[0] = o.mean;
  for (int i = 0; i < o.order(); ++i) {
    const Sinusoid& part = o.parts[static_cast<std::size_t>(i)];
    p.segment<3>(1 + 3 * i) << part.amplitude, part.rate,
        part.phase + part.rate * (like.epoch_s - o.epoch_s);
  }
  return p;
}

/// Errors of a fit of two sinusoids, and their covariance in the same order (by rate).
std::pair<Eigen::VectorXd, Eigen::MatrixXd> errors(const OscillationFit& fit,
                                                   const Oscillation& truth) {
  Eigen::VectorXd error =
      parameters(fit.oscillation, fit.oscillation) - parameters(truth, fit.oscillation);
  for (int i : {3, 6}) error[i] = std::remainder(error[i], 2.0 * kPi);
  Eigen::MatrixXd covariance = fit.covariance;
  if (fit.oscillation.parts[0].rate > fit.oscillation.parts[1].rate) {
    Eigen::Matrix<int, 7, 1> order;
    order << 0, 4, 5, 6, 1, 2, 3;
    covariance = Eigen::PermutationMatrix<7>(order).inverse() * covariance *
                 Eigen::PermutationMatrix<7>(order);
  }
  return {error, covariance};
}

TEST(OscillationFit, FindsKnownParametersAtUnixTimes) {
  const double now_s = 1.7e9;
  std::mt19937_64 random(1);
  const Oscillation truth = two_sinusoids(now_s);
  const OscillationFit fit =
      fit_oscillation(samples_of(truth, now_s, now_s + 30.0, 30.0, 1e-4, random));
  ASSERT_EQ(fit.oscillation.order(), 2);
  const Eigen::VectorXd error = errors(fit, truth).first;
  EXPECT_LT(error.cwiseAbs().maxCoeff(), 1e-3);
  EXPECT_NEAR(fit.rms, 1e-4, 1e-5);
  EXPECT_NEAR(fit.scale, 1.0, 0.1);
}

TEST(OscillationFit, ErrorsAgreeWithTheCovariance) {
  constexpr int kSeeds = 40;
  double sum = 0.0;
  for (int seed = 0; seed < kSeeds; ++seed) {
    std::mt19937_64 random(static_cast<std::uint64_t>(seed));
    const Oscillation truth = two_sinusoids(5.0);
    std::vector<SeriesSample> samples = samples_of(truth, 0.0, 30.0, 10.0, 0.01, random);
    // To the fit only ratios matter: it measures the rest.
    for (SeriesSample& sample : samples) sample.sd *= 3.0;
    const OscillationFit fit = fit_oscillation(samples);
    ASSERT_EQ(fit.oscillation.order(), 2) << seed;
    EXPECT_NEAR(fit.scale, 1.0 / 3.0, 0.07);
    const auto [error, covariance] = errors(fit, truth);
    sum += error.dot(covariance.ldlt().solve(error));
  }
  // The mean of 40 values of chi-squared with 7 degrees of freedom: 7 +- 0.6.
  EXPECT_NEAR(sum / kSeeds, 7.0, 1.8);
}

TEST(OscillationFit, OrderIsThatOfTheDeck) {
  for (int order = 0; order <= 3; ++order) {
    std::mt19937_64 random(static_cast<std::uint64_t>(order));
    Oscillation truth;
    const Oscillation all = two_sinusoids();
    truth.parts = {all.parts[0], all.parts[1], {0.03, 2.0 * kPi / 11.0, 2.0}};
    truth.parts.resize(static_cast<std::size_t>(order));
    EXPECT_EQ(
        fit_oscillation(samples_of(truth, 0.0, 40.0, 10.0, 0.005, random)).oscillation.order(),
        order);
  }
}

TEST(OscillationFit, WithstandsOutliersGapsAndDisorder) {
  std::mt19937_64 random(3);
  const Oscillation truth = two_sinusoids();
  std::vector<SeriesSample> samples = samples_of(truth, 0.0, 30.0, 20.0, 0.003, random);
  samples.erase(std::remove_if(samples.begin(), samples.end(),
                               [](const SeriesSample& sample) {
                                 return sample.time_s > 9.0 && sample.time_s < 14.0;
                               }),
                samples.end());
  std::uniform_int_distribution<std::size_t> any(0, samples.size() - 1);
  for (int i = 0; i < 30; ++i) samples[any(random)].value += 0.5;  // a flipped pose
  std::shuffle(samples.begin(), samples.end(), random);
  const OscillationFit fit = fit_oscillation(samples);
  ASSERT_GE(fit.oscillation.order(), 2);
  for (double time_s = 0.0; time_s < 40.0; time_s += 0.5)
    EXPECT_NEAR(fit.oscillation.value(time_s), truth.value(time_s), 0.005) << time_s;
  EXPECT_GE(std::count(fit.outlier.begin(), fit.outlier.end(), true), 25);
  EXPECT_LE(std::count(fit.outlier.begin(), fit.outlier.end(), true), 35);
}

TEST(OscillationFit, BelievesSamplesAsTheirCovarianceSays) {
  std::mt19937_64 random(4);
  const Oscillation truth = two_sinusoids();
  std::vector<SeriesSample> samples = samples_of(truth, 0.0, 30.0, 10.0, 0.001, random);
  // Every other one is biased, and says that it is bad.
  for (std::size_t i = 0; i < samples.size(); i += 2) {
    samples[i].value += 0.05;
    samples[i].sd = 0.05;
  }
  const OscillationFit fit = fit_oscillation(samples);
  EXPECT_NEAR(fit.oscillation.mean, truth.mean, 2e-3);
}

TEST(OscillationFit, GoesOnFromAnEarlierOne) {
  std::mt19937_64 random(5);
  const Oscillation truth = two_sinusoids();
  const OscillationFit before = fit_oscillation(samples_of(truth, 0.0, 30.0, 10.0, 0.003, random));
  const OscillationFit after =
      refit_oscillation(samples_of(truth, 8.0, 38.0, 10.0, 0.003, random), before.oscillation);
  EXPECT_EQ(after.oscillation.order(), before.oscillation.order());
  EXPECT_NEAR(after.oscillation.epoch_s, 38.0, 0.2);
  for (double time_s = 38.0; time_s < 50.0; time_s += 0.5)
    EXPECT_NEAR(after.oscillation.value(time_s), truth.value(time_s), 0.003) << time_s;
}

TEST(OscillationFit, RefusesBadInput) {
  std::mt19937_64 random(6);
  const std::vector<SeriesSample> good = samples_of(two_sinusoids(), 0.0, 10.0, 10.0, 0.1, random);
  const auto refused = [&](auto change) {
    std::vector<SeriesSample> samples = good;
    OscillationOptions options;
    change(samples, options);
    EXPECT_THROW(fit_orders(samples, options), std::invalid_argument);
  };
  refused([](auto& samples, auto&) { samples.clear(); });
  refused([](auto& samples, auto&) { samples.resize(3); });
  refused([](auto& samples, auto&) { samples[5].value = kNaN; });
  refused([](auto& samples, auto&) { samples[5].time_s = kNaN; });
  refused([](auto& samples, auto&) { samples[5].sd = 0.0; });
  refused([](auto& samples, auto&) {
    for (SeriesSample& sample : samples) sample.time_s = 1.0;
  });
  refused([](auto&, auto& options) { options.max_order = 13; });
  refused([](auto&, auto& options) { options.min_period_s = 0.0; });
  refused([](auto&, auto& options) { options.max_period_s = 1.0; });
  refused([](auto&, auto& options) { options.max_iterations = 0; });
  EXPECT_NO_THROW(fit_orders({good.begin(), good.begin() + 4}));
}

TEST(FitOrders, SaysNothingWhereNumbersOverflow) {
  testing::internal::CaptureStderr();
  for (const double value : {1e150, 1e300})
    for (const double sd : {1e-300, 1e-160}) {
      std::vector<SeriesSample> samples;
      for (int i = 0; i < 60; ++i) samples.push_back({0.5 * i, value * std::sin(0.5 * i), sd});
      EXPECT_FALSE(fit_orders(samples).empty());
    }
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
}

}  // namespace
}  // namespace harco
