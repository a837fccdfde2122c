// ArUco's dictionaries by name; part of the module harco_opencv.so.
#pragma once

#include <string>

#include <opencv2/aruco.hpp>

namespace harco::cli {

/// `name` is 4x4_50 … 7x7_1000, original, mip_36h12 where OpenCV has it; OpenCV's own spelling,
/// DICT_4X4_50, is understood too. Throws std::invalid_argument, saying what there is.
cv::Ptr<cv::aruco::Dictionary> aruco_dictionary(const std::string& name);

}  // namespace harco::cli
