#include "dictionary/generation.hpp"

#include <bit>
#include <cmath>
#include <cstdint>
#include <set>

#include "dictionary/bounds.hpp"
#include "dictionary/mutation.hpp"
#include "dictionary/search.hpp"

namespace harco {
namespace {

// So that the children don't depend on whether parents were generated before.
constexpr std::uint64_t kChildSeed = 0x9e3779b97f4a7c15;

void check_black(const BlackRange& black, int cells, const std::string& whose) {
  const int size = cells * cells;
  if (black.least < 1 || black.most >= size || black.least > black.most)
    refuse("black cells of " + whose + " must be a range within 1 … " + std::to_string(size - 1) +
           ", not " + std::to_string(black.least) + " … " + std::to_string(black.most));
}

}  // namespace

void check_list(const std::vector<int>& list, int cells, const std::string& what) {
  std::set<int> known;
  for (const int cell : list) {
    if (cell < 0 || cell >= cells * cells)
      refuse(what + ": there is no cell " + std::to_string(cell) + " in " + std::to_string(cells) +
             " x " + std::to_string(cells));
    if (!known.insert(cell).second)
      refuse(what + ": cell " + std::to_string(cell) + " stands twice");
  }
}

void check_search(const CodeSearch& search) {
  if (!(search.effort > 0.0) || !std::isfinite(search.effort))
    refuse("effort must be a positive number");
  if (!(search.time_limit_s > 0.0)) refuse("time_limit_s must be a positive number of seconds");
}

DistanceBound check_demand(const Demand& demand, const std::optional<int>& wanted,
                           const std::string& whose) {
  const int size = demand.cells * demand.cells;
  check_black(demand.black, demand.cells, whose);
  for (const CodeGroup& group : demand.groups)
    if (size - std::popcount(group.white) < demand.black.least)
      refuse(whose + " need at least " + std::to_string(demand.black.least) +
             " black cells, but their child cells leave only " +
             std::to_string(size - std::popcount(group.white)));
  DistanceBound bound = distance_bound(demand);
  if (bound.distance < 1)
    refuse("with these child cells and black cells, all codes of " + whose +
           " look the same when turned");
  if (wanted && (*wanted < 1 || *wanted > size))
    refuse("the distance wanted of " + whose + " must be 1 … " + std::to_string(size) + ", not " +
           std::to_string(*wanted));
  if (wanted && *wanted > bound.distance)
    refuse("distance " + std::to_string(*wanted) + " of " + whose + " is impossible: the " +
           bound.reason + " allows " + std::to_string(bound.distance));
  return bound;
}

CodeGroups search_codes(const Demand& demand, bool children, int most_distance,
                        const CodeSearch& search, Monitor& monitor, int& reached) {
  const std::uint64_t seed = children ? search.seed ^ kChildSeed : search.seed;
  return search.method == DictionaryMethod::mutation
             ? mutate_dictionary(demand, children, most_distance, search.effort, seed, monitor,
                                 reached)
             : search_dictionary(demand, most_distance, seed, monitor, reached);
}

}  // namespace harco
