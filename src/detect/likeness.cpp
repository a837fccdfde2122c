#include "detect/likeness.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include <Eigen/Geometry>

#include "detect/sample.hpp"

namespace harco::detect {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr int kAcross = kTexelsAcross;
constexpr int kBlock = 4;
// A block is explained if it is off by no more than this, root mean square.
constexpr float kExplained = 0.16F;
// It has a pattern if its standard deviation is above this.
constexpr float kPattern = 0.15F;
// Blur of the lens (pixels of the image), and of pixels and interpolation (pixels of a level).
constexpr double kLensBlur = 0.6;
constexpr double kPixelBlur = 0.5;

}  // namespace

void unwarp(const Pyramid& image, const Lens& lens, const Registration& registration,
            Unwarped& unwarped) {
  const double texel_px = mean_side(corners_of(registration.image_H_unit)) / kAcross;
  // A level whose pixels are about as large as texels.
  const int level = std::clamp(static_cast<int>(std::lround(std::log2(texel_px))), 0,
                               std::max(0, image.levels() - 1));
  const double pixel = 1 << level;
  const ImageView view = image.level(level);
  unwarped.blur = std::hypot(kPixelBlur * pixel, kLensBlur) / texel_px;
  unwarped.texels.resize(texel_index(kAcross, 0));
  const Vector3d right = registration.image_H_unit.col(0) / kAcross;
  for (int row = 0; row < kAcross; ++row) {
    const Vector2d first(0.5 / kAcross, (row + 0.5) / kAcross);
    Vector3d h = registration.image_H_unit * first.homogeneous();
    // Levels are planes, so along a row they rise evenly.
    double black = registration.levels.black_at(first);
    double contrast = registration.levels.white_at(first) - black;
    const double black_rise = registration.levels.black.y() / kAcross;
    const double contrast_rise = registration.levels.white.y() / kAcross - black_rise;
    float* const texels = &unwarped.texels[texel_index(row, 0)];
    for (int column = 0; column < kAcross; ++column) {
      const auto place = lens.from_ideal(h.hnormalized());
      const Vector2d at =
          place ? Pyramid::in_level(*place, level) : Vector2d(Vector2d::Constant(-1.0));
      const auto grey = sample(view, at.x(), at.y());
      texels[column] = grey ? static_cast<float>((*grey - black) / contrast)
                            : std::numeric_limits<float>::quiet_NaN();
      h += right;
      black += black_rise;
      contrast += contrast_rise;
    }
  }
}

void turn(const Texels& texels, int turns, Texels& turned) {
  constexpr int kLast = kAcross - 1;
  turned.resize(texels.size());
  for (int row = 0; row < kAcross; ++row)
    for (int column = 0; column < kAcross; ++column) {
      const std::size_t from = turns == 0   ? texel_index(row, column)
                               : turns == 1 ? texel_index(column, kLast - row)
                               : turns == 2 ? texel_index(kLast - row, kLast - column)
                                            : texel_index(kLast - column, row);
      turned[texel_index(row, column)] = texels[from];
    }
}

Texels picture_of(const InkMap& ink) {
  Texels picture;
  picture.reserve(texel_index(kAcross, 0));
  const Rect& square = ink.plan().square;
  const double texel = square.width() / kAcross;
  for (int row = 0; row < kAcross; ++row)
    for (int column = 0; column < kAcross; ++column)
      picture.push_back(static_cast<float>(
          ink.white_share({column * texel, row * texel, (column + 1) * texel, (row + 1) * texel})));
  return picture;
}

void smooth(const Texels& texels, double sigma, Texels& smoothed) {
  const int reach = std::max(1, static_cast<int>(std::ceil(2.5 * sigma)));
  std::vector<float> kernel;
  float sum = 0.0F;
  for (int k = -reach; k <= reach; ++k) {
    kernel.push_back(static_cast<float>(std::exp(-0.5 * k * k / (sigma * sigma))));
    sum += kernel.back();
  }
  for (float& weight : kernel) weight /= sum;
  // Down the columns, then along the rows; whole rows at a time, which compilers make fast.
  std::vector<float> row(static_cast<std::size_t>(kAcross + 2 * reach));
  smoothed.assign(texels.size(), 0.0F);
  for (int r = 0; r < kAcross; ++r) {
    std::fill(row.begin(), row.end(), 0.0F);
    float* const inner = row.data() + reach;
    for (int k = -reach; k <= reach; ++k) {
      const float weight = kernel[static_cast<std::size_t>(k + reach)];
      const float* from = &texels[texel_index(std::clamp(r + k, 0, kAcross - 1), 0)];
      for (int c = 0; c < kAcross; ++c) inner[c] += weight * from[c];
    }
    std::fill(row.begin(), row.begin() + reach, inner[0]);
    std::fill(row.end() - reach, row.end(), inner[kAcross - 1]);
    float* const to = &smoothed[texel_index(r, 0)];
    for (int k = 0; k <= 2 * reach; ++k) {
      const float weight = kernel[static_cast<std::size_t>(k)];
      const float* from = row.data() + k;
      for (int c = 0; c < kAcross; ++c) to[c] += weight * from[c];
    }
  }
}

Likeness likeness(const Texels& image, const Texels& picture, int cells) {
  constexpr float kCount = kBlock * kBlock;
  Likeness total;
  const int ring = kAcross / cells;
  for (int top = ring; top + kBlock <= kAcross - ring; top += kBlock)
    for (int left = ring; left + kBlock <= kAcross - ring; left += kBlock) {
      float off = 0.0F;
      float sum = 0.0F;
      float squares = 0.0F;
      for (int row = top; row < top + kBlock; ++row)
        for (int column = left; column < left + kBlock; ++column) {
          const float predicted = picture[texel_index(row, column)];
          const float away = image[texel_index(row, column)] - predicted;
          off += away * away;
          sum += predicted;
          squares += predicted * predicted;
        }
      // Written so that a block beyond the image isn't explained either.
      if (!(off <= kCount * kExplained * kExplained)) continue;
      const bool pattern = squares / kCount - sum * sum / (kCount * kCount) > kPattern * kPattern;
      ++(pattern ? total.patterned : total.even);
    }
  return total;
}

}  // namespace harco::detect
