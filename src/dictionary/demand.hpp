// What is asked of one dictionary, D_F or D_C.
#pragma once

#include <cstdint>
#include <vector>

#include "harco/code.hpp"
#include "harco/dictionary.hpp"

namespace harco {

/// Codes of one layer: how many, and which of their cells hold children and so have to be white.
struct CodeGroup {
  int count = 0;
  std::uint64_t white = 0;
};

struct Demand {
  int cells = 5;
  BlackRange black;
  /// One group a layer. Cells that are white in all of a group's codes may be so in the last
  /// group's, too: the last group takes any code that another one admits.
  std::vector<CodeGroup> groups;

  int size() const {
    int sum = 0;
    for (const CodeGroup& group : groups) sum += group.count;
    return sum;
  }
};

/// Codes group by group, as many as were asked for.
using CodeGroups = std::vector<std::vector<Code>>;

/// All codes of all groups in one row.
std::vector<Code> joined(const CodeGroups& groups);

}  // namespace harco
