#include "harco/draw.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <random>
#include <set>
#include <sstream>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "shell.hpp"

namespace harco {
namespace {

using test::has_program;
using test::TemporaryFolder;

/// Codes that differ in every turn, white in the given cells.
class Codes {
 public:
  explicit Codes(std::uint64_t seed) : random_(seed) {}

  Code next(int cells, const std::vector<int>& white) {
    for (;;) {
      Code code{cells, 0};
      for (int cell = 0; cell < code.size(); ++cell)
        if (random_() % 4 != 0) code.bits |= std::uint64_t{1} << cell;
      for (const int cell : white) code.bits |= std::uint64_t{1} << cell;
      const bool fresh = std::none_of(known_.begin(), known_.end(), [&](const Code& other) {
        return other.cells == cells && distance(other, code) == 0;
      });
      if (!fresh || inner_distance(code) == 0) continue;
      known_.push_back(code);
      return code;
    }
  }

 private:
  std::mt19937_64 random_;
  std::vector<Code> known_;
};

/// One parent; layer k has children of cells[k - 1] in every marker of the layer above.
MarkerSet make_set(double side_m, const std::vector<int>& n, const std::vector<int>& children,
                   const LineWidth& line) {
  Codes codes(42);
  int next_id = 0;
  const std::function<Marker(std::size_t, int)> make = [&](std::size_t layer, int cell) {
    Marker marker;
    marker.cell = cell;
    marker.id = layer == 0 ? 3 : next_id++;
    const bool last = layer + 1 == n.size();
    marker.code = codes.next(n[layer], last ? std::vector<int>{} : children);
    if (!last)
      for (const int child : children) marker.children.push_back(make(layer + 1, child));
    return marker;
  };
  MarkerSet set;
  set.cells = n.front();
  set.line = line;
  set.parents.push_back({side_m, make(0, -1)});
  validate(set);
  return set;
}

const std::vector<int> kQuincunx{0, 4, 12, 20, 24};

/// Whether a point of the parent's plane is black, from the tree alone. Lengths in sides.
class Truth {
 public:
  explicit Truth(const MarkerSet& set) : set_(set), placed_(place(set)) {}

  bool black(double x, double y) const {
    const PlacedMarker& root = placed_.front();
    if (x < 0 || y < 0 || x > root.side_m || y > root.side_m) return false;
    if (cell_is_black(root, x, y)) return true;
    for (const PlacedMarker& child : placed_) {
      if (child.layer == 1) continue;
      const double u = (x - child.origin_m.x()) / child.side_m;
      const double v = (y - child.origin_m.y()) / child.side_m;
      const double out = set_.line.outside;
      const double in = set_.line.inside;
      const bool in_outer = u > -out && v > -out && u < 1 + out && v < 1 + out;
      const bool in_inner = u > in && v > in && u < 1 - in && v < 1 - in;
      if (in_outer && !in_inner) return true;
      if (u > 0 && v > 0 && u < 1 && v < 1 && inner_cell_is_black(child, u, v)) return true;
    }
    return false;
  }

 private:
  static bool inner_cell_is_black(const PlacedMarker& marker, double u, double v) {
    const int n = marker.code.cells;
    const int column = static_cast<int>(std::floor(u * (n + 2))) - 1;
    const int row = static_cast<int>(std::floor(v * (n + 2))) - 1;
    if (column < 0 || row < 0 || column >= n || row >= n) return false;
    return !marker.code.white(row * n + column);
  }

  static bool cell_is_black(const PlacedMarker& root, double x, double y) {
    const double u = x / root.side_m;
    const double v = y / root.side_m;
    const double ring = 1.0 / (root.code.cells + 2);
    const bool in_ring = u < ring || v < ring || u > 1 - ring || v > 1 - ring;
    return in_ring || inner_cell_is_black(root, u, v);
  }

  MarkerSet set_;
  std::vector<PlacedMarker> placed_;
};

void expect_whole(double value) { EXPECT_NEAR(value, std::round(value), 1e-9 * std::abs(value)); }

void expect_drawn_as(const Raster& drawn, MarkerSet set) {
  set.line = drawn.line;
  const Truth truth(set);
  int wrong = 0;
  for (int y = 0; y < drawn.image.height; ++y)
    for (int x = 0; x < drawn.image.width; ++x) {
      const bool black = truth.black((x + 0.5 - drawn.origin_px.x()) / drawn.pixels_per_metre,
                                     (y + 0.5 - drawn.origin_px.y()) / drawn.pixels_per_metre);
      wrong += drawn.image.row(y)[x] != (black ? 0 : 255);
    }
  EXPECT_EQ(wrong, 0);
}

// --- Raster -----------------------------------------------------------------------------------

TEST(Raster, DrawsATinyMarkerAsByHand) {
  MarkerSet set;
  set.cells = 3;
  Marker marker;
  marker.code = parse_code("110100111");
  set.parents.push_back({0.5, marker});
  RasterOptions options;
  options.pixels_per_cell = 1;
  const Raster drawn = raster(set, 0, options);
  const char* expected[] = {"       ",  //
                            " ##### ",  //
                            " #  ## ",  //
                            " # ### ",  //
                            " #   # ",  //
                            " ##### ",  //
                            "       "};
  ASSERT_EQ(drawn.image.width, 7);
  ASSERT_EQ(drawn.image.height, 7);
  for (int y = 0; y < 7; ++y)
    for (int x = 0; x < 7; ++x)
      EXPECT_EQ(drawn.image.row(y)[x], expected[y][x] == '#' ? 0 : 255) << x << " " << y;
  EXPECT_EQ(drawn.origin_px, Eigen::Vector2i(1, 1));
  EXPECT_EQ(drawn.pixels_per_metre, 10.0);
}

TEST(Raster, DrawsAChildAsByHand) {
  MarkerSet set;
  set.cells = 3;
  set.line = {0.0, 0.2};
  Marker child;
  child.code = parse_code("101111110");
  child.cell = 4;
  Marker marker;
  marker.code = parse_code("110111111");
  marker.children = {child};
  set.parents.push_back({1.0, marker});
  RasterOptions options;
  options.pixels_per_cell = 1;
  const Raster drawn = raster(set, 0, options);
  ASSERT_EQ(drawn.image.width, 35);
  // The square's pixels 9 to 18 across and 5 to 16 down: above, the parent's white and black cell;
  // then the child's line, its white ring and its two black cells.
  const char* expected[] = {"      ####",  //
                            "      ####",  //
                            "      ####",  //
                            "      ####",  //
                            "##########",  //
                            "#     #   ",  //
                            "#  #  #   ",  //
                            "#     #   ",  //
                            "#   # #   ",  //
                            "#     #   ",  //
                            "#######   ",  //
                            "          "};
  for (int y = 0; y < 12; ++y)
    for (int x = 0; x < 10; ++x)
      EXPECT_EQ(drawn.image.row(drawn.origin_px.y() + 5 + y)[drawn.origin_px.x() + 9 + x],
                expected[y][x] == '#' ? 0 : 255)
          << x << " " << y;
}

TEST(Raster, IsTheTreePixelByPixel) {
  const struct {
    std::vector<int> n;
    std::vector<int> children;
    LineWidth line;
    double side_m;
  } cases[] = {
      {{5}, {}, {}, 0.2},
      {{5, 5}, kQuincunx, {}, 0.16},
      {{5, 5, 5}, kQuincunx, {}, 1.6},
      {{5, 5, 5}, kQuincunx, {0.0, 0.0714}, 1.6},
      {{5, 5}, kQuincunx, kPaperLine, 1.0 / 3.0},
      {{4, 4, 4}, {0, 3, 5}, {1.0 / 12.0, 0.0}, 0.7},
      {{4, 6, 3}, {0, 2, 8}, {0.05, 0.05}, 0.9},
      {{6, 6}, {0, 1, 2, 7, 35}, {0.0, 0.0625}, 0.25},  // some share edges
  };
  for (const auto& c : cases) {
    const MarkerSet set = make_set(c.side_m, c.n, c.children, c.line);
    RasterOptions options;
    options.min_size_px = 300;
    const Raster drawn = raster(set, 0, options);
    SCOPED_TRACE("width " + std::to_string(drawn.image.width));
    expect_drawn_as(drawn, set);
  }
}

TEST(Raster, AgreesWithTheInkPlan) {
  const MarkerSet set = make_set(0.49, {5, 5}, kQuincunx, LineWidth{});
  RasterOptions options;
  options.min_size_px = 0;
  const Raster drawn = raster(set, 0, options);
  const InkMap ink(set, 0);
  for (int y = 0; y < drawn.image.height; ++y)
    for (int x = 0; x < drawn.image.width; ++x) {
      const double x0 = (x - drawn.origin_px.x()) / drawn.pixels_per_metre;
      const double y0 = (y - drawn.origin_px.y()) / drawn.pixels_per_metre;
      const double size = 1.0 / drawn.pixels_per_metre;
      EXPECT_NEAR(ink.white_share({x0, y0, x0 + size, y0 + size}), drawn.image.row(y)[x] / 255.0,
                  1e-6);
    }
}

TEST(Raster, TakesTheFewestPixelsThatAreExact) {
  RasterOptions free;
  free.min_size_px = 0;
  // Cells of 2 pixels, so that 1/14 of a child's 7 cells is a pixel; 7³ cells and the quiet zone.
  EXPECT_EQ(raster(make_set(1.6, {5, 5, 5}, kQuincunx, {}), 0, free).image.width, 686 * 9 / 7);
  EXPECT_EQ(raster(make_set(1.6, {5, 5, 5}, kQuincunx, {0, 0.0714}), 0, free).image.width,
            686 * 9 / 7);
  // 1/32 of 7 cells is whole from 32 pixels a cell.
  const Raster paper_line = raster(make_set(1.6, {5, 5}, kQuincunx, kPaperLine), 0, free);
  EXPECT_EQ(paper_line.image.width, 32 * 49 * 9 / 7);
  EXPECT_EQ(paper_line.line.inside, 1.0 / 32.0);
  // Without lines a pixel a cell.
  EXPECT_EQ(raster(make_set(1.6, {5}, {}, {}), 0, free).image.width, 9);
  EXPECT_GE(raster(make_set(1.6, {5}, {}, {}), 0).image.width, 1000);
  EXPECT_LT(raster(make_set(1.6, {5}, {}, {}), 0).image.width, 1009);
}

TEST(Raster, EverythingIsAWholeNumber) {
  for (const double side : {0.1, 1.6, 1.0 / 3.0, 0.0571})
    for (const int n : {3, 4, 5, 6, 7, 8})
      for (const int layers : {1, 2, 3}) {
        const std::vector<int> tree(static_cast<std::size_t>(layers), n);
        const MarkerSet set = make_set(side, tree, {0, n * n - 1}, LineWidth{});
        const Raster drawn = raster(set, 0);
        const double side_px = side * drawn.pixels_per_metre;
        expect_whole(side_px);
        EXPECT_NEAR(drawn.origin_px.x(), side_px / (n + 2), 1e-6);
        EXPECT_EQ(drawn.origin_px.x(), drawn.origin_px.y());
        EXPECT_NEAR(drawn.image.width, side_px + 2 * drawn.origin_px.x(), 1e-6);
        EXPECT_EQ(drawn.image.width, drawn.image.height);
        const double child_px = side_px / std::pow(n + 2, layers - 1);
        expect_whole(child_px / (n + 2));
        if (layers > 1) expect_whole(child_px * drawn.line.outside);
      }
}

TEST(Raster, RoundsLinesThatWouldNeedTooLargeAPicture) {
  const MarkerSet set = make_set(1.0, {5, 5}, kQuincunx, kPaperLine);
  RasterOptions options;
  options.max_size_px = 1000;
  const Raster drawn = raster(set, 0, options);
  EXPECT_LE(drawn.image.width, 1000);
  expect_whole(drawn.line.inside * drawn.pixels_per_metre / 7.0);
  EXPECT_NEAR(drawn.line.inside, 1.0 / 32.0, kLineRounding / 32.0);
  EXPECT_NE(drawn.line.inside, 1.0 / 32.0);
}

TEST(Raster, RefusesWhatItCannotDraw) {
  const MarkerSet set = make_set(1.0, {5, 5, 5}, kQuincunx, {});
  const auto refuses = [&](int per_cell, int least, int most) {
    RasterOptions options;
    options.pixels_per_cell = per_cell;
    options.min_size_px = least;
    options.max_size_px = most;
    EXPECT_THROW(raster(set, 0, options), std::invalid_argument)
        << per_cell << " " << least << " " << most;
  };
  refuses(0, 0, 881);   // needs 882
  refuses(0, 0, 0);     //
  refuses(-1, 0, 900);  //
  refuses(0, -1, 900);
  refuses(1, 0, 16384);    // lines of half a pixel
  refuses(100, 0, 16384);  // 44 100 pixels
  EXPECT_THROW(raster(set, 1), std::invalid_argument);
  EXPECT_THROW(raster(set, -1), std::invalid_argument);
  MarkerSet flat = set;
  flat.parents[0].side_m = 0.0;
  EXPECT_THROW(raster(flat, 0), std::invalid_argument);
  RasterOptions options;
  options.max_size_px = 500;
  try {
    raster(set, 0, options);
    FAIL();
  } catch (const std::invalid_argument& error) {
    EXPECT_NE(std::string(error.what()).find("882"), std::string::npos) << error.what();
  }
}

// --- Sheets -----------------------------------------------------------------------------------

TEST(Paper, KnowsItsNames) {
  EXPECT_EQ(paper("A4").width_mm, 210.0);
  EXPECT_EQ(paper("a4").height_mm, 297.0);
  EXPECT_EQ(paper("letter").height_mm, 279.4);
  EXPECT_TRUE(paper("fit").fits_sheet());
  EXPECT_THROW(paper("a9"), std::invalid_argument);
  EXPECT_THROW(paper(""), std::invalid_argument);
  for (const std::string& name : paper_names()) EXPECT_NO_THROW(paper(name));
}

/// Picks a number out of a text behind a mark.
double number_after(const std::string& text, const std::string& mark) {
  const std::size_t at = text.find(mark);
  if (at == std::string::npos) throw std::runtime_error("no " + mark);
  return std::stod(text.substr(at + mark.size()));
}

TEST(Svg, OutlineIsTheRasterToScale) {
  // Filled by hand, row by row: needs no other program.
  const MarkerSet set = make_set(0.1, {5, 5, 5}, kQuincunx, LineWidth{});
  const std::string svg = draw_svg(set, 0);
  const SheetLayout layout = layout_sheet(set, 0);
  EXPECT_NEAR(number_after(svg, "width=\""), layout.width_mm, 1e-4);
  EXPECT_NEAR(number_after(svg, "height=\""), layout.height_mm, 1e-4);
  EXPECT_NEAR(number_after(svg, "viewBox=\"0 0 "), layout.width_mm, 1e-4);

  struct Edge {
    double x, y0, y1;
  };
  std::vector<Edge> edges;  // upright ones
  std::istringstream path(svg.substr(svg.find(" d=\"") + 4));
  double x = 0, y = 0, first_x = 0, first_y = 0;
  for (char command = 0; path >> command && command != '"';) {
    const double before_y = y;
    if (command == 'M') {
      path >> x >> y;
      first_x = x;
      first_y = y;
    } else if (command == 'H') {
      path >> x;
    } else if (command == 'V') {
      path >> y;
      edges.push_back({x, before_y, y});
    } else {
      ASSERT_EQ(command, 'Z');
      if (first_x == x)
        edges.push_back({x, y, first_y});
      else
        ASSERT_EQ(first_y, y);
    }
  }
  RasterOptions options;
  options.min_size_px = 0;
  const Raster drawn = raster(set, 0, options);
  const double pixel_mm = 1000.0 / drawn.pixels_per_metre;
  int wrong = 0;
  for (int row = 0; row < drawn.image.height; ++row) {
    const double at_y = layout.marker_mm.y() + (row + 0.5 - drawn.origin_px.y()) * pixel_mm;
    std::vector<std::pair<double, int>> crossings;
    for (const Edge& edge : edges)
      if ((edge.y0 < at_y) != (edge.y1 < at_y))
        crossings.emplace_back(edge.x, edge.y0 < edge.y1 ? 1 : -1);
    std::sort(crossings.begin(), crossings.end());
    std::size_t next = 0;
    int winding = 0;
    for (int column = 0; column < drawn.image.width; ++column) {
      const double at_x = layout.marker_mm.x() + (column + 0.5 - drawn.origin_px.x()) * pixel_mm;
      for (; next < crossings.size() && crossings[next].first < at_x; ++next)
        winding += crossings[next].second;
      // Odd and not zero must be the same, whichever rule a viewer follows.
      EXPECT_LE(std::abs(winding), 1);
      wrong += (winding != 0) != (drawn.image.row(row)[column] == 0);
    }
  }
  EXPECT_EQ(wrong, 0);
}

/// A grey picture that pdftoppm wrote.
struct Page {
  Image image;
  double pixels_per_mm = 0.0;
  bool black(double x_mm, double y_mm) const { return value(x_mm, y_mm) < 128; }
  int value(double x_mm, double y_mm) const {
    return image.row(
        static_cast<int>(y_mm * pixels_per_mm))[static_cast<int>(x_mm * pixels_per_mm)];
  }
};

std::vector<Page> rendered_pages(const std::filesystem::path& pdf, double dpi) {
  const TemporaryFolder folder;
  const test::CommandResult done =
      test::run_shell("pdftoppm -gray -r " + std::to_string(dpi) + " " + pdf.string() + " " +
                      (folder / "page").string());
  EXPECT_EQ(done.status, 0) << done.errors;
  EXPECT_EQ(done.errors, "");
  std::set<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(folder.path()))
    files.insert(entry.path());
  std::vector<Page> pages;
  for (const auto& file : files) {
    std::istringstream in(test::read_file(file));
    std::string magic;
    int width = 0, height = 0, most = 0;
    in >> magic >> width >> height >> most;
    in.get();
    Page page;
    page.image = Image(width, height);
    in.read(reinterpret_cast<char*>(page.image.pixels.data()),
            static_cast<std::streamsize>(page.image.pixels.size()));
    page.pixels_per_mm = dpi / 25.4;
    pages.push_back(std::move(page));
  }
  return pages;
}

/// Number of points near the four corners of the raster's pixels that a tile shows and the page
/// doesn't. The points keep 15 % of a pixel from its edges.
int differences(const Raster& drawn, const SheetLayout& layout, const Tile& tile,
                const Page& page) {
  const double pixel_mm = 1000.0 / drawn.pixels_per_metre;
  const double keep_mm = 2.0 / page.pixels_per_mm;
  int wrong = 0;
  for (int y = 0; y < drawn.image.height; ++y)
    for (int x = 0; x < drawn.image.width; ++x)
      for (const double u : {0.15, 0.85})
        for (const double v : {0.15, 0.85}) {
          const double sheet_x = layout.marker_mm.x() + (x + u - drawn.origin_px.x()) * pixel_mm;
          const double sheet_y = layout.marker_mm.y() + (y + v - drawn.origin_px.y()) * pixel_mm;
          const Rect& w = tile.window_mm;
          if (sheet_x < w.x0 + keep_mm || sheet_x > w.x1 - keep_mm || sheet_y < w.y0 + keep_mm ||
              sheet_y > w.y1 - keep_mm)
            continue;
          const bool black =
              page.black(tile.page_mm.x() + sheet_x - w.x0, tile.page_mm.y() + sheet_y - w.y0);
          wrong += black != (drawn.image.row(y)[x] == 0);
        }
  return wrong;
}

Raster smallest_raster(const MarkerSet& set) {
  RasterOptions options;
  options.min_size_px = 0;
  return raster(set, 0, options);
}

TEST(Pdf, RendersToTheRaster) {
  if (!has_program("pdftoppm")) GTEST_SKIP() << "pdftoppm is not installed";
  const MarkerSet set = make_set(0.1, {5, 5, 5}, kQuincunx, LineWidth{});
  for (const char* page : {"fit", "a4", "letter"}) {
    SheetOptions options;
    options.page = paper(page);
    const TemporaryFolder folder;
    test::write_file(folder / "m.pdf", draw_pdf(set, 0, options));
    const SheetLayout layout = layout_sheet(set, 0, options);
    const double dpi = 1200.0;
    const std::vector<Page> pages = rendered_pages(folder / "m.pdf", dpi);
    ASSERT_EQ(pages.size(), 1u);
    EXPECT_NEAR(pages[0].image.width / pages[0].pixels_per_mm, layout.page_width_mm, 0.1);
    EXPECT_NEAR(pages[0].image.height / pages[0].pixels_per_mm, layout.page_height_mm, 0.1);
    ASSERT_EQ(layout.tiles.size(), 1u);
    EXPECT_EQ(differences(smallest_raster(set), layout, layout.tiles[0], pages[0]), 0) << page;
  }
}

TEST(Pdf, TilesRenderToTheRaster) {
  if (!has_program("pdftoppm")) GTEST_SKIP() << "pdftoppm is not installed";
  const MarkerSet set = make_set(0.2, {5, 5}, kQuincunx, LineWidth{});
  SheetOptions options;
  options.page = paper("a5");
  const TemporaryFolder folder;
  test::write_file(folder / "m.pdf", draw_pdf(set, 0, options));
  const SheetLayout layout = layout_sheet(set, 0, options);
  const std::vector<Page> pages = rendered_pages(folder / "m.pdf", 150.0);
  ASSERT_GT(layout.tiles.size(), 3u);
  ASSERT_EQ(pages.size(), layout.tiles.size() + 1);
  const Raster drawn = smallest_raster(set);
  for (std::size_t i = 0; i < layout.tiles.size(); ++i)
    EXPECT_EQ(differences(drawn, layout, layout.tiles[i], pages[i + 1]), 0) << "tile " << i;
}

TEST(Svg, RendersToTheRaster) {
  if (!has_program("rsvg-convert") || !has_program("pdftoppm"))
    GTEST_SKIP() << "rsvg-convert or pdftoppm is not installed";
  const MarkerSet set = make_set(0.1, {5, 5, 5}, kQuincunx, LineWidth{});
  SheetOptions options;
  options.set_name = "a <b> & \"c\" (d) \\ ü €";
  const TemporaryFolder folder;
  test::write_file(folder / "m.svg", draw_svg(set, 0, options));
  const test::CommandResult done = test::run_shell(
      "rsvg-convert -f pdf -o " + (folder / "m.pdf").string() + " " + (folder / "m.svg").string());
  ASSERT_EQ(done.status, 0) << done.errors;
  const SheetLayout layout = layout_sheet(set, 0, options);
  const std::vector<Page> pages = rendered_pages(folder / "m.pdf", 1200.0);
  ASSERT_EQ(pages.size(), 1u);
  EXPECT_NEAR(pages[0].image.width / pages[0].pixels_per_mm, layout.width_mm, 0.1);
  EXPECT_NEAR(pages[0].image.height / pages[0].pixels_per_mm, layout.height_mm, 0.1);
  EXPECT_EQ(differences(smallest_raster(set), layout, layout.tiles[0], pages[0]), 0);
}

TEST(Pdf, SaysWhatItIs) {
  if (!has_program("pdftotext")) GTEST_SKIP() << "pdftotext is not installed";
  const MarkerSet set = make_set(0.16, {5, 5}, kQuincunx, LineWidth{});
  SheetOptions options;
  options.set_name = "deck (north) \\ Süd";
  options.page = paper("a5");
  const TemporaryFolder folder;
  test::write_file(folder / "m.pdf", draw_pdf(set, 0, options));
  const test::CommandResult text =
      test::run_shell("pdftotext -raw " + (folder / "m.pdf").string() + " -");
  ASSERT_EQ(text.status, 0);
  for (const char* part : {"Marker 3 · side 160 mm", "deck (north) \\ Süd: 2 layers of 5 × 5 cells",
                           "This ruler must measure 100 mm", "row 1 of 2 · column 2 of 2"})
    EXPECT_NE(text.output.find(part), std::string::npos) << part << "\n" << text.output;
}

TEST(Pdf, TableOfObjectsIsRight) {
  const MarkerSet set = make_set(0.5, {5, 5}, kQuincunx, LineWidth{});
  SheetOptions options;
  options.page = paper("a4");
  const std::string pdf = draw_pdf(set, 0, options);
  ASSERT_EQ(pdf.rfind("%PDF-1.", 0), 0u);
  const std::size_t start = pdf.rfind("startxref\n");
  const auto table = static_cast<std::size_t>(std::stoul(pdf.substr(start + 10)));
  ASSERT_EQ(pdf.compare(table, 5, "xref\n"), 0);
  std::istringstream rows(pdf.substr(table + 5));
  std::size_t first = 0, count = 0;
  rows >> first >> count;
  EXPECT_EQ(first, 0u);
  EXPECT_EQ(number_after(pdf.substr(table), "/Size "), static_cast<double>(count));
  const std::size_t first_row = pdf.find('\n', table + 5) + 1;
  for (std::size_t object = 0; object < count; ++object) {
    const std::string row = pdf.substr(first_row + 20 * object, 20);
    EXPECT_EQ(row.back(), '\n');
    EXPECT_EQ(row[17], object == 0 ? 'f' : 'n');
    if (object == 0) continue;
    const std::string name = std::to_string(object) + " 0 obj\n";
    EXPECT_EQ(pdf.compare(std::stoul(row.substr(0, 10)), name.size(), name), 0) << object;
  }
  // Streams are as long as they say.
  int streams = 0;
  for (std::size_t at = pdf.find("stream\n"); at != std::string::npos;
       at = pdf.find("stream\n", at)) {
    const std::size_t dictionary = pdf.rfind("/Length ", at);
    const std::size_t end = at + 7 + std::stoul(pdf.substr(dictionary + 8));
    ASSERT_EQ(pdf.compare(end, 10, "\nendstream"), 0);
    at = end + 11;
    ++streams;
  }
  // The sheet, the overview and every tile.
  EXPECT_EQ(streams, 2 + static_cast<int>(layout_sheet(set, 0, options).tiles.size()));
}

TEST(Layout, TilesCoverTheSheetAndOverlap) {
  for (const double side : {0.15, 0.3, 1.6})
    for (const char* name : {"a4", "a6", "letter"})
      for (const double overlap : {0.0, 10.0, 25.0}) {
        const MarkerSet set = make_set(side, {5, 5}, kQuincunx, LineWidth{});
        SheetOptions options;
        options.page = paper(name);
        options.overlap_mm = overlap;
        const SheetLayout layout = layout_sheet(set, 0, options);
        ASSERT_EQ(static_cast<int>(layout.tiles.size()), layout.rows * layout.columns);
        // Windows form a grid: it covers if its rows and its columns do.
        for (const Tile& tile : layout.tiles) {
          const Rect& w = tile.window_mm;
          EXPECT_EQ(w.x0 == 0.0, tile.column == 0);
          EXPECT_EQ(w.y0 == 0.0, tile.row == 0);
          EXPECT_EQ(w.x1 == layout.width_mm, tile.column + 1 == layout.columns);
          EXPECT_EQ(w.y1 == layout.height_mm, tile.row + 1 == layout.rows);
          EXPECT_GT(w.width(), 0.0);
          EXPECT_GT(w.height(), 0.0);
          const auto index = static_cast<std::size_t>(tile.row * layout.columns + tile.column);
          EXPECT_EQ(&layout.tiles[index], &tile);
          if (tile.column > 0) {
            EXPECT_NEAR(layout.tiles[index - 1].window_mm.x1 - w.x0, overlap, 1e-9);
          }
          if (tile.row > 0) {
            EXPECT_NEAR(
                layout.tiles[index - static_cast<std::size_t>(layout.columns)].window_mm.y1 - w.y0,
                overlap, 1e-9);
          }
          // Nothing is printed where printers don't reach.
          if (layout.tiles.size() == 1) continue;
          EXPECT_GE(tile.page_mm.x(), 10.0);
          EXPECT_GE(tile.page_mm.y(), 10.0);
          EXPECT_LE(tile.page_mm.x() + w.width(), layout.page_width_mm - 10.0 + 1e-9);
          EXPECT_LE(tile.page_mm.y() + w.height(), layout.page_height_mm - 10.0 + 1e-9);
        }
      }
}

TEST(Layout, OneHundredAndFortyMillimetresFitA4) {
  const MarkerSet set = make_set(0.14, {5, 5}, kQuincunx, LineWidth{});
  SheetOptions options;
  options.page = paper("a4");
  const SheetLayout layout = layout_sheet(set, 0, options);
  EXPECT_EQ(layout.tiles.size(), 1u);
  EXPECT_EQ(layout.page_width_mm, 210.0);
  // Centred: as much room on the left as on the right.
  EXPECT_NEAR(layout.tiles[0].page_mm.x() + layout.marker_mm.x() + 70.0, 105.0, 1e-9);
}

TEST(Layout, RefusesNonsense) {
  const MarkerSet set = make_set(0.5, {5, 5}, kQuincunx, LineWidth{});
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto refuses = [&](const Paper& page, double overlap) {
    SheetOptions options;
    options.page = page;
    options.overlap_mm = overlap;
    EXPECT_THROW(layout_sheet(set, 0, options), std::invalid_argument);
    EXPECT_THROW(draw_pdf(set, 0, options), std::invalid_argument);
  };
  refuses(paper("a4"), -1.0);
  refuses(paper("a4"), nan);
  refuses(paper("a4"), 180.0);
  refuses({nan, 200.0}, 10.0);
  refuses({-210.0, 297.0}, 10.0);
  refuses({210.0, 0.0}, 10.0);
  refuses({20.0, 20.0}, 0.0);
  EXPECT_THROW(draw_svg(set, 7), std::invalid_argument);
  EXPECT_THROW(draw_pdf(MarkerSet{}, 0), std::invalid_argument);
}

TEST(Warnings, NameThinLinesAndSharedEdges) {
  EXPECT_TRUE(print_warnings(make_set(0.2, {5, 5}, kQuincunx, LineWidth{})).empty());
  const auto thin = print_warnings(make_set(0.2, {5, 5, 5, 5}, {0}, LineWidth{}));
  ASSERT_EQ(thin.size(), 1u);  // 0.2 / 343 / 14 m
  EXPECT_NE(thin[0].find("0.042 mm"), std::string::npos) << thin[0];
  // 4 and 5 stand at opposite ends of their rows; 4 and 9 share an edge.
  EXPECT_TRUE(print_warnings(make_set(0.2, {5, 5}, {4, 5}, LineWidth{})).empty());
  const auto shared = print_warnings(make_set(0.2, {5, 5}, {4, 9}, LineWidth{}));
  ASSERT_EQ(shared.size(), 1u);
  EXPECT_NE(shared[0].find("share an edge"), std::string::npos);
}

}  // namespace
}  // namespace harco
