// How much an image looks like a marker's picture where it shows the marker at all.
#pragma once

#include <cstddef>
#include <cstdint>
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

/// What the image shows within a square, its border ring left out: that is the same for all.
struct Unwarped {
  Texels texels;      ///< NaN beyond the image
  double blur = 0.0;  ///< of the picture that they were taken from, standard deviation in texels
};

/// The image within the registered square of a marker of `cells` x `cells` cells (border ring
/// included) as the unit square, judged by the square's black and white. The ring's texels are
/// not written.
void unwarp(const Pyramid& image, const Lens& lens, const Registration& registration, int cells,
            Unwarped& unwarped);

/// A layer-1 marker's picture as it is printed.
Texels picture_of(const InkPlan& plan);

/// Gaussian blur, the border's values going on beyond it.
void smooth(const Texels& texels, double sigma, Texels& smoothed);

/// The texels within a square's border ring cut into blocks of 4 x 4, row-first: the first texel of
/// each, then the second of each, and so on, which many blocks at a time are compared by. All four
/// turns have the same blocks.
struct Blocks {
  static constexpr int kSide = 4;
  static constexpr int kTexels = kSide * kSide;
  int across = 0;
  std::vector<std::int16_t> texels;  ///< black 0 … white 255
  std::size_t count() const { return static_cast<std::size_t>(across * across); }
};
void cut(const Texels& texels, int cells, Blocks& blocks);

/// The same blocks with the square's corner `turns` as the first one.
void turn(const Blocks& blocks, int turns, Blocks& turned);

/// A marker's picture, as blurred as an image.
struct BlurredPicture {
  Blocks blocks;
  std::vector<std::uint8_t> patterned;  ///< of each block: whether there is a pattern in it
};
void blur_picture(const Texels& picture, double sigma, int cells, Texels& scratch,
                  BlurredPicture& blurred);

/// In how many blocks the image looks like the picture.
struct Likeness {
  int patterned = 0;  ///< blocks with a pattern in them, which look so hardly ever by chance,
  int even = 0;       ///< and those of one grey, which easily do
  /// The logarithm of how much more likely the image is with the marker there than with anything:
  /// what is covered counts for nothing.
  double sum() const { return 4.0 * patterned + 0.5 * even; }
};
Likeness likeness(const Blocks& image, const BlurredPicture& picture);

}  // namespace harco::detect
