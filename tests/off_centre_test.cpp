// A camera that aims beside the centre of the sheet, from far to so near that it sees a few cells
// only: a pose in every frame.
#include <cmath>
#include <numbers>
#include <random>

#include <gtest/gtest.h>

#include "harco/harco.hpp"
#include "lab/render.hpp"

namespace harco {
namespace {

TEST(OffCentre, CarpetGivesAPoseFromNearToFar) {
  constexpr double kSide = 1.6;
  constexpr int kFrames = 14;
  CodeSearch search;
  search.effort = 0.05;
  const MarkerSet markers = generate_codes(without_codes(carpet(5), 1, kSide), search).markers;
  const Camera camera = Camera::pinhole(750, 480, 700.0);
  ViewOptions view;
  view.width_px = camera.width;
  view.height_px = camera.height;
  view.focal_px = camera.fx;
  const DistanceRange range = range_in_view(markers, view);
  EXPECT_GT(range.farthest_m / range.nearest_m, 400.0);

  Detector detector(markers, camera);
  for (int i = 0; i < kFrames; ++i) {
    std::mt19937_64 random(static_cast<std::uint64_t>(i));
    std::uniform_real_distribution<double> unit(0.0, 1.0);
    const double distance =
        range.nearest_m * std::pow(range.farthest_m / range.nearest_m, i / (kFrames - 1.0));
    const Eigen::Vector2d aim(0.15 + 0.7 * unit(random), 0.15 + 0.7 * unit(random));
    const Eigen::Isometry3d truth = lab::look_at_marker(kSide * aim, distance, 0.3 * unit(random),
                                                        2.0 * std::numbers::pi * unit(random),
                                                        2.0 * std::numbers::pi * unit(random));
    lab::Scene scene;
    scene.camera = camera;
    scene.parents = {{0, truth}};
    const Image image = lab::render(scene, markers, random());
    const auto poses = estimate_poses(image.view(), detector.detect(image.view()), markers, camera);
    ASSERT_EQ(poses.size(), 1U) << distance << " m";
    const Eigen::Isometry3d& pose = poses.front().camera_T_marker;
    EXPECT_LT((pose.translation() - truth.translation()).norm(), 0.003 * truth.translation().norm())
        << distance << " m";
  }
}

}  // namespace
}  // namespace harco
