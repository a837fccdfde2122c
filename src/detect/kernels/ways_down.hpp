// From where ways lead down, for one row of a map of bits.
#pragma once

#include <cstddef>
#include <cstdint>

namespace harco::detect::kernels {

/// A row of a map, one bit a pixel, of which some rows are goals, and the ways of the row below.
struct WaysRow {
  const std::uint64_t* here;  ///< the lowest bit of a word is the leftmost
  std::uint64_t flip;         ///< all ones if it is zeros that ways lead through
  int words;
  int goals;
  bool is_goal;  ///< whether this row is one
  int reach;     ///< 1, 2 or 3: a way leads to the pixel below or up to so many beside that
  /// As `ways` of the row below, of which word -1 and the one behind the last are read as well.
  const std::uint64_t* below;
  std::ptrdiff_t stride;  ///< words from row to row of ways, which don't overlap with those below
};

/// The pixels from which a way leads down to the first, the second ... of some goals: row k of
/// `ways` tells of goal k + 1, and a row that is a goal itself is its own first one. `broad`,
/// unless it is null, gets those beside which, within two pixels, three neighbours in the row below
/// all lead down to its last goal.
void ways_down(const WaysRow& row, std::uint64_t* ways, std::uint64_t* broad = nullptr);

/// The same in plain C++.
void ways_down_scalar(const WaysRow& row, std::uint64_t* ways, std::uint64_t* broad = nullptr);

}  // namespace harco::detect::kernels
