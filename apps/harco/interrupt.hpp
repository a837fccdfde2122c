// Ctrl-C as a wish to stop and keep what there is.
#pragma once

#include <csignal>

#include "stop_signal.hpp"

namespace harco::cli {

/// While one of these lives, the first Ctrl-C only raises its signal; a second one ends the program
/// as ever. One at a time.
class InterruptGuard {
 public:
  InterruptGuard();
  ~InterruptGuard();
  InterruptGuard(const InterruptGuard&) = delete;
  InterruptGuard& operator=(const InterruptGuard&) = delete;

  /// Whether Ctrl-C has been pressed since the guard was set.
  bool interrupted() const { return signal_.raised(); }
  const StopSignal& signal() const { return signal_; }

 private:
  StopSignal signal_;
  struct sigaction before_ {};
};

}  // namespace harco::cli
