#include "detect/pyramid.hpp"

#include <algorithm>

#include "detect/kernels/halve.hpp"

namespace harco::detect {

void Pyramid::build(const ImageView& image, int most) {
  whole_ = image;
  levels_ = 1;
  extend(most);
}

void Pyramid::extend(int most) {
  for (; levels_ < most; ++levels_) {
    const ImageView larger = level(levels_ - 1);
    const int width = larger.width() / 2;
    const int height = larger.height() / 2;
    if (std::min(width, height) == 0) return;
    Image& half = smaller_[static_cast<std::size_t>(levels_ - 1)];
    if (half.width != width || half.height != height) half = Image(width, height);
    for (int y = 0; y < height; ++y)
      kernels::halve_rows(larger.row(2 * y), larger.row(2 * y + 1), width, half.row(y));
  }
}

ImageView Pyramid::level(int k) const {
  return k == 0 ? whole_ : smaller_[static_cast<std::size_t>(k - 1)].view();
}

}  // namespace harco::detect
