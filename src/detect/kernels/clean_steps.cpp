#include "detect/kernels/clean_steps.hpp"

#include <algorithm>
#include <cstddef>

// Highway compiles this file once for every instruction set.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "detect/kernels/clean_steps.cpp"
#include <hwy/foreach_target.h>
// After foreach_target.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace harco::detect::kernels::HWY_NAMESPACE {

#if HWY_TARGET == HWY_SCALAR

void clean_steps_simd(const EightSamples& samples, int even, int count, int least_contrast,
                      std::uint8_t* rising, std::uint8_t* falling) {
  clean_steps_scalar(samples, even, count, least_contrast, rising, falling);
}

#else

namespace hn = hwy::HWY_NAMESPACE;

template <bool kThreeEven>
void clean_steps_of(const EightSamples& samples, int count, int least_contrast,
                    std::uint8_t* HWY_RESTRICT rising, std::uint8_t* HWY_RESTRICT falling) {
  constexpr int kEven = kThreeEven ? 3 : 2;
  const hn::CappedTag<std::uint8_t, 64> bytes;
  const int lanes = static_cast<int>(hn::Lanes(bytes));
  const int whole = count / 8 * 8;  // bits of whole bytes
  if (whole < lanes) {
    clean_steps_scalar(samples, kEven, count, least_contrast, rising, falling);
    return;
  }
  const auto too_little = hn::Set(bytes, static_cast<std::uint8_t>(least_contrast - 1));
  // Of `lanes` places from `at` on, into so many bits.
  const auto find = [&](int at, std::uint8_t* up_bits, std::uint8_t* down_bits) HWY_ATTR {
    const auto b = hn::LoadU(bytes, samples[2] + at);
    const auto c = hn::LoadU(bytes, samples[3] + at);
    const auto d = hn::LoadU(bytes, samples[4] + at);
    const auto e = hn::LoadU(bytes, samples[5] + at);
    const auto before = hn::LoadU(bytes, samples[1] + at);
    const auto behind = hn::LoadU(bytes, samples[6] + at);
    auto low_before = hn::Min(before, b);
    auto high_before = hn::Max(before, b);
    auto low_behind = hn::Min(e, behind);
    auto high_behind = hn::Max(e, behind);
    if constexpr (kThreeEven) {
      const auto first = hn::LoadU(bytes, samples[0] + at);
      const auto last = hn::LoadU(bytes, samples[7] + at);
      low_before = hn::Min(first, low_before);
      high_before = hn::Max(first, high_before);
      low_behind = hn::Min(last, low_behind);
      high_behind = hn::Max(last, high_behind);
    }
    // One of both is zero.
    const auto up = hn::SaturatedSub(low_behind, high_before);
    const auto down = hn::SaturatedSub(low_before, high_behind);
    const auto uneven = hn::Max(hn::Sub(high_before, low_before), hn::Sub(high_behind, low_behind));
    const auto twice = hn::SaturatedAdd(uneven, uneven);
    const auto four_times = hn::SaturatedAdd(twice, twice);
    // Their mean, rounded up; AverageRound of some Highways overflows with SVE.
    const auto middle = hn::Sub(hn::Or(b, e), hn::ShiftRight<1>(hn::Xor(b, e)));
    const auto passed = hn::Or(hn::And(hn::Lt(c, middle), hn::Not(hn::Lt(d, middle))),
                               hn::And(hn::Lt(d, middle), hn::Not(hn::Lt(c, middle))));
    const auto clean = hn::And(passed, hn::Not(hn::Gt(four_times, hn::Max(up, down))));
    hn::StoreMaskBits(bytes, hn::And(clean, hn::Gt(up, too_little)), up_bits);
    hn::StoreMaskBits(bytes, hn::And(clean, hn::Gt(down, too_little)), down_bits);
  };
  for (int i = 0; i < whole; i += lanes) {
    const int at = std::min(i, whole - lanes);
    find(at, rising + at / 8, falling + at / 8);
  }
  if (whole == count) return;
  // The last places' bits begin within a byte.
  std::array<std::uint8_t, 8> up_bits{};
  std::array<std::uint8_t, 8> down_bits{};
  find(count - lanes, up_bits.data(), down_bits.data());
  const int left = count - whole;
  const auto last_byte = static_cast<std::size_t>(lanes / 8 - 1);
  rising[whole / 8] = static_cast<std::uint8_t>(up_bits[last_byte] >> (8 - left));
  falling[whole / 8] = static_cast<std::uint8_t>(down_bits[last_byte] >> (8 - left));
}

void clean_steps_simd(const EightSamples& samples, int even, int count, int least_contrast,
                      std::uint8_t* rising, std::uint8_t* falling) {
  if (even == 3)
    clean_steps_of<true>(samples, count, least_contrast, rising, falling);
  else
    clean_steps_of<false>(samples, count, least_contrast, rising, falling);
}

#endif

}  // namespace harco::detect::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace harco::detect::kernels {

HWY_EXPORT(clean_steps_simd);

void clean_steps(const EightSamples& samples, int even, int count, int least_contrast,
                 std::uint8_t* rising, std::uint8_t* falling) {
  HWY_DYNAMIC_DISPATCH(clean_steps_simd)(samples, even, count, least_contrast, rising, falling);
}

void clean_steps_scalar(const EightSamples& samples, int even, int count, int least_contrast,
                        std::uint8_t* rising, std::uint8_t* falling) {
  std::fill_n(rising, (count + 7) / 8, std::uint8_t{0});
  std::fill_n(falling, (count + 7) / 8, std::uint8_t{0});
  for (int i = 0; i < count; ++i) {
    const auto grey = [&](int k) { return int{samples[static_cast<std::size_t>(k)][i]}; };
    const auto [low_before, high_before] = std::minmax({grey(3 - even), grey(1), grey(2)});
    const auto [low_behind, high_behind] = std::minmax({grey(5), grey(6), grey(4 + even)});
    const int up = low_behind - high_before;
    const int down = low_before - high_behind;
    const int contrast = std::max(up, down);
    const int uneven = std::max(high_before - low_before, high_behind - low_behind);
    const int middle = (grey(2) + grey(5) + 1) / 2;
    if (contrast < least_contrast || 4 * uneven > contrast ||
        (grey(3) < middle) == (grey(4) < middle))
      continue;
    std::uint8_t* const bits = up > down ? rising : falling;
    bits[i / 8] = static_cast<std::uint8_t>(bits[i / 8] | 1U << i % 8);
  }
}

}  // namespace harco::detect::kernels
#endif
