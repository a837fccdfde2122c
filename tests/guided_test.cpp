// Detection where markers are expected: the same markers, more cheaply.
#include "harco/guided.hpp"

#include <algorithm>
#include <set>
#include <stdexcept>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "harco/pose.hpp"
#include "lab/render.hpp"

namespace harco {
namespace {

/// Two parents of 0.3 m, one of them with a child, before a lens that bends lines.
class Guided : public ::testing::Test {
 protected:
  Guided() {
    Parent one, other;
    one.side_m = other.side_m = 0.3;
    one.marker.id = 4;
    one.marker.code = parse_code("1010100010111000011010101");
    other.marker.id = 6;
    other.marker.code = parse_code("0110111010001011110000110");
    Marker child;
    child.id = 7;
    child.cell = 0;
    child.code = parse_code("1101110110111111110111111");
    one.marker.children.push_back(child);
    markers_.parents = {one, other};
    camera_ = Camera::pinhole(640, 480, 500.0);
    camera_.coefficients = {-0.15, 0.03};
    options_.camera = camera_;
  }

  Eigen::Isometry3d first_pose(int frame) const {
    return lab::look_at_marker({0.4, 0.2}, 1.5 - 0.01 * frame, 0.4, 0.3 + 0.01 * frame, 0.2);
  }

  /// The second marker stands in the other corner from frame `from` on.
  Image frame(int number, int from = 1000) const {
    lab::Scene scene;
    scene.camera = camera_;
    scene.parents.push_back({0, first_pose(number)});
    if (number >= from)
      scene.parents.push_back({1, lab::look_at_marker({-0.5, -0.35}, 1.6, 0.2, 0.0, 0.1)});
    return lab::render(scene, markers_, static_cast<std::uint64_t>(number));
  }

  std::vector<Pose> poses(const Image& image, const std::vector<Detection>& detections) const {
    PoseOptions corners;
    corners.align = false;
    return estimate_poses(image.view(), detections, markers_, camera_, corners);
  }

  MarkerSet markers_;
  Camera camera_;
  DetectorOptions options_;
};

TEST_F(Guided, ARegionShowsWhatTheImageShowsThere) {
  const Image image = frame(0);
  Detector detector(markers_, options_);
  const std::vector<Detection> all = detector.detect(image.view());
  ASSERT_EQ(all.size(), 2U);
  Eigen::Vector2d low(640.0, 480.0), high(0.0, 0.0);
  for (const Eigen::Vector2d& corner : all[0].corners) {
    low = low.cwiseMin(corner);
    high = high.cwiseMax(corner);
  }
  Region region;
  region.x = static_cast<int>(low.x() - 24.0) / 32 * 32;
  region.y = static_cast<int>(low.y() - 24.0) / 32 * 32;
  region.width = std::min(640, static_cast<int>(high.x() + 56.0) / 32 * 32) - region.x;
  region.height = std::min(480, static_cast<int>(high.y() + 56.0) / 32 * 32) - region.y;
  const std::vector<Detection> part = detector.detect(image.view(), region);
  ASSERT_EQ(part.size(), all.size());
  for (std::size_t i = 0; i < all.size(); ++i) {
    EXPECT_EQ(part[i].placed, all[i].placed);
    for (std::size_t c = 0; c < 4; ++c)
      EXPECT_LT((part[i].corners[c] - all[i].corners[c]).norm(), 0.01);
  }
  // The region leaves no trace in the detector.
  const std::vector<Detection> again = detector.detect(image.view());
  EXPECT_EQ(again[0].corners[0], all[0].corners[0]);

  // Nothing below the smallest side is looked for.
  region.min_side_px = 1000.0;
  EXPECT_TRUE(detector.detect(image.view(), region).empty());
  for (const auto& [x, width] : {std::pair{-1, 10}, {0, 0}, {600, 41}, {2147483647, 2}})
    EXPECT_THROW(detector.detect(image.view(), Region{x, 0, width, 10, 0.0}),
                 std::invalid_argument);
}

TEST_F(Guided, LooksWhereTheMarkerIsExpectedAndLosesNothing) {
  GuidedDetector guided(markers_, options_);
  Detector plain(markers_, options_);
  Tracker tracker;
  int parts = 0;
  for (int number = 0; number < 24; ++number) {
    const double time = number / 30.0;
    const Image image = frame(number);
    const std::vector<Detection> found = guided.detect(image.view(), tracker.at(time));
    parts += guided.searched_all() ? 0 : 1;
    const std::vector<Detection> all = plain.detect(image.view());
    ASSERT_EQ(found.size(), all.size()) << number;
    for (std::size_t i = 0; i < all.size(); ++i)
      EXPECT_LT((found[i].corners[0] - all[i].corners[0]).norm(), 0.02) << number;
    tracker.add(poses(image, found), time);
  }
  EXPECT_GE(parts, 18);  // three frames make a track, then nine of ten
}

TEST_F(Guided, FindsASecondMarkerWithinTenFrames) {
  GuidedDetector guided(markers_, options_);
  Tracker tracker;
  constexpr int kEnters = 14;
  int found_at = 0;
  for (int number = 0; number < kEnters + GuideOptions{}.full_every && found_at == 0; ++number) {
    const double time = number / 30.0;
    const Image image = frame(number, kEnters);
    const std::vector<Detection> found = guided.detect(image.view(), tracker.at(time));
    tracker.add(poses(image, found), time);
    for (const Detection& detection : found)
      if (detection.parent == 6) found_at = number;
  }
  EXPECT_GE(found_at, kEnters);
}

TEST_F(Guided, SearchesEverywhereWhereTheMarkerIsNotAsExpected) {
  GuidedDetector guided(markers_, options_);
  Tracker tracker;
  for (int number = 0; number < 5; ++number) {
    const Image image = frame(number);
    tracker.add(poses(image, guided.detect(image.view(), tracker.at(number / 30.0))),
                number / 30.0);
  }
  // It has jumped: found in the same frame.
  lab::Scene scene;
  scene.camera = camera_;
  scene.parents.push_back({0, lab::look_at_marker({-0.3, -0.2}, 1.5, 0.1, 0.0, 0.0)});
  const Image image = lab::render(scene, markers_, 1);
  EXPECT_EQ(guided.detect(image.view(), tracker.at(5 / 30.0)).size(), 2U);
  EXPECT_TRUE(guided.searched_all());
}

TEST_F(Guided, ExpectsARegionAroundTheMarkerThatGrowsWithDoubt) {
  Track track;
  track.parent = 4;
  track.state.status = TrackStatus::tracking;
  track.state.camera_T_marker =
      Eigen::Translation3d(-0.15, -0.15, 2.0) * Eigen::Isometry3d::Identity();
  const Camera pinhole = Camera::pinhole(640, 480, 500.0);
  const auto small = expected_region({track}, markers_, pinhole);
  ASSERT_TRUE(small);
  // The square with its rim: 0.42 m at 2 m are 105 px about the middle, and 8 px more.
  EXPECT_LE(small->x, 319.5 - 52.5 - 8.0);
  EXPECT_GT(small->x, 319.5 - 52.5 - 8.0 - 32.0);
  EXPECT_GE(small->x + small->width, 319.5 + 52.5 + 8.0);
  EXPECT_EQ(small->x % 32, 0);
  EXPECT_NEAR(small->min_side_px, 0.6 * 75.0 / 7.0, 0.1);  // a child of a seventh
  track.state.covariance.topLeftCorner<2, 2>().diagonal().setConstant(0.01);
  const auto large = expected_region({track}, markers_, pinhole);
  EXPECT_GT(large->width, small->width + 150);

  track.state.status = TrackStatus::coasting;
  EXPECT_FALSE(expected_region({track}, markers_, pinhole));
  track.state.status = TrackStatus::tracking;
  track.state.camera_T_marker.translation().z() = -1.0;
  EXPECT_FALSE(expected_region({track}, markers_, pinhole));
  EXPECT_FALSE(expected_region({}, markers_, pinhole));
  EXPECT_THROW(GuidedDetector(markers_, DetectorOptions{}), std::invalid_argument);
}

}  // namespace
}  // namespace harco
