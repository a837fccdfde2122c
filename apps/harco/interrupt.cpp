#include "interrupt.hpp"

#include <atomic>

namespace harco::cli {
namespace {

std::atomic<const StopSignal*> g_signal = nullptr;

extern "C" void note_interrupt(int /*signal*/) {
  if (const StopSignal* signal = g_signal) signal->raise();
}

}  // namespace

InterruptGuard::InterruptGuard() {
  g_signal = &signal_;
  struct sigaction action {};
  action.sa_handler = note_interrupt;
  sigemptyset(&action.sa_mask);
  action.sa_flags = static_cast<int>(SA_RESETHAND | SA_RESTART);
  sigaction(SIGINT, &action, &before_);
}

InterruptGuard::~InterruptGuard() {
  sigaction(SIGINT, &before_, nullptr);
  g_signal = nullptr;
}

}  // namespace harco::cli
