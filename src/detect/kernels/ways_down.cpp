#include "detect/kernels/ways_down.hpp"

#include <algorithm>

// Highway compiles this file once for every instruction set.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "detect/kernels/ways_down.cpp"
#include <hwy/foreach_target.h>
// After foreach_target.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace harco::detect::kernels::HWY_NAMESPACE {

#if HWY_TARGET == HWY_SCALAR

void ways_down_simd(const std::uint64_t* here, std::uint64_t flip, const std::uint64_t* below,
                    int words, std::uint64_t* ways) {
  ways_down_scalar(here, flip, below, words, ways);
}

#else

namespace hn = hwy::HWY_NAMESPACE;

void ways_down_simd(const std::uint64_t* HWY_RESTRICT here, std::uint64_t flip,
                    const std::uint64_t* HWY_RESTRICT below, int words,
                    std::uint64_t* HWY_RESTRICT ways) {
  const hn::ScalableTag<std::uint64_t> lanes_of_words;
  const int lanes = static_cast<int>(hn::Lanes(lanes_of_words));
  if (words < lanes) {
    ways_down_scalar(here, flip, below, words, ways);
    return;
  }
  const auto inverted = hn::Set(lanes_of_words, flip);
  for (int word = 0; word < words; word += lanes) {
    const int at = std::min(word, words - lanes);  // the last step may overlap the one before it
    const auto left = hn::LoadU(lanes_of_words, below + at - 1);
    const auto middle = hn::LoadU(lanes_of_words, below + at);
    const auto right = hn::LoadU(lanes_of_words, below + at + 1);
    const auto from_left = hn::Or(hn::Or(hn::ShiftLeft<1>(middle), hn::ShiftRight<63>(left)),
                                  hn::Or(hn::ShiftLeft<2>(middle), hn::ShiftRight<62>(left)));
    const auto from_right = hn::Or(hn::Or(hn::ShiftRight<1>(middle), hn::ShiftLeft<63>(right)),
                                   hn::Or(hn::ShiftRight<2>(middle), hn::ShiftLeft<62>(right)));
    const auto reached = hn::Or(middle, hn::Or(from_left, from_right));
    const auto own = hn::Xor(hn::LoadU(lanes_of_words, here + at), inverted);
    hn::StoreU(hn::And(own, reached), lanes_of_words, ways + at);
  }
}

#endif

}  // namespace harco::detect::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace harco::detect::kernels {

HWY_EXPORT(ways_down_simd);

void ways_down(const std::uint64_t* here, std::uint64_t flip, const std::uint64_t* below, int words,
               std::uint64_t* ways) {
  HWY_DYNAMIC_DISPATCH(ways_down_simd)(here, flip, below, words, ways);
}

void ways_down_scalar(const std::uint64_t* here, std::uint64_t flip, const std::uint64_t* below,
                      int words, std::uint64_t* ways) {
  for (int word = 0; word < words; ++word) {
    const std::uint64_t left = below[word - 1];
    const std::uint64_t middle = below[word];
    const std::uint64_t right = below[word + 1];
    const std::uint64_t from_left = middle << 1 | left >> 63 | middle << 2 | left >> 62;
    const std::uint64_t from_right = middle >> 1 | right << 63 | middle >> 2 | right << 62;
    ways[word] = (here[word] ^ flip) & (middle | from_left | from_right);
  }
}

}  // namespace harco::detect::kernels
#endif
