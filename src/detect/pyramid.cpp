#include "detect/pyramid.hpp"

#include <algorithm>

#include "detect/kernels/halve.hpp"

namespace harco::detect {
namespace {

/// Rows of a picture at half its size.
void make_rows(const ImageView& larger, int first_row, int end_row, Image& half) {
  for (int y = first_row; y < std::min(end_row, half.height); ++y)
    kernels::halve_rows(larger.row(2 * y), larger.row(2 * y + 1), half.width, half.row(y));
}

}  // namespace

void Pyramid::build(const ImageView& image, int most) {
  whole_ = image;
  levels_ = 1;
  extend(most);
}

void Pyramid::extend(int most) {
  while (levels_ < most) {
    const ImageView larger = level(levels_ - 1);
    Image* const half = add_level();
    if (!half) return;
    make_rows(larger, 0, half->height, *half);
  }
}

void Pyramid::begin(const ImageView& image) {
  whole_ = image;
  levels_ = 1;
  add_level();
}

void Pyramid::halve(int first_row, int end_row) {
  if (levels_ > 1) make_rows(whole_, first_row, end_row, smaller_.front());
}

/// The next level, whose pixels hold anything; null if it would have none.
Image* Pyramid::add_level() {
  const ImageView larger = level(levels_ - 1);
  const int width = larger.width() / 2;
  const int height = larger.height() / 2;
  if (std::min(width, height) == 0) return nullptr;
  Image& half = smaller_[static_cast<std::size_t>(levels_++ - 1)];
  if (half.width != width || half.height != height) half = Image(width, height);
  return &half;
}

ImageView Pyramid::level(int k) const {
  return k == 0 ? whole_ : smaller_[static_cast<std::size_t>(k - 1)].view();
}

}  // namespace harco::detect
