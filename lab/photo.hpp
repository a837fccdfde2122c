// A photograph as a texture: seen from any distance without aliasing, repeated as in mirrors.
#pragma once

#include <vector>

#include "coverage.hpp"
#include "harco/image.hpp"

namespace harco::lab {

class Photo {
 public:
  /// Throws std::invalid_argument for an empty image.
  explicit Photo(const Image& image);

  int width() const { return levels_.front().width; }
  int height() const { return levels_.front().height; }

  /// Which of the halved pictures suits pixels of the camera that are `footprint` pixels of the
  /// photograph wide.
  int level_for(double footprint) const;

  /// Adds `share` of the grey levels at `count` places to `sum`: places u, v times `scale`, from
  /// the photograph's middle, in its pixels. Bilinear within one level.
  void add(const float* u, const float* v, int count, float scale, int level, float share,
           float* sum) const;

 private:
  std::vector<FloatImage> levels_;  ///< each half as large as the one before it
};

/// A picture of nothing in particular: patches and grains of all sizes, as ground and walls have.
/// The same seed gives the same picture. `contrast` is the standard deviation in grey levels.
Image made_up_ground(int size_px, double mean, double contrast, unsigned seed);

}  // namespace harco::lab
