#include "stop_signal.hpp"

#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <system_error>

#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include "harco/error.hpp"

namespace harco::cli {
namespace {

constexpr int kForEver = -1;

/// Whether something happened before `milliseconds` were over.
bool wait_on(pollfd* all, nfds_t count, int milliseconds) {
  for (;;) {
    const int ready = poll(all, count, milliseconds);
    if (ready >= 0) return ready > 0;
    if (errno != EINTR) throw Error("can't wait: " + std::generic_category().message(errno));
  }
}

}  // namespace

StopSignal::StopSignal() : fd_(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {
  if (fd_ < 0) throw Error("no event file: " + std::generic_category().message(errno));
}

StopSignal::~StopSignal() { close(fd_); }

void StopSignal::raise() const noexcept {
  raised_ = true;
  const std::uint64_t one = 1;
  const int before = errno;
  [[maybe_unused]] const auto written = write(fd_, &one, sizeof one);
  errno = before;
}

bool StopSignal::wait_for(int fd) const {
  pollfd both[]{{fd_, POLLIN, 0}, {fd, POLLIN, 0}};
  wait_on(both, 2, kForEver);
  return !raised();
}

bool StopSignal::wait_for_seconds(double seconds) const {
  pollfd one{fd_, POLLIN, 0};
  wait_on(&one, 1, static_cast<int>(std::lround(seconds * 1e3)));
  return !raised();
}

double monotonic_s() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

}  // namespace harco::cli
