// Small marker sets for tests, with codes that can be checked by eye.
#pragma once

#include <cstdint>
#include <vector>

#include "harco/marker.hpp"

namespace harco::test {

/// n x n white cells but for the given ones.
inline Code code_with_black(const std::vector<int>& black, int cells = 5) {
  Code code{cells, 0};
  for (int cell = 0; cell < code.size(); ++cell) code.bits |= std::uint64_t{1} << cell;
  for (const int cell : black) code.bits &= ~(std::uint64_t{1} << cell);
  return code;
}

/// The contract's shape: a parent of 1.6 m, in its cells 0 and 12 the children 7 and 3, in cell 24
/// of child 7 the child 9.
inline MarkerSet three_layers() {
  const Marker last{9, 24, code_with_black({1, 2, 3, 7}), {}};
  const Marker first_child{7, 0, code_with_black({5, 6, 7}), {last}};
  const Marker second_child{3, 12, code_with_black({1, 2, 5}), {}};
  MarkerSet set;
  set.parents.push_back({1.6, {0, -1, code_with_black({1, 5, 6}), {first_child, second_child}}});
  return set;
}

}  // namespace harco::test
