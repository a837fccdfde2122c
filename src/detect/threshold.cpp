#include "detect/threshold.hpp"

#include <algorithm>
#include <cmath>

#include "detect/kernels/band_bits.hpp"

namespace harco::detect {

void DarkMap::resize(int width, int height) {
  if (width == width_ && height == height_) return;
  width_ = width;
  height_ = height;
  stride_ = words_in_row() + 2;
  words_.assign(static_cast<std::size_t>(stride_) * static_cast<std::size_t>(height + 2), 0);
}

int contrast_above_noise(double noise) {
  // Beyond the upper limit it is texture, not noise.
  return std::clamp(static_cast<int>(std::lround(6.0 * noise)), 16, 60);
}

void Threshold::measure(const ImageView& image) {
  Workers alone;
  measure(image, kAll, alone);
}

void Threshold::measure(const ImageView& image, const Wanted& wanted, Workers& workers,
                        Pyramid* half) {
  image_ = image;
  columns_ = (image.width() + kTile - 1) / kTile;
  bands_ = (image.height() + kTile - 1) / kTile;
  const auto columns = static_cast<std::size_t>(columns_);
  scratch_.resize(workers.count());
  for (Scratch& scratch : scratch_) {
    for (auto& band : scratch.low) band.assign(columns + 2, 255);
    for (auto& band : scratch.high) band.assign(columns + 2, 0);
  }
  near_low_.resize(columns * static_cast<std::size_t>(bands_));
  near_high_.resize(near_low_.size());
  for (std::size_t level = 0; level < kLevels.size(); ++level)
    if (wanted[level])
      for (DarkMap* map : {&maps_[level], &upper_edges_[level]})
        map->resize(image.width(), image.height());

  measure_noise(scratch_[0]);
  min_contrast_ = contrast_above_noise(noise_);
  const auto parts = static_cast<int>(workers.parts());
  workers.share(workers.parts(), [&](std::size_t item, std::size_t worker) {
    const auto part = static_cast<int>(item);
    Scratch& scratch = scratch_[worker];
    const int first = bands_ * part / parts;
    const int end = bands_ * (part + 1) / parts;
    if (first == end) return;
    // One band behind the other, while its pixels are still in the cache.
    if (first > 0) measure_band(first - 1, scratch);
    measure_band(first, scratch);
    for (int band = first; band < end; ++band) {
      measure_band(band + 1, scratch);
      find_bits(band, wanted, scratch);
      if (half) half->halve(band * kTile / 2, (band + 1) * kTile / 2);
    }
  });
}

void Threshold::measure_noise(Scratch& scratch) {
  // Some thousands of tiles tell enough.
  constexpr int kEnough = 8192;
  const int every = std::max(1, columns_ * bands_ / kEnough);
  std::array<int, 256> histogram{};
  int count = 0;
  for (int band = every / 2; band < bands_; band += every) {
    measure_band(band, scratch);
    const std::vector<std::uint8_t>& low = scratch.low[static_cast<std::size_t>(band % 4)];
    const std::vector<std::uint8_t>& high = scratch.high[static_cast<std::size_t>(band % 4)];
    for (std::size_t tile = 1; tile <= static_cast<std::size_t>(columns_); ++tile)
      if (low[tile] > 0 && high[tile] < 255) {  // not clipped
        ++histogram[static_cast<std::size_t>(high[tile] - low[tile])];
        ++count;
      }
  }
  int below = 0;
  int range = 0;
  while (range < 255 && 4 * (below += histogram[static_cast<std::size_t>(range)]) < count) ++range;
  // A quarter of all sets of 16 normal deviates have a smaller range than this.
  constexpr double kLowerQuartile = 3.01;
  noise_ = range / kLowerQuartile;
}

void Threshold::measure_band(int band, Scratch& scratch) const {
  if (band >= bands_) return;
  const int y = band * kTile;
  const auto at = static_cast<std::size_t>(band % 4);
  kernels::tile_extremes(image_.row(y), image_.stride(), image_.width(),
                         std::min(kTile, image_.height() - y), scratch.low[at].data() + 1,
                         scratch.high[at].data() + 1);
}

void Threshold::find_bits(int band, const Wanted& wanted, Scratch& scratch) {
  kernels::TileBands bands{};
  for (int i = 0; i < 3; ++i) {
    // The bands beyond the image are its outermost ones.
    const auto at = static_cast<std::size_t>(std::clamp(band + i - 1, 0, bands_ - 1) % 4);
    bands.low[i] = scratch.low[at].data();
    bands.high[i] = scratch.high[at].data();
  }
  const std::ptrdiff_t first = std::ptrdiff_t{band} * columns_;
  std::uint8_t* low = near_low_.data() + first;
  std::uint8_t* high = near_high_.data() + first;
  kernels::tile_extremes_nearby(bands, columns_, low, high);
  const int y = band * kTile;
  kernels::Band of_tiles{{}, low, high, image_.width(), std::min(kTile, image_.height() - y)};
  for (std::size_t i = 0; i < of_tiles.rows.size(); ++i) {
    const int row = y + static_cast<int>(i) - 2;
    of_tiles.rows[i] = image_.row(std::clamp(row, 0, image_.height() - 1));
  }
  const auto bytes = [](std::uint64_t* row) { return reinterpret_cast<std::uint8_t*>(row); };
  for (std::size_t level = 0; level < kLevels.size(); ++level) {
    if (!wanted[level]) continue;
    const Level& asked = kLevels[level];
    kernels::band_bits(
        of_tiles, {asked.sixteenths, least_contrast(level), asked.steep, asked.dark, asked.row_step,
                   bytes(maps_[level].row(y)), bytes(upper_edges_[level].row(y)),
                   maps_[level].bits_in_row() / 8});
  }
}

}  // namespace harco::detect
