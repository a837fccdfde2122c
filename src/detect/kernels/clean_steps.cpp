#include "detect/kernels/clean_steps.hpp"

#include <algorithm>
#include <cstdlib>

// Highway compiles this file once for every instruction set.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "detect/kernels/clean_steps.cpp"
#include <hwy/foreach_target.h>
// After foreach_target.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace harco::detect::kernels::HWY_NAMESPACE {

#if HWY_TARGET == HWY_SCALAR

void clean_steps_simd(const SixSamples& samples, int count, int least_contrast,
                      std::uint8_t* bits) {
  clean_steps_scalar(samples, count, least_contrast, bits);
}

#else

namespace hn = hwy::HWY_NAMESPACE;

void clean_steps_simd(const SixSamples& samples, int count, int least_contrast,
                      std::uint8_t* HWY_RESTRICT bits) {
  const hn::CappedTag<std::uint8_t, 64> bytes;
  const int lanes = static_cast<int>(hn::Lanes(bytes));
  const int whole = count / 8 * 8;  // bits of whole bytes
  if (whole < lanes) {
    clean_steps_scalar(samples, count, least_contrast, bits);
    return;
  }
  const auto too_little = hn::Set(bytes, static_cast<std::uint8_t>(least_contrast - 1));
  for (int i = 0; i < whole; i += lanes) {
    const int at = std::min(i, whole - lanes);
    const auto a = hn::LoadU(bytes, samples[0] + at);
    const auto b = hn::LoadU(bytes, samples[1] + at);
    const auto c = hn::LoadU(bytes, samples[2] + at);
    const auto d = hn::LoadU(bytes, samples[3] + at);
    const auto e = hn::LoadU(bytes, samples[4] + at);
    const auto f = hn::LoadU(bytes, samples[5] + at);
    const auto low_before = hn::Min(a, b);
    const auto high_before = hn::Max(a, b);
    const auto low_behind = hn::Min(e, f);
    const auto high_behind = hn::Max(e, f);
    // One of both is zero.
    const auto contrast = hn::Max(hn::SaturatedSub(low_behind, high_before),
                                  hn::SaturatedSub(low_before, high_behind));
    const auto uneven = hn::Max(hn::Sub(high_before, low_before), hn::Sub(high_behind, low_behind));
    const auto twice = hn::SaturatedAdd(uneven, uneven);
    const auto four_times = hn::SaturatedAdd(twice, twice);
    // Their mean, rounded up; AverageRound of some Highways overflows with SVE.
    const auto middle = hn::Sub(hn::Or(b, e), hn::ShiftRight<1>(hn::Xor(b, e)));
    const auto passed = hn::Or(hn::And(hn::Lt(c, middle), hn::Not(hn::Lt(d, middle))),
                               hn::And(hn::Lt(d, middle), hn::Not(hn::Lt(c, middle))));
    const auto clean = hn::And(hn::Gt(contrast, too_little), hn::Not(hn::Gt(four_times, contrast)));
    hn::StoreMaskBits(bytes, hn::And(clean, passed), bits + at / 8);
  }
  if (whole == count) return;
  SixSamples rest = samples;
  for (const std::uint8_t*& sample : rest) sample += whole;
  clean_steps_scalar(rest, count - whole, least_contrast, bits + whole / 8);
}

#endif

}  // namespace harco::detect::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace harco::detect::kernels {

HWY_EXPORT(clean_steps_simd);

void clean_steps(const SixSamples& samples, int count, int least_contrast, std::uint8_t* bits) {
  HWY_DYNAMIC_DISPATCH(clean_steps_simd)(samples, count, least_contrast, bits);
}

void clean_steps_scalar(const SixSamples& samples, int count, int least_contrast,
                        std::uint8_t* bits) {
  const auto clean = [&](int i) {
    const auto& [a, b, c, d, e, f] = samples;
    const int up = std::min(e[i], f[i]) - std::max(a[i], b[i]);
    const int down = std::min(a[i], b[i]) - std::max(e[i], f[i]);
    const int contrast = std::max(up, down);
    const int uneven = std::max(std::abs(a[i] - b[i]), std::abs(e[i] - f[i]));
    const int middle = (b[i] + e[i] + 1) / 2;
    return contrast >= least_contrast && 4 * uneven <= contrast &&
           (c[i] < middle) != (d[i] < middle);
  };
  for (int i = 0; i < count; i += 8) {
    unsigned byte = 0;
    for (int k = i; k < std::min(i + 8, count); ++k) byte |= (clean(k) ? 1U : 0U) << (k - i);
    bits[i / 8] = static_cast<std::uint8_t>(byte);
  }
}

}  // namespace harco::detect::kernels
#endif
