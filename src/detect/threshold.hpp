// First stage: which pixels are dark, judged against their own neighbourhood.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "detect/kernels/tile_extremes.hpp"
#include "detect/pyramid.hpp"
#include "detect/workers.hpp"
#include "harco/image.hpp"

namespace harco::detect {

/// One bit a pixel: set if it is dark. Whatever lies outside of the image is bright.
class DarkMap {
 public:
  /// All bright. Keeps what is there if the size is the same.
  void resize(int width, int height);

  int width() const { return width_; }
  int height() const { return height_; }

  /// Words of 64 pixels that a row takes, with one of padding on either side: words -1 …
  /// words_in_row() are valid.
  int words_in_row() const { return (width_ + 63) / 64; }

  /// Valid from row -1 to height().
  const std::uint64_t* row(int y) const { return words_.data() + (y + 1) * stride_ + 1; }
  std::uint64_t* row(int y) { return words_.data() + (y + 1) * stride_ + 1; }

  /// Valid from (-1, -1) to (width, height).
  bool dark(int x, int y) const {
    const int bit = x + 64;
    return (row(y)[bit / 64 - 1] >> (bit % 64) & 1) != 0;
  }

  /// For readers of single bits: pixel (x, y) is bit y * bits_in_row() + x from here on; negative
  /// ones are valid as above.
  const std::uint64_t* origin() const { return row(0); }
  std::ptrdiff_t bits_in_row() const { return stride_ * 64; }

 private:
  int width_ = 0, height_ = 0;
  std::ptrdiff_t stride_ = 0;
  std::vector<std::uint64_t> words_;
};

/// The least contrast that noise of a standard deviation `noise` (grey levels) doesn't reach in
/// even ground: the extremes of the 144 pixels around a tile lie six standard deviations apart.
int contrast_above_noise(double noise);

/// Thresholds between the darkest and the brightest grey nearby (in the 3 x 3 tiles around each
/// tile of 4 x 4 pixels), at several levels at once. Where the contrast is less than what noise
/// makes, everything counts as bright.
class Threshold {
 public:
  struct Level {
    int sixteenths;      ///< where the threshold lies between darkest (0) and brightest (16)
    int least_contrast;  ///< grey levels; noise may ask for more
    bool dark;           ///< whether it is dark regions that are looked for, or bright ones
    int steep;           ///< sixteenths of the contrast, for upper_edges
    int row_step;        ///< dark regions are looked for in every row (1), or every second one (2)
  };
  /// The middle finds wide structure without bias. The higher one holds thin dark lines of small
  /// children together. The lower one finds markers in shade beside sunlit ground, where there is
  /// a third grey between the two.
  static constexpr std::array<Level, 3> kLevels{
      {{8, 16, true, 6, 1}, {11, 16, false, 2, 1}, {5, 48, true, 4, 2}}};
  static constexpr std::size_t kMiddleLevel = 0;
  static constexpr std::size_t kLineLevel = 1;
  static constexpr std::size_t kLowLevel = 2;
  static constexpr int kScale = 16;
  /// Which levels are asked for; maps of the others hold anything.
  using Wanted = std::array<bool, kLevels.size()>;
  static constexpr Wanted kAll{true, true, true};

  /// Reads the image, whose pixels have to stay where they are for as long as distances are asked
  /// for, and makes its half picture, if one has begun.
  void measure(const ImageView& image, const Wanted& wanted, Workers& workers,
               Pyramid* half = nullptr);
  void measure(const ImageView& image);  ///< at all levels, alone

  /// Standard deviation of the noise in grey levels, from the ranges of the evenest quarter of
  /// tiles.
  double noise() const { return noise_; }

  const ImageView& image() const { return image_; }

  /// Between the darkest and the brightest grey near a pixel of the image.
  int contrast(int x, int y) const {
    const std::size_t tile = tile_of(x, y);
    return near_high_[tile] - near_low_[tile];
  }

  const DarkMap& map(std::size_t level) const { return maps_[level]; }

  /// Where the grey changes from above a pixel to below it as at the upper edge of a region, and
  /// not as in a blur or in faint texture: from two rows above to one below, by the level's share
  /// of the contrast nearby. Of those rows in which regions are looked for.
  const DarkMap& upper_edges(std::size_t level) const { return upper_edges_[level]; }

  /// Signed distance of a pixel from its threshold, in grey levels x kScale: negative is dark.
  /// Valid everywhere, bright outside of the image.
  int distance(std::size_t level, int x, int y) const {
    if (x < 0 || y < 0 || x >= image_.width() || y >= image_.height()) return 1;
    return distance_inside(level, x, y);
  }

  /// Of a pixel that lies in the image.
  int distance_inside(std::size_t level, int x, int y) const {
    const std::size_t tile = tile_of(x, y);
    const int low = near_low_[tile];
    const int contrast = near_high_[tile] - low;
    if (contrast < least_contrast(level)) return 1;
    return kScale * (image_(x, y) - low) - contrast * kLevels[level].sixteenths;
  }

 private:
  static constexpr int kTile = kernels::kTile;

  std::size_t tile_of(int x, int y) const {
    return static_cast<std::size_t>(y) / kTile * static_cast<std::size_t>(columns_) +
           static_cast<std::size_t>(x) / kTile;
  }
  int least_contrast(std::size_t level) const {
    return std::max(kLevels[level].least_contrast, min_contrast_);
  }
  /// What one of those who work needs of its own.
  struct Scratch {
    std::array<std::vector<std::uint8_t>, 4> low, high;  // of bands of tiles, in turn; padded
  };
  void measure_noise(Scratch& scratch);
  void measure_band(int band, Scratch& scratch) const;
  void find_bits(int band, const Wanted& wanted, Scratch& scratch);

  ImageView image_;
  int columns_ = 0, bands_ = 0;
  double noise_ = 0.0;
  int min_contrast_ = 0;
  std::vector<Scratch> scratch_;
  std::vector<std::uint8_t> near_low_, near_high_;  // of the 3 x 3 tiles around each tile
  std::array<DarkMap, kLevels.size()> maps_;
  std::array<DarkMap, kLevels.size()> upper_edges_;
};

}  // namespace harco::detect
