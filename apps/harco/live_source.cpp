#include "live_source.hpp"

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <system_error>
#include <utility>

#include <sys/eventfd.h>
#include <unistd.h>

#include <fmt/format.h>

#include "harco/error.hpp"

namespace harco::cli {
namespace {

// Pauses before a source is opened again, seconds: each twice as long as the one before.
constexpr double kFirstPause = 0.1;
constexpr double kLongestPause = 2.0;

void tell_people(const std::string& line) { fmt::print(stderr, "harco: {}\n", line); }

}  // namespace

LiveSource::LiveSource(const std::string& word, const LiveOptions& options)
    : word_(word),
      options_(options),
      ready_(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)),
      first_(open_source(word, stop_)) {
  if (ready_ < 0) throw Error("no event file: " + std::generic_category().message(errno));
  if (!options_.tell) options_.tell = tell_people;
  thread_ = std::thread([this] { run(); });
}

LiveSource::~LiveSource() {
  stop_.raise();
  {
    const std::lock_guard lock(mutex_);
    taken_.notify_all();
  }
  thread_.join();
  close(ready_);
  if (dropped_ > 0)
    options_.tell(fmt::format("{}: {} of {} frames were dropped, for want of time", word_, dropped_,
                              received_));
}

void LiveSource::signal_ready() const {
  const std::uint64_t one = 1;
  [[maybe_unused]] const auto written = write(ready_, &one, sizeof one);
}

bool LiveSource::take(Frame& frame) {
  const std::lock_guard lock(mutex_);
  if (!fresh_) return false;
  std::swap(frame, newest_);
  std::swap(frame.number, newest_.number);  // the taker's own
  std::swap(frame.sequence, newest_.sequence);
  newest_.dropped = 0;
  fresh_ = false;
  if (!ended_) {
    std::uint64_t count = 0;
    [[maybe_unused]] const auto got = read(ready_, &count, sizeof count);
  }
  taken_.notify_all();
  return true;
}

bool LiveSource::wait(Frame& frame, const StopSignal& stop) {
  while (!take(frame)) {
    if (ended()) return false;
    if (!stop.wait_for(ready_)) return false;
  }
  return true;
}

bool LiveSource::ended() const {
  const std::lock_guard lock(mutex_);
  return ended_ && !fresh_;
}

std::string LiveSource::error() const {
  const std::lock_guard lock(mutex_);
  return error_;
}

std::size_t LiveSource::dropped() const {
  const std::lock_guard lock(mutex_);
  return dropped_;
}

/// Hands over what has been read.
void LiveSource::publish(bool may_drop) {
  std::unique_lock lock(mutex_);
  if (!may_drop) taken_.wait(lock, [&] { return !fresh_ || stop_.raised(); });
  if (!reading_.timed) reading_.timestamp_s = reading_.received_s;
  reading_.timed = true;
  reading_.dropped = fresh_ ? newest_.dropped + 1 : 0;
  if (fresh_) ++dropped_;
  ++received_;
  std::swap(reading_, newest_);
  fresh_ = true;
  signal_ready();
}

void LiveSource::finish(const std::string& why) {
  const std::lock_guard lock(mutex_);
  ended_ = true;
  error_ = why;
  signal_ready();
}

void LiveSource::run() {
  std::unique_ptr<FrameSource> source = std::move(first_);
  std::string why;
  bool ever = false, down = false;
  double pause = kFirstPause, since = 0.0;
  while (!stop_.raised()) {
    why.clear();
    try {
      if (!source) source = open_source(word_, stop_);
      while (!stop_.raised() && source->next(reading_, options_.colour)) {
        if (down)
          options_.tell(fmt::format("{}: is back after {:.1f} s", word_, monotonic_s() - since));
        down = false;
        ever = true;
        pause = kFirstPause;
        publish(options_.drop || source->runs_on());
      }
    } catch (const std::exception& error) {
      why = error.what();
    }
    const bool may_return = !source || source->may_return();
    source.reset();
    if (stop_.raised()) break;
    const bool again = options_.reopen && may_return && (ever || options_.patient);
    if (!again) break;
    if (!down) {
      since = monotonic_s();
      options_.tell(why.empty() ? fmt::format("{}: has ended; waiting for it to come back", word_)
                                : fmt::format("{}; waiting for it to come back", why));
    }
    down = true;
    stop_.wait_for_seconds(pause);
    pause = std::min(2.0 * pause, kLongestPause);
  }
  finish(why);
}

}  // namespace harco::cli
