// The codes that a search chooses from.
#pragma once

#include <cstdint>
#include <vector>

#include "dictionary/demand.hpp"
#include "dictionary/random.hpp"
#include "dictionary/symmetry.hpp"
#include "dictionary/turns.hpp"

namespace harco {

/// Codes that a demand admits, of codes that are turns of one another only one: all of them where
/// they can be enumerated, else random ones.
class Candidates {
 public:
  Candidates(const Demand& demand, const Turns& turns, Random& random);

  /// Candidates whose inner distance is at least tau, those of the groups with the most fixed cells
  /// first; at most kLimit a group. Random candidates are drawn anew, and turned into such ones.
  std::vector<std::uint64_t> with_inner_distance(int tau, Random& random) const;

  static constexpr std::size_t kLimit = 65536;

 private:
  struct Source {
    std::vector<int> free;              ///< cells that may be black
    std::vector<double> counts;         ///< number of codes with black.least + i black cells
    std::vector<std::uint64_t> listed;  ///< in random order; empty if there are too many
  };
  void enumerate(Source& source) const;
  std::uint64_t draw(const Source& source, Random& random) const;

  Demand demand_;
  const Turns& turns_;
  std::vector<Source> sources_;
};

/// Orbits of codes under a symmetry, each with distance >= tau among its own members. Members
/// stand as canonical turns.
struct Pool {
  std::vector<std::uint64_t> members;   ///< orbit after orbit
  std::vector<std::uint32_t> first;     ///< of each orbit; one more entry at the end
  std::vector<std::uint32_t> admitted;  ///< bit g: group g admits all members, each in some turn

  std::size_t size() const { return admitted.size(); }
  int length(std::size_t orbit) const { return static_cast<int>(first[orbit + 1] - first[orbit]); }
};

Pool make_pool(const std::vector<std::uint64_t>& codes, const Demand& demand, const Turns& turns,
               const Symmetry& symmetry, int tau);

/// The least number of quarter turns after which a group's fixed cells are white; -1: none.
int turns_to_fit(std::uint64_t bits, const CodeGroup& group, const Turns& turns);

}  // namespace harco
