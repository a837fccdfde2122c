// The README's C++ program. It draws what it looks at itself: the marker, seen straight from above.
#include <cmath>
#include <iostream>

#include <harco/harco.hpp>

namespace {

constexpr const char* kMarkers = R"({"format": "harco-markers", "version": 1,
  "cells": 5, "line": {"inside": 0, "outside": 0.0714},
  "parents": [{"id": 4, "side_m": 0.5, "code": "1010101100111010011011011", "children": []}]})";
constexpr double kFocal_px = 1000.0;

/// Writes markers.json and camera.yaml.
harco::Raster prepare() {
  const auto markers = harco::parse_markers(kMarkers);
  harco::save_markers(markers, "markers.json");
  const auto drawn = harco::raster(markers, 0);
  harco::save_camera(harco::Camera::pinhole(drawn.image.width, drawn.image.height, kFocal_px),
                     "camera.yaml");
  return drawn;
}

}  // namespace

int main() {
  const auto drawn = prepare();

  const auto markers = harco::load_markers("markers.json");
  const auto camera = harco::load_camera("camera.yaml");
  harco::Detector detector(markers, camera);

  const auto image = drawn.image.view();
  const auto detections = detector.detect(image);
  const auto poses = harco::PoseEstimator(markers).estimate(image, detections, camera);
  for (const auto& pose : poses)
    std::cout << pose.camera_T_marker.translation().transpose() << "\n";

  const double distance = kFocal_px / drawn.pixels_per_metre;
  const bool right =
      poses.size() == 1 && poses[0].parent == 4 &&
      std::abs(poses[0].camera_T_marker.translation().z() - distance) < 0.01 * distance;
  return right ? 0 : 1;
}
