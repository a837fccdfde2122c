// Every kernel gives the same bytes as its plain twin, on every instruction set of this machine.
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <random>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include <gtest/gtest.h>
#include <hwy/targets.h>

#include "detect/kernels/band_bits.hpp"
#include "detect/kernels/bilinear.hpp"
#include "detect/kernels/clean_steps.hpp"
#include "detect/kernels/explained_blocks.hpp"
#include "detect/kernels/halve.hpp"
#include "detect/kernels/outline.hpp"
#include "detect/kernels/region_tops.hpp"
#include "detect/kernels/region_walk.hpp"
#include "detect/kernels/spread_bits.hpp"
#include "detect/kernels/tall_bits.hpp"
#include "detect/kernels/tile_extremes.hpp"
#include "detect/kernels/ways_down.hpp"
#include "pose/kernels/patch_loops.hpp"

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

TEST(Kernels, GreysBetweenPixelsKnownByHand) {
  const std::vector<std::uint8_t> pixels{0,  100, 50,  //
                                         40, 60,  255};
  const ImageView image(pixels.data(), 3, 2, 3);
  constexpr std::int32_t kPixel = 1 << kPlaceBits;
  const std::int32_t x[] = {0, kPixel / 2, kPixel / 4};
  const std::int32_t y[] = {0, 0, kPixel / 4};
  float grey[3];
  bilinear(image, x, y, 0, 0, 3, grey);
  EXPECT_EQ(grey[0], 0.0F);
  EXPECT_EQ(grey[1], 50.0F);
  EXPECT_EQ(grey[2], 30.0F);  // 25 above, 45 below
  bilinear(image, x, y, kPixel, kPixel / 2, 3, grey);
  EXPECT_EQ(grey[0], 80.0F);
  EXPECT_EQ(grey[1], 116.25F);    // (100 + 50 + 60 + 255) / 4
  EXPECT_EQ(grey[2], 103.4375F);  // 87.5 above, 108.75 below
}

TEST(Kernels, GreysBetweenPixelsAreTheSameOnEveryTarget) {
  on_every_target([] {
    std::mt19937 random(5);
    for (const int width : {2, 3, 4, 5, 17, 64})
      for (const int height : {2, 3, 20}) {
        // Exactly as long as needed, so that sanitizers see what is read beyond it.
        const std::ptrdiff_t stride = width + 1;
        const auto pixels = random_bytes(static_cast<std::size_t>(stride * (height - 1) + width),
                                         static_cast<std::uint32_t>(width * 32 + height));
        const ImageView image(pixels.data(), width, height, stride);
        std::uniform_int_distribution<std::int32_t> across(0, ((width - 1) << kPlaceBits) - 1);
        std::uniform_int_distribution<std::int32_t> down(0, ((height - 1) << kPlaceBits) - 1);
        for (int count = 1; count <= 40; ++count) {
          std::vector<std::int32_t> x, y;
          for (int i = 0; i < count; ++i) {
            x.push_back(across(random) - 7);
            y.push_back(down(random) + 5);
          }
          x[0] = ((width - 1) << kPlaceBits) - 8;  // as far to the right and down as can be
          y[0] = ((height - 1) << kPlaceBits) + 4;
          std::vector<float> grey(x.size());
          std::vector<float> by_hand(x.size());
          bilinear(image, x.data(), y.data(), 7, -5, count, grey.data());
          bilinear_scalar(image, x.data(), y.data(), 7, -5, count, by_hand.data());
          ASSERT_EQ(grey, by_hand) << width << " x " << height << ", " << count;
        }
      }
  });
}

TEST(Kernels, HalvesRowsKnownByHand) {
  // 10 + 20 + 30 + 41 = 101, a quarter of it 25.25; 0 + 1 + 1 + 0 = 2, half of one counts up.
  const std::uint8_t upper[] = {10, 20, 0, 1};
  const std::uint8_t lower[] = {30, 41, 1, 0};
  std::uint8_t half[2];
  halve_rows(upper, lower, 2, half);
  EXPECT_EQ(half[0], 25);
  EXPECT_EQ(half[1], 1);
}

TEST(Kernels, HalvedRowsAreTheSameOnEveryTarget) {
  on_every_target([] {
    for (int width = 1; width <= 200; ++width) {
      const auto size = static_cast<std::size_t>(width);
      const auto upper = random_bytes(2 * size, static_cast<std::uint32_t>(width));
      const auto lower = random_bytes(2 * size, static_cast<std::uint32_t>(width + 1000));
      std::vector<std::uint8_t> half(size);
      std::vector<std::uint8_t> by_hand(size);
      halve_rows(upper.data(), lower.data(), width, half.data());
      halve_rows_scalar(upper.data(), lower.data(), width, by_hand.data());
      ASSERT_EQ(half, by_hand) << width;
    }
  });
}

TEST(Kernels, WaysDownKnownByHand) {
  // Two words a row with one of padding on either side. Of the row below: bit 63 of the first word
  // and what follows the second.
  constexpr std::ptrdiff_t kStride = 4;
  const std::uint64_t below[2 * kStride] = {0, std::uint64_t{1} << 63, 0, 1};
  const std::uint64_t here[] = {~std::uint64_t{0}, ~std::uint64_t{0}};
  std::uint64_t ways[2 * kStride];
  ways_down({here, 0, 2, 2, true, 2, below + 1, kStride}, ways + 1);
  EXPECT_EQ(ways[1], ~std::uint64_t{0});  // to the row itself: its own pixels
  EXPECT_EQ(ways[2], ~std::uint64_t{0});
  EXPECT_EQ(ways[kStride + 1], std::uint64_t{7} << 61);  // to the next goal: two beside that
  EXPECT_EQ(ways[kStride + 2], std::uint64_t{3} << 62 | 3);
  ways_down({here, 0, 2, 2, true, 3, below + 1, kStride}, ways + 1);
  EXPECT_EQ(ways[kStride + 1], std::uint64_t{15} << 60);
  EXPECT_EQ(ways[kStride + 2], std::uint64_t{7} << 61 | 7);
  // Of the bright pixels of an inverted row.
  const std::uint64_t dark[] = {std::uint64_t{1} << 62, 1};
  ways_down({dark, ~std::uint64_t{0}, 2, 2, true, 2, below + 1, kStride}, ways + 1);
  EXPECT_EQ(ways[kStride + 1], std::uint64_t{5} << 61);
  EXPECT_EQ(ways[kStride + 2], std::uint64_t{3} << 62 | 2);
  // Of a row that is none, the ways to each goal lead on from those of the row below.
  const std::uint64_t goals[2 * kStride] = {0, 16, 0, 0, 0, 0, 1, 0};
  ways_down({here, 0, 2, 2, false, 1, goals + 1, kStride}, ways + 1);
  EXPECT_EQ(ways[1], std::uint64_t{7} << 3);
  EXPECT_EQ(ways[2], 0U);
  EXPECT_EQ(ways[kStride + 1], std::uint64_t{1} << 63);
  EXPECT_EQ(ways[kStride + 2], 3U);
  // Broad ones: within two pixels of the middle of three that lead to the last goal.
  const std::uint64_t rows[2 * kStride] = {0, ~std::uint64_t{0},      0, 0,
                                           0, std::uint64_t{3} << 62, 1, 0};
  std::uint64_t broad[2];
  ways_down({here, 0, 2, 2, false, 1, rows + 1, kStride}, ways + 1, broad);
  EXPECT_EQ(broad[0], std::uint64_t{7} << 61);
  EXPECT_EQ(broad[1], 3U);
  ways_down({dark, ~std::uint64_t{0}, 2, 2, true, 1, rows + 1, kStride}, ways + 1, broad);
  EXPECT_EQ(broad[0], std::uint64_t{5} << 61);
  EXPECT_EQ(broad[1], 2U);
  const std::uint64_t narrow[2 * kStride] = {0, ~std::uint64_t{0}, 0, 0, 0, 0, 0b11011011, 0};
  ways_down({here, 0, 2, 2, false, 1, narrow + 1, kStride}, ways + 1, broad);
  EXPECT_EQ(broad[0], 0U);
  EXPECT_EQ(broad[1], 0U);
}

TEST(Kernels, WaysDownAreTheSameOnEveryTarget) {
  on_every_target([] {
    std::mt19937_64 random(5);
    constexpr int kGoals = 4;
    for (int words = 1; words <= 40; ++words) {
      const std::ptrdiff_t stride = words + 2;
      std::vector<std::uint64_t> here(static_cast<std::size_t>(words));
      std::vector<std::uint64_t> below(static_cast<std::size_t>(kGoals * stride));
      for (std::uint64_t& word : here) word = random();
      for (std::uint64_t& word : below) word = random() & random() & random();
      for (const int reach : {1, 2, 3})
        for (const std::uint64_t flip : {std::uint64_t{0}, ~std::uint64_t{0}})
          for (const bool is_goal : {false, true}) {
            std::vector<std::uint64_t> ways(below.size());
            std::vector<std::uint64_t> by_hand(below.size());
            std::vector<std::uint64_t> broad(here.size());
            std::vector<std::uint64_t> broad_by_hand(here.size());
            const WaysRow row{here.data(),      flip,  words, kGoals, is_goal, reach,
                              below.data() + 1, stride};
            ways_down(row, ways.data() + 1, broad.data());
            ways_down_scalar(row, by_hand.data() + 1, broad_by_hand.data());
            ASSERT_EQ(ways, by_hand) << words;
            ASSERT_EQ(broad, broad_by_hand) << words;
          }
    }
  });
}

/// The ends of a region's rows, with what kernels may read beyond.
struct Ends {
  std::vector<std::int32_t> left, right;
  Outline outline(int row_step) {
    Outline outline{left.data(), right.data(), static_cast<int>(left.size()), row_step, 0};
    outline.columns = *std::max_element(right.begin(), right.end()) -
                      *std::min_element(left.begin(), left.end()) + 1;
    left.resize(left.size() + 64, 99999);
    right.resize(right.size() + 64, -99999);
    outline.left = left.data();
    outline.right = right.data();
    return outline;
  }
};

// Of five rows: one pixel, three, seven, three, one. From its middle, (15, 2), the lower right
// corner of the middle row is farthest; farthest from that is the row's upper left one.
TEST(Kernels, OutlineKnownByHand) {
  Ends ends{{15, 14, 12, 14, 15}, {15, 16, 18, 16, 15}};
  const Outline outline = ends.outline(1);
  const OutlineCorners expected{{{19, 3}, {15, 5}, {12, 2}, {16, 0}}};
  on_every_target([&] {
    EXPECT_EQ(outline_corners(outline), expected);
    // Half way down, the middle row's ends lie beyond the steep sides by 3 over twice their
    // length; those of the rows beside lie within the flat ones by 4.
    EXPECT_TRUE(outline_keeps_to(outline, expected, {4, 3, 4, 3}));
    EXPECT_FALSE(outline_keeps_to(outline, expected, {4, 2, 4, 3}));
    EXPECT_FALSE(outline_keeps_to(outline, expected, {3, 3, 4, 3}));
  });
  // Products of so wide a region don't fit into 32 bits everywhere.
  Ends wide{{0, 0, 0}, {9000, 9000, 9000}};
  const Outline bar = wide.outline(1);
  const OutlineCorners corners{{{9001, 3}, {0, 3}, {0, 0}, {9001, 0}}};
  on_every_target([&] {
    EXPECT_EQ(outline_corners(bar), corners);
    EXPECT_TRUE(outline_keeps_to(bar, corners, {18002, 6, 18002, 6}));
    EXPECT_FALSE(outline_keeps_to(bar, {{{9001, 3}, {0, 3}, {0, 0}, {9001, 2}}}, {1, 6, 1, 6}));
  });
}

TEST(Kernels, OutlinesAreTheSameOnEveryTarget) {
  on_every_target([] {
    std::mt19937 random(11);
    const auto up_to = [&](int most) {
      return static_cast<int>(random() % static_cast<unsigned>(most + 1));
    };
    int kept = 0;
    for (int round = 0; round < 600; ++round) {
      // A quadrilateral of about four sides, rough by some pixels.
      const int rows = 1 + up_to(90);
      const int rough = up_to(2);
      Ends ends;
      const int middle = 100 + up_to(50);
      const int bulge_left = up_to(rows);
      const int bulge_right = up_to(rows);
      const int left_slope = 1 + up_to(2);
      const int right_slope = 1 + up_to(2);
      for (int row = 0; row < rows; ++row) {
        const int left = left_slope * (std::min(row, 2 * bulge_left - row) + 1);
        const int right = right_slope * (std::min(row, 2 * bulge_right - row) + 1);
        ends.left.push_back(middle - std::max(left, 0) - up_to(rough));
        ends.right.push_back(middle + std::max(right, 0) + up_to(rough));
      }
      const Outline outline = ends.outline(1 + up_to(1));
      const OutlineCorners corners = outline_corners(outline);
      ASSERT_EQ(corners, outline_corners_scalar(outline)) << round;
      OutlineSlack slack;
      for (std::int32_t& side : slack) side = up_to(3000);
      const bool keeps = outline_keeps_to(outline, corners, slack);
      ASSERT_EQ(keeps, outline_keeps_to_scalar(outline, corners, slack)) << round;
      kept += keeps;
    }
    EXPECT_GT(kept, 50);
    EXPECT_LT(kept, 550);
  });
}

TEST(Kernels, TallBitsKnownByHand) {
  const std::uint64_t here[] = {0b1111, 0};
  const std::uint64_t above[] = {0b0111, 0};
  const std::uint64_t top[] = {0b1101, 1};
  std::uint64_t tall[2];
  tall_bits(here, above, top, 0, 2, tall);
  EXPECT_EQ(tall[0], 0b0101U);
  EXPECT_EQ(tall[1], 0U);
  tall_bits(here, above, top, ~std::uint64_t{0}, 2, tall);
  EXPECT_EQ(tall[0], ~std::uint64_t{0b1111});
  EXPECT_EQ(tall[1], ~std::uint64_t{1});
}

TEST(Kernels, TallBitsAreTheSameOnEveryTarget) {
  on_every_target([] {
    std::mt19937_64 random(6);
    for (int words = 1; words <= 40; ++words) {
      const auto size = static_cast<std::size_t>(words);
      std::vector<std::uint64_t> rows(3 * size);
      for (std::uint64_t& word : rows) word = random();
      for (const std::uint64_t flip : {std::uint64_t{0}, ~std::uint64_t{0}}) {
        std::vector<std::uint64_t> tall(size);
        std::vector<std::uint64_t> by_hand(size);
        const std::uint64_t* row = rows.data();
        tall_bits(row, row + words, row + 2 * words, flip, words, tall.data());
        tall_bits_scalar(row, row + words, row + 2 * words, flip, words, by_hand.data());
        ASSERT_EQ(tall, by_hand) << words;
      }
    }
  });
}

TEST(Kernels, RegionTopsKnownByHand) {
  // Padding, the two words of a row, and padding; of the row above it and of the others likewise.
  const std::uint64_t last = std::uint64_t{1} << 63;
  const std::uint64_t here[] = {0, 0b1110'0110'0110 | last, 0b11, 0};
  std::uint64_t above[] = {0b0010'0000'0000, 0, 0};
  std::uint64_t steep[] = {0b1110'0110'0100, 0b10, 0};
  const std::uint64_t ways[] = {0b1110'0000'0110, 0b10, 0};
  std::uint64_t ends[2];
  std::uint64_t open[2];
  std::uint64_t some[1];
  const TopsRow row{here + 1, above, 0, steep, ways, 2};
  region_tops(row, {ends, open, some});
  // The first stretch; not the second, which has no way down, nor the third, which goes on upwards.
  // The one across the words' border is this word's.
  EXPECT_EQ(ends[0], 0b1000U);
  EXPECT_EQ(open[0], ~std::uint64_t{0});
  EXPECT_EQ(ends[1], 0U);
  EXPECT_EQ(open[1], 0U);
  EXPECT_EQ(some[0], 1U);
  // Something above it in the next word, or nothing steep in either.
  above[1] = 0b01;
  region_tops(row, {ends, open, some});
  EXPECT_EQ(open[0], 0U);
  above[1] = 0;
  steep[1] = 0b100;
  region_tops(row, {ends, open, some});
  EXPECT_EQ(open[0], 0U);
}

TEST(Kernels, RegionTopsAreTheSameOnEveryTarget) {
  on_every_target([] {
    std::mt19937_64 random(7);
    for (int words = 1; words <= 140; ++words) {
      const auto size = static_cast<std::size_t>(words);
      std::vector<std::uint64_t> rows(4 * size + 2);
      for (std::uint64_t& word : rows) word = random() | random();
      // Few words have any; some stretches are as long as a word.
      for (std::size_t i = 0; i < size; ++i) {
        rows[1 + 2 * size + i] &= random() & random() & random();
        if (random() % 8U == 0U) rows[1 + i] = ~std::uint64_t{0};
        if (random() % 4U == 0U) rows[1 + size + i] = 0;
      }
      for (const std::uint64_t flip : {std::uint64_t{0}, ~std::uint64_t{0}}) {
        const std::uint64_t* first = rows.data() + 1;
        const TopsRow row{first, first + size, flip, first + 2 * size, first + 3 * size, words};
        const std::size_t blocks = (size + 63) / 64;
        std::vector<std::uint64_t> ends(size), open(size), some(blocks);
        std::vector<std::uint64_t> ends_by_hand(size), open_by_hand(size), some_by_hand(blocks);
        region_tops(row, {ends.data(), open.data(), some.data()});
        region_tops_scalar(row, {ends_by_hand.data(), open_by_hand.data(), some_by_hand.data()});
        ASSERT_EQ(ends, ends_by_hand) << words;
        ASSERT_EQ(open, open_by_hand) << words;
        ASSERT_EQ(some, some_by_hand) << words;
      }
    }
  });
}

TEST(Kernels, ExtremesNearbyAreTheSameOnEveryTarget) {
  on_every_target([] {
    for (int tiles = 1; tiles <= 150; ++tiles) {
      const auto count = static_cast<std::size_t>(tiles);
      const auto seed = static_cast<std::uint32_t>(tiles);
      std::vector<std::vector<std::uint8_t>> rows;
      for (std::uint32_t i = 0; i < 6; ++i) rows.push_back(random_bytes(count + 2, 6 * seed + i));
      const TileBands bands{{rows[0].data(), rows[1].data(), rows[2].data()},
                            {rows[3].data(), rows[4].data(), rows[5].data()}};
      std::vector<std::uint8_t> low(count);
      std::vector<std::uint8_t> high(count);
      std::vector<std::uint8_t> low_by_hand(count);
      std::vector<std::uint8_t> high_by_hand(count);
      tile_extremes_nearby(bands, tiles, low.data(), high.data());
      tile_extremes_nearby_scalar(bands, tiles, low_by_hand.data(), high_by_hand.data());
      ASSERT_EQ(low, low_by_hand) << tiles;
      ASSERT_EQ(high, high_by_hand) << tiles;
    }
  });
}

// Two rows of ten pixels. The first tile's threshold is 40 + ceil(7 / 16 * 161) = 111, its step
// ceil(6 / 16 * 161) = 61; the second one's contrast is too small for anything dark, its step 6;
// the last one has no contrast and a step of 1.
TEST(Kernels, BandBitsKnownByHand) {
  const std::uint8_t low[] = {40, 90, 7};
  const std::uint8_t high[] = {201, 105, 7};
  const std::uint8_t above[] = {161, 160, 100, 0, 90, 96, 96, 90, 8, 7};
  const std::uint8_t first[] = {110, 111, 40, 201, 90, 91, 92, 105, 7, 7};
  const std::uint8_t second[] = {100, 99, 100, 61, 90, 90, 91, 90, 7, 7};
  Band band{{above, above, first, second, second, second, second}, low, high, 10, 2};
  std::array<std::uint8_t, 16> dark{}, edges{};
  dark.fill(0xFF);
  edges.fill(0xFF);
  const BandLevel level{7, 16, 6, true, 1, dark.data(), edges.data(), 8};
  on_every_target([&] {
    band_bits(band, level);
    EXPECT_EQ(dark[0], 0b0000'0101);
    EXPECT_EQ(dark[1], 0);
    EXPECT_EQ(dark[8], 0b0000'1111);
    EXPECT_EQ(edges[0], 0b0010'0011);  // from `above` to `second`
    EXPECT_EQ(edges[1], 0b0000'0001);
    // Bright ones: where it rises. Nothing is asked of the second row.
    BandLevel bright = level;
    bright.dark = false;
    bright.edge_step = 2;
    edges[8] = 0x55;
    band_bits(band, bright);
    EXPECT_EQ(edges[0], 0b0000'1000);
    EXPECT_EQ(edges[1], 0);
    EXPECT_EQ(edges[8], 0x55);
  });
}

TEST(Kernels, BandBitsAreTheSameOnEveryTarget) {
  on_every_target([] {
    for (int width = 1; width <= 300; ++width) {
      const auto count = static_cast<std::size_t>(width);
      const auto tiles = (count + kTile - 1) / kTile;
      const auto seed = static_cast<std::uint32_t>(1000 * width);
      std::vector<std::vector<std::uint8_t>> rows;
      Band band{};
      for (std::size_t i = 0; i < band.rows.size(); ++i) {
        rows.push_back(random_bytes(count, seed + static_cast<std::uint32_t>(i)));
        band.rows[i] = rows.back().data();
      }
      auto low = random_bytes(tiles, seed + 100);
      auto high = random_bytes(tiles, seed + 101);
      for (std::size_t i = 0; i < tiles; ++i)
        if (low[i] > high[i]) std::swap(low[i], high[i]);
      band.low = low.data();
      band.high = high.data();
      band.width = width;
      band.height = width % 7 == 0 ? 3 : kTile;
      const std::size_t stride = (count + kBitsAtOnce - 1) / kBitsAtOnce * kBitsAtOnce / 8;
      for (const int sixteenths : {0, 5, 11, 16})
        for (const bool is_dark : {false, true}) {
          std::vector<std::uint8_t> dark(kTile * stride), edges(dark.size());
          std::vector<std::uint8_t> dark_by_hand(dark.size()), edges_by_hand(dark.size());
          BandLevel level{sixteenths,
                          16 * sixteenths % 48,
                          1 + sixteenths / 3,
                          is_dark,
                          sixteenths == 5 ? 2 : 1,
                          dark.data(),
                          edges.data(),
                          static_cast<std::ptrdiff_t>(stride)};
          band_bits(band, level);
          level.dark_bits = dark_by_hand.data();
          level.edge_bits = edges_by_hand.data();
          band_bits_scalar(band, level);
          ASSERT_EQ(dark, dark_by_hand) << width;
          ASSERT_EQ(edges, edges_by_hand) << width;
        }
    }
  });
}

TEST(Kernels, CleanStepsKnownByHand) {
  // One row a place; the step lies between the fourth and the fifth sample. In turn: a clean one
  // up, one down, too little contrast, uneven before, uneven behind, the middle passed too late and
  // too early, as uneven as may be, hardly more.
  const std::vector<std::array<std::uint8_t, 8>> places{
      {10, 10, 10, 20, 90, 90, 90, 90},   {90, 90, 90, 80, 10, 10, 10, 10},
      {50, 50, 50, 50, 69, 69, 69, 69},   {30, 10, 10, 20, 90, 90, 90, 90},
      {10, 10, 10, 20, 90, 90, 90, 120},  {10, 10, 10, 20, 30, 90, 90, 90},
      {10, 10, 10, 70, 90, 90, 90, 90},   {10, 30, 30, 30, 99, 110, 110, 110},
      {10, 31, 31, 31, 99, 110, 110, 110}};
  std::array<std::vector<std::uint8_t>, 8> columns;
  EightSamples samples{};
  for (std::size_t k = 0; k < samples.size(); ++k) {
    for (const auto& place : places) columns[k].push_back(place[k]);
    samples[k] = columns[k].data();
  }
  std::vector<std::uint8_t> rising(2, 0xFF);
  std::vector<std::uint8_t> falling(2, 0xFF);
  clean_steps(samples, 3, 9, 20, rising.data(), falling.data());
  EXPECT_EQ(rising, (std::vector<std::uint8_t>{0b10000001, 0}));
  EXPECT_EQ(falling, (std::vector<std::uint8_t>{0b00000010, 0}));
  // Of two samples on either side those that are uneven at the outermost ones are clean as well.
  clean_steps(samples, 2, 9, 20, rising.data(), falling.data());
  EXPECT_EQ(rising, (std::vector<std::uint8_t>{0b10011001, 1}));
  EXPECT_EQ(falling, (std::vector<std::uint8_t>{0b00000010, 0}));
}

TEST(Kernels, CleanStepsAreTheSameOnEveryTarget) {
  on_every_target([] {
    int up = 0;
    int down = 0;
    for (int count = 1; count <= 300; ++count) {
      // Of two levels, so that there are steps.
      std::array<std::vector<std::uint8_t>, 8> columns;
      EightSamples samples{};
      for (std::size_t k = 0; k < samples.size(); ++k) {
        columns[k] = random_bytes(static_cast<std::size_t>(count),
                                  static_cast<std::uint32_t>(count) + 1000U * std::uint32_t(k));
        for (std::uint8_t& value : columns[k])
          value = static_cast<std::uint8_t>((value & 0x80U ? 150U : 50U) + (value & 0x1FU));
        samples[k] = columns[k].data();
      }
      std::vector<std::uint8_t> rising(static_cast<std::size_t>(count + 7) / 8);
      std::vector<std::uint8_t> falling = rising;
      std::vector<std::uint8_t> rising_by_hand = rising;
      std::vector<std::uint8_t> falling_by_hand = rising;
      for (const auto& [even, contrast] : {std::pair(2, 1), std::pair(3, 80), std::pair(3, 255)}) {
        clean_steps(samples, even, count, contrast, rising.data(), falling.data());
        clean_steps_scalar(samples, even, count, contrast, rising_by_hand.data(),
                           falling_by_hand.data());
        ASSERT_EQ(rising, rising_by_hand) << count;
        ASSERT_EQ(falling, falling_by_hand) << count;
        for (const std::uint8_t byte : rising) up += std::popcount(byte);
        for (const std::uint8_t byte : falling) down += std::popcount(byte);
      }
    }
    EXPECT_GT(up, 100);
    EXPECT_GT(down, 100);
  });
}

TEST(Kernels, SpreadBitsKnownByHand) {
  // Two words, with one on either side.
  const std::uint64_t bits[] = {std::uint64_t{1} << 62, 1U << 10, std::uint64_t{1} << 63, 4};
  std::uint64_t spread[2];
  spread_bits(bits + 1, 2, spread);
  EXPECT_EQ(spread[0], 0b11111110000011U);  // 62 + 3 is bit 1 of the next word
  EXPECT_EQ(spread[1], std::uint64_t{15} << 60 | std::uint64_t{1} << 63);
}

TEST(Kernels, SpreadBitsAreTheSameOnEveryTarget) {
  on_every_target([] {
    std::mt19937_64 random(7);
    for (int words = 1; words <= 40; ++words) {
      std::vector<std::uint64_t> bits(static_cast<std::size_t>(words + 2));
      for (std::uint64_t& word : bits) {
        const std::uint64_t some = random();
        const std::uint64_t few = some & random();
        word = few & random();
      }
      std::vector<std::uint64_t> spread(static_cast<std::size_t>(words));
      std::vector<std::uint64_t> by_hand = spread;
      spread_bits(bits.data() + 1, words, spread.data());
      spread_bits_scalar(bits.data() + 1, words, by_hand.data());
      ASSERT_EQ(spread, by_hand) << words;
    }
  });
}

TEST(Kernels, ExplainedBlocksKnownByHand) {
  // Three blocks of two texels: off by nothing; by 3 and 4, or 25; by 5 and 1, or 26. Two are
  // marked.
  const std::int16_t seen[] = {10, 13, 15, 20, 16, 21};
  const std::int16_t predicted[] = {10, 10, 10, 20, 20, 20};
  const std::uint8_t marked[] = {0, 1, 1};
  const Explained close = explained_blocks(seen, predicted, marked, 3, 2, 25);
  EXPECT_EQ(close.all, 2);
  EXPECT_EQ(close.marked, 1);
  const Explained closer = explained_blocks(seen, predicted, marked, 3, 2, 24);
  EXPECT_EQ(closer.all, 1);
  EXPECT_EQ(closer.marked, 0);
}

TEST(Kernels, ExplainedBlocksAreTheSameOnEveryTarget) {
  on_every_target([] {
    std::mt19937 random(3);
    constexpr int kTexels = 16;
    int explained = 0;
    for (int count = 1; count <= 150; ++count) {
      const auto all = static_cast<std::size_t>(kTexels * count);
      std::vector<std::int16_t> seen(all);
      std::vector<std::int16_t> predicted(all);
      std::vector<std::uint8_t> marked(static_cast<std::size_t>(count));
      // About as far apart as the limit, but for some that are very far.
      for (std::size_t i = 0; i < all; ++i) {
        predicted[i] = static_cast<std::int16_t>(random() % 256U);
        seen[i] = static_cast<std::int16_t>(predicted[i] + static_cast<int>(random() % 140U) - 70);
        if (random() % 64U == 0U) seen[i] = static_cast<std::int16_t>(random() % 2U ? 1020 : -1020);
      }
      for (std::uint8_t& mark : marked) mark = static_cast<std::uint8_t>(random() % 2U);
      const Explained fast =
          explained_blocks(seen.data(), predicted.data(), marked.data(), count, kTexels, 26634);
      const Explained plain = explained_blocks_scalar(seen.data(), predicted.data(), marked.data(),
                                                      count, kTexels, 26634);
      ASSERT_EQ(fast.all, plain.all) << count;
      ASSERT_EQ(fast.marked, plain.marked) << count;
      explained += fast.all;
    }
    EXPECT_GT(explained, 1000);
    EXPECT_LT(explained, 10000);
  });
}

/// What a function makes of floats, the same on every instruction set.
template <typename Compute>
void expect_same_bits(const Compute& compute) {
  std::vector<float> first;
  on_every_target([&] {
    const std::vector<float> now = compute();
    if (first.empty()) first = now;
    EXPECT_EQ(now, first);
  });
  EXPECT_FALSE(first.empty());
}

std::vector<float> random_floats(std::size_t count, std::uint32_t seed) {
  std::mt19937 random(seed);
  std::vector<float> values(count);
  for (float& value : values) value = static_cast<float>(random()) * 0x1p-31F - 1.0F;
  return values;
}

/// Columns of random numbers of one length.
struct Columns {
  std::vector<std::vector<float>> values;
  std::vector<float*> pointers;

  Columns(std::size_t n, std::size_t count, std::uint32_t seed) {
    for (std::uint32_t k = 0; k < n; ++k) values.push_back(random_floats(count, seed + k));
    for (auto& column : values) pointers.push_back(column.data());
  }
  const float* const* data() const { return pointers.data(); }
  double at(std::size_t k, std::size_t i) const { return static_cast<double>(values[k][i]); }
};

TEST(Kernels, NormalProductsAreTheSameOnEveryTarget) {
  constexpr std::size_t kColumns = 7;
  for (const std::size_t count : {0U, 1U, 15U, 16U, 39U, 512U, 1100U}) {
    const auto weights = random_floats(count, 1);
    const Columns columns(kColumns, count, 2);
    const auto compute = [&] {
      std::vector<float> sums(kColumns * kColumns);
      harco::kernels::normal_products(weights.data(), columns.data(), kColumns, count, sums.data());
      return sums;
    };
    expect_same_bits(compute);
    const std::vector<float> sums = compute();
    for (std::size_t a = 0; a < kColumns; ++a)
      for (std::size_t b = 0; b <= a; ++b) {
        double sum = 0.0;
        for (std::size_t i = 0; i < count; ++i)
          sum += static_cast<double>(weights[i]) * columns.at(a, i) * columns.at(b, i);
        EXPECT_NEAR(static_cast<double>(sums[a * kColumns + b]), sum, 2e-5);
      }
  }
}

TEST(Kernels, RowsAreSubtractedTheSameOnEveryTarget) {
  for (const std::size_t count : {0U, 7U, 64U, 1500U}) {
    const auto from = random_floats(count, 1), by = random_floats(3, 2);
    const Columns columns(3, count, 3);
    const auto compute = [&] {
      std::vector<float> left(count + 1);
      harco::kernels::subtract_rows(from.data(), columns.data(), by.data(), 3, count, left.data());
      return left;
    };
    expect_same_bits(compute);
    const std::vector<float> left = compute();
    for (std::size_t i = 0; i < count; ++i) {
      double expected = static_cast<double>(from[i]);
      for (std::size_t k = 0; k < 3; ++k) expected -= static_cast<double>(by[k]) * columns.at(k, i);
      EXPECT_NEAR(static_cast<double>(left[i]), expected, 1e-5);
    }
  }
}

TEST(Kernels, WeightsByHand) {
  const std::vector<float> residuals{0.0F, 1.0F, -4.0F, 8.0F, -100.0F};
  std::vector<float> weights(residuals.size());
  harco::kernels::huber_weights(residuals.data(), 0.25F, residuals.size(), weights.data());
  EXPECT_EQ(weights, (std::vector<float>{1.0F, 1.0F, 0.5F, 0.25F, 0.02F}));
  harco::kernels::tukey_weights(residuals.data(), 0.25F, 1.0F / 16.0F, residuals.size(),
                                weights.data());
  EXPECT_EQ(weights, (std::vector<float>{1.0F, 0.96899414F, 0.5625F, 0.0F, 0.0F}));
}

TEST(Kernels, WeightsAreTheSameOnEveryTarget) {
  for (std::size_t count = 0; count < 40; ++count) {
    const auto residuals = random_floats(count, 1);
    expect_same_bits([&] {
      std::vector<float> weights(2 * count + 1);
      harco::kernels::huber_weights(residuals.data(), 7.0F, count, &weights[0]);
      harco::kernels::tukey_weights(residuals.data(), 7.0F, 0.2F, count, &weights[count]);
      return weights;
    });
  }
}

/// What take_pixels makes of a random patch: its columns one after the other.
struct TakenPixels {
  static constexpr std::size_t kArea = harco::kernels::kSide * harco::kernels::kSide;
  static constexpr std::size_t kColumns = 12, kRoom = kArea + harco::kernels::kSide;
  static constexpr float kLeast = 0.9F, kPeak = 0.25F;
  static constexpr harco::kernels::Slope kU{0.5F, 0.1F, -0.2F}, kV{-0.25F, 0.0F, 0.3F};
  std::vector<float> grey = random_floats(kArea, 7), bulge = random_floats(kArea, 8);
  Columns drawn{6, kArea, 1};
  std::array<harco::kernels::Flow, 2> flows{
      {{{0.5F, 0.1F, -0.2F}, {1.0F, 0.0F, 0.3F}}, {{-0.25F, 0.0F, 0.0F}, {2.0F, 0.7F, 0.0F}}}};
  std::array<std::uint16_t, harco::kernels::kSide> some{}, allowed{};
  std::vector<std::vector<float>> columns;
  std::size_t count = 0;

  TakenPixels() {
    for (std::size_t y = 0; y < some.size(); ++y) {
      some[y] = static_cast<std::uint16_t>(0x8421U << (y % 5));
      allowed[y] = y < 3 || y == 9 ? 0 : static_cast<std::uint16_t>(0xffffU >> (y % 4));
    }
  }

  void take(bool bulges) {
    columns.assign(kColumns, std::vector<float>(kRoom));
    const auto at = [&](std::size_t k) { return columns[k].data(); };
    const std::array<float*, 2> rows{at(6), at(7)};
    count = harco::kernels::take_pixels(
        {grey.data(),
         {drawn.pointers[0], drawn.pointers[1], drawn.pointers[2], drawn.pointers[3],
          drawn.pointers[4], drawn.pointers[5]},
         bulges ? bulge.data() : nullptr,
         kPeak,
         flows.data(),
         flows.size(),
         kU,
         kV},
        kLeast, some.data(), allowed.data(),
        {at(0), at(1), at(2), at(3), at(4), at(5), rows.data(), at(8), at(9), at(10), at(11)});
    for (auto& column : columns) column.resize(count);
  }

  bool is_wanted(std::size_t at) const {
    constexpr std::size_t kSide = harco::kernels::kSide;
    const unsigned bit = 1U << (at % kSide);
    const bool steep = std::hypot(drawn.values[1][at], drawn.values[2][at]) >= kLeast;
    return (allowed[at / kSide] & bit) != 0 && (steep || (some[at / kSide] & bit) != 0);
  }
};

TEST(Kernels, PixelsAreTakenTheSameOnEveryTarget) {
  for (const bool bulges : {false, true})
    expect_same_bits([&] {
      TakenPixels pixels;
      pixels.take(bulges);
      std::vector<float> all;
      for (const auto& column : pixels.columns) all.insert(all.end(), column.begin(), column.end());
      return all;
    });
}

TEST(Kernels, PixelsAreTakenAsByHand) {
  constexpr std::size_t kSide = harco::kernels::kSide;
  TakenPixels pixels;
  pixels.take(true);
  std::size_t n = 0;
  for (std::size_t at = 0; at < TakenPixels::kArea; ++at) {
    if (!pixels.is_wanted(at)) continue;
    ASSERT_LT(n, pixels.count);
    const double dx = static_cast<double>(at % kSide) - 7.5,
                 dy = static_cast<double>(at / kSide) - 7.5;
    const auto along = [&](const harco::kernels::Slope& slope) {
      return static_cast<double>(slope.middle) + static_cast<double>(slope.by_x) * dx +
             static_cast<double>(slope.by_y) * dy;
    };
    const auto drawn = [&](std::size_t k) { return pixels.drawn.at(k, at); };
    const auto bulge = static_cast<double>(pixels.bulge[at]);
    const auto flow = [&](std::size_t k) {
      return drawn(1) * along(pixels.flows[k].x) + drawn(2) * along(pixels.flows[k].y);
    };
    const std::array<double, TakenPixels::kColumns> expected{static_cast<double>(pixels.grey[at]),
                                                             1.0 - drawn(0) - 0.25 * bulge,
                                                             along(TakenPixels::kU),
                                                             along(TakenPixels::kV),
                                                             dx / 8.0,
                                                             dy / 8.0,
                                                             flow(0),
                                                             flow(1),
                                                             -0.5 * drawn(3),
                                                             -drawn(4),
                                                             -0.5 * drawn(5),
                                                             -bulge};
    for (std::size_t k = 0; k < expected.size(); ++k)
      EXPECT_NEAR(static_cast<double>(pixels.columns[k][n]), expected[k], 1e-5) << k << " " << at;
    ++n;
  }
  EXPECT_EQ(n, pixels.count);
  EXPECT_GT(n, 30U);
}

/// Samples in a light, as light_rows wants them.
struct LitPixels {
  static constexpr std::size_t kColumns = 13, kPictured = 1;
  static constexpr int kCells = 4;
  std::vector<float> grey, white_share, u, v, depth, residuals;
  Columns columns;
  std::vector<float> seen{0.0F, 0.3F, 0.6F, 0.8F, 1.0F}, slope{1.2F, 1.2F, 1.0F, 0.8F, 0.8F},
      by_log_gamma{0.0F, 0.2F, 0.3F, 0.2F, 0.0F};

  explicit LitPixels(std::size_t count)
      : grey(random_floats(count, 1)),
        white_share(random_floats(count, 2)),
        u(random_floats(count, 3)),
        v(random_floats(count, 4)),
        depth(random_floats(count, 5)),
        residuals(count),
        columns(kColumns, count, 6) {
    for (float& value : grey) value = 128.0F + 127.0F * value;
    for (float& value : white_share) value = 0.5F + 0.6F * value;  // some beyond 0 ... 1
    for (float& value : depth) value = 0.5F + 0.5F * value;
  }

  harco::kernels::LightTerms terms() const {
    return {seen.data(),
            slope.data(),
            by_log_gamma.data(),
            kCells,
            {30.0F, 2.0F, -3.0F, 200.0F, 10.0F, 20.0F, 4.0F, -6.0F, 8.0F},
            0.15F,
            0.4F,
            0.3F,
            kPictured};
  }

  /// All that light_rows leaves.
  std::vector<float> lit(bool shaded, float gain) {
    harco::kernels::light_rows(
        {grey.data(), white_share.data(), u.data(), v.data(), shaded ? depth.data() : nullptr,
         columns.pointers.data(), residuals.data()},
        terms(), gain, 0, grey.size());
    std::vector<float> all = residuals;
    for (const auto& column : columns.values) all.insert(all.end(), column.begin(), column.end());
    return all;
  }
};

TEST(Kernels, LitRowsAreTheSameOnEveryTarget) {
  for (const std::size_t count : {1U, 7U, 16U, 39U})
    for (const bool shaded : {false, true})
      expect_same_bits([&] { return LitPixels(count).lit(shaded, 1.1F); });
}

TEST(Kernels, LitRowsAreDerivativesOfGreys) {
  // By the levels of black (columns 2 to 4) and of white (5 to 10), and what a shadow takes (11,
  // 12).
  constexpr std::size_t kCount = 30;
  LitPixels at(kCount);
  at.lit(true, 0.9F);
  const auto value = [&](std::size_t i, const harco::kernels::LightTerms& t) {
    const double w = std::clamp(static_cast<double>(at.white_share[i]), 0.0, 1.0) * t.cells;
    const auto cell = std::min<std::size_t>(static_cast<std::size_t>(w), LitPixels::kCells - 1);
    const double part = w - static_cast<double>(cell);
    const double seen = (1.0 - part) * static_cast<double>(t.seen[cell]) +
                        part * static_cast<double>(t.seen[cell + 1]);
    std::array<double, 9> l{};
    for (std::size_t k = 0; k < l.size(); ++k) l[k] = static_cast<double>(t.levels[k]);
    const auto u = static_cast<double>(at.u[i]), v = static_cast<double>(at.v[i]);
    const double bow = l[6] * u * u + l[7] * u * v + l[8] * v * v;
    const double black = l[0] + l[1] * u + l[2] * v + static_cast<double>(t.dark_part) * bow;
    const double white = l[3] + l[4] * u + l[5] * v + bow;
    const auto depth = static_cast<double>(at.depth[i]);
    return 0.9 * ((1.0 - depth * static_cast<double>(t.less_black)) * (1.0 - seen) * black +
                  (1.0 - depth * static_cast<double>(t.less_white)) * seen * white);
  };
  for (std::size_t i = 0; i < kCount; ++i) {
    const double grey = value(i, at.terms());
    ASSERT_LT(grey, 255.0);
    EXPECT_NEAR(static_cast<double>(at.grey[i] - at.residuals[i]), grey, 1e-3);
    for (std::size_t k = 0; k < 11; ++k) {
      harco::kernels::LightTerms more = at.terms();
      float& moved = k < 9 ? more.levels[k] : k == 9 ? more.less_white : more.less_black;
      moved += k < 9 ? 1.0F : -1.0F;
      EXPECT_NEAR(at.columns.at(2 + k, i), value(i, more) - grey, 1e-3) << k;
    }
  }
}

/// Sixteen floats that vectors may be read from and written to.
struct alignas(64) Sixteen {
  std::array<float, 16> values;
};

/// A step that a row of pixels sees as a ramp from -half to half, half being 2 pixels; on a margin
/// of `margin` pixels.
std::vector<float> ramp_steps(std::size_t margin, std::size_t stride) {
  using harco::kernels::kSide;
  using harco::kernels::Steps;
  std::vector<float> table(3 * Steps::kPhases * stride);
  for (std::size_t phase = 0; phase < Steps::kPhases; ++phase)
    for (std::size_t i = 0; i < stride; ++i) {
      const float d = static_cast<float>(i) - static_cast<float>(kSide + margin) +
                      static_cast<float>(phase) / static_cast<float>(Steps::kPhases);
      table[3 * phase * stride + i] = std::clamp(0.5F + 0.25F * d, 0.0F, 1.0F);
      table[(3 * phase + 1) * stride + i] = std::abs(d) < 2.0F ? 0.25F : 0.0F;
    }
  return table;
}

TEST(Kernels, PatchesAreDrawnTheSameOnEveryTarget) {
  using harco::kernels::kSide;
  for (const std::size_t margin : {1U, 2U, 5U}) {
    const std::size_t rows = 2 * (kSide + 2 * margin), stride = 2 * (kSide + margin) + 4;
    const auto table = random_floats(48 * stride, 3), starts = random_floats(rows, 4);
    const auto value = random_floats(2 * margin, 5), slope = random_floats(2 * margin, 6),
               bend = random_floats(2 * margin, 7);
    const auto bottom = static_cast<float>(rows);
    const std::vector<harco::kernels::PatchEdge> edges{{3.7F, 0.2F, 1.25F, bottom, 1.0F},
                                                       {17.0F, -4.0F, 8.5F, 11.75F, -1.0F}};
    expect_same_bits([&] {
      constexpr std::size_t kArea = kSide * kSide;
      std::vector<Sixteen> scratch(3 * rows);
      std::vector<float> out(6 * kArea);
      for (const bool more : {false, true})
        harco::kernels::draw_patch(
            edges.data(), edges.size(), starts.data(), margin,
            {table.data(), stride, static_cast<float>(kSide + 2 * margin) + 0.5F},
            {value.data(), slope.data(), bend.data(), value.size()}, more,
            scratch.front().values.data(),
            {&out[0], &out[kArea], &out[2 * kArea], &out[3 * kArea], &out[4 * kArea],
             &out[5 * kArea]});
      return out;
    });
  }
}

TEST(Kernels, DrawsASlantedEdgeByHand) {
  using harco::kernels::kSide;
  constexpr std::size_t kMargin = 2, kRows = 2 * (kSide + 2 * kMargin);
  constexpr std::size_t kStride = 2 * (kSide + kMargin) + 4;
  const std::vector<float> table = ramp_steps(kMargin, kStride), starts(kRows, 0.0F);
  // One pixel to the right in each, from the patch's pixel 3.5 (x = 6) in its first row on; below
  // its fifth row of pixels there is no more of it.
  const std::vector<harco::kernels::PatchEdge> edge{{6.0F, 0.5F, 4.0F, 14.0F, 1.0F}};
  const std::vector<float> value{0.5F}, none{0.0F};
  std::vector<Sixteen> scratch(3 * kRows);
  constexpr std::size_t kArea = kSide * kSide;
  std::vector<float> out(6 * kArea);
  harco::kernels::draw_patch(
      edge.data(), edge.size(), starts.data(), kMargin,
      {table.data(), kStride, static_cast<float>(kSide + 2 * kMargin) + 0.5F},
      {value.data(), none.data(), none.data(), 1}, false, scratch.front().values.data(),
      {&out[0], &out[kArea], &out[2 * kArea], &out[3 * kArea], &out[4 * kArea], &out[5 * kArea]});
  for (std::size_t y = 0; y < kSide; ++y)
    for (std::size_t x = 0; x < kSide; ++x) {
      // The edge in the middle of this row of pixels; pixel x is seen at x + 0.5 + margin.
      const float edge_x = 6.0F + static_cast<float>(y) + 0.5F;
      const float d = static_cast<float>(x + kMargin) + 0.5F - edge_x;
      const bool bent = std::abs(std::abs(d) - 2.0F) < 0.6F;  // within it, half rows differ
      const float expected = y < 5 ? std::clamp(0.5F + 0.25F * d, 0.0F, 1.0F) : 0.0F;
      if (!bent || y >= 5) {
        EXPECT_NEAR(out[y * kSide + x], expected, 1e-5F) << x << " " << y;
      }
    }
}

TEST(Kernels, SumsOfColumnsAreTheSameOnEveryTarget) {
  constexpr std::size_t kColumns = 6, kFirst = 3;
  for (const std::size_t count : {0U, 1U, 15U, 16U, 90U}) {
    const auto weights = random_floats(count + kFirst, 1);
    const Columns columns(kColumns, count + kFirst, 2);
    const auto compute = [&] {
      std::vector<float> sums(kColumns);
      harco::kernels::column_sums(weights.data(), columns.data(), kColumns, kFirst, count,
                                  sums.data());
      return sums;
    };
    expect_same_bits(compute);
    const std::vector<float> sums = compute();
    for (std::size_t k = 0; k < kColumns; ++k) {
      double sum = 0.0;
      for (std::size_t i = kFirst; i < kFirst + count; ++i)
        sum += static_cast<double>(weights[i]) * columns.at(k, i);
      EXPECT_NEAR(static_cast<double>(sums[k]), sum, 2e-5);
    }
  }
}

TEST(Kernels, TukeySumsByHand) {
  // With a variance of 4 and a limit of 16: z^2 = 0, 1/4, 4, 16, 2500; q = 1, 63/64, 3/4, 0, 0.
  const std::vector<float> residuals{0.0F, 1.0F, -4.0F, 8.0F, -100.0F};
  const auto sums = harco::kernels::tukey_sums(residuals.data(), 0.25F, 1.0F / 16.0F, 5);
  EXPECT_NEAR(sums.cubed, 1.0 + 0.953857 + 0.421875, 1e-5);
  EXPECT_NEAR(sums.weight, 1.0 + 0.968994 + 0.5625, 1e-5);
  EXPECT_NEAR(sums.slope, 1.0 + 0.907471 - 0.1875, 1e-5);
  EXPECT_NEAR(sums.square, 0.25 * 0.938950 + 4.0 * 0.316406, 1e-5);
}

TEST(Kernels, TukeySumsAreTheSameOnEveryTarget) {
  for (const std::size_t count : {0U, 5U, 16U, 100U}) {
    const auto residuals = random_floats(count, 1);
    expect_same_bits([&] {
      const auto sums = harco::kernels::tukey_sums(residuals.data(), 7.0F, 0.2F, count);
      return std::vector<float>{sums.cubed, sums.weight, sums.slope, sums.square};
    });
  }
}

TEST(Kernels, MedianSizeIsTheUpperMedian) {
  EXPECT_EQ(harco::kernels::median_size(nullptr, 0), 0.0F);
  for (std::size_t count = 1; count < 50; ++count) {
    auto values = random_floats(count, static_cast<std::uint32_t>(count));
    values[count / 2] = 0.0F;
    expect_same_bits(
        [&] { return std::vector<float>{harco::kernels::median_size(values.data(), count)}; });
    const float found = harco::kernels::median_size(values.data(), count);
    for (float& value : values) value = std::abs(value);
    std::sort(values.begin(), values.end());
    EXPECT_EQ(found, values[count / 2]) << count;
  }
}

/// A map of bits drawn with # for what is dark, and where its regions begin.
class Drawing {
 public:
  explicit Drawing(const std::vector<std::string>& rows)
      : height_(static_cast<int>(rows.size())), width_(static_cast<int>(rows[0].size())) {
    for (auto* map : {&bits_, &tall_})
      map->assign(static_cast<std::size_t>(stride() * (height_ + 2)), 0);
    for (int y = 0; y < height_; ++y)
      for (int x = 0; x < width_; ++x)
        if (rows[static_cast<std::size_t>(y)][static_cast<std::size_t>(x)] == '#') set(bits_, x, y);
  }

  RegionMap map(bool dark, int row_step = 1) {
    std::fill(tall_.begin(), tall_.end(), std::uint8_t{0});
    for (int y = 2; y < height_; ++y)
      for (int x = 0; x < width_; ++x)
        if (get(x, y) == dark && get(x, y - 1) == dark && get(x, y - 2) == dark) set(tall_, x, y);
    return {bits_.data() + first(),
            tall_.data() + first(),
            row_step * stride(),
            width_,
            height_ / row_step,
            row_step,
            dark,
            3,
            12,
            9};
  }

  /// Stretches of one kind below nothing but the other kind.
  std::vector<RegionStart> starts(bool dark, int row_step) const {
    std::vector<RegionStart> found;
    for (int row = 1; row < height_ / row_step; ++row)
      for (int x = 1; x + 1 < width_; ++x) {
        const int y = row * row_step;
        if (get(x, y) != dark || get(x - 1, y) == dark) continue;
        int right = x;
        while (right + 1 < width_ && get(right + 1, y) == dark) ++right;
        bool free = right + 1 < width_;
        for (int i = x; i <= right; ++i) free = free && get(i, y - row_step) != dark;
        if (free) found.push_back({x, right, row});
      }
    return found;
  }

 private:
  std::ptrdiff_t stride() const { return (width_ + 63) / 64 * 8 + 16; }
  std::ptrdiff_t first() const { return stride() + 8; }
  std::size_t byte_of(int x, int y) const {
    return static_cast<std::size_t>(first() + y * stride() + x / 8);
  }
  void set(std::vector<std::uint8_t>& map, int x, int y) const {
    map[byte_of(x, y)] = static_cast<std::uint8_t>(map[byte_of(x, y)] | 1U << (x % 8));
  }
  bool get(int x, int y) const { return (bits_[byte_of(x, y)] >> (x % 8) & 1) != 0; }

  int height_, width_;
  std::vector<std::uint8_t> bits_, tall_;
};

/// What became of regions that were walked.
struct Walked {
  explicit Walked(std::size_t count)
      : ends(count, WalkEnd::given_up),
        walks(count),
        left(kWalkRoom),
        right(kWalkRoom),
        above(kWalkRoom) {}
  WalkedRows rows() { return {left.data(), right.data(), above.data()}; }

  /// Both ends of a region's rows, from the last one up.
  std::vector<std::pair<int, int>> rows_of(std::size_t region) const {
    std::vector<std::pair<int, int>> found;
    auto at = static_cast<std::size_t>(walks[region].last_row);
    for (int row = 0; row < walks[region].rows; ++row) {
      found.emplace_back(left[at], right[at]);
      at = static_cast<std::size_t>(above[at]);
    }
    return found;
  }

  std::vector<WalkEnd> ends;
  std::vector<RegionWalk> walks;
  std::vector<std::int32_t> left, right, above;
};

bool same_walk(const RegionWalk& a, const RegionWalk& b) {
  const auto all = [](const RegionWalk& walk) {
    return std::tuple(walk.rows, walk.left_extreme, walk.right_extreme, walk.left_inwards,
                      walk.right_inwards, walk.least, walk.most, walk.area);
  };
  return all(a) == all(b);
}

TEST(Kernels, WalksOverRegionsKnownByHand) {
  // A square, a stripe that goes on to the border, a block that ends too soon, one that hangs on to
  // something taller on its right, and one that goes out again.
  Drawing drawing({"............................................................",  //
                   "..................................#.........................",  //
                   "..................................#.......##########........",  //
                   "..####....#####.....####..........#.......##########........",  //
                   "..####....#####.....####..........#..........####...........",  //
                   "..####....#####............####...#...........##............",  //
                   "..####....#####............####...#...........##............",  //
                   "..........#####............########..........####...........",  //
                   "..........#####............####...#........########.........",  //
                   "..........#####...........................##########........",  //
                   "..........#####...........................##########........",  //
                   "..........#####.............................................",  //
                   "..........#####.............................................",  //
                   "..........#####............................................."});
  const std::vector<RegionStart> starts{
      {2, 5, 3}, {10, 14, 3}, {20, 23, 3}, {27, 30, 5}, {42, 51, 2}};
  // Some of each, since a few by themselves aren't walked.
  std::vector<RegionStart> crowd;
  for (std::size_t i = 0; i < kWalkFewest; ++i)
    crowd.insert(crowd.end(), starts.begin(), starts.end());
  using enum WalkEnd;
  Walked walked(crowd.size());
  walk_regions_scalar(drawing.map(true), crowd.data(), crowd.size(), walked.rows(),
                      walked.walks.data(), walked.ends.data());
  for (std::size_t i = 0; i < crowd.size(); ++i)
    EXPECT_EQ(walked.ends[i], i % starts.size() == 0 ? closed : given_up) << i;
  EXPECT_TRUE(same_walk(walked.walks[0], {4, 0, -2, 5, false, false, 2, 5, 16}));
  EXPECT_EQ(walked.rows_of(0), (std::vector<std::pair<int, int>>(4, {2, 5})));
  // Too few: each of them stays at its first row.
  walk_regions_scalar(drawing.map(true), starts.data(), kWalkFewest - 1, walked.rows(),
                      walked.walks.data(), walked.ends.data());
  EXPECT_EQ(walked.ends[1], open);
  EXPECT_TRUE(same_walk(walked.walks[1], {1, 0, -10, 14, false, false, 10, 14, 5}));
  // Of every second row: the square has four rows, two of which are seen.
  const RegionStart square{2, 5, 2};
  const std::vector<RegionStart> seen(kWalkFewest, square);
  RegionMap map = drawing.map(true, 2);
  map.least_extent = 4;
  map.least_length = 16;
  map.least_area = 8;
  walk_regions_scalar(map, seen.data(), seen.size(), walked.rows(), walked.walks.data(),
                      walked.ends.data());
  EXPECT_EQ(walked.ends[0], closed);
  EXPECT_TRUE(same_walk(walked.walks[0], {2, 0, -2, 5, false, false, 2, 5, 8}));
  map.least_area = 9;
  walk_regions_scalar(map, seen.data(), seen.size(), walked.rows(), walked.walks.data(),
                      walked.ends.data());
  EXPECT_EQ(walked.ends[0], given_up);
}

// What goes farther than a lane sees stays where it is, with all that is known of it.
TEST(Kernels, WalksOverRegionsStayBeforeFarSteps) {
  std::vector<std::string> rows(9, std::string(64, '.'));
  for (std::size_t y = 2; y < 5; ++y) rows[y].replace(28 - y, 5 + 2 * y, 5 + 2 * y, '#');
  rows[5].replace(4, 50, 50, '#');
  Drawing drawing(rows);
  const std::vector<RegionStart> starts(kWalkFewest, {26, 34, 2});
  on_every_target([&] {
    Walked walked(starts.size());
    walk_regions(drawing.map(true), starts.data(), starts.size(), walked.rows(),
                 walked.walks.data(), walked.ends.data());
    for (std::size_t i = 0; i < starts.size(); ++i) {
      EXPECT_EQ(walked.ends[i], WalkEnd::open);
      EXPECT_TRUE(same_walk(walked.walks[i], {3, 0, -24, 36, false, false, 24, 36, 9 + 11 + 13}));
      EXPECT_EQ(walked.rows_of(i),
                (std::vector<std::pair<int, int>>{{24, 36}, {25, 35}, {26, 34}}));
    }
  });
}

TEST(Kernels, WalksOverRegionsAreTheSameOnEveryTarget) {
  on_every_target([] {
    std::mt19937 random(5);
    const auto below = [&](int end) {
      return static_cast<int>(random() % static_cast<std::uint32_t>(end));
    };
    for (int scene = 0; scene < 60; ++scene) {
      // Blocks that overlap, sprinkled with noise.
      const int width = 20 + below(180);
      const int height = 20 + below(60);
      std::vector<std::string> rows(static_cast<std::size_t>(height),
                                    std::string(static_cast<std::size_t>(width), '.'));
      for (int block = 0; block < width * height / 150; ++block) {
        const int x = below(width);
        const int y = below(height);
        const int w = 1 + below(30);
        const int h = 1 + below(14);
        const int slant = below(5) - 2;
        for (int i = 0; i < h && y + i < height; ++i)
          for (int j = 0; j < w; ++j)
            if (const int at = x + j + slant * i; at >= 0 && at < width)
              rows[static_cast<std::size_t>(y + i)][static_cast<std::size_t>(at)] = '#';
      }
      for (int speck = 0; speck < width * height / 60; ++speck) {
        const auto y = static_cast<std::size_t>(below(height));
        const auto x = static_cast<std::size_t>(below(width));
        rows[y][x] = rows[y][x] == '#' ? '.' : '#';
      }
      Drawing drawing(rows);
      for (const bool dark : {true, false}) {
        const int row_step = 1 + below(2);
        const std::vector<RegionStart> starts = drawing.starts(dark, row_step);
        Walked walked(starts.size());
        Walked by_hand(starts.size());
        const RegionMap map = drawing.map(dark, row_step);
        walk_regions(map, starts.data(), starts.size(), walked.rows(), walked.walks.data(),
                     walked.ends.data());
        walk_regions_scalar(map, starts.data(), starts.size(), by_hand.rows(), by_hand.walks.data(),
                            by_hand.ends.data());
        ASSERT_EQ(walked.ends, by_hand.ends) << "scene " << scene;
        for (std::size_t i = 0; i < starts.size(); ++i) {
          if (walked.ends[i] == WalkEnd::given_up) continue;
          ASSERT_TRUE(same_walk(walked.walks[i], by_hand.walks[i])) << "scene " << scene;
          ASSERT_EQ(walked.rows_of(i), by_hand.rows_of(i)) << "scene " << scene;
        }
      }
    }
  });
}

}  // namespace
}  // namespace harco::detect::kernels
