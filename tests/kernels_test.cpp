// Every kernel gives the same bytes as its plain twin, on every instruction set of this machine.
#include <cstdint>
#include <random>
#include <vector>

#include <gtest/gtest.h>
#include <hwy/targets.h>

#include "detect/kernels/tile_extremes.hpp"

namespace harco::detect::kernels {
namespace {

/// Runs `check` once for every instruction set that this machine has.
template <typename Check>
void on_every_target(const Check& check) {
  const std::int64_t supported = hwy::SupportedTargets();
  for (std::int64_t left = supported; left != 0; left &= left - 1) {
    const std::int64_t target = left & -left;
    hwy::SetSupportedTargetsForTest(target);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
    SCOPED_TRACE(hwy::TargetName(target));
    check();
  }
  hwy::SetSupportedTargetsForTest(0);
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
}

std::vector<std::uint8_t> random_bytes(std::size_t count, std::uint32_t seed) {
  std::mt19937 random(seed);
  std::vector<std::uint8_t> bytes(count);
  for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>(random());
  return bytes;
}

TEST(Kernels, TileExtremesOfTilesKnownByHand) {
  // Two tiles, the second one column wide; three rows.
  const std::vector<std::uint8_t> pixels{9, 8, 7,   6, 50,   //
                                         5, 6, 7,   8, 255,  //
                                         9, 9, 200, 9, 60};
  std::vector<std::uint8_t> low(2);
  std::vector<std::uint8_t> high(2);
  tile_extremes(pixels.data(), 5, 5, 3, low.data(), high.data());
  EXPECT_EQ(low, (std::vector<std::uint8_t>{5, 50}));
  EXPECT_EQ(high, (std::vector<std::uint8_t>{200, 255}));
}

TEST(Kernels, TileExtremesAreTheSameOnEveryTarget) {
  on_every_target([] {
    for (int width = 1; width <= 300; width += width < 140 ? 1 : 7)
      for (int rows = 1; rows <= kTile; ++rows) {
        const std::ptrdiff_t stride = width + 3;
        // Exactly as long as needed, so that sanitizers see what is read beyond it.
        const auto pixels = random_bytes(static_cast<std::size_t>(stride * (rows - 1) + width),
                                         static_cast<std::uint32_t>(width * 4 + rows));
        const auto tiles = static_cast<std::size_t>((width + kTile - 1) / kTile);
        std::vector<std::uint8_t> low(tiles);
        std::vector<std::uint8_t> high(tiles);
        std::vector<std::uint8_t> low_by_hand(tiles);
        std::vector<std::uint8_t> high_by_hand(tiles);
        tile_extremes(pixels.data(), stride, width, rows, low.data(), high.data());
        tile_extremes_scalar(pixels.data(), stride, width, rows, low_by_hand.data(),
                             high_by_hand.data());
        ASSERT_EQ(low, low_by_hand) << width << " x " << rows;
        ASSERT_EQ(high, high_by_hand) << width << " x " << rows;
      }
  });
}

}  // namespace
}  // namespace harco::detect::kernels
