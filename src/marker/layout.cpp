#include "harco/layout.hpp"

#include <algorithm>
#include <stdexcept>
#include <string>

namespace harco {
namespace {

// A child of the carpet that carries others, and its grid, ring included.
constexpr int kCarpetCells = 7;
constexpr int kCarpetParts = kCarpetCells + 2;
// Where small children stand in that grid, along both axes.
constexpr int kCarpetPlaces[] = {1, 4, 7};

void check_cells(int cells) {
  if (cells < 4 || cells > Code::kMaxCells)
    throw std::invalid_argument("layout: cells must be 4 … 8, not " + std::to_string(cells));
}

Marker blank(int cells, int cell) {
  Marker marker;
  marker.cell = cell;
  marker.code.cells = cells;
  return marker;
}

void add_uniform(Marker& marker, const std::vector<std::vector<int>>& child_cells,
                 std::size_t layer) {
  if (layer == child_cells.size()) return;
  for (const int cell : child_cells[layer]) {
    marker.children.push_back(blank(marker.code.cells, cell));
    add_uniform(marker.children.back(), child_cells, layer + 1);
  }
}

/// A cell of the carpet with a child that carries the small ones.
Marker carpet_child(int cells, int cell) {
  Marker child = blank(kCarpetCells, cell);
  for (const int row : kCarpetPlaces)
    for (const int column : kCarpetPlaces)
      child.children.push_back(blank(cells, (row - 1) * kCarpetCells + column - 1));
  return child;
}

/// A cell of the carpet with small children alone.
void add_small_children(Marker& parent, int cells, int cell) {
  for (const int row : kCarpetPlaces)
    for (const int column : kCarpetPlaces) {
      Marker child = blank(cells, cell);
      child.parts = kCarpetParts;
      child.part = row * kCarpetParts + column;
      parent.children.push_back(child);
    }
}

}  // namespace

std::vector<int> quincunx(int cells) {
  check_cells(cells);
  const int last = cells - 1;
  const int middle = last / 2;
  return {0, last, middle * cells + middle, last * cells, last * cells + last};
}

std::vector<int> checkerboard(int cells) {
  check_cells(cells);
  std::vector<int> list;
  for (int cell = 0; cell < cells * cells; ++cell)
    if ((cell / cells + cell % cells) % 2 == 0) list.push_back(cell);
  return list;
}

Marker uniform_layout(int cells, const std::vector<std::vector<int>>& child_cells) {
  check_cells(cells);
  Marker parent = blank(cells, -1);
  add_uniform(parent, child_cells, 0);
  return parent;
}

Marker carpet(int cells) {
  const std::vector<int> carrying = checkerboard(cells);
  Marker parent = blank(cells, -1);
  for (int cell = 0; cell < cells * cells; ++cell)
    if (std::binary_search(carrying.begin(), carrying.end(), cell))
      parent.children.push_back(carpet_child(cells, cell));
    else
      add_small_children(parent, cells, cell);
  return parent;
}

MarkerSet without_codes(const Marker& layout, int parents, double side_m, const LineWidth& line) {
  MarkerSet set;
  set.cells = layout.code.cells;
  set.line = line;
  set.parents.assign(static_cast<std::size_t>(parents), {side_m, layout});
  return set;
}

}  // namespace harco
