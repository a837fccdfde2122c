// Where frames come from: pictures, folders of pictures, videos, cameras and PGM streams, one after
// the other in the order given.
#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "media.hpp"

namespace harco::cli {

struct Frame {
  std::size_t number = 0;    ///< counts on over all sources
  std::string source;        ///< as the output names it
  std::string name;          ///< for files made from this frame: "left01", "street-000012"
  std::size_t sequence = 0;  ///< frames of one sequence follow one another in time
  double timestamp_s = 0.0;
  bool moving = false;             ///< from a video or a camera
  double frames_per_second = 0.0;  ///< of the video; 0 if unknown

  std::filesystem::path file;  ///< a picture still to be loaded; else empty
  Picture picture;
  std::string error;  ///< why there is no picture, naming the source
};

/// Loads a frame's picture if that is still to be done; `frame.error` says so if it fails. Frames
/// may be loaded on several threads.
void load(Frame& frame, bool colour);

/// One of the sources on the command line.
class FrameSource {
 public:
  virtual ~FrameSource() = default;
  /// Fills in source, name, file or picture and, where it is known, the time; false at the end.
  /// Throws Error if the source can't be read (on).
  virtual bool next(Frame& frame, bool colour) = 0;
  /// How many frames it has in all, if that is known.
  virtual std::optional<std::size_t> count() const = 0;
  /// Frames come when they are taken, not when they are asked for.
  virtual bool live() const { return false; }
  /// Single pictures named one by one belong together.
  virtual bool continues(const FrameSource& /*before*/) const { return false; }
};

/// `word` as on the command line: a picture, a folder, a video, camera:N, /dev/videoN, pgm:PATH or
/// pgm:-. Throws Error if there is no such thing or the folder has no pictures.
std::unique_ptr<FrameSource> open_source(const std::string& word);

/// All sources as one sequence of frames. A source that fails gives a frame with an error, and the
/// next one follows.
class Frames {
 public:
  /// Frames that come without a time follow one another at `frame_rate` within their sequence, or
  /// are all taken at 0 if that is 0. Throws as open_source.
  Frames(const std::vector<std::string>& words, double frame_rate, bool colour);

  std::optional<Frame> next();

  std::optional<std::size_t> count() const;  ///< if it is known
  bool live() const;                         ///< whether some source is

 private:
  void go_to_next_source();

  std::vector<std::string> words_;
  std::vector<std::unique_ptr<FrameSource>> sources_;
  double frame_rate_;
  bool colour_;
  std::size_t current_ = 0;   ///< source
  std::size_t number_ = 0;    ///< of the next frame
  std::size_t sequence_ = 0;  ///< its sequence ...
  std::size_t position_ = 0;  ///< ... and place in it
};

/// Files in the order that people expect: numbers by their value ("9" before "10"), ties by bytes.
bool natural_less(const std::string& a, const std::string& b);

}  // namespace harco::cli
