// Kernel: grey values between pixels, at many places.
#pragma once

#include <cstdint>

#include "harco/image.hpp"

namespace harco::detect::kernels {

/// Places are counted in 2048ths of a pixel from the centre of the image's first one.
inline constexpr int kPlaceBits = 11;

/// A coordinate, which isn't negative, in that unit, rounded down.
inline std::int32_t place_of(float pixels) {
  return static_cast<std::int32_t>(static_cast<float>(1 << kPlaceBits) * pixels);
}

/// Bilinear interpolation at (x[i] + dx, y[i] + dy), i < count. Of each place, the pixels to the
/// right and below have to be in the image as well.
void bilinear(const ImageView& image, const std::int32_t* x, const std::int32_t* y, std::int32_t dx,
              std::int32_t dy, int count, float* grey);
void bilinear_scalar(const ImageView& image, const std::int32_t* x, const std::int32_t* y,
                     std::int32_t dx, std::int32_t dy, int count, float* grey);

}  // namespace harco::detect::kernels
