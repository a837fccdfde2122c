// Records: what was measured, when and what became of it, frame by frame as JSON lines, so that it
// can be played again (docs/formats.md).
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "harco/filter.hpp"
#include "harco/pose.hpp"
#include "output_stream.hpp"
#include "results.hpp"
#include "target_teller.hpp"
#include "tracking.hpp"

namespace harco::cli {

/// When a frame went through which stage.
struct FrameTiming {
  std::optional<double> captured_s;  ///< monotonic clock, as all that follow
  double received_s = 0.0;
  double done_s = 0.0;     ///< its result was there
  double detect_ms = 0.0;  ///< how long the detector took
  double pose_ms = 0.0;    ///< and the poses
};

/// All that a record keeps of a frame.
struct FrameRecord {
  FrameResult result;
  std::size_t sequence = 0;       ///< with another one, tracking starts anew
  std::vector<Pose> measured;     ///< the poses before anything made use of time
  CameraPose reference_T_camera;  ///< as given to the filter
  FrameTiming timing;
  // Of a landing:
  std::optional<VehiclePose> vehicle;
  std::optional<Target> target;  ///< made from the result's poses
};

/// A record in the making.
class RecordWriter {
 public:
  /// Of detect; `tracking` is how poses are filtered, if they are, `at_once` as of OutputStream.
  /// Throws Error if the file can't be written.
  RecordWriter(const std::string& file, const std::optional<TrackingOptions>& tracking,
               bool at_once);
  /// Of land; it is written as lines come.
  RecordWriter(const std::string& file, const TargetOptions& target);

  void add(const FrameRecord& frame);
  /// Another line with its end: an object with `message`, what was sent, or `deck`, what is known
  /// of it. Replay passes it on.
  void add_line(const std::string& line) { write(line); }
  void commit();

 private:
  void write(const std::string& line);

  std::string header_;  ///< until it is written, with the first line
  OutputStream output_;
};

/// Reads a record and plays it again: every frame's poses go through the tracking anew, or through
/// what made messages of them. Calls `give` with the lines that the recorded command wrote, or
/// would have written: frames, and messages sent as they are. Throws Error, naming file and line,
/// if it is no record.
void replay(const std::string& file, const std::function<void(const std::string& line)>& give);

}  // namespace harco::cli
