// First stage: which pixels are dark, judged against their own neighbourhood.
#pragma once

#include <cstdint>
#include <vector>

#include "detect/kernels/tile_extremes.hpp"
#include "harco/image.hpp"

namespace harco::detect {

/// Signed distance of every pixel from the local threshold, in grey levels x kScale: negative is
/// dark. Pixels without contrast nearby count as bright. A frame of one bright pixel lies around
/// the image, so that a follower of borders needs no tests for the image's edge.
class ThresholdMap {
 public:
  static constexpr int kScale = 16;

  void resize(int width, int height) {
    width_ = width;
    height_ = height;
    stride_ = width + 2;
    values_.assign(static_cast<std::size_t>(stride_) * static_cast<std::size_t>(height + 2), 1);
  }
  int width() const { return width_; }
  int height() const { return height_; }
  int stride() const { return stride_; }

  /// Valid from (-1, -1) to (width, height).
  const std::int16_t* row(int y) const { return values_.data() + (y + 1) * stride_ + 1; }
  std::int16_t* row(int y) { return values_.data() + (y + 1) * stride_ + 1; }

 private:
  int width_ = 0, height_ = 0, stride_ = 0;
  std::vector<std::int16_t> values_;
};

struct ThresholdOptions {
  /// Where the threshold lies between the darkest and the brightest grey nearby. Above one half,
  /// thin dark lines hold together.
  double level = 0.5;
  /// Least difference between brightest and darkest, in grey levels.
  int min_contrast = 16;
};

/// The least contrast that noise of a standard deviation `noise` (grey levels) doesn't reach in
/// even ground: the extremes of the 144 pixels around a tile lie six standard deviations apart.
int contrast_above_noise(double noise);

/// Extremes of the image over tiles, from which thresholds at any level follow.
class TileExtremes {
 public:
  static constexpr int kTile = kernels::kTile;

  /// Reads the image once.
  void measure(const ImageView& image);

  /// Standard deviation of the noise, from the ranges of the evenest quarter of all tiles.
  double noise() const;

  /// The map for one level.
  void threshold(const ImageView& image, const ThresholdOptions& options, ThresholdMap& map);

 private:
  int columns_ = 0, rows_ = 0;
  std::vector<std::uint8_t> low_, high_;            // of the tile itself
  std::vector<std::uint8_t> near_low_, near_high_;  // of the 3 x 3 tiles around it
  std::vector<std::int16_t> level_row_;             // the threshold along one image row
  std::vector<std::int16_t> tile_level_;
};

}  // namespace harco::detect
