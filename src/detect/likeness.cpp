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

std::size_t index(int row, int column) {
  return static_cast<std::size_t>(row * kAcross + column);
}

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
  unwarped.texels.resize(index(kAcross, 0));
  for (int row = 0; row < kAcross; ++row)
    for (int column = 0; column < kAcross; ++column) {
      float& texel = unwarped.texels[index(row, column)];
      texel = std::numeric_limits<float>::quiet_NaN();
      const Vector2d unit((column + 0.5) / kAcross, (row + 0.5) / kAcross);
      const Vector3d h = registration.image_H_unit * unit.homogeneous();
      const auto place = lens.from_ideal(h.hnormalized());
      if (!place) continue;
      const Vector2d at = Pyramid::in_level(*place, level);
      const auto grey = sample(view, at.x(), at.y());
      if (!grey) continue;
      const double black = registration.levels.black_at(unit);
      const double white = registration.levels.white_at(unit);
      texel = static_cast<float>((*grey - black) / (white - black));
    }
}

void turn(const Texels& texels, int turns, Texels& turned) {
  constexpr int kLast = kAcross - 1;
  turned.resize(texels.size());
  for (int row = 0; row < kAcross; ++row)
    for (int column = 0; column < kAcross; ++column) {
      const std::size_t from = turns == 0   ? index(row, column)
                               : turns == 1 ? index(column, kLast - row)
                               : turns == 2 ? index(kLast - row, kLast - column)
                                            : index(kLast - column, row);
      turned[index(row, column)] = texels[from];
    }
}

Texels picture_of(const InkMap& ink) {
  Texels picture;
  picture.reserve(index(kAcross, 0));
  const Rect& square = ink.plan().square;
  const double texel = square.width() / kAcross;
  for (int row = 0; row < kAcross; ++row)
    for (int column = 0; column < kAcross; ++column)
      picture.push_back(static_cast<float>(ink.white_share(
          {column * texel, row * texel, (column + 1) * texel, (row + 1) * texel})));
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
  Texels once(texels.size());
  const auto pass = [&](const Texels& from, Texels& to, int down, int right) {
    for (int row = 0; row < kAcross; ++row)
      for (int column = 0; column < kAcross; ++column) {
        float value = 0.0F;
        for (int k = -reach; k <= reach; ++k)
          value += kernel[static_cast<std::size_t>(k + reach)] *
                   from[index(std::clamp(row + k * down, 0, kAcross - 1),
                              std::clamp(column + k * right, 0, kAcross - 1))];
        to[index(row, column)] = value;
      }
  };
  smoothed.resize(texels.size());
  pass(texels, once, 0, 1);
  pass(once, smoothed, 1, 0);
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
          const float predicted = picture[index(row, column)];
          const float away = image[index(row, column)] - predicted;
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

CellVotes cell_votes(const Texels& image, const Texels& picture,
                     const std::vector<CellSquare>& children) {
  constexpr float kBlack = 0.42F, kWhite = 0.58F, kAgree = 0.2F;
  constexpr int kNeighbours = 5;
  CellVotes votes;
  for (const CellSquare& child : children) {
    const double cell = child.side / child.cells;
    const auto at = [&](const Texels& texels, int row, int column) {
      float sum = 0.0F;
      for (const double dy : {-0.2, 0.2})
        for (const double dx : {-0.2, 0.2}) {
          const double x = child.origin.x() + (column + 0.5 + dx) * cell - 0.5;
          const double y = child.origin.y() + (row + 0.5 + dy) * cell - 0.5;
          const int x0 = std::clamp(static_cast<int>(x), 0, kAcross - 2);
          const int y0 = std::clamp(static_cast<int>(y), 0, kAcross - 2);
          const auto fx = static_cast<float>(x - x0);
          const auto fy = static_cast<float>(y - y0);
          const float top = texels[index(y0, x0)] * (1 - fx) + fx * texels[index(y0, x0 + 1)];
          const float low =
              texels[index(y0 + 1, x0)] * (1 - fx) + fx * texels[index(y0 + 1, x0 + 1)];
          sum += 0.25F * (top + fy * (low - top));
        }
      return sum;
    };
    std::vector<float> seen, expected;
    for (int row = 0; row < child.cells; ++row)
      for (int column = 0; column < child.cells; ++column) {
        seen.push_back(at(image, row, column));
        expected.push_back(at(picture, row, column));
      }
    const auto cell_at = [&](int row, int column) {
      return static_cast<std::size_t>(row * child.cells + column);
    };
    for (int row = 1; row < child.cells - 1; ++row)
      for (int column = 1; column < child.cells - 1; ++column) {
        const float e = expected[cell_at(row, column)];
        votes.predicted += e < kBlack;
        int agree = 0;
        for (int dy = -1; dy <= 1; ++dy)
          for (int dx = -1; dx <= 1; ++dx)
            if (dx != 0 || dy != 0) {
              const std::size_t i = cell_at(row + dy, column + dx);
              agree += std::abs(seen[i] - expected[i]) < kAgree;
            }
        if (agree < kNeighbours) continue;
        const float s = seen[cell_at(row, column)];
        if (e < kBlack) {
          votes.confirmed += std::abs(s - e) < kAgree;
          votes.missing += std::abs(s - (1.0F)) < kAgree;
        } else if (e > kWhite) {
          votes.wrong += agree > kNeighbours && s < kBlack && s > -kAgree;
        }
      }
  }
  return votes;
}

}  // namespace harco::detect
