// The quadrilateral that a region's outline is like, from the ends of its rows.
#pragma once

#include <array>
#include <cstdint>

namespace harco::detect::kernels {

/// The ends of a region, row by row: its pixels reach from left[row] to right[row].
struct Outline {
  const std::int32_t* left;   ///< as many more as a vector has may be read of both, and hold
  const std::int32_t* right;  ///< anything
  int rows;                   ///< that are known
  int row_step;               ///< pixels from one to the next
  int columns;                ///< of the bounding box, in pixels
};

/// A corner of pixels: x from where the ends are counted, y from the top of the first row.
struct OutlineCorner {
  int x, y;
  bool operator==(const OutlineCorner&) const = default;
};
using OutlineCorners = std::array<OutlineCorner, 4>;

/// Two points of the outline, the first one farthest from its middle, the other one farthest from
/// that, and those farthest from the line between them on both sides; clockwise as seen on the
/// screen. Of several the one in the uppermost row.
OutlineCorners outline_corners(const Outline& outline);

/// What an outline may stray from a side: `length` times so many pixels, twice, of all four.
using OutlineSlack = std::array<std::int32_t, 4>;

/// Whether the outline keeps to the sides between the corners.
bool outline_keeps_to(const Outline& outline, const OutlineCorners& corners,
                      const OutlineSlack& slack);

/// The same in plain C++.
OutlineCorners outline_corners_scalar(const Outline& outline);
bool outline_keeps_to_scalar(const Outline& outline, const OutlineCorners& corners,
                             const OutlineSlack& slack);

}  // namespace harco::detect::kernels
