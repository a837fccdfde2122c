// Where an image steps from one even level to another along scan lines, and which of these steps
// may be part of a straight edge across them.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "harco/image.hpp"

namespace harco::detect {

/// A bit for each place on each scan line, steps up and steps down apart. Of texture, most steps go
/// on nowhere; bits tell that, 64 places at a time, before a pixel is looked at again.
class StepMap {
 public:
  static constexpr int kApart = 2;  ///< pixels from one scan line to the next
  // Pixels before and behind the one that a step follows that it takes.
  static constexpr int kBefore = 3, kBehind = 4;

  /// Finds the steps along every other row or every other column, of at least `least_contrast` grey
  /// levels between `even` (2 or 3) even samples on either side, as kernels::clean_steps has them.
  /// Those are left that stand in a row of three: on both neighbouring scan lines, or on the next
  /// two on one side, steps of the same kind lie no farther along than edges of 45 degrees lead, or
  /// a little more. None lie on the outermost rows or columns across which scan lines go. The image
  /// is larger than kBefore + kBehind both ways.
  void find(const ImageView& image, bool along_rows, int even, int least_contrast);

  /// About how many such steps there are along rows, in line or not: by every eighth scan line.
  int count_roughly(const ImageView& image, int even, int least_contrast);

  /// Calls `visit(s, t)` for each step, by the coordinate `s` of its scan line across scan lines
  /// and the coordinate `t` along it of the pixel that it follows, in the order of both.
  template <typename Visit>
  void for_each(const Visit& visit) const {
    for (int line = 0; line < lines_; ++line) {
      const std::uint64_t* const up = &in_line_[at(line, 0)];
      const std::uint64_t* const down = &in_line_[at(line, 1)];
      for (int word = 0; word < words_; ++word)
        for (std::uint64_t left = up[word] | down[word]; left != 0; left &= left - 1)
          visit(kApart * line, 64 * word + std::countr_zero(left) + kBefore);
    }
  }

 private:
  /// A row of bits for each scan line and kind, a word of nothing between them, and rows of nothing
  /// before the first line and behind the last one.
  using Bits = std::vector<std::uint64_t>;

  void clear(int lines, int places);
  void find_along_rows(const ImageView& image, int even, int least_contrast);
  void find_along_columns(const ImageView& image, int even, int least_contrast);
  void keep_in_line();
  int stride() const { return words_ + 1; }
  /// The first word of a row.
  std::size_t at(int line, int kind) const {
    return static_cast<std::size_t>((2 * (line + 1) + kind) * stride() + 1);
  }

  std::array<int, 3> shape_{};  // width, height and way
  int lines_ = 0;
  int words_ = 0;  // of a scan line
  Bits found_, near_, in_line_;
  Bits rising_, falling_;  // of one row of the image
  Bits band_;              // of 64 rows, one word across after the other
};

}  // namespace harco::detect
