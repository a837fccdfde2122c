#include "detect/kernels/explained_blocks.hpp"

#include <algorithm>
#include <cstddef>

// Highway compiles this file once for every instruction set.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "detect/kernels/explained_blocks.cpp"
#include <hwy/foreach_target.h>
// After foreach_target.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace harco::detect::kernels::HWY_NAMESPACE {

#if HWY_TARGET == HWY_SCALAR

Explained explained_blocks_simd(const std::int16_t* seen, const std::int16_t* predicted,
                                const std::uint8_t* marked, int count, int texels, int most) {
  return explained_blocks_scalar(seen, predicted, marked, count, texels, most);
}

#else

namespace hn = hwy::HWY_NAMESPACE;

Explained explained_blocks_simd(const std::int16_t* HWY_RESTRICT seen,
                                const std::int16_t* HWY_RESTRICT predicted,
                                const std::uint8_t* HWY_RESTRICT marked, int count, int texels,
                                int most) {
  const hn::ScalableTag<std::int16_t> tag;
  const hn::Rebind<std::uint8_t, decltype(tag)> bytes;
  const int lanes = static_cast<int>(hn::Lanes(tag));
  if (count < lanes) return explained_blocks_scalar(seen, predicted, marked, count, texels, most);
  // Its square is just below 32768; what is farther off is too much as well.
  const auto far = hn::Set(tag, std::int16_t{181});
  const auto limit = hn::Set(tag, static_cast<std::int16_t>(most));
  Explained total;
  for (int i = 0; i < count; i += lanes) {
    const int first = std::min(i, count - lanes);
    auto off = hn::Zero(tag);
    for (int k = 0; k < texels; ++k) {
      const std::ptrdiff_t at = static_cast<std::ptrdiff_t>(k) * count + first;
      const auto away = hn::Sub(hn::LoadU(tag, seen + at), hn::LoadU(tag, predicted + at));
      const auto near = hn::Min(hn::Abs(away), far);
      off = hn::SaturatedAdd(off, hn::Mul(near, near));
    }
    // The last step may overlap the one before it.
    const auto known = hn::FirstN(tag, static_cast<std::size_t>(i - first));
    const auto explained = hn::Not(hn::Or(known, hn::Gt(off, limit)));
    const auto chosen = hn::Gt(hn::PromoteTo(tag, hn::LoadU(bytes, marked + first)), hn::Zero(tag));
    total.all += static_cast<int>(hn::CountTrue(tag, explained));
    total.marked += static_cast<int>(hn::CountTrue(tag, hn::And(explained, chosen)));
  }
  return total;
}

#endif

}  // namespace harco::detect::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace harco::detect::kernels {

HWY_EXPORT(explained_blocks_simd);

Explained explained_blocks(const std::int16_t* seen, const std::int16_t* predicted,
                           const std::uint8_t* marked, int count, int texels, int most) {
  return HWY_DYNAMIC_DISPATCH(explained_blocks_simd)(seen, predicted, marked, count, texels, most);
}

Explained explained_blocks_scalar(const std::int16_t* seen, const std::int16_t* predicted,
                                  const std::uint8_t* marked, int count, int texels, int most) {
  Explained total;
  for (int i = 0; i < count; ++i) {
    std::int64_t off = 0;
    for (int k = 0; k < texels; ++k) {
      const std::ptrdiff_t at = static_cast<std::ptrdiff_t>(k) * count + i;
      const std::int64_t away = seen[at] - predicted[at];
      off += away * away;
    }
    total.all += off <= most ? 1 : 0;
    total.marked += off <= most && marked[i] != 0 ? 1 : 0;
  }
  return total;
}

}  // namespace harco::detect::kernels
#endif
