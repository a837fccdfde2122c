// Pictures, videos, cameras and drawing: what the command has from OpenCV.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "harco/image.hpp"

namespace harco::cli {

/// 8-bit colour, rows one after another without gaps.
struct ColourImage {
  int width = 0;
  int height = 0;
  std::vector<std::uint8_t> bgr;  ///< blue, green, red, pixel by pixel
};

/// A picture for the detector, and for those who look at what it found.
struct Picture {
  Image grey;
  ColourImage colour;  ///< empty unless it was asked for
};

struct Colour {
  std::uint8_t red = 0, green = 0, blue = 0;
};

/// A line through points; whole numbers are pixel centres.
struct Stroke {
  std::vector<Eigen::Vector2d> points;
  Colour colour;
  bool closed = false;
  int thickness = 1;
};

/// A line of text. What the font lacks shows as a question mark.
struct Label {
  Eigen::Vector2d at;  ///< left end of its baseline
  std::string text;
  Colour colour;
  double height_px = 12.0;  ///< of a capital letter
};

/// What is drawn over a picture: strokes first, labels over them on a dark rim.
struct Overlay {
  std::vector<Stroke> strokes;
  std::vector<Label> labels;
};

/// Frames of a video or a camera, one after the other.
class VideoReader {
 public:
  virtual ~VideoReader() = default;
  /// The next frame, into the memory of the one before; false at the end.
  virtual bool read(Picture& picture, bool colour) = 0;
  /// When the last frame was taken: seconds from the video's start; for a camera, on the
  /// monotonic clock.
  virtual double time_s() const = 0;
  virtual double frames_per_second() const = 0;  ///< 0 if unknown
  virtual long frame_count() const = 0;          ///< 0 if unknown; what the file says, else
};

/// A video file in the making.
class VideoWriter {
 public:
  virtual ~VideoWriter() = default;
  virtual void write(const ColourImage& picture) = 0;
};

class Media {
 public:
  virtual ~Media() = default;

  /// A picture from the bytes of a file, in any format that OpenCV reads; `name` stands in the
  /// Error that is thrown if it can't be.
  virtual Picture decode(const std::vector<std::uint8_t>& bytes, const std::string& name,
                         bool colour) const = 0;

  /// Throws Error if it is no video.
  virtual std::unique_ptr<VideoReader> open_video(const std::string& file) const = 0;
  /// `device` is a number or a device file such as /dev/video0. Throws Error.
  virtual std::unique_ptr<VideoReader> open_camera(const std::string& device) const = 0;
  /// The format follows from the name's ending: mp4, m4v, mov, mkv or avi. Throws Error.
  virtual std::unique_ptr<VideoWriter> create_video(const std::string& file, int width, int height,
                                                    double frames_per_second) const = 0;

  /// The bytes of a picture file; `ending` names the format (".png", ".jpg"). Throws Error.
  virtual std::vector<std::uint8_t> encode(const ColourImage& picture,
                                           const std::string& ending) const = 0;

  virtual void draw(const Overlay& overlay, ColourImage& picture) const = 0;

  /// The picture, `factor` times as large, each pixel a square.
  virtual ColourImage enlarged(const ColourImage& picture, int factor) const = 0;
};

/// OpenCV's, loaded at the first call. Throws Error if it isn't there.
const Media& media();

/// The same picture in colour's clothes.
inline ColourImage to_colour(const Image& grey) {
  ColourImage colour{grey.width, grey.height, {}};
  colour.bgr.reserve(grey.pixels.size() * 3);
  for (const std::uint8_t value : grey.pixels) colour.bgr.insert(colour.bgr.end(), 3, value);
  return colour;
}

}  // namespace harco::cli
