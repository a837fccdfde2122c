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

/// How far a side may move from one row to the next; whoever goes farther stays.
constexpr int kWalkReach = 12;

/// How much a side may go out again after it has come in, so many pixels below its region's top.
constexpr int walk_tolerance(int height) { return 2 + height / 16; }

/// Regions that are walked at the same time: at most, and at least; fewer stay where they are.
constexpr std::size_t kWalkTogether = 1024;
constexpr std::size_t kWalkFewest = 4;

/// Rows of regions that were walked: their ends, and where the row above is listed; first of all
/// the first ones, in the order of the regions. There is room for kWalkRoom of them.
struct WalkedRows {
  std::int32_t* left;
  std::int32_t* right;
  std::int32_t* above;
};
constexpr std::size_t kWalkRoom = 32 * kWalkTogether;

enum class WalkEnd : std::uint8_t {
  given_up,
  closed,  ///< large enough, nothing lies below the last row
  open     ///< what comes below the last row couldn't be told, or there was no more room
};

/// How far a region was walked.
struct RegionWalk {
  std::int32_t rows;      ///< its first one included
  std::int32_t last_row;  ///< where the last one is listed
  /// Counted outwards: how far the sides have come, or from where they have come in, if they do.
  std::int32_t left_extreme, right_extreme;
  bool left_inwards, right_inwards;
  std::int32_t least, most;  ///< of all ends
  std::int32_t area;         ///< in pixels of the rows that are looked at
};

/// Goes down both sides of up to kWalkTogether regions from their tops. Those that end too small,
/// touch the image's border, go out again after they have come in, or meet something that comes
/// down from farther above are given up. ends[i] and, unless it was given up, walks[i] tell of
/// starts[i].
void walk_regions(const RegionMap& map, const RegionStart* starts, std::size_t count,
                  const WalkedRows& listed, RegionWalk* walks, WalkEnd* ends);

/// The same in plain C++.
void walk_regions_scalar(const RegionMap& map, const RegionStart* starts, std::size_t count,
                         const WalkedRows& listed, RegionWalk* walks, WalkEnd* ends);

}  // namespace harco::detect::kernels
