#include "lab/experiments/picture.hpp"

#include <array>
#include <cmath>
#include <cstdint>
#include <string_view>

#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

namespace harco::lab {
namespace {

constexpr int kQuality = 70;  // of the JPEG

// BGR, from layer 1 on; further layers begin anew.
const std::array<cv::Scalar, 3> kLayers{cv::Scalar(40, 90, 255), cv::Scalar(80, 200, 60),
                                        cv::Scalar(255, 160, 40)};

std::string base64(const std::vector<std::uint8_t>& bytes) {
  constexpr std::string_view kDigits =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t group = 0;
    for (std::size_t k = 0; k < 3; ++k)
      group = group << 8U | (i + k < bytes.size() ? bytes[i + k] : 0U);
    for (std::size_t k = 0; k < 4; ++k)
      out += i + k <= bytes.size() ? kDigits[group >> (18U - 6U * k) & 63U] : '=';
  }
  return out;
}

}  // namespace

Picture picture_of(const ImageView& image, const std::string& label,
                   const std::vector<Detection>& detections, int width_px) {
  // OpenCV doesn't write to it.
  const cv::Mat grey(image.height(), image.width(), CV_8U, const_cast<std::uint8_t*>(image.row(0)),
                     static_cast<std::size_t>(image.stride()));
  const double scale = static_cast<double>(width_px) / image.width();
  cv::Mat small, colour;
  cv::resize(grey, small, {width_px, static_cast<int>(std::lround(scale * image.height()))}, 0.0,
             0.0, cv::INTER_AREA);
  cv::cvtColor(small, colour, cv::COLOR_GRAY2BGR);
  for (const Detection& detection : detections) {
    std::vector<cv::Point> outline;
    for (const Eigen::Vector2d& corner : detection.corners)
      outline.emplace_back(static_cast<int>(std::lround(scale * corner.x())),
                           static_cast<int>(std::lround(scale * corner.y())));
    const auto layer = static_cast<std::size_t>(detection.layer - 1) % kLayers.size();
    cv::polylines(colour, outline, true, kLayers[layer], 1, cv::LINE_AA);
  }
  std::vector<std::uint8_t> bytes;
  cv::imencode(".jpg", colour, bytes, {cv::IMWRITE_JPEG_QUALITY, kQuality});
  return {label, base64(bytes)};
}

Json to_json(const Picture& picture) {
  return {{"label", picture.label}, {"jpeg", picture.jpeg_base64}};
}

Picture picture_from(const Json& json) {
  return {json.at("label").get<std::string>(), json.at("jpeg").get<std::string>()};
}

}  // namespace harco::lab
