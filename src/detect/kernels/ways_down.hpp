// Where a way leads down, for one row of a map of bits.
#pragma once

#include <cstdint>

namespace harco::detect::kernels {

/// Those pixels of a row, one bit each, that have a set pixel of the row `below` under them or up
/// to two pixels beside that. `here` counts inverted if `flip` is all ones. Reads below[-1] and
/// below[words] as well; bit 0 of a word is the leftmost.
void ways_down(const std::uint64_t* here, std::uint64_t flip, const std::uint64_t* below, int words,
               std::uint64_t* ways);

/// The same in plain C++.
void ways_down_scalar(const std::uint64_t* here, std::uint64_t flip, const std::uint64_t* below,
                      int words, std::uint64_t* ways);

}  // namespace harco::detect::kernels
