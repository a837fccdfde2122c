#include "other_detectors.hpp"

#include <memory>
#include <stdexcept>
#include <string>

#include <apriltag/apriltag.h>
#include <apriltag/tag16h5.h>
#include <apriltag/tag25h9.h>
#include <apriltag/tag36h10.h>
#include <apriltag/tag36h11.h>
#include <opencv2/aruco.hpp>
#include <opencv2/core.hpp>

namespace harco::test {
namespace {

using Family = std::unique_ptr<apriltag_family_t, void (*)(apriltag_family_t*)>;

Family make_family(const std::string& name) {
  if (name == "16h5") return {tag16h5_create(), tag16h5_destroy};
  if (name == "25h9") return {tag25h9_create(), tag25h9_destroy};
  if (name == "36h10") return {tag36h10_create(), tag36h10_destroy};
  if (name == "36h11") return {tag36h11_create(), tag36h11_destroy};
  throw std::invalid_argument("no family " + name);
}

}  // namespace

std::vector<Reading> read_by_opencv(const Image& image, int dictionary) {
  cv::Mat grey(image.height, image.width, CV_8U);
  std::copy(image.pixels.begin(), image.pixels.end(), grey.begin<unsigned char>());
  std::vector<std::vector<cv::Point2f>> corners;
  std::vector<int> ids;
  cv::aruco::detectMarkers(grey, cv::aruco::getPredefinedDictionary(dictionary), corners, ids);
  std::vector<Reading> readings;
  for (std::size_t i = 0; i < ids.size(); ++i) {
    Reading& reading = readings.emplace_back();
    reading.id = ids[i];
    for (std::size_t k = 0; k < 4; ++k)
      reading.corners[k] = Eigen::Vector2f(corners[i][k].x, corners[i][k].y).cast<double>();
  }
  return readings;
}

std::vector<Reading> read_by_apriltag(const Image& image, const char* family_name,
                                      float quad_decimate) {
  const Family family = make_family(family_name);
  const std::unique_ptr<apriltag_detector_t, void (*)(apriltag_detector_t*)> detector{
      apriltag_detector_create(), apriltag_detector_destroy};
  apriltag_detector_add_family(detector.get(), family.get());
  detector->quad_decimate = quad_decimate;

  std::vector<std::uint8_t> pixels = image.pixels;
  image_u8_t picture{image.width, image.height, image.width, pixels.data()};
  zarray_t* found = apriltag_detector_detect(detector.get(), &picture);
  std::vector<Reading> readings;
  for (int i = 0; i < zarray_size(found); ++i) {
    apriltag_detection_t* tag = nullptr;
    zarray_get(found, i, static_cast<void*>(&tag));
    Reading& reading = readings.emplace_back();
    reading.id = tag->id;
    // Theirs run bottom-left, bottom-right, top-right, top-left; pixel centres are at a half.
    for (std::size_t k = 0; k < 4; ++k)
      reading.corners[k] = Eigen::Vector2d(tag->p[3 - k][0] - 0.5, tag->p[3 - k][1] - 0.5);
  }
  apriltag_detections_destroy(found);
  return readings;
}

}  // namespace harco::test
