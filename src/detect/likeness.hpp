// How much an image looks like a marker's picture where it shows the marker at all.
#pragma once

#include <cstddef>
#include <vector>

#include "detect/lens.hpp"
#include "detect/pyramid.hpp"
#include "detect/registration.hpp"
#include "harco/geometry.hpp"

namespace harco::detect {

/// Texels across a marker's square: several to a child's cell, so that codes of children count.
/// What covers a marker covers it at every size, so this is enough however large it is seen.
inline constexpr int kTexelsAcross = 128;

/// A square's texels, row-first; black 0 … white 1.
using Texels = std::vector<float>;
inline std::size_t texel_index(int row, int column) {
  return static_cast<std::size_t>(row * kTexelsAcross + column);
}

/// What the image shows within a square.
struct Unwarped {
  Texels texels;      ///< NaN beyond the image
  double blur = 0.0;  ///< of the picture that they were taken from, standard deviation in texels
};

/// The image within a registered square as the unit square, judged by the square's black and white.
void unwarp(const Pyramid& image, const Lens& lens, const Registration& registration,
            Unwarped& unwarped);

/// The same, with its corner `turns` as the first one.
void turn(const Texels& texels, int turns, Texels& turned);

/// A layer-1 marker's picture as it is printed.
Texels picture_of(const InkMap& ink);

/// Gaussian blur, the border's values going on beyond it.
void smooth(const Texels& texels, double sigma, Texels& smoothed);

/// In how many blocks of texels the image looks like the picture, the ring of a square of
/// `cells` x `cells` left out: it is the same for all.
struct Likeness {
  int patterned = 0;  ///< blocks with a pattern in them, which look so hardly ever by chance,
  int even = 0;       ///< and those of one grey, which easily do
  /// The logarithm of how much more likely the image is with the marker there than with anything:
  /// what is covered counts for nothing.
  double sum() const { return 4.0 * patterned + 0.5 * even; }
};
Likeness likeness(const Texels& image, const Texels& picture, int cells);

}  // namespace harco::detect
