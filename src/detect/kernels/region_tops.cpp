#include "detect/kernels/region_tops.hpp"

#include <algorithm>

// Highway compiles this file once for every instruction set.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "detect/kernels/region_tops.cpp"
#include <hwy/foreach_target.h>
// After foreach_target.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace harco::detect::kernels::HWY_NAMESPACE {

#if HWY_TARGET == HWY_SCALAR

void region_tops_simd(const TopsRow& row, const Tops& tops) { region_tops_scalar(row, tops); }

#else

namespace hn = hwy::HWY_NAMESPACE;

void region_tops_simd(const TopsRow& row, const Tops& tops) {
  const hn::CappedTag<std::uint64_t, 8> lanes_of_words;  // no more than bits in a byte
  const int lanes = static_cast<int>(hn::Lanes(lanes_of_words));
  if (row.words < lanes) {
    region_tops_scalar(row, tops);
    return;
  }
  std::fill_n(tops.some, (row.words + 63) / 64, 0);
  const auto flip = hn::Set(lanes_of_words, row.flip);
  const auto ones = hn::Set(lanes_of_words, ~std::uint64_t{0});
  for (int word = 0; word < row.words; word += lanes) {
    const int at = std::min(word, row.words - lanes);  // the last step may overlap
    const auto load = [&](const std::uint64_t* words)
                          HWY_ATTR { return hn::LoadU(lanes_of_words, words + at); };
    const auto inside = hn::Xor(load(row.here), flip);
    const auto before = hn::Xor(load(row.here - 1), flip);
    const auto edge = hn::AndNot(hn::Xor(load(row.above), flip), inside);
    const auto begin =
        hn::AndNot(hn::Or(hn::ShiftLeft<1>(inside), hn::ShiftRight<63>(before)), edge);
    // A sum carries a bit that is set in a stretch of edge to the bit behind the stretch.
    const auto from_begin = hn::Add(edge, begin);
    const auto from_good = hn::Add(edge, hn::And(edge, hn::And(load(row.steep), load(row.ways))));
    const auto ends = hn::AndNot(inside, hn::And(from_begin, from_good));
    // What goes on into the next word has none above there either, and one that is set in both.
    const auto next = hn::Xor(load(row.here + 1), flip);
    const auto lead = hn::AndNot(hn::Sub(next, ones), next);
    const auto covered = hn::And(lead, hn::Xor(load(row.above + 1), flip));
    const auto good_next = hn::And(lead, hn::And(load(row.steep + 1), load(row.ways + 1)));
    const auto zero = hn::Zero(lanes_of_words);
    const auto good =
        hn::Or(hn::Lt(from_good, edge), hn::Or(hn::Ne(good_next, zero), hn::Eq(lead, ones)));
    const auto open = hn::VecFromMask(
        lanes_of_words, hn::And(hn::Lt(from_begin, edge), hn::And(good, hn::Eq(covered, zero))));
    hn::StoreU(ends, lanes_of_words, tops.ends + at);
    hn::StoreU(open, lanes_of_words, tops.open + at);
    const auto some = hn::Ne(hn::Or(ends, open), zero);
    std::uint8_t bits[8] = {};
    hn::StoreMaskBits(lanes_of_words, some, bits);
    const int shift = at % 64;
    tops.some[at / 64] |= std::uint64_t{bits[0]} << shift;
    if (shift + lanes > 64) tops.some[at / 64 + 1] |= std::uint64_t{bits[0]} >> (64 - shift);
  }
}

#endif

}  // namespace harco::detect::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace harco::detect::kernels {

HWY_EXPORT(region_tops_simd);

void region_tops(const TopsRow& row, const Tops& tops) {
  HWY_DYNAMIC_DISPATCH(region_tops_simd)(row, tops);
}

void region_tops_scalar(const TopsRow& row, const Tops& tops) {
  std::fill_n(tops.some, (row.words + 63) / 64, 0);
  for (int word = 0; word < row.words; ++word) {
    const std::uint64_t inside = row.here[word] ^ row.flip;
    const std::uint64_t before = row.here[word - 1] ^ row.flip;
    const std::uint64_t edge = inside & ~(row.above[word] ^ row.flip);
    const std::uint64_t from_begin = edge + (edge & ~(inside << 1 | before >> 63));
    const std::uint64_t from_good = edge + (edge & row.steep[word] & row.ways[word]);
    tops.ends[word] = from_begin & from_good & ~inside;
    const std::uint64_t next = row.here[word + 1] ^ row.flip;
    const std::uint64_t lead = next & ~(next + 1);
    const bool covered = (lead & (row.above[word + 1] ^ row.flip)) != 0;
    const bool good = from_good < edge || (lead & row.steep[word + 1] & row.ways[word + 1]) != 0 ||
                      lead == ~std::uint64_t{0};
    tops.open[word] = from_begin < edge && good && !covered ? ~std::uint64_t{0} : 0;
    if ((tops.ends[word] | tops.open[word]) != 0)
      tops.some[word / 64] |= std::uint64_t{1} << (word % 64);
  }
}

}  // namespace harco::detect::kernels
#endif
