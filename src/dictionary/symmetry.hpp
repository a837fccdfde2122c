// Symmetries of the code space: permutations of cells under which no distance changes.
//
// A permutation that commutes with the quarter turn leaves all distances of Eq. 11 as they are.
// The best codes known are unions of few orbits of such a permutation (the 30 codes at tau = 7 for
// n = 5 are circles and lines over GF(25), with many), so a search that asks for one has
// far less to search and loses little.
#pragma once

#include <cstdint>
#include <vector>

#include "dictionary/demand.hpp"
#include "dictionary/random.hpp"
#include "dictionary/turns.hpp"

namespace harco {

class Symmetry {
 public:
  /// The identity.
  explicit Symmetry(int size);

  /// Moves rings of four cells in cycles of one length and turns some on the way; cells that groups
  /// of the demand fix go to cells that the same groups fix.
  static Symmetry random(const Demand& demand, const Turns& turns, Random& random);

  std::uint64_t operator()(std::uint64_t bits) const;

  /// Where each cell goes.
  const std::vector<int>& images() const { return images_; }

 private:
  std::vector<int> images_;
};

}  // namespace harco
