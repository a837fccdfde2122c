// A progress bar on standard error, for whoever watches a terminal.
#pragma once

#include <chrono>
#include <string>

namespace harco::cli {

/// Shows nothing unless standard error is a terminal; leaves no trace when it goes.
class ProgressBar {
 public:
  explicit ProgressBar(std::string label);
  ~ProgressBar();
  ProgressBar(const ProgressBar&) = delete;
  ProgressBar& operator=(const ProgressBar&) = delete;

  /// `share` of the work is done, 0 … 1; `note` stands behind the bar. Cheap enough to call often.
  void show(double share, const std::string& note = "");

 private:
  std::string label_;
  bool terminal_;
  bool shown_ = false;
  std::chrono::steady_clock::time_point next_;
};

}  // namespace harco::cli
