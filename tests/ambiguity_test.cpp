// Both solutions of a small marker's pose: what the image makes of them.
#include <cmath>
#include <random>

#include <gtest/gtest.h>
#include <Eigen/Cholesky>

#include "harco/harco.hpp"
#include "lab/render.hpp"
#include "sample_markers.hpp"

namespace harco {
namespace {

using Eigen::Isometry3d;
using Vector6d = Eigen::Matrix<double, 6, 1>;

Vector6d error_of(const Isometry3d& estimate, const Isometry3d& truth) {
  const Eigen::AngleAxisd turn(estimate.linear().transpose() * truth.linear());
  Vector6d error;
  error << truth.translation() - estimate.translation(), turn.angle() * turn.axis();
  return error;
}

TEST(Ambiguity, SmallMarkersDoNotFlip) {
  constexpr double kSide = 1.6;
  constexpr double kFar = 0.2;  // radians: another solution, not noise
  const MarkerSet markers = test::three_layers();
  Detector detector(markers);
  std::mt19937_64 random(11);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  int found = 0, open = 0, corners_open = 0;
  double normalised = 0.0;
  constexpr int kFrames = 60;
  for (int frame = 0; frame < kFrames; ++frame) {
    lab::Scene scene;
    scene.camera = Camera::pinhole(200, 160, 700.0);
    const double side_px = 20.0 + 20.0 * unit(random);
    const double turn = 6.2831853;
    Isometry3d truth = lab::look_at_marker(
        {0.5 * kSide, 0.5 * kSide}, scene.camera.fx * kSide / side_px,
        20.0 / 360.0 * turn * unit(random), turn * unit(random), turn * unit(random));
    scene.parents = {{0, truth}};
    const Image image = lab::render(scene, markers, random());
    const auto detections = detector.detect(image.view());
    PoseOptions corners_only;
    corners_only.align = false;
    const auto corners =
        estimate_poses(image.view(), detections, markers, scene.camera, corners_only);
    const auto poses = estimate_poses(image.view(), detections, markers, scene.camera);
    if (poses.empty()) continue;
    ++found;
    corners_open += corners[0].alternative ? 1 : 0;
    open += poses[0].alternative ? 1 : 0;
    for (const Pose& pose : {corners[0], poses[0]}) {
      const double off = error_of(pose.camera_T_marker, truth).tail<3>().norm();
      const double other =
          pose.alternative ? error_of(*pose.alternative, truth).tail<3>().norm() : off;
      EXPECT_LT(std::min(off, other), kFar) << frame;
    }
    const Vector6d error = error_of(poses[0].camera_T_marker, truth);
    normalised += error.dot(poses[0].covariance->ldlt().solve(error));
  }
  EXPECT_GE(found, kFrames * 9 / 10);
  // The image decides what corners leave open.
  EXPECT_GT(corners_open, 0);
  EXPECT_LT(open, corners_open);
  EXPECT_LE(open, kFrames / 10);
  EXPECT_GT(normalised / found, 4.0);
  EXPECT_LT(normalised / found, 8.5);
}

}  // namespace
}  // namespace harco
