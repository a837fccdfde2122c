// What `harco land` says of itself: JSON lines of what was seen and sent, a status line for who
// watches a terminal, and a summary.
#pragma once

#include <cstddef>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "deck_watch.hpp"
#include "land_link.hpp"
#include "output_stream.hpp"
#include "record.hpp"

namespace harco::cli {

/// Lines of JSON from several threads: what is sent, for who reads along; all of it, in a record.
class LandLog {
 public:
  /// `print` is to standard output; without a name there is no record. Lines are written as they
  /// come. Throws Error if that can't be.
  LandLog(bool print, const std::string& record, const TargetOptions& options);

  void add(const FrameRecord& frame);
  void add_line(const std::string& line);
  void commit();

 private:
  std::mutex mutex_;
  std::optional<OutputStream> printed_;
  std::optional<RecordWriter> record_;
};

/// {"deck": {"time_s": …, "phase": "ready", "windows": […], …}}
std::string json_line(const DeckView& deck);

/// What was seen of the target in one frame.
struct TargetView {
  double received_s = 0.0;  ///< when the frame had come
  std::vector<int> layers;  ///< that were seen
  bool posed = false;       ///< there was a pose ...
  bool believed = false;    ///< ... and it agrees with those before it
  bool foretold = false;    ///< it wasn't seen, but is where it must be by now
  double range_m = 0.0;
  std::optional<double> sd_m;  ///< of the target point: root of the sum of its variances
};

/// Latencies, and what share of them was below.
class Latencies {
 public:
  void add(double seconds);
  std::size_t count() const { return all_.size(); }
  double quantile(double share) const;  ///< of at least one

 private:
  std::vector<double> all_;  ///< the last few thousand
  std::size_t next_ = 0;
};

/// A line on standard error that follows what happens; only where that is a terminal.
class StatusLine {
 public:
  StatusLine();
  ~StatusLine();
  StatusLine(const StatusLine&) = delete;
  StatusLine& operator=(const StatusLine&) = delete;

  bool due(double now_s) const { return terminal_ && now_s >= next_s_; }
  void show(const std::string& text, double now_s);
  /// A line that stays, terminal or not.
  void tell(const std::string& line);

 private:
  std::mutex mutex_;
  bool terminal_;
  bool shown_ = false;
  double next_s_ = 0.0;
};

std::string status_text(const TargetView& view, double frames_per_second, const Latencies& latency,
                        bool absolute, const LandLinkState& link,
                        const std::optional<DeckView>& deck);

}  // namespace harco::cli
