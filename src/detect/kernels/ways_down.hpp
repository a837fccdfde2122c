// From where ways lead down, for one row of a map of bits.
#pragma once

#include <cstddef>
#include <cstdint>

namespace harco::detect::kernels {

/// Some rows of a map are goals. The pixels of a row, one bit each, from which a way leads down to
/// the first, the second ... of `goals` goals below: row k of `ways` tells of goal k + 1, and a row
/// that `is_goal` itself is its own first one. A way goes from a pixel to the one under it or up to
/// `reach` (1, 2 or 3) beside that. `here` counts inverted if `flip` is all ones; bit 0 of a word
/// is the leftmost. `below` holds the ways of the row below, of which word -1 and the one behind
/// the last are read as well. Rows of both are `stride` words apart; they don't overlap.
void ways_down(const std::uint64_t* here, std::uint64_t flip, int words, int goals, bool is_goal,
               int reach, const std::uint64_t* below, std::ptrdiff_t stride, std::uint64_t* ways);

/// The same in plain C++.
void ways_down_scalar(const std::uint64_t* here, std::uint64_t flip, int words, int goals,
                      bool is_goal, int reach, const std::uint64_t* below, std::ptrdiff_t stride,
                      std::uint64_t* ways);

}  // namespace harco::detect::kernels
