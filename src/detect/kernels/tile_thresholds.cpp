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

void shares_simd(const std::uint8_t* low, const std::uint8_t* high, int tiles, int level,
                 std::uint8_t* shares) {
  tile_shares_scalar(low, high, tiles, level, shares);
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

using Words = hn::ScalableTag<std::uint32_t>;  // one tile's columns each
constexpr Words kWords;

/// `level` sixteenths, rounded up.
HWY_INLINE hn::Vec<Words> share_of(hn::Vec<Words> contrast, int level) {
  const auto sixteenths = hn::Mul(contrast, hn::Set(kWords, static_cast<std::uint32_t>(level)));
  return hn::ShiftRight<4>(hn::Add(sixteenths, hn::Set(kWords, 15)));
}

HWY_INLINE hn::Vec<Words> load_tiles(const std::uint8_t* tiles) {
  const hn::Rebind<std::uint8_t, Words> bytes;
  return hn::PromoteTo(kWords, hn::LoadU(bytes, tiles));
}

/// Writes each tile's value to its columns.
HWY_INLINE void store_columns(hn::Vec<Words> values, std::uint8_t* columns) {
  const hn::Repartition<std::uint8_t, Words> bytes;
  values = hn::Or(values, hn::ShiftLeft<8>(values));
  values = hn::Or(values, hn::ShiftLeft<16>(values));
  hn::StoreU(hn::BitCast(bytes, values), bytes, columns);
}

void thresholds_simd(const std::uint8_t* HWY_RESTRICT low, const std::uint8_t* HWY_RESTRICT high,
                     int tiles, int level, int min_contrast,
                     std::uint8_t* HWY_RESTRICT thresholds) {
  const int lanes = static_cast<int>(hn::Lanes(kWords));
  if (tiles < lanes) {
    tile_thresholds_scalar(low, high, tiles, level, min_contrast, thresholds);
    return;
  }
  const auto least_contrast = hn::Set(kWords, static_cast<std::uint32_t>(min_contrast));
  for (int tile = 0; tile < tiles; tile += lanes) {
    const int at = std::min(tile, tiles - lanes);
    const auto least = load_tiles(low + at);
    const auto contrast = hn::Sub(load_tiles(high + at), least);
    store_columns(hn::IfThenZeroElse(hn::Lt(contrast, least_contrast),
                                     hn::Add(least, share_of(contrast, level))),
                  thresholds + at * kTile);
  }
}

void shares_simd(const std::uint8_t* HWY_RESTRICT low, const std::uint8_t* HWY_RESTRICT high,
                 int tiles, int level, std::uint8_t* HWY_RESTRICT shares) {
  const int lanes = static_cast<int>(hn::Lanes(kWords));
  if (tiles < lanes) {
    tile_shares_scalar(low, high, tiles, level, shares);
    return;
  }
  const auto one = hn::Set(kWords, 1);
  for (int tile = 0; tile < tiles; tile += lanes) {
    const int at = std::min(tile, tiles - lanes);
    const auto contrast = hn::Sub(load_tiles(high + at), load_tiles(low + at));
    store_columns(hn::Max(share_of(contrast, level), one), shares + at * kTile);
  }
}

#endif

}  // namespace harco::detect::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace harco::detect::kernels {

HWY_EXPORT(nearby_simd);
HWY_EXPORT(thresholds_simd);
HWY_EXPORT(shares_simd);

void tile_extremes_nearby(const TileBands& bands, int tiles, std::uint8_t* low,
                          std::uint8_t* high) {
  HWY_DYNAMIC_DISPATCH(nearby_simd)(bands, tiles, low, high);
}

void tile_thresholds(const std::uint8_t* low, const std::uint8_t* high, int tiles, int level,
                     int min_contrast, std::uint8_t* thresholds) {
  HWY_DYNAMIC_DISPATCH(thresholds_simd)(low, high, tiles, level, min_contrast, thresholds);
}

void tile_shares(const std::uint8_t* low, const std::uint8_t* high, int tiles, int level,
                 std::uint8_t* shares) {
  HWY_DYNAMIC_DISPATCH(shares_simd)(low, high, tiles, level, shares);
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

void tile_shares_scalar(const std::uint8_t* low, const std::uint8_t* high, int tiles, int level,
                        std::uint8_t* shares) {
  for (int tile = 0; tile < tiles; ++tile) {
    const int share = ((high[tile] - low[tile]) * level + 15) >> 4;
    std::fill_n(shares + tile * kTile, kTile, static_cast<std::uint8_t>(std::max(share, 1)));
  }
}

}  // namespace harco::detect::kernels
#endif
