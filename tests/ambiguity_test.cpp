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

/// A marker's corners as `truth` puts them, each coordinate wrong by up to `wrong_px`.
Detection seen_at(const Isometry3d& truth, const PlacedMarker& marker, int placed,
                  const Camera& camera, double wrong_px, std::mt19937_64& random) {
  std::uniform_real_distribution<double> wrong(-wrong_px, wrong_px);
  Detection seen;
  seen.placed = placed;
  seen.id = marker.id;
  seen.layer = marker.layer;
  const auto corners = marker.corners_m();
  for (std::size_t i = 0; i < 4; ++i) {
    const Eigen::Vector3d point = truth * Eigen::Vector3d(corners[i].x(), corners[i].y(), 0.0);
    seen.corners[i] = *camera.project(point);
    seen.corners[i].x() += wrong(random);
    seen.corners[i].y() += wrong(random);
  }
  seen.corner_covariance = 0.04 * Matrix8d::Identity();
  return seen;
}

TEST(Ambiguity, OneSmallChildLeadsToThePoseOfWhatIsInView) {
  constexpr double kSide = 1.6;
  const MarkerSet markers = test::three_layers();
  const std::vector<PlacedMarker> placed = place(markers);
  int child = 0;
  while (placed[static_cast<std::size_t>(child)].id != 3) ++child;
  const Camera camera = Camera::pinhole(240, 180, 700.0);
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  for (int frame = 0; frame < 12; ++frame) {
    // The child is some 17 px wide, and about half of the parent is out of view.
    const double tilt = 0.6 * unit(random), around = 6.28 * unit(random);
    Isometry3d truth = lab::look_at_marker({0.5 * kSide, 0.5 * kSide}, 700.0 * kSide / 120.0, tilt,
                                           around, 6.28 * unit(random));
    truth.translation().x() += 0.9 * kSide;
    lab::Scene scene;
    scene.camera = camera;
    scene.parents = {{0, truth}};
    const Image image = lab::render(scene, markers, random());
    const Detection seen =
        seen_at(truth, placed[static_cast<std::size_t>(child)], child, camera, 0.7, random);
    const auto poses = estimate_poses(image.view(), {seen}, markers, camera);
    ASSERT_EQ(poses.size(), 1U);
    const Vector6d error = error_of(poses[0].camera_T_marker, truth);
    EXPECT_TRUE(poses[0].aligned) << frame;
    EXPECT_LT(error.tail<3>().norm(), 0.01) << frame;
    EXPECT_LT(error.head<3>().norm(), 0.002 * truth.translation().norm()) << frame;
  }
}

TEST(Ambiguity, ShadowsDoNotFlip) {
  constexpr double kSide = 1.6;
  const MarkerSet markers = test::three_layers();
  const std::vector<PlacedMarker> placed = place(markers);
  const Camera camera = Camera::pinhole(120, 100, 700.0);
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  for (int frame = 0; frame < 20; ++frame) {
    const double tilt = 0.2 + 0.5 * unit(random), around = 6.28 * unit(random);
    lab::Scene scene;
    scene.camera = camera;
    scene.parents = {{0, lab::look_at_marker({0.5 * kSide, 0.5 * kSide}, 700.0 * kSide / 36.0, tilt,
                                             around, 6.28 * unit(random))}};
    const Isometry3d& truth = scene.parents[0].camera_T_marker;
    lab::FloatImage exact = lab::render_exact(scene, markers);
    const double way = 6.28 * unit(random), off = 10.0 * (unit(random) - 0.5);
    for (int y = 0; y < exact.height; ++y)
      for (int x = 0; x < exact.width; ++x)
        if (std::cos(way) * (x - camera.cx) + std::sin(way) * (y - camera.cy) > off)
          exact.row(y)[x] *= 0.45F;
    const Image image = lab::expose(exact, scene.noise_sigma, random());
    const Detection seen = seen_at(truth, placed[0], 0, camera, 0.8, random);
    const auto poses = estimate_poses(image.view(), {seen}, markers, camera);
    ASSERT_EQ(poses.size(), 1U);
    const Vector6d error = error_of(poses[0].camera_T_marker, truth);
    if (poses[0].alternative) {
      EXPECT_LT(error.dot(poses[0].covariance->ldlt().solve(error)), 22.5) << frame;
    } else {
      EXPECT_LT(error.tail<3>().norm(), 0.1) << frame;
    }
  }
}

}  // namespace
}  // namespace harco
