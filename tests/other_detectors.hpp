// What the detectors that others use read in an image.
#pragma once

#include <array>
#include <vector>

#include <Eigen/Core>

#include "harco/image.hpp"

namespace harco::test {

/// One marker as another detector reports it, put into our conventions: corners top-left,
/// top-right, bottom-right, bottom-left of the upright marker, (0, 0) the centre of the top-left
/// pixel.
struct Reading {
  int id = 0;
  std::array<Eigen::Vector2d, 4> corners{};
};

/// By cv::aruco::detectMarkers with its defaults. `dictionary` is one of OpenCV's numbers, such as
/// cv::aruco::DICT_6X6_250.
std::vector<Reading> read_by_opencv(const Image& image, int dictionary);

/// By libapriltag with its defaults, quad_decimate 2 among them. `family` is 16h5, 25h9, 36h10 or
/// 36h11.
std::vector<Reading> read_by_apriltag(const Image& image, const char* family,
                                      float quad_decimate = 2.0F);

}  // namespace harco::test
