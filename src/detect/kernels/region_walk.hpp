// The first rows of many regions at once, to tell which of them can't be convex.
#pragma once

#include <cstddef>
#include <cstdint>

namespace harco::detect::kernels {

/// Where regions are looked for: maps of one bit a pixel, the lowest bit of a byte leftmost, both
/// with eight bytes of padding on either side of a row and a row of padding at the bottom.
struct RegionMap {
  const std::uint8_t* bits;  ///< the region's pixels are set if `dark`, else clear
  const std::uint8_t* tall;  ///< set where this and the two pixels above are the region's
  std::ptrdiff_t stride;     ///< bytes from row to row of those that are looked at, of both
  int width, height;         ///< height in such rows
  int row_step;              ///< pixels from one to the next
  bool dark;                 ///< pixels that touch at a corner hang together
  int least_extent;          ///< of a bounding box's both sides, in pixels
  int least_length;          ///< of the way around it, in steps along the sides of pixels
  int least_area;            ///< in pixels of the rows that are looked at
};

/// The first row of a region: its pixels from `left` to `right`, within the image.
struct RegionStart {
  int left, right, y;
};

/// Rows that are looked at, and how far a side may move from one row to the next; whoever goes
/// farther stays.
constexpr int kWalkRows = 256;
constexpr int kWalkReach = 12;

/// Goes down both sides of regions from their tops. Those that end too small, touch the image's
/// border, go out again after they have come in, or meet something that comes down from farther
/// above are given up: survives[i] tells of starts[i], 1 or 0.
void walk_regions(const RegionMap& map, const RegionStart* starts, std::size_t count,
                  std::uint8_t* survives);

/// The same in plain C++, one after the other.
void walk_regions_scalar(const RegionMap& map, const RegionStart* starts, std::size_t count,
                         std::uint8_t* survives);

}  // namespace harco::detect::kernels
