// Network streams and GStreamer pipelines, by the module harco_gstreamer.so.
#pragma once

#include <memory>
#include <string>

#include "media.hpp"
#include "stop_signal.hpp"

namespace harco::cli {

/// Frames of a pipeline that is running.
class Stream {
 public:
  virtual ~Stream() = default;
  /// Waits for the next frame; its memory is used again. False at the end, or when stopped. Throws
  /// Error if the pipeline fails or stands still.
  virtual bool read(Picture& picture) = 0;
  /// When the last frame was taken, seconds: of a live pipeline by the monotonic clock, else since
  /// its beginning.
  virtual double time_s() const = 0;
  /// Whether its frames come when they are taken.
  virtual bool live() const = 0;
};

/// GStreamer's description of a source's word: rtsp://…, rtp://HOST:PORT[?encoding=NAME] or
/// gst:PIPELINE, with an appsink at its end. Throws Error for another word.
std::string pipeline_of(const std::string& word);

/// Starts the pipeline of a word. Throws Error if it can't be.
std::unique_ptr<Stream> open_stream(const std::string& word, bool colour, const StopSignal& stop);

}  // namespace harco::cli
