#include "detect/kernels/steep_bits.hpp"

#include <algorithm>

// Highway compiles this file once for every instruction set.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "detect/kernels/steep_bits.cpp"
#include <hwy/foreach_target.h>
// After foreach_target.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace harco::detect::kernels::HWY_NAMESPACE {

#if HWY_TARGET == HWY_SCALAR

void steep_bits_simd(const std::uint8_t* from, const std::uint8_t* to, const std::uint8_t* least,
                     int width, std::uint8_t* bits) {
  steep_bits_scalar(from, to, least, width, bits);
}

#else

namespace hn = hwy::HWY_NAMESPACE;

void steep_bits_simd(const std::uint8_t* HWY_RESTRICT from, const std::uint8_t* HWY_RESTRICT to,
                     const std::uint8_t* HWY_RESTRICT least, int width,
                     std::uint8_t* HWY_RESTRICT bits) {
  const hn::CappedTag<std::uint8_t, 64> bytes;
  const int lanes = static_cast<int>(hn::Lanes(bytes));
  const int whole = width / 8 * 8;  // bits of whole bytes
  if (whole < lanes) {
    steep_bits_scalar(from, to, least, width, bits);
    return;
  }
  for (int x = 0; x < whole; x += lanes) {
    const int at = std::min(x, whole - lanes);
    const auto fall = hn::SaturatedSub(hn::LoadU(bytes, from + at), hn::LoadU(bytes, to + at));
    const auto less = hn::Lt(fall, hn::LoadU(bytes, least + at));
    hn::StoreMaskBits(bytes, hn::Not(less), bits + at / 8);
  }
  steep_bits_scalar(from + whole, to + whole, least + whole, width - whole, bits + whole / 8);
}

#endif

}  // namespace harco::detect::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace harco::detect::kernels {

HWY_EXPORT(steep_bits_simd);

void steep_bits(const std::uint8_t* from, const std::uint8_t* to, const std::uint8_t* least,
                int width, std::uint8_t* bits) {
  HWY_DYNAMIC_DISPATCH(steep_bits_simd)(from, to, least, width, bits);
}

void steep_bits_scalar(const std::uint8_t* from, const std::uint8_t* to, const std::uint8_t* least,
                       int width, std::uint8_t* bits) {
  for (int x = 0; x < width; x += 8) {
    unsigned byte = 0;
    for (int i = x; i < std::min(x + 8, width); ++i)
      byte |= (std::max(from[i] - to[i], 0) >= least[i] ? 1U : 0U) << (i - x);
    bits[x / 8] = static_cast<std::uint8_t>(byte);
  }
}

}  // namespace harco::detect::kernels
#endif
