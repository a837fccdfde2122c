#include "detect/workers.hpp"

#include <atomic>
#include <stdexcept>
#include <vector>

#include <gtest/gtest.h>

namespace harco::detect {
namespace {

TEST(Workers, DoEveryItemOnce) {
  for (const std::size_t threads : {1U, 2U, 5U}) {
    Workers workers(threads);
    EXPECT_EQ(workers.count(), threads);
    for (const std::size_t items : {0U, 1U, 3U, 1000U}) {
      std::vector<int> done(items);
      workers.share(items, [&](std::size_t item, std::size_t worker) {
        EXPECT_LT(worker, threads);
        ++done[item];
      });
      EXPECT_EQ(done, std::vector<int>(items, 1)) << threads << " threads";
    }
  }
}

TEST(Workers, HaveNumbersOfTheirOwn) {
  Workers workers(4);
  std::vector<std::atomic<int>> busy(workers.count());
  std::atomic<int> clashes = 0;
  for (int round = 0; round < 50; ++round)
    workers.share(64, [&](std::size_t, std::size_t worker) {
      clashes += busy[worker]++ != 0;
      --busy[worker];
    });
  EXPECT_EQ(clashes, 0);
}

TEST(Workers, AreSeveral) {
  // Both items have to be under way at the same time.
  Workers workers(2);
  std::mutex mutex;
  std::condition_variable met;
  int here = 0;
  workers.share(2, [&](std::size_t, std::size_t) {
    std::unique_lock lock(mutex);
    ++here;
    met.notify_all();
    met.wait(lock, [&] { return here == 2; });
  });
  EXPECT_EQ(here, 2);
}

TEST(Workers, PassExceptionsOnAndGoOnAfterwards) {
  for (const std::size_t threads : {1U, 3U}) {
    Workers workers(threads);
    const auto fail = [](std::size_t item, std::size_t) {
      if (item == 7) throw std::runtime_error("seven");
    };
    for (int round = 0; round < 3; ++round)
      EXPECT_THROW(workers.share(100, fail), std::runtime_error) << threads << " threads";
    std::atomic<int> done = 0;
    workers.share(10, [&](std::size_t, std::size_t) { ++done; });
    EXPECT_EQ(done, 10);
  }
}

}  // namespace
}  // namespace harco::detect
