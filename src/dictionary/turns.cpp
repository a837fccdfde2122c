#include "dictionary/turns.hpp"

#include <algorithm>
#include <bit>

namespace harco {

Turns::Turns(int cells) : cells_(cells) {
  tables_.resize(static_cast<std::size_t>((size() + 7) / 8));
  for (int cell = 0; cell < size(); ++cell) {
    const std::uint64_t image = std::uint64_t{1} << turned_cell(cell);
    auto& table = tables_[static_cast<std::size_t>(cell / 8)];
    for (std::size_t byte = 0; byte < table.size(); ++byte)
      if (((byte >> (cell % 8)) & 1U) != 0) table[byte] |= image;
  }
  for (int cell = 0; cell < size(); ++cell) {
    std::array<int, 4> ring{cell};
    for (std::size_t k = 1; k < 4; ++k) ring[k] = turned_cell(ring[k - 1]);
    const bool centre = ring[1] == cell;
    if (!centre && *std::min_element(ring.begin(), ring.end()) == cell) rings_.push_back(ring);
  }
}

std::uint64_t Turns::canonical(std::uint64_t bits) const {
  const auto turns = all(bits);
  return *std::min_element(turns.begin(), turns.end());
}

int Turns::inner_distance(std::uint64_t bits) const {
  const std::uint64_t once = turned(bits);
  return std::min(std::popcount(bits ^ once), std::popcount(bits ^ turned(once)));
}

int Turns::distance(std::uint64_t a, std::uint64_t b) const {
  int least = size();
  for (const std::uint64_t turn : all(b)) least = std::min(least, std::popcount(a ^ turn));
  return least;
}

}  // namespace harco
