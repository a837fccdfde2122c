#include "detect/kernels/tile_thresholds.hpp"

#include <algorithm>

#include "detect/kernels/tile_extremes.hpp"

// Highway compiles this file once for every instruction set.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "detect/kernels/tile_thresholds.cpp"
#include <hwy/foreach_target.h>
// After foreach_target.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace harco::detect::kernels::HWY_NAMESPACE {

#if HWY_TARGET == HWY_SCALAR

void nearby_simd(const TileBands& bands, int tiles, std::uint8_t* low, std::uint8_t* high) {
  tile_extremes_nearby_scalar(bands, tiles, low, high);
}

void thresholds_simd(const std::uint8_t* low, const std::uint8_t* high, int tiles, int level,
                     int min_contrast, std::uint8_t* thresholds) {
  tile_thresholds_scalar(low, high, tiles, level, min_contrast, thresholds);
}

#else

namespace hn = hwy::HWY_NAMESPACE;

void nearby_simd(const TileBands& bands, int tiles, std::uint8_t* HWY_RESTRICT low,
                 std::uint8_t* HWY_RESTRICT high) {
  const hn::ScalableTag<std::uint8_t> bytes;
  const int lanes = static_cast<int>(hn::Lanes(bytes));
  if (tiles < lanes) {
    tile_extremes_nearby_scalar(bands, tiles, low, high);
    return;
  }
  for (int tile = 0; tile < tiles; tile += lanes) {
    const int at = std::min(tile, tiles - lanes);
    auto least = hn::Set(bytes, 255);
    auto most = hn::Zero(bytes);
    for (int row = 0; row < 3; ++row)
      for (int side = 0; side < 3; ++side) {
        least = hn::Min(least, hn::LoadU(bytes, bands.low[row] + at + side));
        most = hn::Max(most, hn::LoadU(bytes, bands.high[row] + at + side));
      }
    hn::StoreU(least, bytes, low + at);
    hn::StoreU(most, bytes, high + at);
  }
}

void thresholds_simd(const std::uint8_t* HWY_RESTRICT low, const std::uint8_t* HWY_RESTRICT high,
                     int tiles, int level, int min_contrast,
                     std::uint8_t* HWY_RESTRICT thresholds) {
  const hn::ScalableTag<std::uint32_t> words;  // one tile's columns each
  const hn::Rebind<std::uint8_t, decltype(words)> bytes;
  const hn::Repartition<std::uint8_t, decltype(words)> columns;
  const int lanes = static_cast<int>(hn::Lanes(words));
  if (tiles < lanes) {
    tile_thresholds_scalar(low, high, tiles, level, min_contrast, thresholds);
    return;
  }
  const auto factor = hn::Set(words, static_cast<std::uint32_t>(level));
  const auto least_contrast = hn::Set(words, static_cast<std::uint32_t>(min_contrast));
  const auto round_up = hn::Set(words, 15);
  for (int tile = 0; tile < tiles; tile += lanes) {
    const int at = std::min(tile, tiles - lanes);
    const auto least = hn::PromoteTo(words, hn::LoadU(bytes, low + at));
    const auto contrast = hn::Sub(hn::PromoteTo(words, hn::LoadU(bytes, high + at)), least);
    auto threshold =
        hn::Add(least, hn::ShiftRight<4>(hn::Add(hn::Mul(contrast, factor), round_up)));
    threshold = hn::IfThenZeroElse(hn::Lt(contrast, least_contrast), threshold);
    threshold = hn::Or(threshold, hn::ShiftLeft<8>(threshold));
    threshold = hn::Or(threshold, hn::ShiftLeft<16>(threshold));
    hn::StoreU(hn::BitCast(columns, threshold), columns, thresholds + at * kTile);
  }
}

#endif

}  // namespace harco::detect::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace harco::detect::kernels {

HWY_EXPORT(nearby_simd);
HWY_EXPORT(thresholds_simd);

void tile_extremes_nearby(const TileBands& bands, int tiles, std::uint8_t* low,
                          std::uint8_t* high) {
  HWY_DYNAMIC_DISPATCH(nearby_simd)(bands, tiles, low, high);
}

void tile_thresholds(const std::uint8_t* low, const std::uint8_t* high, int tiles, int level,
                     int min_contrast, std::uint8_t* thresholds) {
  HWY_DYNAMIC_DISPATCH(thresholds_simd)(low, high, tiles, level, min_contrast, thresholds);
}

void tile_extremes_nearby_scalar(const TileBands& bands, int tiles, std::uint8_t* low,
                                 std::uint8_t* high) {
  for (int tile = 0; tile < tiles; ++tile) {
    std::uint8_t least = 255;
    std::uint8_t most = 0;
    for (int row = 0; row < 3; ++row)
      for (int side = 0; side < 3; ++side) {
        least = std::min(least, bands.low[row][tile + side]);
        most = std::max(most, bands.high[row][tile + side]);
      }
    low[tile] = least;
    high[tile] = most;
  }
}

void tile_thresholds_scalar(const std::uint8_t* low, const std::uint8_t* high, int tiles, int level,
                            int min_contrast, std::uint8_t* thresholds) {
  for (int tile = 0; tile < tiles; ++tile) {
    const int contrast = high[tile] - low[tile];
    const int threshold = contrast < min_contrast ? 0 : low[tile] + ((contrast * level + 15) >> 4);
    std::fill_n(thresholds + tile * kTile, kTile, static_cast<std::uint8_t>(threshold));
  }
}

}  // namespace harco::detect::kernels
#endif
