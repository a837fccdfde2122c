// Ctrl-C as a wish to stop and keep what there is.
#pragma once

#include <csignal>

namespace harco::cli {

/// While one of these lives, the first Ctrl-C is only noted; a second one ends the program as ever.
class InterruptGuard {
 public:
  InterruptGuard();
  ~InterruptGuard();
  InterruptGuard(const InterruptGuard&) = delete;
  InterruptGuard& operator=(const InterruptGuard&) = delete;

  /// Whether Ctrl-C has been pressed since the guard was set.
  bool interrupted() const;

 private:
  struct sigaction before_ {};
};

}  // namespace harco::cli
