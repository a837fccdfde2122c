// The code of one marker: n x n bits, and the distances between codes (paper, sections 3
// and 3.3.2).
#pragma once

#include <cstdint>
#include <string>

namespace harco {

/// n x n bits, row by row from the top-left cell (Eq. 1). Bit i of `bits` is cell i; 1 is white.
struct Code {
  static constexpr int kMinCells = 3;
  static constexpr int kMaxCells = 8;

  int cells = 0;  ///< n, the number of inner cells along a side
  std::uint64_t bits = 0;

  int size() const { return cells * cells; }
  bool white(int cell) const { return ((bits >> cell) & 1U) != 0; }
  int black_count() const;

  friend bool operator==(const Code& a, const Code& b) {
    return a.cells == b.cells && a.bits == b.bits;
  }
  friend bool operator!=(const Code& a, const Code& b) { return !(a == b); }
};

/// From '0' and '1', row-first. The length must be a square from 3 x 3 to 8 x 8; otherwise
/// std::invalid_argument.
Code parse_code(const std::string& text);

/// The inverse of parse_code.
std::string to_string(const Code& code);

/// The code as seen after turning the marker clockwise by `quarter_turns` x 90 degrees: R_k of
/// Eq. 11. Any integer is allowed.
Code rotated(const Code& code, int quarter_turns);

/// Number of cells in which two codes of equal size differ.
int hamming(const Code& a, const Code& b);

/// Distance between two different markers: the least Hamming distance over the four turns
/// (Eq. 11, i != j).
int distance(const Code& a, const Code& b);

/// The inner distance: the least Hamming distance of a code to its own three other turns
/// (Eq. 11, i = j). It says how safely the orientation can be told.
int inner_distance(const Code& code);

}  // namespace harco
