// Work on many threads whose results come out in the order of the input.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <exception>
#include <map>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

namespace harco::cli {

/// Until `take()` returns nothing: takes an item, turns it into a result by `work(worker, item)`,
/// hands the result to `give(result)`. take and give are called by one thread at a time and in
/// order; work runs on `jobs` threads at once, `worker` being 0 … jobs - 1. The first exception
/// ends everything and is passed on.
template <typename Take, typename Work, typename Give>
void work_in_order(int jobs, Take take, Work work, Give give) {
  if (jobs <= 1) {
    while (auto item = take()) give(work(std::size_t{0}, std::move(*item)));
    return;
  }

  using Item = typename decltype(take())::value_type;
  using Result = decltype(work(std::size_t{0}, std::declval<Item>()));
  std::mutex taking, giving;
  std::condition_variable given;
  std::map<std::size_t, Result> waiting;
  std::size_t taken = 0, next = 0;
  bool over = false;           // nobody takes anything any more; under `taking`
  std::exception_ptr failure;  // under `giving`
  // How far the quick ones may run ahead of the slowest.
  const std::size_t ahead = 4 * static_cast<std::size_t>(jobs);

  const auto run = [&](std::size_t worker) {
    for (;;) {
      std::optional<Item> item;
      std::size_t index = 0;
      {
        const std::lock_guard lock(taking);
        if (over) return;
        item = take();
        index = taken++;
        if (!item) over = true;
      }
      if (!item) return;
      Result result = work(worker, std::move(*item));
      std::unique_lock lock(giving);
      given.wait(lock, [&] { return index < next + ahead || failure; });
      if (failure) return;
      waiting.emplace(index, std::move(result));
      for (auto first = waiting.find(next); first != waiting.end(); first = waiting.find(next)) {
        give(std::move(first->second));
        waiting.erase(first);
        ++next;
      }
      given.notify_all();
    }
  };
  const auto run_safely = [&](std::size_t worker) {
    try {
      run(worker);
    } catch (...) {
      const std::scoped_lock lock(taking, giving);
      over = true;
      if (!failure) failure = std::current_exception();
      given.notify_all();
    }
  };

  std::vector<std::thread> threads;
  for (int i = 0; i < jobs; ++i) threads.emplace_back(run_safely, static_cast<std::size_t>(i));
  for (std::thread& thread : threads) thread.join();
  if (failure) std::rethrow_exception(failure);
}

}  // namespace harco::cli
