// Turning codes fast: Code::rotated by table, eight cells at a time.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

namespace harco {

/// A code and its turns by 90, 180 and 270 degrees.
using FourTurns = std::array<std::uint64_t, 4>;

class Turns {
 public:
  explicit Turns(int cells);

  int cells() const { return cells_; }
  int size() const { return cells_ * cells_; }

  /// Where a clockwise quarter turn takes a cell.
  int turned_cell(int cell) const {
    return (cell % cells_) * cells_ + (cells_ - 1 - cell / cells_);
  }

  std::uint64_t turned(std::uint64_t bits) const {
    std::uint64_t result = 0;
    for (const auto& table : tables_) {
      result |= table[bits & 0xff];
      bits >>= 8;
    }
    return result;
  }

  FourTurns all(std::uint64_t bits) const {
    const std::uint64_t once = turned(bits);
    const std::uint64_t twice = turned(once);
    return {bits, once, twice, turned(twice)};
  }

  /// The least of the four turns: equal for codes that can't be told apart.
  std::uint64_t canonical(std::uint64_t bits) const;

  /// inner_distance and distance of code.hpp.
  int inner_distance(std::uint64_t bits) const;
  int distance(std::uint64_t a, std::uint64_t b) const;

  /// The cells in rings of four that follow one another by quarter turns; the centre of an odd n
  /// is none of them.
  const std::vector<std::array<int, 4>>& rings() const { return rings_; }

 private:
  int cells_;
  std::vector<std::array<std::uint64_t, 256>> tables_;  ///< one for every eight cells
  std::vector<std::array<int, 4>> rings_;
};

}  // namespace harco
