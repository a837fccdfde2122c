// All sources of a command line, one after the other in the order given.
#pragma once

#include <cstddef>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "frame_source.hpp"
#include "media.hpp"
#include "stop_signal.hpp"

namespace harco::cli {

struct FramesOptions {
  /// Frames that come without a time follow one another at this rate within their sequence, or are
  /// all taken at 0 if it is 0. Per second.
  double frame_rate = 0.0;
  bool colour = false;
  /// Drop frames of a pipe for which there is no time, and open it again when it ends. Cameras and
  /// network streams are always read like that.
  bool live = false;
};

/// All sources as one sequence of frames. A source that fails gives a frame with an error, and the
/// next one follows.
class Frames {
 public:
  /// Waiting for frames ends with `stop`. Throws as open_source.
  Frames(const std::vector<std::string>& words, const FramesOptions& options,
         const StopSignal& stop);

  std::optional<Frame> next();

  /// Takes back a picture that nobody needs any more, for the next frame. From any thread.
  void recycle(Picture&& picture);

  std::optional<std::size_t> count() const;  ///< if it is known
  bool live() const;                         ///< whether some source is

 private:
  void go_to_next_source();
  Picture unused_picture();

  std::vector<std::string> words_;
  FramesOptions options_;
  const StopSignal& stop_;
  std::vector<std::unique_ptr<FrameSource>> sources_;
  std::size_t current_ = 0;   ///< source
  std::size_t number_ = 0;    ///< of the next frame
  std::size_t sequence_ = 0;  ///< its sequence ...
  std::size_t position_ = 0;  ///< ... and place in it
  std::mutex mutex_;
  std::vector<Picture> unused_;
};

}  // namespace harco::cli
