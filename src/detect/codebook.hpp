// Which marker a code belongs to.
#pragma once

#include <cstdint>
#include <unordered_map>
#include <vector>

#include "harco/marker.hpp"

namespace harco::detect {

/// A marker of the set, turned as it was seen.
struct Match {
  int placed = 0;  ///< index into place(markers)
  int turns = 0;   ///< the code seen is the marker's, turned clockwise so many times by 90 degrees
  int errors = 0;  ///< cells that differ
};

/// The codes of one kind (parents or children) and one size, in all four turns.
class Codebook {
 public:
  Codebook(int cells, const std::vector<PlacedMarker>& placed, bool children);

  int cells() const { return cells_; }
  bool empty() const { return entries_.empty(); }

  /// Half the least distance of the codes, rounded down: so many errors never lead to another code.
  int safe_errors() const { return safe_errors_; }

  /// Appends every marker with at most `max_errors` cells different from `bits`.
  void find(std::uint64_t bits, int max_errors, std::vector<Match>& matches) const;

 private:
  struct Entry {
    std::uint64_t bits;
    int placed;
    int turns;
  };
  int cells_;
  int safe_errors_ = 0;
  std::vector<Entry> entries_;
  std::unordered_map<std::uint64_t, std::size_t> exact_;
};

}  // namespace harco::detect
