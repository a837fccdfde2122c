// The README's C++ program on a picture that it draws itself: the marker, seen straight from above.
#include <cmath>
#include <iostream>

#include <harco/harco.hpp>

namespace {

constexpr const char* kMarkers = R"({"format": "harco-markers", "version": 1,
  "cells": 5, "line": {"inside": 0, "outside": 0.0714},
  "parents": [{"id": 4, "side_m": 0.5, "code": "1010101100111010011011011", "children": []}]})";

}  // namespace

int main() {
  const auto markers = harco::parse_markers(kMarkers);
  const harco::Raster drawn = harco::raster(markers, 0);
  const auto camera = harco::Camera::pinhole(drawn.image.width, drawn.image.height, 1000.0);

  harco::Detector detector(markers);
  const auto image = drawn.image.view();
  const auto detections = detector.detect(image);
  int right = 0;
  for (const auto& pose : harco::estimate_poses(image, detections, markers, camera)) {
    const Eigen::Vector3d t = pose.camera_T_marker.translation();
    std::cout << "marker " << pose.parent << " at " << t.transpose() << " m\n";
    const double distance = 1000.0 / drawn.pixels_per_metre;
    if (pose.parent == 4 && std::abs(t.z() - distance) < 0.01 * distance) ++right;
  }
  return right == 1 ? 0 : 1;
}
