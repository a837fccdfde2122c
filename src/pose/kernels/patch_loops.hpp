// The loops in which alignment spends its time. Compiled for every instruction set; all give the
// same bits, since sums are kept in a fixed order and nothing is fused.
#pragma once

#include <cstddef>

namespace harco::kernels {

/// sum of weights[i] * row[i] * columns[k][i] over i < count, for every k < n, into sums[k].
void weighted_products(const float* weights, const float* row, const float* const* columns,
                       std::size_t n, std::size_t count, float* scratch, float* sums);

/// Sides of a patch of pixels, see PatchPainter.
inline constexpr std::size_t kSide = 16;

/// A symmetric blur and its first and second derivative, at the distances 1/2, 3/2 ... half pixels.
struct Taps {
  const float* value;
  const float* slope;
  const float* bend;
  std::size_t count;
};

/// A patch blurred and differentiated.
struct Channels {
  float *ink, *by_x, *by_y, *by_xx, *by_xy, *by_yy;  ///< kSide x kSide each
};

/// `grid` has 2 (kSide + 2 margin) rows of half pixels, `stride` apart, of which as many columns
/// are read. `scratch` holds (2 + 2 * 3) * (kSide + 2 margin) * 2 * kSide values or more.
void blur_patch(const float* grid, std::size_t stride, std::size_t margin, const Taps& taps,
                float* scratch, const Channels& to);

}  // namespace harco::kernels
