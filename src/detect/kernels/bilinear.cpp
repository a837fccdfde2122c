#include "detect/kernels/bilinear.hpp"

#include <algorithm>
#include <cstddef>
#include <limits>

// Highway compiles this file once for every instruction set.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "detect/kernels/bilinear.cpp"
#include <hwy/foreach_target.h>
// After foreach_target.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace harco::detect::kernels::HWY_NAMESPACE {

// Where nothing gathers, lanes would be loaded one by one.
#if HWY_TARGET == HWY_AVX2 || HWY_TARGET == HWY_AVX3 || HWY_TARGET == HWY_AVX3_DL

namespace hn = hwy::HWY_NAMESPACE;

void bilinear_simd(const ImageView& image, const std::int32_t* HWY_RESTRICT x,
                   const std::int32_t* HWY_RESTRICT y, std::int32_t dx, std::int32_t dy, int count,
                   float* HWY_RESTRICT grey) {
  const hn::ScalableTag<std::int32_t> lanes_of_places;
  const hn::Rebind<float, decltype(lanes_of_places)> lanes_of_greys;
  const int lanes = static_cast<int>(hn::Lanes(lanes_of_places));
  const std::ptrdiff_t bytes = (image.height() - 1) * image.stride() + image.width();
  if (count < lanes || bytes < 8 || bytes > std::numeric_limits<std::int32_t>::max()) {
    bilinear_scalar(image, x, y, dx, dy, count, grey);
    return;
  }
  const auto right = hn::Set(lanes_of_places, dx);
  const auto down = hn::Set(lanes_of_places, dy);
  const auto parts = hn::Set(lanes_of_places, (1 << kPlaceBits) - 1);
  const auto first = hn::Set(lanes_of_places, 0xFF);
  const auto stride = hn::Set(lanes_of_places, static_cast<std::int32_t>(image.stride()));
  const auto last_word = hn::Set(lanes_of_places, static_cast<std::int32_t>(bytes - 4));
  const auto scale = hn::Set(lanes_of_greys, 1.0F / (1 << (2 * kPlaceBits)));
  // Between the first two bytes of a word.
  const auto between = [&](hn::VFromD<decltype(lanes_of_places)> word,
                           hn::VFromD<decltype(lanes_of_places)> part) HWY_ATTR {
    const auto left = hn::And(word, first);
    const auto next = hn::And(hn::ShiftRight<8>(word), first);
    return hn::Add(hn::ShiftLeft<kPlaceBits>(left), hn::Mul(part, hn::Sub(next, left)));
  };
  const auto* words = reinterpret_cast<const std::int32_t*>(image.row(0));
  for (int i = 0; i < count; i += lanes) {
    const int at = std::min(i, count - lanes);  // the last step may overlap the one before it
    const auto column = hn::Add(hn::LoadU(lanes_of_places, x + at), right);
    const auto row = hn::Add(hn::LoadU(lanes_of_places, y + at), down);
    const auto part_right = hn::And(column, parts);
    const auto part_down = hn::And(row, parts);
    const auto upper = hn::Add(hn::Mul(hn::ShiftRight<kPlaceBits>(row), stride),
                               hn::ShiftRight<kPlaceBits>(column));
    // A word that would end beyond the image is read where it doesn't, and shifted.
    const auto lower = hn::Add(upper, stride);
    const auto within = hn::Min(lower, last_word);
    const auto beyond = hn::ShiftLeft<3>(hn::Sub(lower, within));
    const auto above = between(hn::GatherOffset(lanes_of_places, words, upper), part_right);
    const auto below =
        between(hn::Shr(hn::GatherOffset(lanes_of_places, words, within), beyond), part_right);
    const auto sum =
        hn::Add(hn::ShiftLeft<kPlaceBits>(above), hn::Mul(part_down, hn::Sub(below, above)));
    hn::StoreU(hn::Mul(hn::ConvertTo(lanes_of_greys, sum), scale), lanes_of_greys, grey + at);
  }
}

#else

void bilinear_simd(const ImageView& image, const std::int32_t* x, const std::int32_t* y,
                   std::int32_t dx, std::int32_t dy, int count, float* grey) {
  bilinear_scalar(image, x, y, dx, dy, count, grey);
}

#endif

}  // namespace harco::detect::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace harco::detect::kernels {

HWY_EXPORT(bilinear_simd);

void bilinear(const ImageView& image, const std::int32_t* x, const std::int32_t* y, std::int32_t dx,
              std::int32_t dy, int count, float* grey) {
  HWY_DYNAMIC_DISPATCH(bilinear_simd)(image, x, y, dx, dy, count, grey);
}

void bilinear_scalar(const ImageView& image, const std::int32_t* x, const std::int32_t* y,
                     std::int32_t dx, std::int32_t dy, int count, float* grey) {
  constexpr std::int32_t kOne = 1 << kPlaceBits;
  for (int i = 0; i < count; ++i) {
    const std::int32_t column = x[i] + dx;
    const std::int32_t row = y[i] + dy;
    const std::int32_t part_right = column & (kOne - 1);
    const std::int32_t part_down = row & (kOne - 1);
    const std::uint8_t* const upper = image.row(row >> kPlaceBits) + (column >> kPlaceBits);
    const std::uint8_t* const lower = upper + image.stride();
    const std::int32_t above = kOne * upper[0] + part_right * (upper[1] - upper[0]);
    const std::int32_t below = kOne * lower[0] + part_right * (lower[1] - lower[0]);
    grey[i] = static_cast<float>(kOne * above + part_down * (below - above)) *
              (1.0F / (1 << (2 * kPlaceBits)));
  }
}

}  // namespace harco::detect::kernels
#endif
