#include "detect/likeness.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include <Eigen/Geometry>

#include "detect/kernels/bilinear.hpp"
#include "detect/kernels/explained_blocks.hpp"
#include "detect/sample.hpp"

namespace harco::detect {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr int kAcross = kTexelsAcross;
constexpr int kSide = Blocks::kSide;
// A block is explained if it is off by no more than this, root mean square.
constexpr float kExplained = 0.16F;
// It has a pattern if its standard deviation is above this.
constexpr float kPattern = 0.15F;
// Of blocks' texels: white, and what is far off from anything that a picture holds.
constexpr float kWhite = 255.0F;
constexpr float kFarOff = 4.0F;
// Blur of the lens (pixels of the image), and of pixels and interpolation (pixels of a level).
constexpr double kLensBlur = 0.6;
constexpr double kPixelBlur = 0.5;
// So far blur reaches at most, texels.
constexpr int kMostReach = 8;

/// Where the texels of a row lie in the image.
struct Places {
  std::array<float, kAcross> x, y;
};

/// Those from `first` on (unit square), each by `right` after the one before, in pixels of a level.
void find_places(const Lens& lens, int level, const Vector3d& first, const Vector3d& right,
                 std::size_t count, Places& places) {
  if (lens.bends()) {
    for (std::size_t k = 0; k < count; ++k) {
      const Vector3d h = first + static_cast<double>(k) * right;
      const auto place = lens.from_ideal(h.hnormalized());
      const Vector2d at = place ? Pyramid::in_level(*place, level) : Vector2d(-1.0, -1.0);
      places.x[k] = static_cast<float>(at.x());
      places.y[k] = static_cast<float>(at.y());
    }
    return;
  }
  // As above, which compilers make fast.
  const float scale = 1.0F / static_cast<float>(1 << level);
  const float shift = 0.5F * scale - 0.5F;
  const Eigen::Vector3f h = first.cast<float>();
  const Eigen::Vector3f rise = right.cast<float>();
  for (std::size_t k = 0; k < count; ++k) {
    const auto along = static_cast<float>(static_cast<int>(k));
    const float nearness = scale / (h.z() + along * rise.z());
    places.x[k] = (h.x() + along * rise.x()) * nearness + shift;
    places.y[k] = (h.y() + along * rise.y()) * nearness + shift;
  }
}

}  // namespace

void unwarp(const Pyramid& image, const Lens& lens, const Registration& registration, int cells,
            Unwarped& unwarped) {
  const double texel_px = mean_side(corners_of(registration.image_H_unit)) / kAcross;
  // A level whose pixels are about as large as texels.
  const int level = std::clamp(static_cast<int>(std::lround(std::log2(texel_px))), 0,
                               std::max(0, image.levels() - 1));
  const ImageView view = image.level(level);
  unwarped.blur = std::hypot(kPixelBlur * (1 << level), kLensBlur) / texel_px;
  unwarped.texels.resize(texel_index(kAcross, 0));
  // One more on either side, for those who look between texels.
  const int begin = kAcross / cells - 1;
  const auto count = static_cast<std::size_t>(kAcross - 2 * begin);
  const Vector3d right = registration.image_H_unit.col(0) / kAcross;
  Places places{};
  for (int row = begin; row < kAcross - begin; ++row) {
    const Vector2d first((begin + 0.5) / kAcross, (row + 0.5) / kAcross);
    find_places(lens, level, registration.image_H_unit * first.homogeneous(), right, count, places);
    // Levels are planes, so along a row they rise evenly.
    const LightLevels& levels = registration.levels;
    const auto black = static_cast<float>(levels.black_at(first));
    const auto contrast = static_cast<float>(levels.white_at(first)) - black;
    const auto black_rise = static_cast<float>(levels.black.y() / kAcross);
    const auto contrast_rise = static_cast<float>(levels.white.y() / kAcross) - black_rise;
    float* const texels = &unwarped.texels[texel_index(row, begin)];
    const auto among = [&](std::size_t k, float margin) {
      return among_pixels(view, places.x[k] - margin, places.y[k] - margin) &&
             among_pixels(view, places.x[k] + margin, places.y[k] + margin);
    };
    // A straight row whose ends are in the image is wholly so, but for rounding.
    constexpr float kRounding = 0.01F;
    const bool whole = !lens.bends() && among(0, kRounding) && among(count - 1, kRounding);
    if (whole) {
      std::array<std::int32_t, kAcross> x;
      std::array<std::int32_t, kAcross> y;
      for (std::size_t k = 0; k < count; ++k) {
        x[k] = kernels::place_of(places.x[k]);
        y[k] = kernels::place_of(places.y[k]);
      }
      kernels::bilinear(view, x.data(), y.data(), 0, 0, static_cast<int>(count), texels);
    } else {
      for (std::size_t k = 0; k < count; ++k)
        texels[k] = among(k, 0.0F) ? sample_among(view, places.x[k], places.y[k])
                                   : std::numeric_limits<float>::quiet_NaN();
    }
    for (std::size_t k = 0; k < count; ++k) {
      const auto along = static_cast<float>(static_cast<int>(k));
      texels[k] = (texels[k] - (black + along * black_rise)) / (contrast + along * contrast_rise);
    }
  }
}

Texels picture_of(const InkPlan& plan) {
  Texels picture(texel_index(kAcross, 0), 0.0F);
  const double texel = plan.square.width() / kAcross;
  // What a stretch covers of the texels from one to another.
  const auto part = [](double from, double to, int at) {
    return std::min(to, at + 1.0) - std::max(from, static_cast<double>(at));
  };
  const auto first = [](double from) { return std::max(0, static_cast<int>(from)); };
  const auto last = [](double to) { return std::min(kAcross, static_cast<int>(std::ceil(to))); };
  const auto paint = [&](const Rect& rect, double white) {
    const double left = (rect.x0 - plan.square.x0) / texel;
    const double top = (rect.y0 - plan.square.y0) / texel;
    const double right = (rect.x1 - plan.square.x0) / texel;
    const double bottom = (rect.y1 - plan.square.y0) / texel;
    for (int row = first(top); row < last(bottom); ++row) {
      const double share = white * part(top, bottom, row);
      for (int column = first(left); column < last(right); ++column)
        picture[texel_index(row, column)] += static_cast<float>(share * part(left, right, column));
    }
  };
  for (const Rect& rect : plan.white) paint(rect, 1.0);
  for (const Rect& rect : plan.black) paint(rect, -1.0);
  for (float& grey : picture) grey = std::clamp(grey, 0.0F, 1.0F);
  return picture;
}

void smooth(const Texels& texels, double sigma, Texels& smoothed) {
  const int reach = std::clamp(static_cast<int>(std::ceil(2.5 * sigma)), 1, kMostReach);
  std::array<float, 2 * kMostReach + 1> kernel{};
  float sum = 0.0F;
  for (int k = -reach; k <= reach; ++k) {
    float& weight = kernel[static_cast<std::size_t>(k + reach)];
    weight = static_cast<float>(std::exp(-0.5 * k * k / (sigma * sigma)));
    sum += weight;
  }
  for (float& weight : kernel) weight /= sum;
  // Down the columns, then along the rows; whole rows at a time, which compilers make fast.
  std::array<float, kAcross + 2 * kMostReach> row{};
  smoothed.assign(texels.size(), 0.0F);
  for (int r = 0; r < kAcross; ++r) {
    row.fill(0.0F);
    float* const inner = row.data() + reach;
    for (int k = -reach; k <= reach; ++k) {
      const float weight = kernel[static_cast<std::size_t>(k + reach)];
      const float* from = &texels[texel_index(std::clamp(r + k, 0, kAcross - 1), 0)];
      for (int c = 0; c < kAcross; ++c) inner[c] += weight * from[c];
    }
    std::fill_n(row.begin(), reach, inner[0]);
    std::fill_n(inner + kAcross, reach, inner[kAcross - 1]);
    float* const to = &smoothed[texel_index(r, 0)];
    for (int k = 0; k <= 2 * reach; ++k) {
      const float weight = kernel[static_cast<std::size_t>(k)];
      const float* from = row.data() + k;
      for (int c = 0; c < kAcross; ++c) to[c] += weight * from[c];
    }
  }
}

void cut(const Texels& texels, int cells, Blocks& blocks) {
  const int ring = kAcross / cells;
  // Cells of whole blocks, as eight to a square are, have their edges in the middle of blocks, or
  // no block would have a pattern.
  const bool whole = kAcross % cells == 0 && ring % kSide == 0;
  blocks.across = (kAcross - 2 * ring) / kSide - (whole ? 1 : 0);
  blocks.texels.resize(blocks.count() * Blocks::kTexels);
  const int first = (kAcross - kSide * blocks.across) / 2;
  std::size_t block = 0;
  for (int top = first; top < first + kSide * blocks.across; top += kSide)
    for (int left = first; left < first + kSide * blocks.across; left += kSide, ++block)
      for (std::size_t k = 0; k < Blocks::kTexels; ++k) {
        const int row = top + static_cast<int>(k) / kSide;
        const int column = left + static_cast<int>(k) % kSide;
        const float value = texels[texel_index(row, column)];
        // Beyond the image there is nothing, which is far off from everything.
        const float bounded = value < kFarOff ? std::max(value, -kFarOff) : kFarOff;
        blocks.texels[k * blocks.count() + block] = static_cast<std::int16_t>(kWhite * bounded);
      }
}

void turn(const Blocks& blocks, int turns, Blocks& turned) {
  turned.across = blocks.across;
  turned.texels.resize(blocks.texels.size());
  // Where (row, column) of a square of `side` comes from.
  const auto from = [&](int row, int column, int side) {
    const int last = side - 1;
    const int at = turns == 0   ? row * side + column
                   : turns == 1 ? column * side + last - row
                   : turns == 2 ? (last - row) * side + last - column
                                : (last - column) * side + row;
    return static_cast<std::size_t>(at);
  };
  std::int16_t* to = turned.texels.data();
  for (int k = 0; k < Blocks::kTexels; ++k) {
    const std::size_t texel = from(k / kSide, k % kSide, kSide);
    const std::int16_t* const texels = &blocks.texels[texel * blocks.count()];
    for (int row = 0; row < blocks.across; ++row)
      for (int column = 0; column < blocks.across; ++column)
        *to++ = texels[from(row, column, blocks.across)];
  }
}

void blur_picture(const Texels& picture, double sigma, int cells, Texels& scratch,
                  BlurredPicture& blurred) {
  smooth(picture, sigma, scratch);
  cut(scratch, cells, blurred.blocks);
  const std::size_t count = blurred.blocks.count();
  blurred.patterned.resize(count);
  for (std::size_t i = 0; i < count; ++i) {
    constexpr float kShare = 1.0F / Blocks::kTexels;
    float sum = 0.0F;
    float squares = 0.0F;
    for (std::size_t k = 0; k < Blocks::kTexels; ++k) {
      const float texel = static_cast<float>(blurred.blocks.texels[k * count + i]) / kWhite;
      sum += kShare * texel;
      squares += kShare * texel * texel;
    }
    blurred.patterned[i] = squares - sum * sum > kPattern * kPattern;
  }
}

Likeness likeness(const Blocks& image, const BlurredPicture& picture) {
  constexpr int kMost =
      static_cast<int>(Blocks::kTexels * kExplained * kExplained * kWhite * kWhite);
  static_assert(kMost < std::numeric_limits<std::int16_t>::max(), "sums saturate there");
  const kernels::Explained explained = kernels::explained_blocks(
      image.texels.data(), picture.blocks.texels.data(), picture.patterned.data(),
      static_cast<int>(image.count()), Blocks::kTexels, kMost);
  return {explained.marked, explained.all - explained.marked};
}

}  // namespace harco::detect
