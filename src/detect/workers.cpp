#include "detect/workers.hpp"

#include <algorithm>
#include <utility>

namespace harco::detect {

Workers::Workers(std::size_t threads) {
  try {
    helpers_.reserve(threads);
    for (std::size_t worker = 1; worker < threads; ++worker)
      helpers_.emplace_back([this, worker] { help(worker); });
  } catch (...) {
    dismiss();
    throw;
  }
}

Workers::~Workers() { dismiss(); }

void Workers::dismiss() {
  {
    const std::lock_guard lock(mutex_);
    over_ = true;
  }
  begun_.notify_all();
  for (std::thread& helper : helpers_) helper.join();
}

void Workers::run(std::size_t items, const Call& call) {
  if (helpers_.empty() || items <= 1) {
    for (std::size_t item = 0; item < items; ++item) call.with(call.work, item, 0);
    return;
  }
  std::unique_lock lock(mutex_);
  call_ = call;
  next_ = 0;
  items_ = items;
  for (std::size_t i = 1; i < std::min(items, count()); ++i) begun_.notify_one();
  work_off(lock, 0);
  // A helper that is still asleep isn't waited for.
  done_.wait(lock, [this] { return running_ == 0; });
  if (failure_) std::rethrow_exception(std::exchange(failure_, nullptr));
}

void Workers::help(std::size_t worker) {
  std::unique_lock lock(mutex_);
  for (;;) {
    begun_.wait(lock, [this] { return over_ || next_ < items_; });
    if (over_) return;
    work_off(lock, worker);
    if (running_ == 0) done_.notify_one();
  }
}

void Workers::work_off(std::unique_lock<std::mutex>& lock, std::size_t worker) {
  while (next_ < items_) {
    const std::size_t item = next_++;
    ++running_;
    lock.unlock();
    std::exception_ptr failure;
    try {
      call_.with(call_.work, item, worker);
    } catch (...) {
      failure = std::current_exception();
    }
    lock.lock();
    --running_;
    if (!failure) continue;
    if (!failure_) failure_ = failure;
    next_ = items_;
  }
}

}  // namespace harco::detect
