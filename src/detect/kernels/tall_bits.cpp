#include "detect/kernels/tall_bits.hpp"

#include <algorithm>

// Highway compiles this file once for every instruction set.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "detect/kernels/tall_bits.cpp"
#include <hwy/foreach_target.h>
// After foreach_target.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace harco::detect::kernels::HWY_NAMESPACE {

#if HWY_TARGET == HWY_SCALAR

void tall_bits_simd(const std::uint64_t* here, const std::uint64_t* above, const std::uint64_t* top,
                    std::uint64_t flip, int words, std::uint64_t* tall) {
  tall_bits_scalar(here, above, top, flip, words, tall);
}

#else

namespace hn = hwy::HWY_NAMESPACE;

void tall_bits_simd(const std::uint64_t* HWY_RESTRICT here, const std::uint64_t* HWY_RESTRICT above,
                    const std::uint64_t* HWY_RESTRICT top, std::uint64_t flip, int words,
                    std::uint64_t* HWY_RESTRICT tall) {
  const hn::ScalableTag<std::uint64_t> lanes_of_words;
  const int lanes = static_cast<int>(hn::Lanes(lanes_of_words));
  if (words < lanes) {
    tall_bits_scalar(here, above, top, flip, words, tall);
    return;
  }
  const auto inverted = hn::Set(lanes_of_words, flip);
  for (int word = 0; word < words; word += lanes) {
    const int at = std::min(word, words - lanes);  // the last step may overlap the one before it
    const auto own = hn::Xor(hn::LoadU(lanes_of_words, here + at), inverted);
    const auto next = hn::Xor(hn::LoadU(lanes_of_words, above + at), inverted);
    const auto last = hn::Xor(hn::LoadU(lanes_of_words, top + at), inverted);
    hn::StoreU(hn::And(own, hn::And(next, last)), lanes_of_words, tall + at);
  }
}

#endif

}  // namespace harco::detect::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace harco::detect::kernels {

HWY_EXPORT(tall_bits_simd);

void tall_bits(const std::uint64_t* here, const std::uint64_t* above, const std::uint64_t* top,
               std::uint64_t flip, int words, std::uint64_t* tall) {
  HWY_DYNAMIC_DISPATCH(tall_bits_simd)(here, above, top, flip, words, tall);
}

void tall_bits_scalar(const std::uint64_t* here, const std::uint64_t* above,
                      const std::uint64_t* top, std::uint64_t flip, int words,
                      std::uint64_t* tall) {
  for (int word = 0; word < words; ++word)
    tall[word] = (here[word] ^ flip) & (above[word] ^ flip) & (top[word] ^ flip);
}

}  // namespace harco::detect::kernels
#endif
