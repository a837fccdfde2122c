#include "hierarchy.hpp"

#include <algorithm>
#include <limits>
#include <set>
#include <stdexcept>

#include "number_list.hpp"

namespace harco::cli {
namespace {

struct Cell {
  int row, column;
};

Cell cell_at(int index, int n) { return {index / n, index % n}; }

int squared_distance(Cell a, Cell b) {
  return (a.row - b.row) * (a.row - b.row) + (a.column - b.column) * (a.column - b.column);
}

/// The white cell nearest the middle; the first of equals. -1 if all are black.
int middle_white(const Code& code) {
  const int n = code.cells;
  int best = -1;
  int least = std::numeric_limits<int>::max();
  for (int i = 0; i < code.size(); ++i) {
    const Cell at = cell_at(i, n);
    // In half cells, so that the middle of an even n is a whole number too.
    const int off = squared_distance({2 * at.row, 2 * at.column}, {n - 1, n - 1});
    if (code.white(i) && off < least) {
      least = off;
      best = i;
    }
  }
  return best;
}

/// The white cell farthest from all chosen; -1 if every other one shares an edge with one of them.
int farthest_white(const Code& code, const std::vector<int>& chosen) {
  constexpr int kSharedEdge = 1;
  int best = -1;
  int greatest = kSharedEdge;
  for (int i = 0; i < code.size(); ++i) {
    if (!code.white(i)) continue;
    int nearest = std::numeric_limits<int>::max();
    for (const int other : chosen)
      nearest =
          std::min(nearest, squared_distance(cell_at(i, code.cells), cell_at(other, code.cells)));
    if (nearest > greatest) {
      greatest = nearest;
      best = i;
    }
  }
  return best;
}

std::vector<int> spread_cells(const Code& code, int most) {
  std::vector<int> chosen;
  int next = middle_white(code);
  while (next >= 0 && static_cast<int>(chosen.size()) < most) {
    chosen.push_back(next);
    next = farthest_white(code, chosen);
  }
  std::sort(chosen.begin(), chosen.end());
  return chosen;
}

/// The middle cell of n x n; of an even n the four around the middle.
std::vector<int> middle_cells(int n) {
  const int low = (n - 1) / 2;
  const int high = n / 2;
  std::set<int> cells{low * n + low, low * n + high, high * n + low, high * n + high};
  return {cells.begin(), cells.end()};
}

}  // namespace

ChildLayout parse_child_layout(const std::string& text, int cells) {
  const std::string spread = "spread";
  if (text == spread) return {};
  if (text.rfind(spread + ":", 0) == 0) {
    const auto count = whole_number(text.substr(spread.size() + 1));
    if (!count || *count == 0)
      throw std::invalid_argument("--children '" + text +
                                  "': needs a positive number after spread:");
    return {*count, std::nullopt};
  }
  return {0, parse_cells(text, cells, "--children")};
}

std::vector<int> child_cells(const Code& code, const ChildLayout& layout) {
  if (!layout.cells) return spread_cells(code, layout.spread);
  std::vector<int> white;
  for (const int cell : *layout.cells)
    if (code.white(cell)) white.push_back(cell);
  std::sort(white.begin(), white.end());
  return white;
}

DictionaryOptions codes_for_hierarchy(const std::vector<Code>& parents,
                                      const HierarchyOptions& options) {
  if (options.layers < 2) throw std::invalid_argument("a hierarchy has at least 2 layers");
  if (parents.empty()) throw std::invalid_argument("a hierarchy needs parents");
  const ChildLayout layout = parse_child_layout(options.children, parents.front().cells);

  DictionaryOptions wanted;
  wanted.cells = options.child_cells;
  wanted.seed = options.seed;
  wanted.given_parents = parents;
  for (const Code& code : parents) wanted.given_child_cells.push_back(child_cells(code, layout));
  wanted.child_cells.assign(static_cast<std::size_t>(options.layers - 1),
                            quincunx(options.child_cells));
  wanted.white_cells = middle_cells(options.child_cells);
  return wanted;
}

}  // namespace harco::cli
