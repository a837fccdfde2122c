// Grey values between pixels.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>

#include "harco/image.hpp"

namespace harco::detect {

/// Whether a point lies between pixels' centres.
inline bool between_pixels(const ImageView& image, double x, double y) {
  return x >= 0.0 && y >= 0.0 && x <= image.width() - 1 && y <= image.height() - 1;
}

/// Bilinear interpolation at a point between pixels' centres.
inline double sample_inside(const ImageView& image, double x, double y) {
  const int x0 = std::min(static_cast<int>(x), image.width() - 2);
  const int y0 = std::min(static_cast<int>(y), image.height() - 2);
  if (x0 < 0 || y0 < 0) return image(static_cast<int>(x), static_cast<int>(y));  // 1 pixel wide
  const double fx = x - x0;
  const double fy = y - y0;
  const std::uint8_t* upper = image.row(y0) + x0;
  const std::uint8_t* lower = upper + image.stride();
  const double top = upper[0] + fx * (upper[1] - upper[0]);
  const double bottom = lower[0] + fx * (lower[1] - lower[0]);
  return top + fy * (bottom - top);
}

/// Whether all four pixels around a point are in the image.
inline bool among_pixels(const ImageView& image, float x, float y) {
  return x >= 0.0F && y >= 0.0F && x < static_cast<float>(image.width() - 1) &&
         y < static_cast<float>(image.height() - 1);
}

/// Bilinear interpolation at such a point, twice as fast.
inline float sample_among(const ImageView& image, float x, float y) {
  const int left = static_cast<int>(x);
  const int top = static_cast<int>(y);
  const std::uint8_t* const upper = image.row(top) + left;
  const std::uint8_t* const lower = upper + image.stride();
  const float fx = x - static_cast<float>(left);
  const float fy = y - static_cast<float>(top);
  const float above = static_cast<float>(upper[0]) + fx * static_cast<float>(upper[1] - upper[0]);
  const float below = static_cast<float>(lower[0]) + fx * static_cast<float>(lower[1] - lower[0]);
  return above + fy * (below - above);
}

/// As sample_inside(); empty outside of the pixels' centres.
inline std::optional<double> sample(const ImageView& image, double x, double y) {
  if (!between_pixels(image, x, y)) return std::nullopt;
  return sample_inside(image, x, y);
}

}  // namespace harco::detect
