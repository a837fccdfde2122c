// Light that falls off across a marker must not move its corners.
#include <cmath>
#include <numbers>
#include <random>

#include <gtest/gtest.h>

#include "harco/harco.hpp"
#include "lab/render.hpp"

namespace harco {
namespace {

MarkerSet two_layers() {
  DictionaryOptions options;
  options.child_cells = {quincunx(5)};
  options.child_distance = 5;  // soon found
  return build_markers(generate_dictionary(options), 1.0);
}

TEST(UnevenLight, MovesNoCorner) {
  const MarkerSet markers = two_layers();
  for (int turn = 0; turn < 8; ++turn) {
    SCOPED_TRACE(turn);
    lab::Scene scene;
    scene.camera = Camera::pinhole(640, 480, 600.0);
    const Eigen::Isometry3d pose =
        lab::look_at_marker({0.5, 0.5}, 2.2, 0.4, turn, turn * std::numbers::pi / 4);
    scene.parents.push_back({0, pose});
    scene.gain_left = 0.6;
    scene.gain_right = 1.1;

    Detector detector(markers);
    const auto detections = detector.detect(lab::render(scene, markers, 1).view());
    ASSERT_EQ(detections.size(), 6U);
    for (const Detection& seen : detections) {
      const auto corners = detector.placed()[static_cast<std::size_t>(seen.placed)].corners_m();
      for (std::size_t i = 0; i < 4; ++i) {
        const auto at =
            scene.camera.project(pose * Eigen::Vector3d(corners[i].x(), corners[i].y(), 0.0));
        EXPECT_LT((seen.corners[i] - *at).norm(), seen.layer == 1 ? 0.12 : 0.25)
            << "layer " << seen.layer << " corner " << i;
      }
    }
  }
}

TEST(UnevenLight, OfAShadowsEdgeHidesNoSmallMarker) {
  // Sixty pixels large: too small for its children, and for what is done for covered ones.
  const MarkerSet markers = two_layers();
  Detector detector(markers);
  std::mt19937_64 random(7);
  const auto between = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  constexpr int kScenes = 60;
  int found = 0;
  for (int i = 0; i < kScenes; ++i) {
    lab::Scene scene;
    scene.camera = Camera::pinhole(640, 480, 600.0);
    scene.black = between(15.0, 45.0);
    const double tilt = between(0.0, 0.8);
    const double towards = between(0.0, 6.28);
    const double turn = between(0.0, 6.28);
    const Eigen::Isometry3d pose = lab::look_at_marker({0.5, 0.5}, 10.0, tilt, towards, turn);
    scene.parents.push_back({0, pose});
    lab::FloatImage light = lab::render_exact(scene, markers);
    // A shadow with a straight edge that crosses the marker.
    const double shade = between(0.35, 0.7);
    const double way = between(0.0, 6.28);
    const double off = between(-20.0, 20.0);
    for (int y = 0; y < light.height; ++y)
      for (int x = 0; x < light.width; ++x)
        if ((x - 320) * std::cos(way) + (y - 240) * std::sin(way) > off)
          light.row(y)[x] *= static_cast<float>(shade);
    for (const Detection& seen : detector.detect(lab::expose(light, 2.0, random()).view())) {
      if (seen.layer != 1) continue;
      ++found;
      for (const Eigen::Vector2d& corner : seen.corners)
        EXPECT_LT((corner - Eigen::Vector2d(320, 240)).norm(), 50.0) << "scene " << i;
      const auto corner = scene.camera.project(pose.translation());
      EXPECT_LT((seen.corners[0] - *corner).norm(), 1.0) << "scene " << i;
    }
  }
  EXPECT_GE(found, kScenes * 9 / 10);
}

}  // namespace
}  // namespace harco
