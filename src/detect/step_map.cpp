#include "detect/step_map.hpp"

#include <algorithm>
#include <bit>

#include "detect/kernels/clean_steps.hpp"
#include "detect/kernels/spread_bits.hpp"

namespace harco::detect {
namespace {

/// Of 64 words: bit k of word i becomes bit i of word k.
void transpose(std::uint64_t* block) {
  for (std::size_t half = 32; half != 0; half /= 2) {
    // The lower half of the bits of each 2 * half.
    const std::uint64_t low = ~std::uint64_t{0} / ((std::uint64_t{1} << half) + 1);
    for (std::size_t first = 0; first < 64; first += 2 * half)
      for (std::size_t i = first; i < first + half; ++i) {
        const std::uint64_t swapped = (block[i] >> half ^ block[i + half]) & low;
        block[i] ^= swapped << half;
        block[i + half] ^= swapped;
      }
  }
}

/// Of samples `apart` bytes from one another, the first of them from `first` on.
void clean_steps(const std::uint8_t* first, std::ptrdiff_t apart, int even, int count,
                 int least_contrast, std::uint64_t* rising, std::uint64_t* falling) {
  kernels::EightSamples samples{};
  for (std::size_t k = 0; k < samples.size(); ++k)
    samples[k] = first + static_cast<std::ptrdiff_t>(k) * apart;
  kernels::clean_steps(samples, even, count, least_contrast,
                       reinterpret_cast<std::uint8_t*>(rising),
                       reinterpret_cast<std::uint8_t*>(falling));
}

}  // namespace

void StepMap::clear(int lines, int places) {
  lines_ = lines;
  words_ = (places + 63) / 64;
  for (Bits* const bits : {&found_, &near_, &in_line_}) bits->assign(at(lines + 1, 0), 0);
}

int StepMap::count_roughly(const ImageView& image, int even, int least_contrast) {
  constexpr int kLines = 8;
  const int places = image.width() - kBefore - kBehind;
  rising_.assign(static_cast<std::size_t>(places + 63) / 64, 0);
  falling_ = rising_;
  int count = 0;
  for (int y = kApart; y < image.height() - 1; y += kApart * kLines) {
    clean_steps(image.row(y), 1, even, places, least_contrast, rising_.data(), falling_.data());
    for (std::size_t word = 0; word < rising_.size(); ++word)
      count += std::popcount(rising_[word] | falling_[word]);
  }
  return kLines * count;
}

void StepMap::find(const ImageView& image, bool along_rows, int even, int least_contrast) {
  const std::array<int, 3> shape{image.width(), image.height(), along_rows ? 1 : 0};
  // What isn't written stays empty.
  if (shape != shape_) {
    const int across = along_rows ? image.height() : image.width();
    const int along = along_rows ? image.width() : image.height();
    clear((across + kApart - 1) / kApart, along - kBefore - kBehind);
    shape_ = shape;
  }
  if (along_rows)
    find_along_rows(image, even, least_contrast);
  else
    find_along_columns(image, even, least_contrast);
  keep_in_line();
}

void StepMap::find_along_rows(const ImageView& image, int even, int least_contrast) {
  const int places = image.width() - kBefore - kBehind;
  for (int line = 1; kApart * line < image.height() - 1; ++line)
    clean_steps(image.row(kApart * line), 1, even, places, least_contrast, &found_[at(line, 0)],
                &found_[at(line, 1)]);
}

/// Row by row; steps up of every other column in even bits, steps down in odd ones. 64 rows of
/// that, turned by 64 bits, are a word of each column.
void StepMap::find_along_columns(const ImageView& image, int even, int least_contrast) {
  static_assert(kApart == 2);
  constexpr std::uint64_t kEvery = 0x5555555555555555U;
  const int width = image.width();
  const int places = image.height() - kBefore - kBehind;
  const auto across = static_cast<std::size_t>((width + 63) / 64);
  rising_.assign(across, 0);
  falling_.assign(across, 0);
  for (int band = 0; band < words_; ++band) {
    band_.assign(64 * across, 0);
    for (int i = 0; i < std::min(64, places - 64 * band); ++i) {
      clean_steps(image.row(64 * band + i), image.stride(), even, width, least_contrast,
                  rising_.data(), falling_.data());
      for (std::size_t word = 0; word < across; ++word)
        band_[64 * word + static_cast<std::size_t>(i)] =
            (rising_[word] & kEvery) | (falling_[word] & kEvery) << 1;
    }
    for (std::size_t word = 0; word < across; ++word) {
      std::uint64_t* const block = &band_[64 * word];
      transpose(block);
      const int first = static_cast<int>(32 * word);
      const int end = std::min(first + 32, width / kApart);
      for (int line = std::max(1, first); line < end; ++line)
        for (int kind = 0; kind < 2; ++kind)
          found_[at(line, kind) + static_cast<std::size_t>(band)] =
              block[2 * (line - first) + kind];
    }
  }
}

void StepMap::keep_in_line() {
  const std::size_t first = at(0, 0);
  const std::size_t end = at(lines_ - 1, 1) + static_cast<std::size_t>(words_);
  const auto next = static_cast<std::size_t>(2 * stride());
  const auto all = static_cast<int>(found_.size() - 2);
  kernels::spread_bits(&found_[1], all, &near_[1]);
  for (std::size_t i = first; i < end; ++i)
    in_line_[i] = found_[i] & near_[i - next] & near_[i + next];
  kernels::spread_bits(&in_line_[1], all, &near_[1]);
  for (std::size_t i = first; i < end; ++i)
    in_line_[i] |= found_[i] & (near_[i - next] | near_[i + next]);
}

}  // namespace harco::detect
