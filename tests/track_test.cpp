#include "harco/track.hpp"

#include <cmath>
#include <limits>
#include <stdexcept>

#include <gtest/gtest.h>

namespace harco {
namespace {

using Eigen::AngleAxisd;
using Eigen::Vector3d;

Detection detection(int placed, int bit_errors = 0, bool tentative = false) {
  Detection d;
  d.placed = placed;
  d.bit_errors = bit_errors;
  d.tentative = tentative;
  return d;
}

TEST(Memory, ConfirmsWhatWasSeenInMoreThanBOfTheLastCFrames) {
  MemoryOptions options;
  options.a = 2;
  options.b = 2;
  options.c = 4;
  Memory memory(options);
  const Detection tentative = detection(7, 2, true);
  EXPECT_TRUE(memory.confirm({tentative}).empty());
  EXPECT_EQ(memory.confirm({detection(7)}).size(), 1U);
  EXPECT_EQ(memory.confirm({detection(7)}).size(), 1U);
  EXPECT_TRUE(memory.confirm({tentative}).empty());  // seen in two frames only
  EXPECT_EQ(memory.confirm({detection(7)}).size(), 1U);
  // Of the last four frames, three saw it. It comes back as a detection like any other.
  const std::vector<Detection> confirmed = memory.confirm({detection(1), tentative});
  ASSERT_EQ(confirmed.size(), 2U);
  EXPECT_EQ(confirmed[1].placed, 7);
  EXPECT_FALSE(confirmed[1].tentative);
}

TEST(Memory, CountsFramesNotDetectionsAndForgets) {
  MemoryOptions options;
  options.b = 1;
  options.c = 3;
  Memory memory(options);
  memory.confirm({detection(7), detection(7)});  // seen twice, in one frame
  EXPECT_TRUE(memory.confirm({detection(7, 2, true)}).empty());
  memory.confirm({detection(7)});
  EXPECT_EQ(memory.confirm({detection(7, 2, true)}).size(), 1U);  // frames: 1, -, 1
  memory.confirm({});
  memory.confirm({});
  EXPECT_TRUE(memory.confirm({detection(7, 2, true)}).empty());  // frames: 1, -, -
}

TEST(Memory, BelievesAtMostAWrongBits) {
  MemoryOptions options;
  options.a = 2;
  options.b = 0;
  Memory memory(options);
  memory.confirm({detection(7)});
  EXPECT_TRUE(memory.confirm({detection(7, 3, true)}).empty());
  EXPECT_EQ(memory.confirm({detection(7, 2, true)}).size(), 1U);
  EXPECT_TRUE(memory.confirm({detection(8, 2, true)}).empty());  // another marker
}

TEST(Memory, RefusesImpossibleRules) {
  for (const MemoryOptions& options :
       {MemoryOptions{-1, 3, 10}, MemoryOptions{3, -1, 10}, MemoryOptions{3, 3, 0}})
    EXPECT_THROW(Memory{options}, std::invalid_argument);
}

Pose pose(int parent, const Vector3d& translation, double turn_z = 0.0) {
  Pose p;
  p.parent = parent;
  p.camera_T_marker.translation() = translation;
  p.camera_T_marker.linear() = AngleAxisd(turn_z, Vector3d::UnitZ()).toRotationMatrix();
  p.covariance = Matrix6d::Identity();
  return p;
}

/// A marker tilted by `tilt` or by its mirrored tilt, `ratio` for the first.
Pose undecided(double tilt, double ratio) {
  Pose pose;
  pose.camera_T_marker.linear() = AngleAxisd(tilt, Vector3d::UnitX()).toRotationMatrix();
  pose.camera_T_marker.translation() = Vector3d(0.0, 0.0, 30.0);
  pose.alternative = pose.camera_T_marker;
  pose.alternative->linear() = AngleAxisd(-tilt, Vector3d::UnitX()).toRotationMatrix();
  pose.log_likelihood_ratio = ratio;
  pose.covariance = 1e-4 * Matrix6d::Identity();
  (*pose.covariance)(3, 3) += 4.0 * tilt * tilt / (1.0 + std::exp(ratio));
  return pose;
}

double tilt_of(const Pose& pose) {
  return std::atan2(pose.camera_T_marker.linear()(2, 1), pose.camera_T_marker.linear()(1, 1));
}

TEST(Continuity, KeepsAMarkerFromFlipping) {
  Continuity continuity;
  std::vector<Pose> decided{undecided(0.4, 0.0)};
  decided[0].alternative.reset();
  decided[0].log_likelihood_ratio.reset();
  continuity.decide(decided, 0.0);
  EXPECT_FALSE(decided[0].alternative);
  // The next frame leans the wrong way, a little.
  std::vector<Pose> next{undecided(-0.4, 0.5)};
  continuity.decide(next, 0.03);
  EXPECT_NEAR(tilt_of(next[0]), 0.4, 1e-9);
  ASSERT_TRUE(next[0].alternative);
  EXPECT_NEAR(*next[0].log_likelihood_ratio, 0.8 * 6.0 - 0.5, 1e-6);
  // Its covariance is what it would be had it known at once.
  EXPECT_NEAR((*next[0].covariance)(3, 3),
              1e-4 + 4.0 * 0.16 / (1.0 + std::exp(*next[0].log_likelihood_ratio)), 1e-9);
  // Strong evidence of its own is not overruled.
  std::vector<Pose> strong{undecided(-0.4, 5.5)};
  continuity.decide(strong, 0.06);
  EXPECT_NEAR(tilt_of(strong[0]), -0.4, 1e-9);
}

TEST(Continuity, SeveralFramesDecideWhatOneLeavesOpen) {
  Continuity continuity;
  bool decided = false;
  for (int frame = 0; frame < 12 && !decided; ++frame) {
    std::vector<Pose> poses{undecided(0.4, 2.0)};
    continuity.decide(poses, 0.033 * frame);
    EXPECT_NEAR(tilt_of(poses[0]), 0.4, 1e-9);
    decided = !poses[0].alternative;
    EXPECT_FALSE(decided && frame < 2);
  }
  EXPECT_TRUE(decided);
  // After a second out of sight it starts anew.
  std::vector<Pose> later{undecided(-0.4, 2.0)};
  continuity.decide(later, 3.0);
  EXPECT_NEAR(*later[0].log_likelihood_ratio, 2.0, 1e-12);
  // So does all when time runs backwards.
  std::vector<Pose> earlier{undecided(-0.4, 1.0)};
  continuity.decide(earlier, 2.0);
  EXPECT_NEAR(*earlier[0].log_likelihood_ratio, 1.0, 1e-12);
}

TEST(LowPass, AnswersAStepAsAFirstOrderFilterDoes) {
  LowPass filter(0.5);
  filter.filter({pose(3, {0, 0, 1}, 0.0)}, 10.0);
  const double share = 1.0 - std::exp(-0.2 / 0.5);
  const Pose one = filter.filter({pose(3, {1, 0, 2}, 0.4)}, 10.2).at(0);
  EXPECT_LT((one.camera_T_marker.translation() - Vector3d(share, 0, 1 + share)).norm(), 1e-12);
  EXPECT_LT(
      (one.camera_T_marker.linear() - AngleAxisd(0.4 * share, Vector3d::UnitZ()).toRotationMatrix())
          .norm(),
      1e-12);
  EXPECT_FALSE(one.covariance);
  // Two steps of 0.2 s go as far as one of 0.4 s.
  const Pose two = filter.filter({pose(3, {1, 0, 2}, 0.4)}, 10.4).at(0);
  EXPECT_NEAR(two.camera_T_marker.translation().x(), 1.0 - std::exp(-0.4 / 0.5), 1e-12);
}

TEST(LowPass, KeepsParentsAndCopiesApart) {
  LowPass filter(1.0);
  filter.filter({pose(3, {0, 0, 1}), pose(3, {5, 0, 1}), pose(8, {9, 0, 1})}, 0.0);
  const auto filtered =
      filter.filter({pose(8, {9, 0, 1}), pose(3, {5.5, 0, 1}), pose(3, {0.5, 0, 1})}, 1.0);
  const double share = 1.0 - std::exp(-1.0);
  EXPECT_NEAR(filtered.at(0).camera_T_marker.translation().x(), 9.0, 1e-12);
  EXPECT_NEAR(filtered.at(1).camera_T_marker.translation().x(), 5.0 + 0.5 * share, 1e-12);
  EXPECT_NEAR(filtered.at(2).camera_T_marker.translation().x(), 0.5 * share, 1e-12);
}

TEST(LowPass, StartsAnewAfterTenTimeConstants) {
  LowPass filter(0.1);
  filter.filter({pose(3, {0, 0, 1})}, 0.0);
  filter.filter({}, 0.9);
  EXPECT_LT(filter.filter({pose(3, {1, 0, 1})}, 0.95).at(0).camera_T_marker.translation().x(), 1.0);
  EXPECT_EQ(filter.filter({pose(3, {2, 0, 1})}, 2.0).at(0).camera_T_marker.translation().x(), 2.0);
}

TEST(LowPass, WithoutATimeConstantNothingIsFiltered) {
  LowPass filter(0.0);
  filter.filter({pose(3, {0, 0, 1})}, 0.0);
  const Pose same = filter.filter({pose(3, {1, 0, 1})}, 0.01).at(0);
  EXPECT_EQ(same.camera_T_marker.translation().x(), 1.0);
  EXPECT_TRUE(same.covariance);
}

TEST(LowPass, RefusesImpossibleTimes) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(LowPass(-1.0), std::invalid_argument);
  EXPECT_THROW(LowPass{kNan}, std::invalid_argument);
  LowPass filter(0.1);
  EXPECT_THROW(filter.filter({}, kNan), std::invalid_argument);
  filter.filter({pose(3, {0, 0, 1})}, 5.0);
  EXPECT_THROW(filter.filter({pose(3, {0, 0, 1})}, 4.0), std::invalid_argument);
}

}  // namespace
}  // namespace harco
