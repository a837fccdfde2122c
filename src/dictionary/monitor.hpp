// Watches over one generation: what has been done, what remains, and whether to stop.
#pragma once

#include <chrono>
#include <cstdint>

#include "harco/dictionary.hpp"

namespace harco {

/// Decisions of a search depend on its count of work alone; the clock and the callback only cut.
class Monitor {
 public:
  Monitor(double time_limit_s, const DictionaryCallback& callback);

  /// One of the dictionaries is next: it takes the shares `from` … `to` of the whole, and at most
  /// `work` units.
  void begin(double from, double to, double work);

  /// Adds to the work done. False: stop now.
  bool spend(double work);

  /// Stopped by the clock or the callback, for good.
  bool cut() const { return cut_; }
  double work_left() const { return work_allowed_ - work_done_; }

  void count_iteration() { ++iterations_; }
  std::int64_t iterations() const { return iterations_; }

  DictionaryProgress& progress() { return progress_; }

 private:
  using Clock = std::chrono::steady_clock;
  void look_at_clock();

  DictionaryCallback callback_;
  double time_limit_s_;
  Clock::time_point start_ = Clock::now();
  Clock::time_point next_call_ = start_;
  double share_from_ = 0.0;
  double share_to_ = 1.0;
  double work_allowed_ = 0.0;
  double work_done_ = 0.0;
  double work_unseen_ = 0.0;  ///< since the clock was looked at
  std::int64_t iterations_ = 0;
  bool cut_ = false;
  DictionaryProgress progress_;
};

}  // namespace harco
