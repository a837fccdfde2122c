#include "draw/tiling.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <vector>

#include "draw/text.hpp"

namespace harco {
namespace {

using Eigen::Vector2d;

constexpr double kMargin_mm = 10.0;  ///< of a tile's page: for marks, and out of printers' reach
constexpr double kFont_mm = 2.8;
constexpr double kLeastWindow_mm = 30.0;
constexpr int kMostPages = 10000;

constexpr Color kCut{0.78, 0.10, 0.10};

/// Number of windows that cover `length` with neighbours sharing `overlap`.
int windows(double length, double window, double overlap) {
  return std::max(1, static_cast<int>(std::ceil((length - overlap) / (window - overlap) - 1e-9)));
}

/// Pages of one orientation. Tiles are filled in later.
SheetLayout on_pages(const Sheet& sheet, double page_width, double page_height, double overlap) {
  SheetLayout pages;
  pages.width_mm = sheet.width_mm;
  pages.height_mm = sheet.height_mm;
  pages.marker_mm = sheet.marker_mm;
  pages.page_width_mm = page_width;
  pages.page_height_mm = page_height;
  if (sheet.width_mm <= page_width && sheet.height_mm <= page_height) return pages;
  const double window_x = page_width - 2.0 * kMargin_mm;
  const double window_y = page_height - 2.0 * kMargin_mm;
  if (std::min(window_x, window_y) - overlap < kLeastWindow_mm)
    throw std::invalid_argument("an overlap of " + number(overlap, 2) +
                                " mm leaves too little of the page");
  const double most = std::max(sheet.width_mm, sheet.height_mm) / kLeastWindow_mm;
  if (most > kMostPages) throw std::invalid_argument("the marker is too large for such pages");
  pages.columns = windows(sheet.width_mm, window_x, overlap);
  pages.rows = windows(sheet.height_mm, window_y, overlap);
  // One page in the other direction may still be larger than the sheet.
  return pages;
}

void add_tiles(SheetLayout& pages, double overlap) {
  if (pages.rows * pages.columns == 1) {
    const Vector2d centred(0.5 * (pages.page_width_mm - pages.width_mm),
                           0.5 * (pages.page_height_mm - pages.height_mm));
    pages.tiles.push_back({0, 0, {0.0, 0.0, pages.width_mm, pages.height_mm}, centred});
    return;
  }
  const double window_x = pages.page_width_mm - 2.0 * kMargin_mm;
  const double window_y = pages.page_height_mm - 2.0 * kMargin_mm;
  for (int row = 0; row < pages.rows; ++row)
    for (int column = 0; column < pages.columns; ++column) {
      const double x = column * (window_x - overlap);
      const double y = row * (window_y - overlap);
      pages.tiles.push_back(
          {row,
           column,
           {x, y, std::min(x + window_x, pages.width_mm), std::min(y + window_y, pages.height_mm)},
           {kMargin_mm, kMargin_mm}});
    }
}

std::string coordinates(int row, int column) {
  return std::to_string(row + 1) + " / " + std::to_string(column + 1);
}

}  // namespace

SheetLayout layout(const Sheet& sheet, const SheetOptions& options) {
  const double overlap = options.overlap_mm;
  if (!(overlap >= 0.0) || !std::isfinite(overlap))
    throw std::invalid_argument("the overlap of pages must not be negative");
  const double width = options.page.fits_sheet() ? sheet.width_mm : options.page.width_mm;
  const double height = options.page.fits_sheet() ? sheet.height_mm : options.page.height_mm;
  if (!(width > 0.0 && height > 0.0) || !std::isfinite(width) || !std::isfinite(height))
    throw std::invalid_argument("a page's width and height must be positive");
  SheetLayout upright = on_pages(sheet, width, height, overlap);
  if (options.page.fits_sheet()) {
    add_tiles(upright, overlap);
    return upright;
  }
  SheetLayout turned = on_pages(sheet, height, width, overlap);
  SheetLayout& fewer =
      turned.rows * turned.columns < upright.rows * upright.columns ? turned : upright;
  if (fewer.rows * fewer.columns > kMostPages)
    throw std::invalid_argument("the marker would need " +
                                std::to_string(fewer.rows * fewer.columns) + " pages");
  add_tiles(fewer, overlap);
  return fewer;
}

DisplayList tile_marks(const SheetLayout& layout, const Tile& tile, const std::string& title,
                       double overlap_mm) {
  const Vector2d low = tile.page_mm;
  const Vector2d high = low + Vector2d(tile.window_mm.width(), tile.window_mm.height());
  constexpr double kNear = 1.0;
  constexpr double kFar = 6.0;
  DisplayList shapes;
  // A line across the page's whole width or height that leaves out the window itself.
  const auto mark = [&](int axis, double at, const Color& color) {
    std::vector<Segment> segments;
    for (const auto& [from, to] : {std::pair{low[1 - axis] - kFar, low[1 - axis] - kNear},
                                   std::pair{high[1 - axis] + kNear, high[1 - axis] + kFar}}) {
      Segment segment;
      segment[0][axis] = segment[1][axis] = at;
      segment[0][1 - axis] = from;
      segment[1][1 - axis] = to;
      segments.push_back(segment);
    }
    shapes.push_back(Strokes{segments, color.r > kGrey.r ? 0.25 : 0.15, color});
  };
  const std::string cut = "cut";
  const double small = 0.75 * kFont_mm;
  if (tile.column > 0) {
    mark(0, low.x(), kCut);
    shapes.push_back(
        Text{{low.x() - 0.8, high.y() + 3.5}, small, cut, Anchor::end, false, false, kCut});
  }
  if (tile.row > 0) {
    mark(1, low.y(), kCut);
    shapes.push_back(
        Text{{low.x() - 2.0, low.y() - 0.8}, small, cut, Anchor::end, false, false, kCut});
  }
  if (tile.column + 1 < layout.columns) {
    mark(0, high.x() - overlap_mm, kGrey);
    shapes.push_back(Text{{high.x() - overlap_mm + 0.8, high.y() + 3.5},
                          small,
                          "edge of " + coordinates(tile.row, tile.column + 1),
                          Anchor::start,
                          false,
                          false,
                          kGrey});
  }
  if (tile.row + 1 < layout.rows) {
    mark(1, high.y() - overlap_mm, kGrey);
    shapes.push_back(Text{{high.x() + 3.2, high.y() - overlap_mm - 0.8},
                          small,
                          "edge of " + coordinates(tile.row + 1, tile.column),
                          Anchor::start,
                          false,
                          true,
                          kGrey});
  }
  shapes.push_back(Text{
      {0.5 * (low.x() + high.x()), low.y() - 3.0},
      kFont_mm,
      title + " · row " + std::to_string(tile.row + 1) + " of " + std::to_string(layout.rows) +
          " · column " + std::to_string(tile.column + 1) + " of " + std::to_string(layout.columns),
      Anchor::middle});
  return shapes;
}

Overview overview(const SheetLayout& layout, const std::string& title, double overlap_mm) {
  const double font = 1.2 * kFont_mm;
  const double width = layout.page_width_mm - 2.0 * kMargin_mm;
  Overview page;
  page.below.push_back(Text{{kMargin_mm, kMargin_mm + 2.0 * font},
                            1.8 * font,
                            title + ": how the pages go together",
                            Anchor::start,
                            true});
  double y = add_paragraph(
      page.below, {kMargin_mm, kMargin_mm + 3.0 * font}, width, font,
      "The marker is printed over " + std::to_string(layout.rows * layout.columns) + " pages, " +
          std::to_string(layout.rows) + " rows and " + std::to_string(layout.columns) +
          " columns; each says its own row / column. Print at 100 %. Cut every page along its red "
          "marks, left and top. Then glue it over the strip of " +
          number(overlap_mm, 1) +
          " mm that it shares with the page before: its cut edges lie on the grey marks of that "
          "page, and the pattern goes on without a step.");
  y = add_ruler(page.below, {kMargin_mm, y + font}, width, font) + font;

  const double height = layout.page_height_mm - kMargin_mm - y;
  page.scale = std::min(width / layout.width_mm, height / layout.height_mm);
  page.sheet_mm = {0.5 * (layout.page_width_mm - page.scale * layout.width_mm), y};
  const auto on_page = [&](double sheet_x, double sheet_y) -> Vector2d {
    return page.sheet_mm + page.scale * Vector2d(sheet_x, sheet_y);
  };
  std::vector<Segment> borders;
  for (const Tile& tile : layout.tiles) {
    const Rect& w = tile.window_mm;
    // What is seen of a page once the next ones lie on it.
    const double x1 = tile.column + 1 < layout.columns ? w.x1 - overlap_mm : w.x1;
    const double y1 = tile.row + 1 < layout.rows ? w.y1 - overlap_mm : w.y1;
    const Loop seen{on_page(w.x0, w.y0), on_page(x1, w.y0), on_page(x1, y1), on_page(w.x0, y1)};
    for (std::size_t i = 0; i < seen.size(); ++i)
      borders.push_back({seen[i], seen[(i + 1) % seen.size()]});
    const std::string name = coordinates(tile.row, tile.column);
    const double shown_width = page.scale * (x1 - w.x0);
    const double shown_height = page.scale * (y1 - w.y0);
    const double size = std::min({4.0, 0.5 * shown_width / text_width(name), 0.5 * shown_height});
    const Vector2d centre = on_page(0.5 * (w.x0 + x1), 0.5 * (w.y0 + y1));
    const Vector2d half(0.5 * size * text_width(name) + 0.2 * size, 0.6 * size);
    page.above.push_back(Fill{{{centre - half, centre + Vector2d(half.x(), -half.y()),
                                centre + half, centre + Vector2d(-half.x(), half.y())}},
                              kWhite});
    page.above.push_back(
        Text{centre + Vector2d(0.0, 0.36 * size), size, name, Anchor::middle, false, false, kCut});
  }
  page.above.push_back(Strokes{std::move(borders), 0.2, kCut});
  return page;
}

SheetLayout layout_sheet(const MarkerSet& markers, int parent_index, const SheetOptions& options) {
  return layout(make_sheet(markers, parent_index, options), options);
}

}  // namespace harco
