#include "pose/kernels/patch_loops.hpp"

#include <cstdint>

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

// By reference: targets differ in how they would hand vectors over.
HWY_INLINE void load(const float* from, Lanes& lanes) {
  __builtin_memcpy(&lanes, from, sizeof lanes);
}

HWY_INLINE float sum_of(const Lanes& l) {
  float halves[8];
  for (std::size_t k = 0; k < 8; ++k) halves[k] = l[k] + l[k + 8];
  return ((halves[0] + halves[4]) + (halves[2] + halves[6])) +
         ((halves[1] + halves[5]) + (halves[3] + halves[7]));
}

/// Of whole vectors: sums[r * stride + c] += rows[r] * columns[c], lane by lane.
template <std::size_t kRows, std::size_t kColumns>
HWY_INLINE void products(const float* const* rows, const float* const* columns, std::size_t count,
                         Lanes* HWY_RESTRICT sums, std::size_t stride) {
  Lanes lanes[kRows][kColumns];
  for (std::size_t r = 0; r < kRows; ++r)
    for (std::size_t c = 0; c < kColumns; ++c) lanes[r][c] = sums[r * stride + c];
  for (std::size_t i = 0; i < count; i += kLanes) {
    Lanes left[kRows];
#pragma GCC unroll 4
    for (std::size_t r = 0; r < kRows; ++r) load(rows[r] + i, left[r]);
#pragma GCC unroll 4
    for (std::size_t c = 0; c < kColumns; ++c) {
      Lanes right;
      load(columns[c] + i, right);
#pragma GCC unroll 4
      for (std::size_t r = 0; r < kRows; ++r) lanes[r][c] += left[r] * right;
    }
  }
  for (std::size_t r = 0; r < kRows; ++r)
    for (std::size_t c = 0; c < kColumns; ++c) sums[r * stride + c] = lanes[r][c];
}

// As many rows and columns at once as the registers hold; sums are the same whatever they are.
#if HWY_TARGET <= HWY_AVX3
constexpr std::size_t kTile = 4;
#else
constexpr std::size_t kTile = 2;
#endif

// Of all columns, what the first cache holds.
constexpr std::size_t kBlock = 256;

/// Whole vectors of at most a block, weighted: what is on the left of the diagonal, and a few more.
template <std::size_t kRows>
HWY_INLINE void products_of_rows(const float* HWY_RESTRICT weights, const float* const* columns,
                                 std::size_t first, std::size_t count, Lanes* HWY_RESTRICT sums,
                                 std::size_t stride) {
  alignas(64) float weighted[kRows][kBlock];
  const float* rows[kRows];
  for (std::size_t r = 0; r < kRows; ++r) {
    rows[r] = weighted[r];
    for (std::size_t i = 0; i < count; ++i) weighted[r][i] = weights[i] * columns[first + r][i];
  }
  sums += first * stride;
  std::size_t c = 0;
  for (; c + kTile <= first + kRows; c += kTile)
    products<kRows, kTile>(rows, columns + c, count, sums + c, stride);
  for (; c < first + kRows; ++c) products<kRows, 1>(rows, columns + c, count, sums + c, stride);
}

void products_of_block(const float* HWY_RESTRICT weights, const float* const* columns,
                       std::size_t n, std::size_t count, Lanes* HWY_RESTRICT sums) {
  std::size_t a = 0;
  for (; a + kTile <= n; a += kTile) products_of_rows<kTile>(weights, columns, a, count, sums, n);
  for (; a < n; ++a) products_of_rows<1>(weights, columns, a, count, sums, n);
}

void normal_products_on(const float* HWY_RESTRICT weights, const float* const* columns,
                        std::size_t n, std::size_t count, float* HWY_RESTRICT sums) {
  Lanes lanes[kMostColumns * kMostColumns];
  for (std::size_t k = 0; k < n * n; ++k) lanes[k] = Lanes{};
  const float* at[kMostColumns];
  const std::size_t whole = count - count % kLanes;
  for (std::size_t first = 0; first < whole; first += kBlock) {
    const std::size_t length = whole - first < kBlock ? whole - first : kBlock;
    for (std::size_t k = 0; k < n; ++k) at[k] = columns[k] + first;
    products_of_block(weights + first, at, n, length, lanes);
  }
  if (whole < count) {
    alignas(64) float rest[kMostColumns + 1][kLanes] = {};
    for (std::size_t k = 0; k < n; ++k) {
      for (std::size_t i = whole; i < count; ++i) rest[k][i - whole] = columns[k][i];
      at[k] = rest[k];
    }
    for (std::size_t i = whole; i < count; ++i) rest[n][i - whole] = weights[i];
    products_of_block(rest[n], at, n, kLanes, lanes);
  }
  for (std::size_t a = 0; a < n; ++a)
    for (std::size_t b = 0; b < n; ++b) sums[a * n + b] = b <= a ? sum_of(lanes[a * n + b]) : 0.0F;
}

void column_sums_on(const float* HWY_RESTRICT weights, const float* const* columns, std::size_t n,
                    std::size_t first, std::size_t count, float* HWY_RESTRICT sums) {
  const std::size_t whole = count - count % kLanes;
  const float* from[1] = {weights + first};
  const float* at[4];
  for (std::size_t k = 0; k < n; k += 4) {
    const std::size_t some = n - k < 4 ? n - k : 4;
    for (std::size_t c = 0; c < some; ++c) {
      at[c] = columns[k + c] + first;
      float rest = 0.0F;
      for (std::size_t i = whole; i < count; ++i) rest += from[0][i] * at[c][i];
      sums[k + c] = rest;
    }
    Lanes lanes[4] = {};
    if (some == 4)
      products<1, 4>(from, at, whole, lanes, n);
    else
      for (std::size_t c = 0; c < some; ++c) products<1, 1>(from, at + c, whole, lanes + c, n);
    for (std::size_t c = 0; c < some; ++c) sums[k + c] += sum_of(lanes[c]);
  }
}

void tukey_sums_on(const float* HWY_RESTRICT residuals, float inverse_variance, float inverse_limit,
                   std::size_t count, TukeySums& sums) {
  Lanes loss = {}, weight = {}, slope = {}, square = {};
  const auto take = [&](const Lanes& r) {
    const Lanes z2 = r * r * inverse_variance;
    Lanes q = 1.0F - z2 * inverse_limit;
    q = q > 0.0F ? q : Lanes{};
    const Lanes w = q * q;
    loss += q * w;
    weight += w;
    slope += q * (5.0F * q - 4.0F);
    square += z2 * w * w;
  };
  std::size_t i = 0;
  Lanes some;
  for (; i + kLanes <= count; i += kLanes) {
    load(residuals + i, some);
    take(some);
  }
  float missing = 0.0F;
  if (i < count) {
    alignas(64) float rest[kLanes];
    for (std::size_t k = 0; k < kLanes; ++k) rest[k] = i + k < count ? residuals[i + k] : 0.0F;
    missing = static_cast<float>(kLanes - (count - i));  // that fit well
    load(rest, some);
    take(some);
  }
  sums.cubed = sum_of(loss) - missing;
  sums.weight = sum_of(weight) - missing;
  sums.slope = sum_of(slope) - missing;
  sums.square = sum_of(square);
}

float median_size_on(const float* HWY_RESTRICT values, std::size_t count) {
  // Sizes of floats are in the order of their bits: the least one that more than half of all do
  // not exceed, bit by bit.
  using Bits = std::int32_t __attribute__((vector_size(64)));
  const std::size_t whole = count - count % kLanes, wanted = count / 2 + 1;
  std::uint32_t found = 0;
  for (std::uint32_t bit = 1U << 30U; bit != 0; bit >>= 1U) {
    const std::uint32_t limit = found + (bit - 1U);
    Bits below = {};
    std::size_t i = 0;
    for (; i < whole; i += kLanes) {
      Bits bits;
      __builtin_memcpy(&bits, values + i, sizeof bits);
      below -= (bits & 0x7fffffff) <= static_cast<std::int32_t>(limit);
    }
    std::size_t number = 0;
    for (std::size_t k = 0; k < kLanes; ++k) number += static_cast<std::size_t>(below[k]);
    for (; i < count; ++i) {
      std::uint32_t bits = 0;
      __builtin_memcpy(&bits, values + i, sizeof bits);
      number += (bits & 0x7fffffffU) <= limit ? 1 : 0;
    }
    if (number < wanted) found += bit;
  }
  float result = 0.0F;
  __builtin_memcpy(&result, &found, sizeof result);
  return result;
}

void subtract_rows_on(const float* HWY_RESTRICT from, const float* const* columns,
                      const float* HWY_RESTRICT by, std::size_t n, std::size_t count,
                      float* HWY_RESTRICT left) {
  constexpr std::size_t kRun = 1024;
  for (std::size_t first = 0; first < count; first += kRun) {
    const std::size_t last = count - first < kRun ? count : first + kRun;
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

static_assert(kSide == kLanes);

/// What the pixels' columns see of a row of half pixels, and the first two derivatives.
struct RowOfHalves {
  Lanes value, slope, bend;
};

/// From x on, `height` more ink; x spread evenly with the variance 2 * `spread`.
HWY_INLINE void cross(const Steps& steps, float x, float height, float spread, RowOfHalves& row) {
  // The place on an edge that is nearly level is known no better than rounding leaves it.
  const auto limit = static_cast<float>(steps.stride - kSide - 1);
  const float within = steps.origin - x < limit ? steps.origin - x : limit;
  const float at = within > 0.0F ? within : 0.0F;
  constexpr float kHalf = 0.5F;
  const float phases = at * Steps::kPhases + kHalf;  // rounds
  const auto nearest = static_cast<std::size_t>(phases);
  const float off = at - static_cast<float>(nearest) * (1.0F / Steps::kPhases);
  const float* from =
      steps.table + (nearest % Steps::kPhases) * 3 * steps.stride + nearest / Steps::kPhases;
  Lanes value, slope, bend;
  load(from, value);
  load(from + steps.stride, slope);
  load(from + 2 * steps.stride, bend);
  const float second = 0.5F * off * off + spread;
  row.value += height * (value + (off * slope + second * bend));
  row.slope += height * (slope + off * bend);
  row.bend += height * bend;
}

HWY_INLINE void draw_edge(const PatchEdge& edge, const Steps& steps, RowOfHalves* rows) {
  constexpr float kFlattest = 0.75F;  // that one crossing goes sideways, pixels
  const auto first = static_cast<int>(edge.top);
  const float size = edge.slope < 0.0F ? -edge.slope : edge.slope;
  for (int row = first; static_cast<float>(row) < edge.bottom; ++row) {
    const auto above = static_cast<float>(row);
    const float top = edge.top > above ? edge.top : above;
    const float bottom = edge.bottom < above + 1.0F ? edge.bottom : above + 1.0F;
    const float height = bottom - top, wide = size * height;
    const float middle = edge.x + edge.slope * (0.5F * (top + bottom) - edge.top);
    if (wide <= kFlattest) {
      cross(steps, middle, edge.sign * height, wide * wide * (1.0F / 24.0F), rows[row]);
      continue;
    }
    const int parts = static_cast<int>(wide * (1.0F / kFlattest)) + 1;
    const float share = 1.0F / static_cast<float>(parts);
    const float step = edge.slope * height * share;
    const float spread = step * step * (1.0F / 24.0F);
    float x = middle - 0.5F * step * static_cast<float>(parts - 1);
    for (int k = 0; k < parts; ++k, x += step)
      cross(steps, x, edge.sign * height * share, spread, rows[row]);
  }
}

void draw_patch_on(const PatchEdge* edges, std::size_t count, const float* HWY_RESTRICT starts,
                   std::size_t margin, const Steps& steps, const Taps& taps, bool more,
                   float* HWY_RESTRICT scratch, const Channels& to) {
  const std::size_t halves = 2 * (kSide + 2 * margin);
  auto* rows = reinterpret_cast<RowOfHalves*>(scratch);
  for (std::size_t row = 0; row < halves; ++row) {
    if (!more) rows[row].value = rows[row].slope = rows[row].bend = Lanes{};
    rows[row].value += starts[row];
  }
  for (std::size_t k = 0; k < count; ++k) draw_edge(edges[k], steps, rows);
  if (to.ink == nullptr) return;
  const auto store = [](const Lanes& lanes, float* at) {
    __builtin_memcpy(at, &lanes, sizeof lanes);
  };
  for (std::size_t y = 0; y < kSide; ++y) {
    Lanes ink = {}, by_x = {}, by_y = {}, by_xx = {}, by_xy = {}, by_yy = {};
    const RowOfHalves* above = rows + 2 * (y + margin);
    const RowOfHalves* below = above + 1;
    for (std::size_t j = 0; j < taps.count; ++j, --above, ++below) {
      const float tv = taps.value[j], ts = taps.slope[j], tb = taps.bend[j];
      const Lanes value = above->value + below->value, slope = above->slope + below->slope;
      ink += tv * value;
      by_yy += tb * value;
      by_y += ts * (below->value - above->value);
      by_x += tv * slope;
      by_xy += ts * (below->slope - above->slope);
      by_xx += tv * (above->bend + below->bend);
    }
    const std::size_t at = y * kSide;
    store(ink, to.ink + at);
    store(by_x, to.by_x + at);
    store(by_y, to.by_y + at);
    store(by_xx, to.by_xx + at);
    store(by_xy, to.by_xy + at);
    store(by_yy, to.by_yy + at);
  }
}

std::size_t take_pixels_on(const SeenPatch& patch, float least, const std::uint16_t* some,
                           const std::uint16_t* allowed, const PickedPixels& to) {
  const hn::CappedTag<float, kSide> d;
  using V = hn::Vec<decltype(d)>;
  constexpr float kMiddle = 0.5F * (kSide - 1);
  const auto set = [&](float value) { return hn::Set(d, value); };
  const std::size_t lanes = hn::Lanes(d);
  std::size_t count = 0;
  for (std::size_t y = 0; y < kSide; ++y)
    for (std::size_t x = 0; x < kSide; x += lanes) {
      const std::uint32_t may = static_cast<std::uint32_t>(allowed[y]) >> x;
      if (may == 0) continue;
      const std::size_t at = y * kSide + x;
      const auto mask_of = [&](std::uint32_t bits) {
        const std::uint8_t bytes[8] = {static_cast<std::uint8_t>(bits),
                                       static_cast<std::uint8_t>(bits >> 8U)};
        return hn::LoadMaskBits(d, bytes);
      };
      const V gx = hn::LoadU(d, patch.drawn.by_x + at), gy = hn::LoadU(d, patch.drawn.by_y + at);
      const auto steep = hn::Ge(hn::Add(hn::Mul(gx, gx), hn::Mul(gy, gy)), set(least * least));
      const auto picked =
          hn::And(mask_of(may), hn::Or(mask_of(static_cast<std::uint32_t>(some[y]) >> x), steep));
      const auto put = [&](V values, float* column) {
        hn::StoreU(hn::Compress(values, picked), d, column + count);
      };
      const auto from = [&](const float* channel) { return hn::LoadU(d, channel + at); };
      const V dx = hn::Add(hn::Iota(d, 0.0F), set(static_cast<float>(x) - kMiddle));
      const V dy = set(static_cast<float>(y) - kMiddle);
      const auto over_patch = [&](const Slope& slope) {
        return hn::Add(hn::Add(set(slope.middle), hn::Mul(set(slope.by_x), dx)),
                       hn::Mul(set(slope.by_y), dy));
      };
      for (std::size_t k = 0; k < patch.unknowns; ++k)
        put(hn::Add(hn::Mul(gx, over_patch(patch.flows[k].x)),
                    hn::Mul(gy, over_patch(patch.flows[k].y))),
            to.flows[k]);
      V white = hn::Sub(set(1.0F), from(patch.drawn.ink));
      if (patch.bulge != nullptr) {
        const V by_peak = hn::Neg(from(patch.bulge));
        white = hn::Add(white, hn::Mul(set(patch.peak), by_peak));
        put(by_peak, to.by_peak);
      }
      put(white, to.white_share);
      put(hn::Mul(set(-0.5F), from(patch.drawn.by_xx)), to.by_xx);
      put(hn::Neg(from(patch.drawn.by_xy)), to.by_xy);
      put(hn::Mul(set(-0.5F), from(patch.drawn.by_yy)), to.by_yy);
      put(from(patch.grey), to.grey);
      put(over_patch(patch.u), to.u);
      put(over_patch(patch.v), to.v);
      put(hn::Mul(dx, set(2.0F / kSide)), to.along_x);
      put(hn::Mul(dy, set(2.0F / kSide)), to.along_y);
      count += hn::CountTrue(d, picked);
    }
  return count;
}

}  // namespace harco::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace harco::kernels {

HWY_EXPORT(normal_products_on);
HWY_EXPORT(column_sums_on);
HWY_EXPORT(tukey_sums_on);
HWY_EXPORT(median_size_on);
HWY_EXPORT(subtract_rows_on);
HWY_EXPORT(huber_weights_on);
HWY_EXPORT(tukey_weights_on);
HWY_EXPORT(light_rows_on);
HWY_EXPORT(draw_patch_on);
HWY_EXPORT(take_pixels_on);

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

void light_rows(const LitSamples& samples, const LightTerms& light, float gain, std::size_t first,
                std::size_t count) {
  HWY_DYNAMIC_DISPATCH(light_rows_on)(samples, light, gain, first, count);
}

void draw_patch(const PatchEdge* edges, std::size_t count, const float* starts, std::size_t margin,
                const Steps& steps, const Taps& taps, bool more, float* scratch,
                const Channels& to) {
  HWY_DYNAMIC_DISPATCH(draw_patch_on)
  (edges, count, starts, margin, steps, taps, more, scratch, to);
}

std::size_t take_pixels(const SeenPatch& patch, float least, const std::uint16_t* some,
                        const std::uint16_t* allowed, const PickedPixels& to) {
  return HWY_DYNAMIC_DISPATCH(take_pixels_on)(patch, least, some, allowed, to);
}

void column_sums(const float* weights, const float* const* columns, std::size_t n,
                 std::size_t first, std::size_t count, float* sums) {
  HWY_DYNAMIC_DISPATCH(column_sums_on)(weights, columns, n, first, count, sums);
}

TukeySums tukey_sums(const float* residuals, float inverse_variance, float inverse_limit,
                     std::size_t count) {
  TukeySums sums{};
  HWY_DYNAMIC_DISPATCH(tukey_sums_on)(residuals, inverse_variance, inverse_limit, count, sums);
  return sums;
}

float median_size(const float* values, std::size_t count) {
  return count == 0 ? 0.0F : HWY_DYNAMIC_DISPATCH(median_size_on)(values, count);
}

}  // namespace harco::kernels
#endif
