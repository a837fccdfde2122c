#include "harco/layout.hpp"

#include <algorithm>
#include <stdexcept>
#include <string>
#include <utility>

namespace harco {
namespace {

// The grid of a child of the carpet that carries others, ring included.
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

/// Calls visit(row, column) with all places of small children in a cell of the carpet.
template <typename Visit>
void for_each_place(const Visit& visit) {
  for (const int row : kCarpetPlaces)
    for (const int column : kCarpetPlaces) visit(row, column);
}

/// A cell of the carpet with a child that carries the small ones.
Marker carpet_child(int cells, int cell) {
  Marker child = blank(kCarpetCells, cell);
  for_each_place([&](int row, int column) {
    child.children.push_back(blank(cells, (row - 1) * kCarpetCells + column - 1));
  });
  return child;
}

Marker in_part(Marker child, int parts, int row, int column) {
  child.parts = parts;
  child.part = row * parts + column;
  return child;
}

/// A cell of the carpet without such a child: in its middle one of a third of the side, with one of
/// its own in its middle, and the small ones around it.
void add_loose_children(Marker& parent, int cells, int cell) {
  const int middle = kCarpetParts / 2;
  for_each_place([&](int row, int column) {
    if (row != middle || column != middle)
      parent.children.push_back(in_part(blank(cells, cell), kCarpetParts, row, column));
  });
  Marker half_way = in_part(blank(kCarpetCells, cell), 3, 1, 1);
  half_way.children.push_back(blank(cells, kCarpetCells * kCarpetCells / 2));
  parent.children.push_back(std::move(half_way));
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
      add_loose_children(parent, cells, cell);
  return parent;
}

std::string to_string(LayoutKind kind) {
  switch (kind) {
    case LayoutKind::quincunx:
      return "quincunx";
    case LayoutKind::checkerboard:
      return "checkerboard";
    case LayoutKind::carpet:
      return "carpet";
  }
  throw std::invalid_argument("no such layout");
}

Marker make_layout(LayoutKind kind, int cells, int layers) {
  if (layers < 1 || layers > kMostLayers)
    throw std::invalid_argument("layout: layers must be 1 … " + std::to_string(kMostLayers) +
                                ", not " + std::to_string(layers));
  if (kind == LayoutKind::carpet) {
    if (layers != kCarpetLayers)
      throw std::invalid_argument("layout: a carpet has " + std::to_string(kCarpetLayers) +
                                  " layers, not " + std::to_string(layers));
    return carpet(cells);
  }
  const std::vector<int> child_cells =
      kind == LayoutKind::quincunx ? quincunx(cells) : checkerboard(cells);
  return uniform_layout(
      cells, std::vector<std::vector<int>>(static_cast<std::size_t>(layers - 1), child_cells));
}

LineWidth default_line(int cells) {
  check_cells(cells);
  return {0.0, 0.5 / (cells + 2)};
}

MarkerSet without_codes(const Marker& layout, int parents, double side_m, const LineWidth& line) {
  MarkerSet set;
  set.cells = layout.code.cells;
  set.line = line;
  set.parents.assign(static_cast<std::size_t>(parents), {side_m, layout});
  return set;
}

}  // namespace harco
