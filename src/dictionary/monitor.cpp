#include "dictionary/monitor.hpp"

#include <algorithm>

namespace harco {
namespace {

constexpr double kWorkBetweenLooks = 2e6;  // about a millisecond
constexpr std::chrono::milliseconds kBetweenCalls{50};

}  // namespace

Monitor::Monitor(double time_limit_s, const DictionaryCallback& callback)
    : callback_(callback), time_limit_s_(time_limit_s) {}

void Monitor::begin(double from, double to, double work) {
  share_from_ = from;
  share_to_ = to;
  work_allowed_ = work;
  work_done_ = 0.0;
  next_call_ = Clock::time_point{};  // a new dictionary is worth a call at once
  look_at_clock();
}

bool Monitor::spend(double work) {
  work_done_ += work;
  work_unseen_ += work;
  if (work_unseen_ >= kWorkBetweenLooks) {
    work_unseen_ = 0.0;
    look_at_clock();
  }
  return !cut_ && work_done_ < work_allowed_;
}

void Monitor::look_at_clock() {
  if (cut_) return;
  const Clock::time_point now = Clock::now();
  const double elapsed_s = std::chrono::duration<double>(now - start_).count();
  cut_ = elapsed_s >= time_limit_s_;
  if (!callback_ || now < next_call_) return;
  next_call_ = now + kBetweenCalls;
  const double done = work_allowed_ > 0.0 ? std::min(1.0, work_done_ / work_allowed_) : 0.0;
  progress_.share = std::min(
      1.0, std::max(share_from_ + (share_to_ - share_from_) * done, elapsed_s / time_limit_s_));
  if (!callback_(progress_)) cut_ = true;
}

}  // namespace harco
