// Least and greatest grey of every tile of pixels, and of those around it.
#pragma once

#include <cstddef>
#include <cstdint>

namespace harco::detect::kernels {

/// Side of a tile, in pixels.
inline constexpr int kTile = 4;

/// The extremes of a band of tiles: `rows` (1 … kTile) rows of `width` pixels, `stride` bytes
/// apart. Writes one value for every tile, the last of which may be narrower; reads no pixel beyond
/// the width.
void tile_extremes(const std::uint8_t* pixels, std::ptrdiff_t stride, int width, int rows,
                   std::uint8_t* low, std::uint8_t* high);

/// The extremes of three bands of tiles, one above the other. Every row starts with one value for
/// the tile left of the image and ends with one for the tile right of it.
struct TileBands {
  const std::uint8_t* low[3];
  const std::uint8_t* high[3];
};

/// For each of the middle band's `tiles` tiles, the extremes of the 3 x 3 tiles around it.
void tile_extremes_nearby(const TileBands& bands, int tiles, std::uint8_t* low, std::uint8_t* high);

/// The same in plain C++, the reference for every instruction set.
void tile_extremes_scalar(const std::uint8_t* pixels, std::ptrdiff_t stride, int width, int rows,
                          std::uint8_t* low, std::uint8_t* high);
void tile_extremes_nearby_scalar(const TileBands& bands, int tiles, std::uint8_t* low,
                                 std::uint8_t* high);

}  // namespace harco::detect::kernels
