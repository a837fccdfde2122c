#include "harco/merge.hpp"

#include <stdexcept>

namespace harco {

MarkerSet merge(const std::vector<MarkerSet>& sets) {
  if (sets.empty()) throw std::invalid_argument("merge: there is no set");
  MarkerSet all;
  all.cells = sets.front().cells;
  const MarkerSet* lined = nullptr;  // the first set with children
  for (const MarkerSet& set : sets) {
    all.parents.insert(all.parents.end(), set.parents.begin(), set.parents.end());
    if (set.layers() < 2) continue;
    if (lined && (set.line.inside != lined->line.inside || set.line.outside != lined->line.outside))
      throw std::invalid_argument("merge: the lines around children differ");
    if (!lined) lined = &set;
  }
  if (lined) all.line = lined->line;
  validate(all);
  return all;
}

}  // namespace harco
