#include "pose/kernels/patch_loops.hpp"

// Highway compiles this file once for every instruction set.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "pose/kernels/patch_loops.cpp"
#include <hwy/foreach_target.h>
// After foreach_target.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace harco::kernels::HWY_NAMESPACE {

// Plain loops over blocks of fixed length, which the compiler turns into each target's vectors.
using Lanes = float __attribute__((vector_size(32)));  // g++'s and clang's own
constexpr std::size_t kLanes = 8;

template <std::size_t kColumns>
HWY_INLINE void products(const float* HWY_RESTRICT a, const float* const* columns,
                         std::size_t count, float* HWY_RESTRICT sums) {
  Lanes lanes[kColumns] = {};
  std::size_t i = 0;
  for (; i + kLanes <= count; i += kLanes) {
    Lanes left;
    __builtin_memcpy(&left, a + i, sizeof left);
#pragma GCC unroll 4
    for (std::size_t c = 0; c < kColumns; ++c) {
      Lanes right;
      __builtin_memcpy(&right, columns[c] + i, sizeof right);
      lanes[c] += left * right;
    }
  }
  for (std::size_t c = 0; c < kColumns; ++c) {
    const Lanes& l = lanes[c];
    float rest = 0.0F;
    for (std::size_t k = i; k < count; ++k) rest += a[k] * columns[c][k];
    sums[c] = (((l[0] + l[4]) + (l[2] + l[6])) + ((l[1] + l[5]) + (l[3] + l[7]))) + rest;
  }
}

void weighted_products_on(const float* HWY_RESTRICT weights, const float* HWY_RESTRICT row,
                          const float* const* columns, std::size_t n, std::size_t count,
                          float* HWY_RESTRICT scratch, float* HWY_RESTRICT sums) {
  for (std::size_t i = 0; i < count; ++i) scratch[i] = weights[i] * row[i];
  std::size_t k = 0;
  for (; k + 4 <= n; k += 4) products<4>(scratch, columns + k, count, sums + k);
  for (; k < n; ++k) products<1>(scratch, columns + k, count, sums + k);
}

/// Along the rows: what each pixel's column of a patch sees of every row of half pixels.
HWY_INLINE void blur_rows(const float* HWY_RESTRICT grid, std::size_t stride, std::size_t margin,
                          const Taps& taps, float* HWY_RESTRICT halves, float* HWY_RESTRICT value,
                          float* HWY_RESTRICT slope, float* HWY_RESTRICT bend) {
  const std::size_t half = kSide + 2 * margin;
  float* HWY_RESTRICT even = halves;
  float* HWY_RESTRICT odd = halves + half;
  for (std::size_t row = 0; row < 2 * half; ++row) {
    const float* HWY_RESTRICT share = grid + row * stride;
    for (std::size_t i = 0; i < half; ++i) {
      even[i] = share[2 * i];
      odd[i] = share[2 * i + 1];
    }
    float v[kSide] = {}, s[kSide] = {}, b[kSide] = {};
    for (std::size_t j = 0; j < taps.count; ++j) {
      // The half pixels at distance j + 1/2 on both sides of a pixel's middle.
      const float* left = j % 2 == 0 ? even + margin - j / 2 : odd + margin - (j + 1) / 2;
      const float* right = j % 2 == 0 ? odd + margin + j / 2 : even + margin + (j + 1) / 2;
      const float tv = taps.value[j], ts = taps.slope[j], tb = taps.bend[j];
      for (std::size_t x = 0; x < kSide; ++x) {
        const float sum = left[x] + right[x];
        v[x] += tv * sum;
        s[x] += ts * (right[x] - left[x]);
        b[x] += tb * sum;
      }
    }
    for (std::size_t x = 0; x < kSide; ++x) {
      value[row * kSide + x] = v[x];
      slope[row * kSide + x] = s[x];
      bend[row * kSide + x] = b[x];
    }
  }
}

void blur_patch_on(const float* HWY_RESTRICT grid, std::size_t stride, std::size_t margin,
                   const Taps& taps, float* HWY_RESTRICT scratch, const Channels& to) {
  const std::size_t half = kSide + 2 * margin;
  float* HWY_RESTRICT value = scratch + 2 * half;
  float* HWY_RESTRICT slope = value + 2 * half * kSide;
  float* HWY_RESTRICT bend = slope + 2 * half * kSide;
  blur_rows(grid, stride, margin, taps, scratch, value, slope, bend);
  for (std::size_t y = 0; y < kSide; ++y) {
    float ink[kSide] = {}, by_x[kSide] = {}, by_y[kSide] = {};
    float by_xx[kSide] = {}, by_xy[kSide] = {}, by_yy[kSide] = {};
    for (std::size_t j = 0; j < taps.count; ++j) {
      const std::size_t above = (2 * (y + margin) - j) * kSide;
      const std::size_t below = (2 * (y + margin) + 1 + j) * kSide;
      const float tv = taps.value[j], ts = taps.slope[j], tb = taps.bend[j];
      for (std::size_t x = 0; x < kSide; ++x) {
        const float v = value[above + x] + value[below + x];
        ink[x] += tv * v;
        by_yy[x] += tb * v;
        by_y[x] += ts * (value[below + x] - value[above + x]);
      }
      for (std::size_t x = 0; x < kSide; ++x) {
        by_x[x] += tv * (slope[above + x] + slope[below + x]);
        by_xy[x] += ts * (slope[below + x] - slope[above + x]);
        by_xx[x] += tv * (bend[above + x] + bend[below + x]);
      }
    }
    for (std::size_t x = 0; x < kSide; ++x) {
      const std::size_t at = y * kSide + x;
      to.ink[at] = ink[x], to.by_x[at] = by_x[x], to.by_y[at] = by_y[x];
      to.by_xx[at] = by_xx[x], to.by_xy[at] = by_xy[x], to.by_yy[at] = by_yy[x];
    }
  }
}

}  // namespace harco::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace harco::kernels {

HWY_EXPORT(weighted_products_on);
HWY_EXPORT(blur_patch_on);

void weighted_products(const float* weights, const float* row, const float* const* columns,
                       std::size_t n, std::size_t count, float* scratch, float* sums) {
  HWY_DYNAMIC_DISPATCH(weighted_products_on)(weights, row, columns, n, count, scratch, sums);
}

void blur_patch(const float* grid, std::size_t stride, std::size_t margin, const Taps& taps,
                float* scratch, const Channels& to) {
  HWY_DYNAMIC_DISPATCH(blur_patch_on)(grid, stride, margin, taps, scratch, to);
}

}  // namespace harco::kernels
#endif
