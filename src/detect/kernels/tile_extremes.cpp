#include "detect/kernels/tile_extremes.hpp"

#include <algorithm>

// Highway compiles this file once for every instruction set.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "detect/kernels/tile_extremes.cpp"
#include <hwy/cache_control.h>
#include <hwy/foreach_target.h>
// After foreach_target.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace harco::detect::kernels::HWY_NAMESPACE {

#if HWY_TARGET == HWY_SCALAR

// What is left where a machine has none of the instruction sets that Highway knows.
void tile_extremes_simd(const std::uint8_t* pixels, std::ptrdiff_t stride, int width, int rows,
                        std::uint8_t* low, std::uint8_t* high) {
  tile_extremes_scalar(pixels, stride, width, rows, low, high);
}

void nearby_simd(const TileBands& bands, int tiles, std::uint8_t* low, std::uint8_t* high) {
  tile_extremes_nearby_scalar(bands, tiles, low, high);
}

#else

namespace hn = hwy::HWY_NAMESPACE;

/// Applies `op` across the four bytes of every 32-bit lane (the columns of a tile); the result is
/// each lane's lowest byte.
template <class Bytes, class V, class Op>
HWY_INLINE auto reduce_tiles(Bytes bytes, V v, const Op& op) {
  const hn::Repartition<std::uint32_t, Bytes> tiles;
  v = op(v, hn::BitCast(bytes, hn::ShiftRight<16>(hn::BitCast(tiles, v))));
  v = op(v, hn::BitCast(bytes, hn::ShiftRight<8>(hn::BitCast(tiles, v))));
  return hn::TruncateTo(hn::Rebind<std::uint8_t, decltype(tiles)>(), hn::BitCast(tiles, v));
}

void tile_extremes_simd(const std::uint8_t* HWY_RESTRICT pixels, std::ptrdiff_t stride, int width,
                        int rows, std::uint8_t* HWY_RESTRICT low, std::uint8_t* HWY_RESTRICT high) {
  const hn::ScalableTag<std::uint8_t> bytes;
  const hn::Rebind<std::uint8_t, hn::Repartition<std::uint32_t, decltype(bytes)>> tile_bytes;
  const int lanes = static_cast<int>(hn::Lanes(bytes));
  const int whole = width / kTile * kTile;  // the last tile may be narrower
  if (whole < lanes) {
    tile_extremes_scalar(pixels, stride, width, rows, low, high);
    return;
  }
  for (int x = 0; x < whole; x += lanes) {
    const int at = std::min(x, whole - lanes);  // the last step may overlap the one before it
    const std::uint8_t* HWY_RESTRICT column = pixels + at;
    // The next band: nobody has read it yet.
    for (int y = 0; y < rows; ++y) hwy::Prefetch(column + (rows + y) * stride);
    auto least = hn::LoadU(bytes, column);
    auto most = least;
    for (int y = 1; y < rows; ++y) {
      const auto row = hn::LoadU(bytes, column + y * stride);
      least = hn::Min(least, row);
      most = hn::Max(most, row);
    }
    const auto min = [](auto a, auto b) HWY_ATTR { return hn::Min(a, b); };
    const auto max = [](auto a, auto b) HWY_ATTR { return hn::Max(a, b); };
    hn::StoreU(reduce_tiles(bytes, least, min), tile_bytes, low + at / kTile);
    hn::StoreU(reduce_tiles(bytes, most, max), tile_bytes, high + at / kTile);
  }
  if (whole < width)
    tile_extremes_scalar(pixels + whole, stride, width - whole, rows, low + whole / kTile,
                         high + whole / kTile);
}

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

#endif

}  // namespace harco::detect::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace harco::detect::kernels {

HWY_EXPORT(tile_extremes_simd);
HWY_EXPORT(nearby_simd);

void tile_extremes(const std::uint8_t* pixels, std::ptrdiff_t stride, int width, int rows,
                   std::uint8_t* low, std::uint8_t* high) {
  HWY_DYNAMIC_DISPATCH(tile_extremes_simd)(pixels, stride, width, rows, low, high);
}

void tile_extremes_nearby(const TileBands& bands, int tiles, std::uint8_t* low,
                          std::uint8_t* high) {
  HWY_DYNAMIC_DISPATCH(nearby_simd)(bands, tiles, low, high);
}

void tile_extremes_scalar(const std::uint8_t* pixels, std::ptrdiff_t stride, int width, int rows,
                          std::uint8_t* low, std::uint8_t* high) {
  for (int x = 0; x < width; x += kTile) {
    std::uint8_t least = 255;
    std::uint8_t most = 0;
    for (int y = 0; y < rows; ++y)
      for (int i = x; i < std::min(x + kTile, width); ++i) {
        least = std::min(least, pixels[y * stride + i]);
        most = std::max(most, pixels[y * stride + i]);
      }
    low[x / kTile] = least;
    high[x / kTile] = most;
  }
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

}  // namespace harco::detect::kernels
#endif
