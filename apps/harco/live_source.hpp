// Frames as they are taken: a thread of its own reads the source, and who asks gets the newest.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "frame_source.hpp"
#include "stop_signal.hpp"

namespace harco::cli {

struct LiveOptions {
  bool colour = false;
  /// Drop old frames even of a source that would wait, such as a pipe.
  bool drop = true;
  /// Open a source again that ends or fails; where it can't come back (standard input, a file), its
  /// end is the end.
  bool reopen = true;
  /// Keep trying even if it has never given a frame; else that is an error.
  bool patient = false;
  /// Takes one line for people, from any thread: that the source has failed, is back, dropped
  /// frames. By default they go to standard error.
  std::function<void(const std::string& line)> tell;
};

/// Nothing is allocated or copied in passing: frames change hands, three of them go round. Frames
/// of a source without times have their time of arrival, by the monotonic clock.
class LiveSource {
 public:
  /// Starts to read at once. Throws as open_source.
  explicit LiveSource(const std::string& word, const LiveOptions& options = {});
  ~LiveSource();
  LiveSource(const LiveSource&) = delete;
  LiveSource& operator=(const LiveSource&) = delete;

  /// The newest frame, if there is one that hasn't been taken. Never waits.
  bool take(Frame& frame);

  /// Can be read from while there may be something to take, or the source has ended: for poll().
  int ready_fd() const { return ready_; }

  /// Waits for the next frame. False when the source has ended or `stop` is raised.
  bool wait(Frame& frame, const StopSignal& stop);

  bool ended() const;           ///< and no frame is left
  std::string error() const;    ///< why it has ended; empty where that's no failure
  std::size_t dropped() const;  ///< frames so far

 private:
  void run();
  void publish(bool may_drop);
  void finish(const std::string& why);
  void signal_ready() const;

  std::string word_;
  LiveOptions options_;
  StopSignal stop_;
  int ready_;

  mutable std::mutex mutex_;
  std::condition_variable taken_;  ///< for a source that waits
  Frame newest_;                   ///< under the mutex, as all that follows
  bool fresh_ = false;             ///< newest_ hasn't been taken
  bool ended_ = false;
  std::string error_;
  std::size_t dropped_ = 0, received_ = 0;

  Frame reading_;  ///< the thread's own
  std::unique_ptr<FrameSource> first_;
  std::thread thread_;
};

}  // namespace harco::cli
