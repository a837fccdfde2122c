// From the extremes of tiles to bits that tell of every pixel.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "detect/kernels/tile_extremes.hpp"

namespace harco::detect::kernels {

/// Pixels whose bits are written at once: rows of bits hold a multiple of that.
inline constexpr int kBitsAtOnce = 64;

/// The pixels of a band of tiles and what is known of the tiles.
struct Band {
  /// From two rows above the band to one below it; beyond the image, its outermost row.
  std::array<const std::uint8_t*, kTile + 3> rows;
  const std::uint8_t *low, *high;  ///< extremes around each tile
  int width;
  int height;  ///< 1 … kTile rows, in the image
};

/// What is asked of one level of a band.
struct BandLevel {
  int sixteenths;      ///< of the contrast, where the threshold lies
  int least_contrast;  ///< below, nothing is dark
  int steep;           ///< sixteenths of the contrast
  bool dark;           ///< whether it is dark below an upper edge, or bright
  int edge_step;       ///< edges are asked for in every row (1), or in every second one (2)
  /// Where the first row's bits go, bit 0 of a byte for the leftmost pixel, 0 beyond the last.
  std::uint8_t *dark_bits, *edge_bits;
  std::ptrdiff_t stride;  ///< from there to the next row's, in bytes
};

/// Of the pixels of a band:
///   dark if  16 * grey < 16 * low + sixteenths * (high - low)  and  high - low >= least_contrast;
///   below an upper edge if the grey falls (or rises) from two rows above to one below by `steep`
///   sixteenths of high - low, and by one level at least.
void band_bits(const Band& band, const BandLevel& level);

/// The same in plain C++.
void band_bits_scalar(const Band& band, const BandLevel& level);

}  // namespace harco::detect::kernels
