// Layouts: where the children of a marker sit. The more of its plane they cover, the farther beside
// the marker's centre a camera close by may look and still see one whole; the more codes they
// need. plan.hpp tells what a layout sees.
//
// A layout is a marker without codes: `Marker::code` has its n, and no bit set; ids are 0.
#pragma once

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

/// Three sizes of markers that cover all inner cells of the parent. Every other cell (checkerboard)
/// holds a child of 7 x 7 cells, which has a small child in every third cell of every third row.
/// All other cells, black ones too, hold nine of the same size in the same places. So small
/// children stand two of their sides apart over the whole marker, 9 for every cell: 239 markers for
/// n = 5. The parent and the small children have n x n cells.
Marker carpet(int cells);
inline constexpr int kCarpetLayers = 3;

/// `parents` markers like `layout`, side by side in one set, without codes.
MarkerSet without_codes(const Marker& layout, int parents, double side_m,
                        const LineWidth& line = {});

}  // namespace harco
