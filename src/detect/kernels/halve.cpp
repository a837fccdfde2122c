#include "detect/kernels/halve.hpp"

#include <algorithm>

// Highway compiles this file once for every instruction set.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "detect/kernels/halve.cpp"
#include <hwy/foreach_target.h>
// After foreach_target.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace harco::detect::kernels::HWY_NAMESPACE {

#if HWY_TARGET == HWY_SCALAR

void halve_simd(const std::uint8_t* upper, const std::uint8_t* lower, int width,
                std::uint8_t* half) {
  halve_rows_scalar(upper, lower, width, half);
}

#else

namespace hn = hwy::HWY_NAMESPACE;

void halve_simd(const std::uint8_t* HWY_RESTRICT upper, const std::uint8_t* HWY_RESTRICT lower,
                int width, std::uint8_t* HWY_RESTRICT half) {
  const hn::ScalableTag<std::uint8_t> bytes;
  const hn::Repartition<std::uint16_t, decltype(bytes)> pairs;
  const hn::Rebind<std::uint8_t, decltype(pairs)> means;
  const int lanes = static_cast<int>(hn::Lanes(pairs));
  if (width < lanes) {
    halve_rows_scalar(upper, lower, width, half);
    return;
  }
  const auto first = hn::Set(pairs, 0xFF);
  const auto sum = [&](const std::uint8_t* pixels) HWY_ATTR {
    const auto pair = hn::BitCast(pairs, hn::LoadU(bytes, pixels));
    return hn::Add(hn::And(pair, first), hn::ShiftRight<8>(pair));
  };
  for (int x = 0; x < width; x += lanes) {
    const int at = std::min(x, width - lanes);  // the last step may overlap the one before it
    const auto four = hn::Add(sum(upper + 2 * at), sum(lower + 2 * at));
    const auto mean = hn::ShiftRight<2>(hn::Add(four, hn::Set(pairs, 2)));
    hn::StoreU(hn::TruncateTo(means, mean), means, half + at);
  }
}

#endif

}  // namespace harco::detect::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace harco::detect::kernels {

HWY_EXPORT(halve_simd);

void halve_rows(const std::uint8_t* upper, const std::uint8_t* lower, int width,
                std::uint8_t* half) {
  HWY_DYNAMIC_DISPATCH(halve_simd)(upper, lower, width, half);
}

void halve_rows_scalar(const std::uint8_t* upper, const std::uint8_t* lower, int width,
                       std::uint8_t* half) {
  for (int x = 0; x < width; ++x)
    half[x] = static_cast<std::uint8_t>(
        (upper[2 * x] + upper[2 * x + 1] + lower[2 * x] + lower[2 * x + 1] + 2) >> 2);
}

}  // namespace harco::detect::kernels
#endif
