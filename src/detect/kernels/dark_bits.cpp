#include "detect/kernels/dark_bits.hpp"

#include <algorithm>

// Highway compiles this file once for every instruction set.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "detect/kernels/dark_bits.cpp"
#include <hwy/foreach_target.h>
// After foreach_target.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace harco::detect::kernels::HWY_NAMESPACE {

#if HWY_TARGET == HWY_SCALAR

void dark_bits_simd(const std::uint8_t* pixels, const std::uint8_t* thresholds, int width,
                    std::uint8_t* bits) {
  dark_bits_scalar(pixels, thresholds, width, bits);
}

#else

namespace hn = hwy::HWY_NAMESPACE;

void dark_bits_simd(const std::uint8_t* HWY_RESTRICT pixels,
                    const std::uint8_t* HWY_RESTRICT thresholds, int width,
                    std::uint8_t* HWY_RESTRICT bits) {
  const hn::CappedTag<std::uint8_t, 64> bytes;
  const int lanes = static_cast<int>(hn::Lanes(bytes));
  const int whole = width / 8 * 8;  // bits of whole bytes
  if (whole < lanes) {
    dark_bits_scalar(pixels, thresholds, width, bits);
    return;
  }
  for (int x = 0; x < whole; x += lanes) {
    const int at = std::min(x, whole - lanes);
    const auto grey = hn::LoadU(bytes, pixels + at);
    hn::StoreMaskBits(bytes, hn::Lt(grey, hn::LoadU(bytes, thresholds + at)), bits + at / 8);
  }
  dark_bits_scalar(pixels + whole, thresholds + whole, width - whole, bits + whole / 8);
}

#endif

}  // namespace harco::detect::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace harco::detect::kernels {

HWY_EXPORT(dark_bits_simd);

void dark_bits(const std::uint8_t* pixels, const std::uint8_t* thresholds, int width,
               std::uint8_t* bits) {
  HWY_DYNAMIC_DISPATCH(dark_bits_simd)(pixels, thresholds, width, bits);
}

void dark_bits_scalar(const std::uint8_t* pixels, const std::uint8_t* thresholds, int width,
                      std::uint8_t* bits) {
  for (int x = 0; x < width; x += 8) {
    unsigned byte = 0;
    for (int i = x; i < std::min(x + 8, width); ++i)
      byte |= (pixels[i] < thresholds[i] ? 1U : 0U) << (i - x);
    bits[x / 8] = static_cast<std::uint8_t>(byte);
  }
}

}  // namespace harco::detect::kernels
#endif
