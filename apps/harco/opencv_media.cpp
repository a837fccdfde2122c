// Media by OpenCV; part of the module harco_opencv.so.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <optional>

#include <opencv2/core.hpp>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>

#include "harco/error.hpp"
#include "media.hpp"
#include "opencv_module.hpp"

namespace harco::cli {
namespace {

Image to_image(const cv::Mat& grey) {
  Image image(grey.cols, grey.rows);
  for (int y = 0; y < grey.rows; ++y)
    std::memcpy(image.row(y), grey.ptr(y), static_cast<std::size_t>(grey.cols));
  return image;
}

ColourImage to_colour_image(const cv::Mat& bgr) {
  ColourImage image{bgr.cols, bgr.rows, {}};
  image.bgr.reserve(bgr.total() * 3);
  for (int y = 0; y < bgr.rows; ++y)
    image.bgr.insert(image.bgr.end(), bgr.ptr(y), bgr.ptr(y) + 3 * bgr.cols);
  return image;
}

/// A view: OpenCV wants a pointer that isn't const even where it only reads.
cv::Mat view(const ColourImage& image) {
  return {image.height, image.width, CV_8UC3, const_cast<std::uint8_t*>(image.bgr.data())};
}

/// OpenCV's view of our memory, which it then writes to.
cv::Mat view(Image& image, const cv::Size& size) {
  image.width = size.width;
  image.height = size.height;
  image.pixels.resize(static_cast<std::size_t>(size.area()));
  return {size, CV_8UC1, image.pixels.data()};
}

cv::Mat view(ColourImage& image, const cv::Size& size) {
  image.width = size.width;
  image.height = size.height;
  image.bgr.resize(3 * static_cast<std::size_t>(size.area()));
  return {size, CV_8UC3, image.bgr.data()};
}

/// A frame as cameras and videos give it (8 or 16 bits, one, three or four channels), into the
/// memory of the picture before.
void to_picture(cv::Mat frame, bool colour, Picture& picture) {
  if (frame.depth() == CV_16U) frame.convertTo(frame, CV_8U, 1.0 / 257.0);
  cv::Mat grey = view(picture.grey, frame.size());
  const int channels = frame.channels();
  if (channels == 1) frame.copyTo(grey);
  if (channels == 3) cv::cvtColor(frame, grey, cv::COLOR_BGR2GRAY);
  if (channels == 4) cv::cvtColor(frame, grey, cv::COLOR_BGRA2GRAY);
  if (!colour) return;
  cv::Mat bgr = view(picture.colour, frame.size());
  if (channels == 1) cv::cvtColor(frame, bgr, cv::COLOR_GRAY2BGR);
  if (channels == 3) frame.copyTo(bgr);
  if (channels == 4) cv::cvtColor(frame, bgr, cv::COLOR_BGRA2BGR);
}

class OpencvVideo : public VideoReader {
 public:
  OpencvVideo(const cv::VideoCapture& capture, bool live)
      : capture_(capture),
        live_(live),
        frames_per_second_(positive(capture_.get(cv::CAP_PROP_FPS))) {}

  bool read(Picture& picture, bool colour) override {
    if (!capture_.read(frame_) || frame_.empty()) return false;
    time_s_ = live_ ? time_taken() : time_in_file();
    ++frames_;
    to_picture(frame_, colour, picture);
    return true;
  }

  double time_s() const override { return time_s_; }
  double frames_per_second() const override { return frames_per_second_; }
  long frame_count() const override {
    return live_ ? 0 : std::lround(positive(capture_.get(cv::CAP_PROP_FRAME_COUNT)));
  }

 private:
  static double positive(double value) { return std::isfinite(value) && value > 0.0 ? value : 0.0; }

  /// The driver's time stamp, where it is one of the monotonic clock; else now.
  double time_taken() const {
    constexpr double kOldest = 1.0;  // seconds
    const double now =
        std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
    const double stamp = positive(capture_.get(cv::CAP_PROP_POS_MSEC)) * 1e-3;
    return stamp <= now && stamp > now - kOldest ? stamp : now;
  }

  /// The file's own time stamp; where it has none, the frame's number over the rate.
  double time_in_file() const {
    const double stamp = positive(capture_.get(cv::CAP_PROP_POS_MSEC)) * 1e-3;
    if (frames_ == 0 || stamp > time_s_) return stamp;
    return frames_per_second_ > 0.0 ? static_cast<double>(frames_) / frames_per_second_ : time_s_;
  }

  cv::VideoCapture capture_;
  bool live_;
  double frames_per_second_;
  cv::Mat frame_;  ///< its memory is used again
  long frames_ = 0;
  double time_s_ = 0.0;
};

class OpencvVideoWriter : public VideoWriter {
 public:
  OpencvVideoWriter(const cv::VideoWriter& writer, std::string file, int width, int height)
      : writer_(writer), file_(std::move(file)), width_(width), height_(height) {}

  void write(const ColourImage& picture) override {
    if (picture.width != width_ || picture.height != height_)
      throw Error(file_ + ": a video has frames of one size, not " + std::to_string(width_) +
                  " x " + std::to_string(height_) + " and " + std::to_string(picture.width) +
                  " x " + std::to_string(picture.height));
    writer_.write(view(picture));
  }

 private:
  cv::VideoWriter writer_;
  std::string file_;
  int width_, height_;
};

class OpencvMedia : public Media {
 public:
  OpencvMedia() {
    // What goes wrong is said once, by us, not by the libraries below.
    cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
    setenv("OPENCV_FFMPEG_LOGLEVEL", "-8", /*overwrite=*/0);
    // A camera that stands still is soon opened again; seconds.
    setenv("OPENCV_VIDEOIO_V4L_SELECT_TIMEOUT", "2", /*overwrite=*/0);
    // The command's own threads share the work.
    cv::setNumThreads(1);
  }

  Picture decode(const std::vector<std::uint8_t>& bytes, const std::string& name,
                 bool colour) const override {
    Picture picture;
    picture.grey = to_image(decode_as(bytes, name, cv::IMREAD_GRAYSCALE));
    if (colour) picture.colour = to_colour_image(decode_as(bytes, name, cv::IMREAD_COLOR));
    return picture;
  }

  std::unique_ptr<VideoReader> open_video(const std::string& file) const override {
    // OpenCV's other way, GStreamer, prints what it thinks of files that it can't read.
    cv::VideoCapture capture;
    if (!capture.open(file, cv::CAP_FFMPEG))
      throw Error(file + ": is neither a picture nor a video that can be read");
    return std::make_unique<OpencvVideo>(std::move(capture), false);
  }

  std::unique_ptr<VideoReader> open_camera(const std::string& device) const override {
    const bool number = device.find_first_not_of("0123456789") == std::string::npos &&
                        !device.empty() && device.size() < 6;
    cv::VideoCapture capture;
    const bool open =
        number ? capture.open(std::stoi(device), cv::CAP_V4L2) : capture.open(device, cv::CAP_V4L2);
    if (!open) throw Error("camera " + device + ": can't be opened");
    return std::make_unique<OpencvVideo>(std::move(capture), true);
  }

  std::unique_ptr<VideoWriter> create_video(const std::string& file, int width, int height,
                                            double frames_per_second) const override {
    const bool avi = std::filesystem::path(file).extension() == ".avi";
    const int codec = avi ? cv::VideoWriter::fourcc('M', 'J', 'P', 'G')
                          : cv::VideoWriter::fourcc('m', 'p', '4', 'v');
    cv::VideoWriter writer;
    if (!writer.open(file, cv::CAP_FFMPEG, codec, frames_per_second, {width, height}))
      throw Error(file + ": can't be written as a video");
    return std::make_unique<OpencvVideoWriter>(std::move(writer), file, width, height);
  }

  std::vector<std::uint8_t> encode(const ColourImage& picture,
                                   const std::string& ending) const override {
    std::vector<std::uint8_t> bytes;
    bool encoded = false;
    try {
      encoded = cv::imencode(ending, view(picture), bytes);
    } catch (const cv::Exception&) {
    }
    if (!encoded) throw Error("'" + ending + "': no picture format that can be written");
    return bytes;
  }

  void draw(const Overlay& overlay, ColourImage& picture) const override {
    cv::Mat canvas = view(picture);
    for (const Stroke& stroke : overlay.strokes) draw_stroke(stroke, canvas);
    for (const Label& label : overlay.labels) draw_label(label, canvas);
  }

  ColourImage enlarged(const ColourImage& picture, int factor) const override {
    cv::Mat large;
    cv::resize(view(picture), large, {}, factor, factor, cv::INTER_NEAREST);
    return to_colour_image(large);
  }

 private:
  static cv::Mat decode_as(const std::vector<std::uint8_t>& bytes, const std::string& name,
                           int mode) {
    cv::Mat image;
    std::string why;
    try {
      if (!bytes.empty()) image = cv::imdecode(bytes, mode);
    } catch (const cv::Exception& error) {
      why = " (" + error.err + ")";
    }
    if (image.empty()) throw Error(name + ": can't be read as a picture" + why);
    return image;
  }

  static cv::Scalar scalar(const Colour& c) {
    return {double(c.blue), double(c.green), double(c.red)};
  }

  static void draw_stroke(const Stroke& stroke, cv::Mat& canvas) {
    constexpr int kShift = 4;  // sixteenths of a pixel
    // Far outside of the picture there is nothing to draw, and whole numbers end.
    constexpr double kFar = 1e5;
    std::vector<cv::Point> points;
    for (const Eigen::Vector2d& p : stroke.points) {
      if (!p.allFinite()) return;
      const Eigen::Vector2d fixed = p.cwiseMax(-kFar).cwiseMin(kFar) * (1 << kShift);
      points.emplace_back(cvRound(fixed.x()), cvRound(fixed.y()));
    }
    cv::polylines(canvas, points, stroke.closed, scalar(stroke.colour), stroke.thickness,
                  cv::LINE_AA, kShift);
  }

  static void draw_label(const Label& label, cv::Mat& canvas) {
    if (!label.at.allFinite()) return;
    constexpr auto kFont = cv::FONT_HERSHEY_SIMPLEX;
    const double scale = label.height_px / 21.0;  // the font's capitals are 21 px high
    const int thickness = std::max(1, cvRound(scale * 1.5));
    const cv::Point at(cvRound(label.at.x()), cvRound(label.at.y()));
    cv::putText(canvas, label.text, at, kFont, scale, {0.0, 0.0, 0.0}, thickness + 2, cv::LINE_AA);
    cv::putText(canvas, label.text, at, kFont, scale, scalar(label.colour), thickness, cv::LINE_AA);
  }
};

}  // namespace

HARCO_OPENCV_EXPORT const Media* harco_opencv_media() {
  static const OpencvMedia instance;
  return &instance;
}

}  // namespace harco::cli
