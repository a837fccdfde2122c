// Layouts: where the children of a marker sit. The more of its plane they cover, the farther beside
// the marker's centre a camera close by may look and still see one whole; the more codes they
// need. plan.hpp tells what a layout sees.
//
// A layout is a marker without codes: `Marker::code` has its n, and no bit set; ids are 0.
#pragma once

#include <string>
#include <vector>

#include "harco/marker.hpp"

namespace harco {

/// Cells of n x n that hold children: the four corners and the centre (of the four central cells of
/// an even n, the top-left one). No two share an edge. For n = 5: 0, 4, 12, 20, 24.
std::vector<int> quincunx(int cells);

/// Every other cell, corners included: (n² + 1) / 2 of them, rounded down; 13 for n = 5. No two
/// share an edge.
std::vector<int> checkerboard(int cells);

/// All markers have n x n cells and fill theirs; every marker of layer i has children in the cells
/// child_cells[i - 1]. None: a parent alone.
Marker uniform_layout(int cells, const std::vector<std::vector<int>>& child_cells);

/// Markers that cover all inner cells of the parent. Every other cell (checkerboard) holds a child
/// of 7 x 7 cells, which has a small child in every third cell of every third row. All other cells,
/// black ones too, hold small ones of the same size in the same places, but in their middle a child
/// of 7 x 7 cells that is a third as large as the cell and has one of its own in its middle. So
/// small children stand two of their sides apart over the whole marker, and larger ones fill the
/// gap between them and the parent. The parent and the small children have n x n cells; for n = 5
/// there are 251 markers, for n = 6 361.
Marker carpet(int cells);
inline constexpr int kCarpetLayers = 3;
inline constexpr int kCarpetCells = 7;  ///< n of those that are not the parent's

/// The layouts that have names.
enum class LayoutKind {
  quincunx,  ///< five children in every marker: the paper's, for a camera that looks at the centre
  checkerboard,  ///< every other cell
  carpet         ///< three layers that cover the whole marker
};

std::string to_string(LayoutKind kind);

/// The layout with so many layers, 1 … 8, in which all markers but some of the carpet's have n x n
/// cells. Throws std::invalid_argument, among others for a carpet of other than three layers.
Marker make_layout(LayoutKind kind, int cells, int layers);

/// The line around children of n x n cells: nothing inside, half a cell outside, which is a whole
/// pixel as soon as a cell is two. 1/14 of the side for n = 5.
LineWidth default_line(int cells);

/// `parents` markers like `layout`, side by side in one set, without codes.
MarkerSet without_codes(const Marker& layout, int parents, double side_m,
                        const LineWidth& line = {});

}  // namespace harco
