#include "photo.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <stdexcept>

namespace harco::lab {
namespace {

FloatImage halved(const FloatImage& from) {
  FloatImage to((from.width + 1) / 2, (from.height + 1) / 2);
  for (int y = 0; y < to.height; ++y) {
    const float* a = from.row(2 * y);
    const float* b = from.row(std::min(2 * y + 1, from.height - 1));
    for (int x = 0; x < to.width; ++x) {
      const int left = 2 * x;
      const int right = std::min(left + 1, from.width - 1);
      to.row(y)[x] = 0.25F * (a[left] + a[right] + b[left] + b[right]);
    }
  }
  return to;
}

/// 0 … size - 1, forth and back.
int mirrored(int i, int size) {
  if (static_cast<unsigned>(i) < static_cast<unsigned>(size)) return i;
  const int period = 2 * size;
  i %= period;
  if (i < 0) i += period;
  return i < size ? i : period - 1 - i;
}

}  // namespace

Photo::Photo(const Image& image) {
  if (image.width <= 0 || image.height <= 0)
    throw std::invalid_argument("Photo: the image is empty");
  FloatImage first(image.width, image.height);
  std::copy(image.pixels.begin(), image.pixels.end(), first.pixels.begin());
  levels_.push_back(std::move(first));
  while (std::max(levels_.back().width, levels_.back().height) > 1)
    levels_.push_back(halved(levels_.back()));
}

int Photo::level_for(double footprint) const {
  if (!(footprint > 1.0)) return 0;
  return std::min(static_cast<int>(std::lround(std::log2(footprint))),
                  static_cast<int>(levels_.size()) - 1);
}

void Photo::add(const float* u, const float* v, int count, float scale, int level, float share,
                float* sum) const {
  const FloatImage& picture = levels_[static_cast<std::size_t>(level)];
  const float shrink = std::ldexp(1.0F, -level);
  // Pixel 0 of a level covers pixels 0 ... 2^level - 1 of the photograph.
  const float x0 = 0.5F * static_cast<float>(width()) * shrink - 0.5F;
  const float y0 = 0.5F * static_cast<float>(height()) * shrink - 0.5F;
  const float step = scale * shrink;
  for (int i = 0; i < count; ++i) {
    constexpr float kMost = 1e9F;  // whole numbers hold it
    const float x = std::clamp(x0 + step * u[i], -kMost, kMost);
    const float y = std::clamp(y0 + step * v[i], -kMost, kMost);
    const int column = static_cast<int>(x) - (x < 0.0F ? 1 : 0);
    const int line = static_cast<int>(y) - (y < 0.0F ? 1 : 0);
    const float right = x - static_cast<float>(column);
    const float below = y - static_cast<float>(line);
    const int left_x = mirrored(column, picture.width);
    const int right_x = mirrored(column + 1, picture.width);
    const float* a = picture.row(mirrored(line, picture.height));
    const float* b = picture.row(mirrored(line + 1, picture.height));
    const float upper = a[left_x] + right * (a[right_x] - a[left_x]);
    const float lower = b[left_x] + right * (b[right_x] - b[left_x]);
    sum[i] += share * (upper + below * (lower - upper));
  }
}

Image made_up_ground(int size_px, double mean, double contrast, unsigned seed) {
  if (size_px <= 0) throw std::invalid_argument("made-up ground: its size must be positive");
  std::mt19937 random(seed);
  const auto grain = [&] { return static_cast<float>(random() >> 8) * 0x1p-24F - 0.5F; };
  FloatImage sum(size_px, size_px);
  // Octaves of smooth noise, each with half the amplitude of the coarser one to the power 0.8.
  float amplitude = 1.0F;
  for (int cells = 4; cells < size_px; cells *= 2, amplitude *= 0.62F) {
    FloatImage knots(cells, cells);
    for (float& value : knots.pixels) value = amplitude * grain();
    const float step = static_cast<float>(cells) / static_cast<float>(size_px);
    for (int y = 0; y < size_px; ++y)
      for (int x = 0; x < size_px; ++x) {
        const float u = step * static_cast<float>(x);
        const float v = step * static_cast<float>(y);
        const int x0 = static_cast<int>(u);
        const int y0 = static_cast<int>(v);
        const int x1 = (x0 + 1) % cells;
        const int y1 = (y0 + 1) % cells;
        const auto smooth = [](float t) { return t * t * (3.0F - 2.0F * t); };
        const float a = smooth(u - static_cast<float>(x0));
        const float b = smooth(v - static_cast<float>(y0));
        const float upper = knots.row(y0)[x0] + a * (knots.row(y0)[x1] - knots.row(y0)[x0]);
        const float lower = knots.row(y1)[x0] + a * (knots.row(y1)[x1] - knots.row(y1)[x0]);
        sum.row(y)[x] += upper + b * (lower - upper);
      }
  }
  double squares = 0.0;
  for (const float value : sum.pixels)
    squares += static_cast<double>(value) * static_cast<double>(value);
  const double scale =
      contrast / std::sqrt(std::max(1e-12, squares / static_cast<double>(sum.pixels.size())));
  Image image(size_px, size_px);
  for (std::size_t i = 0; i < image.pixels.size(); ++i)
    image.pixels[i] = static_cast<std::uint8_t>(
        std::lround(std::clamp(mean + scale * static_cast<double>(sum.pixels[i]), 0.0, 255.0)));
  return image;
}

}  // namespace harco::lab
