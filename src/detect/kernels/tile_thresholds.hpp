// From the extremes of tiles to the threshold of every pixel.
#pragma once

#include <cstddef>
#include <cstdint>

namespace harco::detect::kernels {

/// The extremes of three bands of tiles, one above the other. Every row starts with one value for
/// the tile left of the image and ends with one for the tile right of it.
struct TileBands {
  const std::uint8_t* low[3];
  const std::uint8_t* high[3];
};

/// For each of the middle band's `tiles` tiles: the extremes of the 3 x 3 tiles around it, and from
/// them the least grey that is not dark, written four times (once for each column of the tile):
///   dark if  16 * grey < 16 * low + level * (high - low),
/// or none (0) where `high - low` is less than `min_contrast`. `level` is in sixteenths.
void tile_extremes_nearby(const TileBands& bands, int tiles, std::uint8_t* low, std::uint8_t* high);
void tile_thresholds(const std::uint8_t* low, const std::uint8_t* high, int tiles, int level,
                     int min_contrast, std::uint8_t* thresholds);

/// Of each tile `level` sixteenths of the contrast, rounded up, at least one grey level; written
/// four times likewise.
void tile_shares(const std::uint8_t* low, const std::uint8_t* high, int tiles, int level,
                 std::uint8_t* shares);

/// The same in plain C++.
void tile_extremes_nearby_scalar(const TileBands& bands, int tiles, std::uint8_t* low,
                                 std::uint8_t* high);
void tile_thresholds_scalar(const std::uint8_t* low, const std::uint8_t* high, int tiles, int level,
                            int min_contrast, std::uint8_t* thresholds);
void tile_shares_scalar(const std::uint8_t* low, const std::uint8_t* high, int tiles, int level,
                        std::uint8_t* shares);

}  // namespace harco::detect::kernels
