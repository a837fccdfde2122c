#include "detect/kernels/spread_bits.hpp"

#include <algorithm>

// Highway compiles this file once for every instruction set.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "detect/kernels/spread_bits.cpp"
#include <hwy/foreach_target.h>
// After foreach_target.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace harco::detect::kernels::HWY_NAMESPACE {

#if HWY_TARGET == HWY_SCALAR

void spread_bits_simd(const std::uint64_t* bits, int words, std::uint64_t* spread) {
  spread_bits_scalar(bits, words, spread);
}

#else

namespace hn = hwy::HWY_NAMESPACE;

void spread_bits_simd(const std::uint64_t* HWY_RESTRICT bits, int words,
                      std::uint64_t* HWY_RESTRICT spread) {
  const hn::ScalableTag<std::uint64_t> tag;
  const int lanes = static_cast<int>(hn::Lanes(tag));
  if (words < lanes) {
    spread_bits_scalar(bits, words, spread);
    return;
  }
  for (int word = 0; word < words; word += lanes) {
    const int at = std::min(word, words - lanes);  // the last step may overlap the one before it
    const auto before = hn::LoadU(tag, bits + at - 1);
    const auto own = hn::LoadU(tag, bits + at);
    const auto behind = hn::LoadU(tag, bits + at + 1);
    const auto one_up = hn::Or(own, hn::ShiftLeft<1>(own));
    const auto one_down = hn::Or(own, hn::ShiftRight<1>(own));
    const auto within = hn::Or(hn::Or(one_up, hn::ShiftLeft<2>(one_up)),
                               hn::Or(one_down, hn::ShiftRight<2>(one_down)));
    const auto entering =
        hn::Or(hn::Or(hn::ShiftRight<61>(before),
                      hn::Or(hn::ShiftRight<62>(before), hn::ShiftRight<63>(before))),
               hn::Or(hn::ShiftLeft<61>(behind),
                      hn::Or(hn::ShiftLeft<62>(behind), hn::ShiftLeft<63>(behind))));
    hn::StoreU(hn::Or(within, entering), tag, spread + at);
  }
}

#endif

}  // namespace harco::detect::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace harco::detect::kernels {

HWY_EXPORT(spread_bits_simd);

void spread_bits(const std::uint64_t* bits, int words, std::uint64_t* spread) {
  HWY_DYNAMIC_DISPATCH(spread_bits_simd)(bits, words, spread);
}

void spread_bits_scalar(const std::uint64_t* bits, int words, std::uint64_t* spread) {
  for (int word = 0; word < words; ++word) {
    spread[word] = bits[word];
    for (int far = 1; far <= 3; ++far)
      spread[word] |= bits[word] << far | bits[word - 1] >> (64 - far) | bits[word] >> far |
                      bits[word + 1] << (64 - far);
  }
}

}  // namespace harco::detect::kernels
#endif
