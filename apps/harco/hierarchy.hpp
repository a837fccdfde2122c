// Parents of another family made hierarchical: children in white cells of theirs.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "harco/code.hpp"
#include "harco/dictionary.hpp"

namespace harco::cli {

/// Where a parent's children sit, among its white cells.
struct ChildLayout {
  /// Up to so many, as far from one another as the code allows, no two sharing an edge.
  int spread = 5;
  /// Or: the white ones of these cells of the n x n, whatever lies beside them.
  std::optional<std::vector<int>> cells;
};

/// "spread", "spread:COUNT", "quincunx", "checkerboard" or cells such as "0,4-6", in a marker of
/// n x n cells. Throws std::invalid_argument, repeating the text, for anything else.
ChildLayout parse_child_layout(const std::string& text, int cells);

/// The cells of `code` that hold children, in rising order. With `spread`: first the white cell
/// nearest the middle, then always the one farthest from those chosen. An all-white 5 x 5 has the
/// quincunx.
std::vector<int> child_cells(const Code& code, const ChildLayout& layout);

struct HierarchyOptions {
  int layers = 2;  ///< of the whole marker, 2 or more
  std::string children = "spread";
  int child_cells = 5;  ///< n of the children
  std::uint64_t seed = 1;
};

/// The children's codes that `parents` of another family need, for generate_dictionary. Children
/// that carry children have them in the quincunx. The middle of every child is white, so that
/// detectors that look at the middle of a parent's cell read it as before. Throws
/// std::invalid_argument for options that make no sense.
DictionaryOptions codes_for_hierarchy(const std::vector<Code>& parents,
                                      const HierarchyOptions& options);

}  // namespace harco::cli
