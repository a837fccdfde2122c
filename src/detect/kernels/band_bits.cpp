#include "detect/kernels/band_bits.hpp"

#include <algorithm>

// Highway compiles this file once for every instruction set.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "detect/kernels/band_bits.cpp"
#include <hwy/foreach_target.h>
// After foreach_target.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace harco::detect::kernels::HWY_NAMESPACE {

#if HWY_TARGET == HWY_SCALAR

void band_bits_simd(const Band& band, const BandLevel& level) { band_bits_scalar(band, level); }

#else

namespace hn = hwy::HWY_NAMESPACE;
using Pixels = hn::CappedTag<std::uint8_t, kBitsAtOnce>;
using Tiles = hn::Repartition<std::uint32_t, Pixels>;  // one tile's columns each
constexpr Pixels kPixels;
constexpr Tiles kTiles;

HWY_INLINE hn::Vec<Tiles> load_tiles(const std::uint8_t* tiles) {
  const hn::Rebind<std::uint8_t, Tiles> bytes;
  return hn::PromoteTo(kTiles, hn::LoadU(bytes, tiles));
}

/// So many sixteenths, rounded up.
HWY_INLINE hn::Vec<Tiles> share_of(hn::Vec<Tiles> contrast, hn::Vec<Tiles> sixteenths) {
  const auto share = hn::Mul(contrast, sixteenths);
  return hn::ShiftRight<4>(hn::Add(share, hn::Set(kTiles, 15)));
}

/// Each tile's value for its columns.
HWY_INLINE hn::Vec<Pixels> columns_of(hn::Vec<Tiles> values) {
  values = hn::Or(values, hn::ShiftLeft<8>(values));
  return hn::BitCast(kPixels, hn::Or(values, hn::ShiftLeft<16>(values)));
}

/// Of a whole number of vectors, and all rows.
template <bool kDark, int kEdgeStep>
void bits_of(const Band& band, const BandLevel& level) {
  const int lanes = static_cast<int>(hn::Lanes(kPixels));
  // Copies: for all that compilers know, bytes that are stored may change what is pointed at.
  const auto rows = band.rows;
  const std::uint8_t* const low = band.low;
  const std::uint8_t* const high = band.high;
  std::uint8_t* const dark_bits = level.dark_bits;
  std::uint8_t* const edge_bits = level.edge_bits;
  const std::ptrdiff_t stride = level.stride;
  const int width = band.width;
  const auto sixteenths = hn::Set(kTiles, static_cast<std::uint32_t>(level.sixteenths));
  const auto steep_sixteenths = hn::Set(kTiles, static_cast<std::uint32_t>(level.steep));
  const auto least_contrast = hn::Set(kTiles, static_cast<std::uint32_t>(level.least_contrast));
  for (int x = 0; x < width; x += lanes) {
    const auto least = load_tiles(low + x / kTile);
    const auto contrast = hn::Sub(load_tiles(high + x / kTile), least);
    const auto threshold = columns_of(hn::IfThenZeroElse(
        hn::Lt(contrast, least_contrast), hn::Add(least, share_of(contrast, sixteenths))));
    const auto steep =
        columns_of(hn::Max(share_of(contrast, steep_sixteenths), hn::Set(kTiles, 1)));
    for (std::size_t row = 0; row < kTile; ++row) {
      const auto dark = hn::Lt(hn::LoadU(kPixels, rows[row + 2] + x), threshold);
      hn::StoreMaskBits(kPixels, dark, dark_bits + static_cast<int>(row) * stride + x / 8);
    }
    for (std::size_t row = 0; row < kTile; row += kEdgeStep) {
      const auto above = hn::LoadU(kPixels, rows[row] + x);
      const auto below = hn::LoadU(kPixels, rows[row + 3] + x);
      const auto fall = kDark ? hn::SaturatedSub(above, below) : hn::SaturatedSub(below, above);
      hn::StoreMaskBits(kPixels, hn::Not(hn::Lt(fall, steep)),
                        edge_bits + static_cast<int>(row) * stride + x / 8);
    }
  }
}

void bits_of(const Band& band, const BandLevel& level) {
  if (level.dark)
    level.edge_step == 1 ? bits_of<true, 1>(band, level) : bits_of<true, 2>(band, level);
  else
    level.edge_step == 1 ? bits_of<false, 1>(band, level) : bits_of<false, 2>(band, level);
}

void band_bits_simd(const Band& band, const BandLevel& level) {
  if (band.height < kTile) {
    band_bits_scalar(band, level);
    return;
  }
  const int lanes = static_cast<int>(hn::Lanes(kPixels));
  Band part = band;
  part.width = band.width / lanes * lanes;
  bits_of(part, level);
  const int left = band.width - part.width;
  if (left == 0) return;
  // What doesn't fill a vector is copied into one, beside pixels that give no bits.
  std::uint8_t pixels[kTile + 3][kBitsAtOnce];
  std::uint8_t low[kBitsAtOnce / kTile] = {};
  std::uint8_t high[kBitsAtOnce / kTile] = {};
  for (std::size_t row = 0; row < band.rows.size(); ++row) {
    std::fill_n(pixels[row], lanes, std::uint8_t{255});
    std::copy_n(band.rows[row] + part.width, left, pixels[row]);
    part.rows[row] = pixels[row];
  }
  std::copy_n(band.low + part.width / kTile, (left + kTile - 1) / kTile, low);
  std::copy_n(band.high + part.width / kTile, (left + kTile - 1) / kTile, high);
  part.low = low;
  part.high = high;
  BandLevel rest = level;
  rest.dark_bits += part.width / 8;
  rest.edge_bits += part.width / 8;
  part.width = lanes;
  bits_of(part, rest);
}

#endif

}  // namespace harco::detect::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace harco::detect::kernels {

HWY_EXPORT(band_bits_simd);

void band_bits(const Band& band, const BandLevel& level) {
  HWY_DYNAMIC_DISPATCH(band_bits_simd)(band, level);
}

void band_bits_scalar(const Band& band, const BandLevel& level) {
  const auto share = [](int contrast, int sixteenths) { return (contrast * sixteenths + 15) / 16; };
  const auto is_dark = [&](std::size_t row, int x) {
    const int tile = x / kTile;
    const int contrast = band.high[tile] - band.low[tile];
    return contrast >= level.least_contrast &&
           band.rows[row + 2][x] < band.low[tile] + share(contrast, level.sixteenths);
  };
  const auto is_below_edge = [&](std::size_t row, int x) {
    const int tile = x / kTile;
    const int fall = band.rows[row][x] - band.rows[row + 3][x];
    const int least = std::max(share(band.high[tile] - band.low[tile], level.steep), 1);
    return (level.dark ? fall : -fall) >= least;
  };
  const auto write = [&](std::uint8_t* bits, std::size_t row, const auto& is_set) {
    for (int x = 0; x < band.width; x += 8) {
      unsigned byte = 0;
      for (int i = x; i < std::min(x + 8, band.width); ++i)
        byte |= (is_set(row, i) ? 1U : 0U) << (i - x);
      bits[x / 8] = static_cast<std::uint8_t>(byte);
    }
  };
  for (int row = 0; row < band.height; ++row) {
    const auto at = static_cast<std::size_t>(row);
    write(level.dark_bits + row * level.stride, at, is_dark);
    if (row % level.edge_step == 0) write(level.edge_bits + row * level.stride, at, is_below_edge);
  }
}

}  // namespace harco::detect::kernels
#endif
