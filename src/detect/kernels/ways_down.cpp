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

void ways_down_simd(const std::uint64_t* here, std::uint64_t flip, int words, int goals,
                    bool is_goal, int reach, const std::uint64_t* below, std::ptrdiff_t stride,
                    std::uint64_t* ways) {
  ways_down_scalar(here, flip, words, goals, is_goal, reach, below, stride, ways);
}

#else

namespace hn = hwy::HWY_NAMESPACE;
constexpr hn::ScalableTag<std::uint64_t> kWords;
using Words = hn::Vec<decltype(kWords)>;

/// What is set up to kReach bits beside, in a row of words.
template <int kReach>
HWY_INLINE Words nearby(Words left, Words middle, Words right) {
  if constexpr (kReach == 0) {
    return middle;
  } else {
    const auto from_left = hn::Or(hn::ShiftLeft<kReach>(middle), hn::ShiftRight<64 - kReach>(left));
    const auto from_right =
        hn::Or(hn::ShiftRight<kReach>(middle), hn::ShiftLeft<64 - kReach>(right));
    return hn::Or(hn::Or(from_left, from_right), nearby<kReach - 1>(left, middle, right));
  }
}

template <int kReach>
void ways_within(const std::uint64_t* HWY_RESTRICT here, std::uint64_t flip, int words, int goals,
                 bool is_goal, const std::uint64_t* HWY_RESTRICT below, std::ptrdiff_t stride,
                 std::uint64_t* HWY_RESTRICT ways) {
  const int lanes = static_cast<int>(hn::Lanes(kWords));
  const auto inverted = hn::Set(kWords, flip);
  for (int word = 0; word < words; word += lanes) {
    const int at = std::min(word, words - lanes);  // the last step may overlap the one before it
    const auto own = hn::Xor(hn::LoadU(kWords, here + at), inverted);
    const std::uint64_t* from = below + at;
    std::uint64_t* to = ways + at;
    int goal = 0;
    if (is_goal) {
      hn::StoreU(own, kWords, to);
      to += stride;
      ++goal;
    }
    for (; goal < goals; ++goal, from += stride, to += stride) {
      const auto reached = nearby<kReach>(hn::LoadU(kWords, from - 1), hn::LoadU(kWords, from),
                                          hn::LoadU(kWords, from + 1));
      hn::StoreU(hn::And(own, reached), kWords, to);
    }
  }
}

void ways_down_simd(const std::uint64_t* here, std::uint64_t flip, int words, int goals,
                    bool is_goal, int reach, const std::uint64_t* below, std::ptrdiff_t stride,
                    std::uint64_t* ways) {
  if (words < static_cast<int>(hn::Lanes(kWords)))
    ways_down_scalar(here, flip, words, goals, is_goal, reach, below, stride, ways);
  else if (reach == 1)
    ways_within<1>(here, flip, words, goals, is_goal, below, stride, ways);
  else if (reach == 2)
    ways_within<2>(here, flip, words, goals, is_goal, below, stride, ways);
  else
    ways_within<3>(here, flip, words, goals, is_goal, below, stride, ways);
}

#endif

}  // namespace harco::detect::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace harco::detect::kernels {

HWY_EXPORT(ways_down_simd);

void ways_down(const std::uint64_t* here, std::uint64_t flip, int words, int goals, bool is_goal,
               int reach, const std::uint64_t* below, std::ptrdiff_t stride, std::uint64_t* ways) {
  HWY_DYNAMIC_DISPATCH(ways_down_simd)
  (here, flip, words, goals, is_goal, reach, below, stride, ways);
}

void ways_down_scalar(const std::uint64_t* here, std::uint64_t flip, int words, int goals,
                      bool is_goal, int reach, const std::uint64_t* below, std::ptrdiff_t stride,
                      std::uint64_t* ways) {
  for (int word = 0; word < words; ++word) {
    const std::uint64_t own = here[word] ^ flip;
    const std::uint64_t* from = below + word;
    std::uint64_t* to = ways + word;
    int goal = 0;
    if (is_goal) {
      *to = own;
      to += stride;
      ++goal;
    }
    for (; goal < goals; ++goal, from += stride, to += stride) {
      std::uint64_t reached = from[0];
      for (int beside = 1; beside <= reach; ++beside)
        reached |= from[0] << beside | from[-1] >> (64 - beside) | from[0] >> beside |
                   from[1] << (64 - beside);
      *to = own & reached;
    }
  }
}

}  // namespace harco::detect::kernels
#endif
