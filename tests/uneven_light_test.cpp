// Light that falls off across a marker must not move its corners.
#include <numbers>

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

}  // namespace
}  // namespace harco
