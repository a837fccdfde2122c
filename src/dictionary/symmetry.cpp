#include "dictionary/symmetry.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <map>
#include <numeric>

namespace harco {
namespace {

/// For each of a ring's four cells, the set of groups that fix it.
using RingMark = std::array<unsigned, 4>;

RingMark mark(const std::array<int, 4>& ring, const Demand& demand) {
  RingMark marks{};
  for (std::size_t k = 0; k < 4; ++k)
    for (std::size_t g = 0; g < demand.groups.size(); ++g)
      marks[k] |= static_cast<unsigned>((demand.groups[g].white >> ring[k]) & 1U) << g;
  return marks;
}

}  // namespace

Symmetry::Symmetry(int size) : images_(static_cast<std::size_t>(size)) {
  std::iota(images_.begin(), images_.end(), 0);
}

Symmetry Symmetry::random(const Demand& demand, const Turns& turns, Random& random) {
  std::map<RingMark, std::vector<std::array<int, 4>>> alike;
  for (const auto& ring : turns.rings()) alike[mark(ring, demand)].push_back(ring);

  Symmetry symmetry(turns.size());
  for (auto& [marks, rings] : alike) {
    const bool may_turn = std::count(marks.begin(), marks.end(), marks[0]) == 4;
    random.shuffle(rings);
    const std::size_t length = 1 + random.below(rings.size());
    const std::size_t cycle_turn = random.below(std::size_t{4});
    const std::size_t rest_turn = random.below(std::size_t{4});
    for (std::size_t first = 0; first < rings.size();) {
      const bool whole = first + length <= rings.size();
      const std::size_t cycle = whole ? length : 1;
      // Where turns of single rings differ, the symmetry has more of the orders 2 and 4.
      const std::size_t turn = whole ? cycle_turn : rest_turn * random.below(std::size_t{2});
      for (std::size_t i = 0; i < cycle; ++i) {
        const auto& from = rings[first + i];
        const auto& to = rings[first + (i + 1) % cycle];
        const std::size_t shift = may_turn && i + 1 == cycle ? turn : 0;
        for (std::size_t k = 0; k < 4; ++k)
          symmetry.images_[static_cast<std::size_t>(from[k])] = to[(k + shift) % 4];
      }
      first += cycle;
    }
  }
  return symmetry;
}

std::uint64_t Symmetry::operator()(std::uint64_t bits) const {
  std::uint64_t moved = 0;
  for (; bits != 0; bits &= bits - 1)
    moved |= std::uint64_t{1} << images_[static_cast<std::size_t>(std::countr_zero(bits))];
  return moved;
}

}  // namespace harco
