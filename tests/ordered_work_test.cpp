#include "ordered_work.hpp"

#include <atomic>
#include <cstddef>
#include <memory>
#include <optional>
#include <stdexcept>
#include <vector>

#include <gtest/gtest.h>

namespace harco::cli {
namespace {

/// 0, 1, … count - 1.
auto counter(int count) {
  return [count, next = 0]() mutable {
    return next < count ? std::optional<int>(next++) : std::nullopt;
  };
}

/// Takes longer for some items than for others, in no order.
int toil(int item) {
  volatile int sum = 0;
  for (int i = 0; i < (item * 7919) % 20000; ++i) sum = sum + 1;
  return item * item;
}

TEST(OrderedWork, GivesResultsInTheOrderOfTheInput) {
  for (const int jobs : {1, 2, 7}) {
    std::vector<int> results;
    work_in_order(
        jobs, counter(500), [](std::size_t, int item) { return toil(item); },
        [&](int result) { results.push_back(result); });
    ASSERT_EQ(results.size(), 500U);
    for (int i = 0; i < 500; ++i) EXPECT_EQ(results[static_cast<std::size_t>(i)], i * i);
  }
}

TEST(OrderedWork, NeverGivesOneWorkerTwoItemsAtOnce) {
  std::vector<std::atomic<int>> busy(4);
  std::atomic<int> clashes = 0;
  work_in_order(
      4, counter(400),
      [&](std::size_t worker, int item) {
        if (busy.at(worker)++ != 0) ++clashes;
        const int result = toil(item);
        --busy.at(worker);
        return result;
      },
      [](int) {});
  EXPECT_EQ(clashes, 0);
}

TEST(OrderedWork, MovesItemsThatCantBeCopied) {
  int sum = 0;
  work_in_order(
      3,
      [next = 0]() mutable -> std::optional<std::unique_ptr<int>> {
        if (next == 10) return std::nullopt;
        return std::make_unique<int>(next++);
      },
      [](std::size_t, std::unique_ptr<int> item) { return item; },
      [&](std::unique_ptr<int> item) { sum += *item; });
  EXPECT_EQ(sum, 45);
}

TEST(OrderedWork, PassesOnWhatAnyStageThrows) {
  const auto fail_at = [](int where, int item) {
    if (item == where) throw std::runtime_error("item " + std::to_string(item));
    return item;
  };
  for (const int jobs : {1, 4}) {
    std::vector<int> results;
    const auto keep = [&](int result) { results.push_back(result); };
    EXPECT_THROW(
        work_in_order(
            jobs, counter(100), [&](std::size_t, int item) { return fail_at(40, item); }, keep),
        std::runtime_error);
    EXPECT_LE(results.size(), 40U);
    EXPECT_THROW(work_in_order(
                     jobs, counter(100), [](std::size_t, int item) { return item; },
                     [&](int item) { fail_at(40, item); }),
                 std::runtime_error);
    EXPECT_THROW(
        work_in_order(
            jobs, [&, next = 0]() mutable { return std::optional<int>(fail_at(40, next++)); },
            [](std::size_t, int item) { return item; }, [](int) {}),
        std::runtime_error);
  }
}

}  // namespace
}  // namespace harco::cli
