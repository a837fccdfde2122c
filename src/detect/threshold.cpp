#include "detect/threshold.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace harco::detect {
namespace {

// The threshold of a tile without contrast: everything counts as bright.
constexpr std::int16_t kFlat = -1;

}  // namespace

void TileExtremes::measure(const ImageView& image) {
  columns_ = (image.width() + kTile - 1) / kTile;
  rows_ = (image.height() + kTile - 1) / kTile;
  const auto count = static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_);
  low_.resize(count);
  high_.resize(count);
  for (int row = 0; row < rows_; ++row) {
    const auto first = static_cast<std::ptrdiff_t>(row) * columns_;
    kernels::tile_extremes(image.row(row * kTile), image.stride(), image.width(),
                           std::min(kTile, image.height() - row * kTile), low_.data() + first,
                           high_.data() + first);
  }
  near_low_.resize(count);
  near_high_.resize(count);
  for (int row = 0; row < rows_; ++row)
    for (int column = 0; column < columns_; ++column) {
      std::uint8_t low = 255;
      std::uint8_t high = 0;
      for (int r = std::max(0, row - 1); r <= std::min(rows_ - 1, row + 1); ++r)
        for (int c = std::max(0, column - 1); c <= std::min(columns_ - 1, column + 1); ++c) {
          const auto tile = static_cast<std::size_t>(r * columns_ + c);
          low = std::min(low, low_[tile]);
          high = std::max(high, high_[tile]);
        }
      const auto tile = static_cast<std::size_t>(row * columns_ + column);
      near_low_[tile] = low;
      near_high_[tile] = high;
    }
}

double TileExtremes::noise() const {
  std::array<int, 256> histogram{};
  int count = 0;
  for (std::size_t tile = 0; tile < low_.size(); ++tile)
    if (low_[tile] > 0 && high_[tile] < 255) {  // not clipped
      ++histogram[static_cast<std::size_t>(high_[tile] - low_[tile])];
      ++count;
    }
  int below = 0;
  int range = 0;
  while (range < 255 && 4 * (below += histogram[static_cast<std::size_t>(range)]) < count) ++range;
  // A quarter of all sets of 16 normal deviates have a smaller range than this.
  constexpr double kLowerQuartile = 3.01;
  return range / kLowerQuartile;
}

int contrast_above_noise(double noise) {
  // Beyond the upper limit it is texture, not noise.
  return std::clamp(static_cast<int>(std::lround(6.0 * noise)), 16, 60);
}

void TileExtremes::threshold(const ImageView& image, const ThresholdOptions& options,
                             ThresholdMap& map) {
  map.resize(image.width(), image.height());
  const auto level = static_cast<int>(std::lround(options.level * ThresholdMap::kScale));
  tile_level_.resize(near_low_.size());
  for (std::size_t tile = 0; tile < near_low_.size(); ++tile) {
    const int contrast = near_high_[tile] - near_low_[tile];
    tile_level_[tile] =
        contrast < options.min_contrast
            ? kFlat
            : static_cast<std::int16_t>(near_low_[tile] * ThresholdMap::kScale + contrast * level);
  }
  for (int y = 0; y < image.height(); ++y) {
    const std::uint8_t* pixels = image.row(y);
    std::int16_t* out = map.row(y);
    const auto first = static_cast<std::size_t>(y / kTile) * static_cast<std::size_t>(columns_);
    for (int column = 0; column < columns_; ++column) {
      const int x1 = std::min(image.width(), (column + 1) * kTile);
      const std::int16_t at = tile_level_[first + static_cast<std::size_t>(column)];
      for (int x = column * kTile; x < x1; ++x)
        out[x] = at == kFlat ? std::int16_t{1}
                             : static_cast<std::int16_t>(pixels[x] * ThresholdMap::kScale - at);
    }
  }
}

}  // namespace harco::detect
