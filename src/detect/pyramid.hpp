// A picture at its own size, at half of it, at a quarter, and so on.
#pragma once

#include <array>

#include <Eigen/Core>

#include "harco/image.hpp"

namespace harco::detect {

class Pyramid {
 public:
  static constexpr int kLevels = 5;

  /// The pixels have to stay where they are for as long as the pyramid is used. So many levels at
  /// most; more of them later, by extend().
  void build(const ImageView& image, int most = kLevels);
  void extend(int most = kLevels);

  /// Likewise a pyramid of two levels, the rows of the second of which have yet to be made: some
  /// from first_row to before end_row at a time, where the picture has just been read anyway. Rows
  /// beyond the last are none.
  void begin(const ImageView& image);
  void halve(int first_row, int end_row);

  /// Level 0 is the picture itself; each pixel of a level is the mean of four of the one below.
  ImageView level(int k) const;
  int levels() const { return levels_; }  ///< built; all of them hold at least one pixel

  /// A point of the picture in pixels of a level, and the other way round.
  static Eigen::Vector2d in_level(const Eigen::Vector2d& point, int k) {
    const double scale = 1.0 / (1 << k);
    return ((point.array() + 0.5) * scale - 0.5).matrix();
  }
  static Eigen::Vector2d in_whole(const Eigen::Vector2d& point, int k) {
    const double pixel = 1 << k;
    return ((point.array() + 0.5) * pixel - 0.5).matrix();
  }

 private:
  Image* add_level();
  ImageView whole_;
  std::array<Image, kLevels - 1> smaller_;
  int levels_ = 0;
};

}  // namespace harco::detect
