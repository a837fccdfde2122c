// How those who wait are told that they needn't any more.
#pragma once

#include <atomic>

namespace harco::cli {

/// Raised once, from any thread or from a signal handler, and seen by all.
class StopSignal {
 public:
  /// Throws Error if the system has no more file descriptors.
  StopSignal();
  ~StopSignal();
  StopSignal(const StopSignal&) = delete;
  StopSignal& operator=(const StopSignal&) = delete;

  void raise() const noexcept;
  bool raised() const noexcept { return raised_; }
  int fd() const noexcept { return fd_; }  ///< can be read from once raised

  /// Waits until `fd` can be read from or has ended. False if the signal came first.
  bool wait_for(int fd) const;
  /// Waits for so long. False if the signal came first.
  bool wait_for_seconds(double seconds) const;

 private:
  int fd_;
  mutable std::atomic<bool> raised_ = false;
  static_assert(std::atomic<bool>::is_always_lock_free, "a signal handler must not wait");
};

/// Seconds on the machine's monotonic clock.
double monotonic_s();

}  // namespace harco::cli
