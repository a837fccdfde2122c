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

void ways_down_simd(const WaysRow& row, std::uint64_t* ways, std::uint64_t* broad) {
  ways_down_scalar(row, ways, broad);
}

#else

namespace hn = hwy::HWY_NAMESPACE;
constexpr hn::ScalableTag<std::uint64_t> kWords;
using Words = hn::Vec<decltype(kWords)>;

/// Every bit from kBits farther to the left, or to the right if negative, in a row of words.
template <int kBits>
HWY_INLINE Words moved(Words left, Words middle, Words right) {
  if constexpr (kBits > 0)
    return hn::Or(hn::ShiftLeft<kBits>(middle), hn::ShiftRight<64 - kBits>(left));
  else if constexpr (kBits < 0)
    return hn::Or(hn::ShiftRight<-kBits>(middle), hn::ShiftLeft<64 + kBits>(right));
  else
    return middle;
}

/// What is set up to kReach bits beside.
template <int kReach>
HWY_INLINE Words nearby(Words left, Words middle, Words right) {
  if constexpr (kReach == 0)
    return middle;
  else
    return hn::Or(hn::Or(moved<kReach>(left, middle, right), moved<-kReach>(left, middle, right)),
                  nearby<kReach - 1>(left, middle, right));
}

/// Where three neighbours are set, of which the middle one is kBits farther to the left.
template <int kBits>
HWY_INLINE Words three(Words left, Words middle, Words right) {
  return hn::And(hn::And(moved<kBits - 1>(left, middle, right), moved<kBits>(left, middle, right)),
                 moved<kBits + 1>(left, middle, right));
}

/// Where three neighbours are set, of which the middle one is up to two bits away.
HWY_INLINE Words near_three(Words left, Words middle, Words right) {
  const auto on_left = hn::Or(three<2>(left, middle, right), three<1>(left, middle, right));
  const auto on_right = hn::Or(three<-2>(left, middle, right), three<-1>(left, middle, right));
  return hn::Or(hn::Or(on_left, on_right), three<0>(left, middle, right));
}

template <int kReach>
void ways_within(const WaysRow& row, std::uint64_t* HWY_RESTRICT ways,
                 std::uint64_t* HWY_RESTRICT broad) {
  const int lanes = static_cast<int>(hn::Lanes(kWords));
  const auto inverted = hn::Set(kWords, row.flip);
  const std::uint64_t* HWY_RESTRICT here = row.here;
  const std::uint64_t* HWY_RESTRICT below = row.below;
  const std::ptrdiff_t stride = row.stride;
  for (int word = 0; word < row.words; word += lanes) {
    const int at = std::min(word, row.words - lanes);  // the last step may overlap the one before
    const auto own = hn::Xor(hn::LoadU(kWords, here + at), inverted);
    const std::uint64_t* from = below + at;
    std::uint64_t* to = ways + at;
    int goal = 0;
    if (row.is_goal) {
      hn::StoreU(own, kWords, to);
      to += stride;
      ++goal;
    }
    for (; goal < row.goals; ++goal, from += stride, to += stride) {
      const auto reached = nearby<kReach>(hn::LoadU(kWords, from - 1), hn::LoadU(kWords, from),
                                          hn::LoadU(kWords, from + 1));
      hn::StoreU(hn::And(own, reached), kWords, to);
    }
    if (broad) {
      const std::uint64_t* longest = below + (row.goals - 1) * stride + at;
      const auto reached = near_three(hn::LoadU(kWords, longest - 1), hn::LoadU(kWords, longest),
                                      hn::LoadU(kWords, longest + 1));
      hn::StoreU(hn::And(own, reached), kWords, broad + at);
    }
  }
}

void ways_down_simd(const WaysRow& row, std::uint64_t* ways, std::uint64_t* broad) {
  if (row.words < static_cast<int>(hn::Lanes(kWords)))
    ways_down_scalar(row, ways, broad);
  else if (row.reach == 1)
    ways_within<1>(row, ways, broad);
  else if (row.reach == 2)
    ways_within<2>(row, ways, broad);
  else
    ways_within<3>(row, ways, broad);
}

#endif

}  // namespace harco::detect::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace harco::detect::kernels {

HWY_EXPORT(ways_down_simd);

void ways_down(const WaysRow& row, std::uint64_t* ways, std::uint64_t* broad) {
  HWY_DYNAMIC_DISPATCH(ways_down_simd)(row, ways, broad);
}

void ways_down_scalar(const WaysRow& row, std::uint64_t* ways, std::uint64_t* broad) {
  // Every bit from so many farther to the left, or to the right if negative.
  const auto moved = [](const std::uint64_t* word, int bits) {
    if (bits == 0) return word[0];
    return bits > 0 ? word[0] << bits | word[-1] >> (64 - bits)
                    : word[0] >> -bits | word[1] << (64 + bits);
  };
  for (int word = 0; word < row.words; ++word) {
    const std::uint64_t own = row.here[word] ^ row.flip;
    const std::uint64_t* from = row.below + word;
    std::uint64_t* to = ways + word;
    int goal = 0;
    if (row.is_goal) {
      *to = own;
      to += row.stride;
      ++goal;
    }
    for (; goal < row.goals; ++goal, from += row.stride, to += row.stride) {
      std::uint64_t reached = 0;
      for (int beside = -row.reach; beside <= row.reach; ++beside) reached |= moved(from, beside);
      *to = own & reached;
    }
    if (broad) {
      const std::uint64_t* longest = row.below + word + (row.goals - 1) * row.stride;
      std::uint64_t three = 0;
      for (int middle = -2; middle <= 2; ++middle)
        three |= moved(longest, middle - 1) & moved(longest, middle) & moved(longest, middle + 1);
      broad[word] = own & three;
    }
  }
}

}  // namespace harco::detect::kernels
#endif
