// One source of frames: pictures, a folder of pictures, a video, a camera, a network stream, a
// GStreamer pipeline or PGM images on a pipe.
#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "media.hpp"
#include "stop_signal.hpp"

namespace harco::cli {

struct Frame {
  std::size_t number = 0;    ///< counts on over all sources
  std::string source;        ///< as the output names it
  std::string name;          ///< for files made from this frame: "left01", "street-000012"
  std::size_t sequence = 0;  ///< frames of one sequence follow one another in time
  double timestamp_s = 0.0;  ///< when it was taken, by the clock of its source
  bool timed = false;        ///< the source has said so; else timestamp_s is made up
  /// The same by the machine's monotonic clock (monotonic_s), where the source tells: cameras and
  /// live pipelines.
  std::optional<double> captured_s;
  double received_s = 0.0;         ///< when all of it had come, by the monotonic clock
  std::size_t dropped = 0;         ///< frames just before it for which there was no time
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

  /// Waits for the next frame and fills it in, but for number, sequence and dropped; the memory of
  /// its picture is used again. False at the end, or when stopped. Throws Error if the source can't
  /// be read (on).
  virtual bool next(Frame& frame, bool colour) = 0;

  /// How many frames it has in all, if that is known.
  virtual std::optional<std::size_t> count() const = 0;

  /// Frames come when they are taken, not when they are asked for.
  virtual bool live() const { return false; }
  /// It holds no frames back for who is slow: better drop old ones. Known once there was a frame.
  virtual bool runs_on() const { return false; }
  /// It may come back after it has ended or failed, if it is opened again.
  virtual bool may_return() const { return false; }
  /// Single pictures named one by one belong together.
  virtual bool continues(const FrameSource& /*before*/) const { return false; }
};

/// `word` as on the command line: a picture, a folder, a video, camera:N, /dev/videoN, rtsp://…,
/// rtp://…, gst:PIPELINE, pgm:PATH or pgm:-. It is opened when the first frame is asked for;
/// waiting for frames ends with `stop`. Throws Error if there is no such thing or the folder has no
/// pictures.
std::unique_ptr<FrameSource> open_source(const std::string& word, const StopSignal& stop);

/// Files in the order that people expect: numbers by their value ("9" before "10"), ties by bytes.
bool natural_less(const std::string& a, const std::string& b);

}  // namespace harco::cli
