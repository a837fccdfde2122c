// A sheet over several pages.
#pragma once

#include "draw/sheet.hpp"
#include "harco/draw.hpp"

namespace harco {

/// Where the parts of a sheet come to lie on its pages. Throws std::invalid_argument.
SheetLayout layout(const Sheet& sheet, const SheetOptions& options);

/// What a tile's page shows besides its part of the sheet: cut marks, where its neighbours come to
/// lie, and which page it is. In millimetres of the page.
DisplayList tile_marks(const SheetLayout& layout, const Tile& tile, const std::string& title,
                       double overlap_mm);

/// The first page of a tiled sheet: how the pages go together.
struct Overview {
  DisplayList below;  ///< painted before the small picture of the sheet
  double scale = 1.0;
  Eigen::Vector2d sheet_mm = Eigen::Vector2d::Zero();  ///< its top-left corner on the page
  DisplayList above;                                   ///< painted after it
};
Overview overview(const SheetLayout& layout, const std::string& title, double overlap_mm);

}  // namespace harco
