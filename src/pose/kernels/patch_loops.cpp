#include "pose/kernels/patch_loops.hpp"

// Highway compiles this file once for every instruction set.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "pose/kernels/patch_loops.cpp"
#include <hwy/foreach_target.h>
// After foreach_target.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace harco::kernels::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

// Sums over blocks of fixed length, which the compiler turns into each target's vectors.
using Lanes = float __attribute__((vector_size(64)));  // g++'s and clang's own
constexpr std::size_t kLanes = 16;

template <std::size_t kColumns>
HWY_INLINE void products(const float* HWY_RESTRICT a, const float* const* columns,
                         std::size_t first, std::size_t count, float* HWY_RESTRICT sums) {
  Lanes lanes[kColumns] = {};
  std::size_t i = 0;
  for (; i + kLanes <= count; i += kLanes) {
    Lanes left;
    __builtin_memcpy(&left, a + i, sizeof left);
#pragma GCC unroll 4
    for (std::size_t c = 0; c < kColumns; ++c) {
      Lanes right;
      __builtin_memcpy(&right, columns[c] + first + i, sizeof right);
      lanes[c] += left * right;
    }
  }
  for (std::size_t c = 0; c < kColumns; ++c) {
    const Lanes& l = lanes[c];
    float rest = 0.0F;
    for (std::size_t k = i; k < count; ++k) rest += a[k] * columns[c][first + k];
    float halves[8];
    for (std::size_t k = 0; k < 8; ++k) halves[k] = l[k] + l[k + 8];
    sums[c] += (((halves[0] + halves[4]) + (halves[2] + halves[6])) +
                ((halves[1] + halves[5]) + (halves[3] + halves[7]))) +
               rest;
  }
}

void normal_products_on(const float* HWY_RESTRICT weights, const float* const* columns,
                        std::size_t n, std::size_t count, float* HWY_RESTRICT sums) {
  constexpr std::size_t kBlock = 512;  // of all columns, that the first cache holds
  float weighted[kBlock];
  for (std::size_t k = 0; k < n * n; ++k) sums[k] = 0.0F;
  for (std::size_t first = 0; first < count; first += kBlock) {
    const std::size_t length = count - first < kBlock ? count - first : kBlock;
    for (std::size_t a = 1; a < n; ++a) {
      const float* HWY_RESTRICT row = columns[a] + first;
      for (std::size_t i = 0; i < length; ++i) weighted[i] = weights[first + i] * row[i];
      std::size_t k = 0;
      for (; k + 4 <= a + 1; k += 4)
        products<4>(weighted, columns + k, first, length, sums + a * n + k);
      for (; k <= a; ++k) products<1>(weighted, columns + k, first, length, sums + a * n + k);
    }
  }
}

void subtract_rows_on(const float* HWY_RESTRICT from, const float* const* columns,
                      const float* HWY_RESTRICT by, std::size_t n, std::size_t count,
                      float* HWY_RESTRICT left) {
  constexpr std::size_t kBlock = 1024;
  for (std::size_t first = 0; first < count; first += kBlock) {
    const std::size_t last = count - first < kBlock ? count : first + kBlock;
    for (std::size_t i = first; i < last; ++i) left[i] = from[i];
    std::size_t k = 0;
    for (; k + 4 <= n; k += 4) {
      const float *HWY_RESTRICT a = columns[k], *HWY_RESTRICT b = columns[k + 1];
      const float *HWY_RESTRICT c = columns[k + 2], *HWY_RESTRICT d = columns[k + 3];
      const float ta = by[k], tb = by[k + 1], tc = by[k + 2], td = by[k + 3];
      for (std::size_t i = first; i < last; ++i)
        left[i] -= (ta * a[i] + tb * b[i]) + (tc * c[i] + td * d[i]);
    }
    for (; k < n; ++k) {
      const float* HWY_RESTRICT row = columns[k];
      const float times = by[k];
      for (std::size_t i = first; i < last; ++i) left[i] -= times * row[i];
    }
  }
}

/// Calls visit(tag, i) for whole vectors first, one by one for the rest.
template <typename Visit>
HWY_INLINE void for_each_vector(std::size_t count, Visit visit) {
  const hn::ScalableTag<float> all;
  const hn::CappedTag<float, 1> one;
  std::size_t i = 0;
  for (; i + hn::Lanes(all) <= count; i += hn::Lanes(all)) visit(all, i);
  for (; i < count; ++i) visit(one, i);
}

void huber_weights_on(const float* HWY_RESTRICT residuals, float inverse_variance,
                      std::size_t count, float* HWY_RESTRICT weights) {
  for_each_vector(count, [&](auto d, std::size_t i) {
    const auto r = hn::LoadU(d, residuals + i), one = hn::Set(d, 1.0F);
    const auto z2 = hn::Mul(hn::Mul(r, r), hn::Set(d, inverse_variance));
    hn::StoreU(hn::Div(one, hn::Sqrt(hn::Max(one, z2))), d, weights + i);
  });
}

void tukey_weights_on(const float* HWY_RESTRICT residuals, float inverse_variance,
                      float inverse_limit, std::size_t count, float* HWY_RESTRICT weights) {
  for_each_vector(count, [&](auto d, std::size_t i) {
    const auto r = hn::LoadU(d, residuals + i);
    const auto z2 = hn::Mul(hn::Mul(r, r), hn::Set(d, inverse_variance));
    const auto rest = hn::Sub(hn::Set(d, 1.0F), hn::Mul(z2, hn::Set(d, inverse_limit)));
    const auto q = hn::Max(hn::Zero(d), rest);
    hn::StoreU(hn::Mul(q, q), d, weights + i);
  });
}

void flow_rows_on(const Gradients& g, const Flow* flows, std::size_t n, std::size_t count,
                  float* const* rows) {
  for (std::size_t k = 0; k < n; ++k) {
    const Flow flow = flows[k];
    for_each_vector(count, [&](auto d, std::size_t i) {
      const auto dx = hn::LoadU(d, g.dx + i), dy = hn::LoadU(d, g.dy + i);
      const auto along = [&](const float* f) {
        return hn::Add(hn::Add(hn::Set(d, f[0]), hn::Mul(hn::Set(d, f[1]), dx)),
                       hn::Mul(hn::Set(d, f[2]), dy));
      };
      hn::StoreU(hn::Add(hn::Mul(hn::LoadU(d, g.by_x + i), along(flow.x)),
                         hn::Mul(hn::LoadU(d, g.by_y + i), along(flow.y))),
                 d, rows[k] + i);
    });
  }
}

void light_rows_on(const LitSamples& at, const LightTerms& light, float gain, std::size_t first,
                   std::size_t count) {
  using hn::Add, hn::Mul, hn::Sub;
  constexpr float kBrightest = 255.0F;
  const float* l = light.levels;
  for_each_vector(count, [&](auto d, std::size_t k) {
    const std::size_t i = first + k;
    const hn::RebindToSigned<decltype(d)> di;
    const auto set = [&](float value) { return hn::Set(d, value); };
    const auto one = set(1.0F);
    const auto u = hn::LoadU(d, at.u + i), v = hn::LoadU(d, at.v + i);
    const auto share = hn::Min(hn::Max(hn::LoadU(d, at.white_share + i), hn::Zero(d)), one);
    const auto place = Mul(share, set(static_cast<float>(light.cells)));
    const auto cell = hn::Min(hn::ConvertTo(di, place), hn::Set(di, light.cells - 1));
    const auto part = Sub(place, hn::ConvertTo(d, cell));
    const auto look_up = [&](const float* table) {
      const auto low = hn::GatherIndex(d, table, cell);
      return Add(low, Mul(part, Sub(hn::GatherIndex(d, table + 1, cell), low)));
    };
    // constant + by_u u + by_v v
    const auto linear = [&](const float* by) {
      return Add(Add(set(by[0]), Mul(set(by[1]), u)), Mul(set(by[2]), v));
    };
    const auto seen = look_up(light.seen), unseen = Sub(one, seen);
    const auto bow =
        Add(Mul(u, Add(Mul(set(l[6]), u), Mul(set(l[7]), v))), Mul(Mul(v, v), set(l[8])));
    const auto plane = Add(linear(l), Mul(set(light.dark_part), bow));
    const auto parabola = Add(linear(l + 3), bow);
    auto on_black = set(gain), on_white = set(gain);
    if (at.depth != nullptr) {
      const auto depth = hn::LoadU(d, at.depth + i);
      on_black = Mul(on_black, Sub(one, Mul(depth, set(light.less_black))));
      on_white = Mul(on_white, Sub(one, Mul(depth, set(light.less_white))));
    }
    const auto black = Mul(on_black, plane);
    auto contrast = Sub(Mul(on_white, parabola), black);
    const auto value = Add(black, Mul(contrast, seen));
    // Nothing that is burnt out tells by how much.
    const auto burnt = hn::Gt(value, set(kBrightest));
    contrast = hn::IfThenZeroElse(burnt, contrast);
    on_black = hn::IfThenZeroElse(burnt, on_black);
    on_white = hn::IfThenZeroElse(burnt, on_white);
    hn::StoreU(Sub(hn::LoadU(d, at.grey + i), hn::Min(set(kBrightest), value)), d,
               at.residuals + i);
    const auto slope = Mul(contrast, look_up(light.slope));
    for (std::size_t c = 0; c < light.pictured; ++c)
      hn::StoreU(Mul(hn::LoadU(d, at.columns[c] + i), slope), d, at.columns[c] + i);
    float* const* to = at.columns + light.pictured;
    const auto store = [&](auto row) { hn::StoreU(row, d, *to++ + i); };
    store(Mul(contrast, look_up(light.by_log_gamma)));
    const auto of_black = Mul(on_black, unseen), of_white = Mul(on_white, seen);
    store(of_black);
    store(Mul(of_black, u));
    store(Mul(of_black, v));
    store(of_white);
    store(Mul(of_white, u));
    store(Mul(of_white, v));
    const auto both = Add(of_white, Mul(set(light.dark_part), of_black));
    store(Mul(Mul(both, u), u));
    store(Mul(Mul(both, u), v));
    store(Mul(Mul(both, v), v));
    if (at.depth == nullptr) return;
    const auto missing = hn::IfThenZeroElse(burnt, Mul(set(gain), hn::LoadU(d, at.depth + i)));
    store(Mul(Mul(missing, parabola), seen));
    store(Mul(Mul(missing, plane), unseen));
  });
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

HWY_EXPORT(normal_products_on);
HWY_EXPORT(subtract_rows_on);
HWY_EXPORT(huber_weights_on);
HWY_EXPORT(tukey_weights_on);
HWY_EXPORT(flow_rows_on);
HWY_EXPORT(light_rows_on);
HWY_EXPORT(blur_patch_on);

void normal_products(const float* weights, const float* const* columns, std::size_t n,
                     std::size_t count, float* sums) {
  HWY_DYNAMIC_DISPATCH(normal_products_on)(weights, columns, n, count, sums);
}

void subtract_rows(const float* from, const float* const* columns, const float* by, std::size_t n,
                   std::size_t count, float* left) {
  HWY_DYNAMIC_DISPATCH(subtract_rows_on)(from, columns, by, n, count, left);
}

void huber_weights(const float* residuals, float inverse_variance, std::size_t count,
                   float* weights) {
  HWY_DYNAMIC_DISPATCH(huber_weights_on)(residuals, inverse_variance, count, weights);
}

void tukey_weights(const float* residuals, float inverse_variance, float inverse_limit,
                   std::size_t count, float* weights) {
  HWY_DYNAMIC_DISPATCH(tukey_weights_on)
  (residuals, inverse_variance, inverse_limit, count, weights);
}

void flow_rows(const Gradients& gradients, const Flow* flows, std::size_t n, std::size_t count,
               float* const* rows) {
  HWY_DYNAMIC_DISPATCH(flow_rows_on)(gradients, flows, n, count, rows);
}

void light_rows(const LitSamples& samples, const LightTerms& light, float gain, std::size_t first,
                std::size_t count) {
  HWY_DYNAMIC_DISPATCH(light_rows_on)(samples, light, gain, first, count);
}

void blur_patch(const float* grid, std::size_t stride, std::size_t margin, const Taps& taps,
                float* scratch, const Channels& to) {
  HWY_DYNAMIC_DISPATCH(blur_patch_on)(grid, stride, margin, taps, scratch, to);
}

}  // namespace harco::kernels
#endif
