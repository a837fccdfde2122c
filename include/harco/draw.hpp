// Drawing a marker: raster, SVG and PDF, all from the ink of geometry.hpp.
//
// A sheet is what gets printed: the marker with its quiet zone (one cell of white around the black
// square) and, outside of that, what whoever prints and mounts it needs to know. Lengths on a
// sheet are millimetres from the sheet's top-left corner, x right, y down.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "harco/geometry.hpp"
#include "harco/image.hpp"
#include "harco/marker.hpp"

namespace harco {

// --- Raster ---------------------------------------------------------------------------------

struct RasterOptions {
  /// Side of the marker's smallest cell; 0 chooses the smallest that makes every line whole.
  int pixels_per_cell = 0;
  int min_size_px = 1000;   ///< least width of the image, where pixels_per_cell is free
  int max_size_px = 16384;  ///< greatest width of the image, whose square it takes in bytes
};

/// A parent with its quiet zone in which every cell and every line is a whole number of pixels.
struct Raster {
  Image image;  ///< 0 black, 255 white, nothing between
  /// Pixel edge of the black square's top-left corner: the square's first pixel starts there.
  Eigen::Vector2i origin_px;
  double pixels_per_metre = 0.0;  ///< times the side: a whole number (of pixels)
  LineWidth line;                 ///< as drawn: what was asked for, rounded to whole pixels
};

/// Lines that no image of the allowed size shows exactly are rounded by up to this share of their
/// width; a width that needs more is refused.
inline constexpr double kLineRounding = 0.1;

/// Up to this share a line counts as exact: a fraction written with few digits, such as 0.0714.
inline constexpr double kLineExact = 0.005;

/// Draws parent `parent_index`. Throws std::invalid_argument if the options make no sense, or if
/// the marker needs more pixels than they allow; the message says how many.
Raster raster(const MarkerSet& markers, int parent_index, const RasterOptions& options = {});

// --- Sheets ---------------------------------------------------------------------------------

/// Paper, upright. Both lengths 0 means a page that is as large as the sheet.
struct Paper {
  double width_mm = 0.0;
  double height_mm = 0.0;
  bool fits_sheet() const { return width_mm == 0.0 && height_mm == 0.0; }
};

/// Names of known papers: fit, a0 … a6, letter, legal, tabloid.
std::vector<std::string> paper_names();
/// Upper or lower case; std::invalid_argument if there is no such paper.
Paper paper(const std::string& name);

struct SheetOptions {
  std::string set_name;      ///< printed beside the id; UTF-8, may be empty
  Paper page;                ///< of the PDF; an SVG is always one page as large as the sheet
  double overlap_mm = 10.0;  ///< shared by neighbouring pages of a marker larger than its page
};

/// The part of a sheet that one page shows.
struct Tile {
  int row = 0, column = 0;
  Rect window_mm;                                     ///< in the sheet
  Eigen::Vector2d page_mm = Eigen::Vector2d::Zero();  ///< the window's top-left corner on the page
};

/// Where everything comes to lie.
struct SheetLayout {
  double width_mm = 0.0, height_mm = 0.0;               ///< of the sheet
  Eigen::Vector2d marker_mm = Eigen::Vector2d::Zero();  ///< the black square's top-left corner
  double page_width_mm = 0.0, page_height_mm = 0.0;     ///< of a page, perhaps landscape
  int rows = 1, columns = 1;
  std::vector<Tile> tiles;  ///< row by row; a single one shows the whole sheet
};

/// The layout of parent `parent_index`. Throws std::invalid_argument if the page is too small to
/// tile over, or the overlap is negative or leaves nothing of it.
SheetLayout layout_sheet(const MarkerSet& markers, int parent_index,
                         const SheetOptions& options = {});

/// The text of an SVG file, true to scale. Ink is one filled outline, without seams.
std::string draw_svg(const MarkerSet& markers, int parent_index, const SheetOptions& options = {});

/// The bytes of a PDF file, true to scale. A sheet larger than its page is tiled: an overview
/// page, then one page a tile with cut marks. Throws as layout_sheet.
std::string draw_pdf(const MarkerSet& markers, int parent_index, const SheetOptions& options = {});

// --- Warnings -------------------------------------------------------------------------------

/// The thinnest line that a printer of 300 dpi draws well.
inline constexpr double kThinnestPrintedLine_m = 0.2e-3;

/// What may go wrong with this set on paper, a sentence each: lines thinner than a printer draws
/// well, children whose lines run into a neighbour because they share an edge.
std::vector<std::string> print_warnings(const MarkerSet& markers);

}  // namespace harco
