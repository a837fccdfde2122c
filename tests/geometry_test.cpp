#include "harco/geometry.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <random>
#include <stdexcept>
#include <vector>

#include <gtest/gtest.h>

#include "sample_markers.hpp"

namespace harco {
namespace {

using test::code_with_black;
using test::three_layers;

double area_of(const std::vector<Rect>& coat) {
  double sum = 0.0;
  for (const Rect& rect : coat) sum += rect.area();
  return sum;
}

bool overlap(const Rect& a, const Rect& b) {
  constexpr double kRounding = 1e-9;
  return std::min(a.x1, b.x1) - std::max(a.x0, b.x0) > kRounding &&
         std::min(a.y1, b.y1) - std::max(a.y0, b.y0) > kRounding;
}

/// A parent of 7 m, so that its cells are 1 m wide, with one child in cell 12.
MarkerSet single_child(const LineWidth& line, const std::vector<int>& parent_black,
                       const std::vector<int>& child_black) {
  MarkerSet set;
  set.line = line;
  const Marker child{0, 12, code_with_black(child_black), {}};
  set.parents.push_back({7.0, {0, -1, code_with_black(parent_black), {child}}});
  return set;
}

// --- Areas by hand ------------------------------------------------------------------------------

TEST(InkPlan, AreasOfAPlainParent) {
  MarkerSet set = single_child({}, {1, 5, 6}, {5, 6, 7});
  set.parents[0].marker.children.clear();
  const InkPlan plan = ink_plan(set, 0);
  EXPECT_DOUBLE_EQ(plan.square.area(), 49.0);
  EXPECT_EQ(plan.white.size(), 22U);
  EXPECT_NEAR(area_of(plan.white), 22.0, 1e-12);
  EXPECT_TRUE(plan.black.empty());
}

TEST(InkPlan, OurLineByHand) {
  // Around a child of 1 m: (1 + 2/14)^2 - 1 = 15/49 m^2; three black cells of 1/49 m^2.
  const InkPlan plan = ink_plan(single_child({0.0, 1.0 / 14.0}, {1, 2, 5}, {5, 6, 7}), 0);
  EXPECT_NEAR(area_of(plan.black), 18.0 / 49.0, 1e-12);
}

TEST(InkPlan, ThePapersLineByHand) {
  // From 1 - 1/16 to 1 + 1/16: (17/16)^2 - (15/16)^2 = 64/256 = 0.25 m^2.
  const InkPlan plan = ink_plan(single_child(kPaperLine, {1, 2, 5}, {5, 6, 7}), 0);
  EXPECT_NEAR(area_of(plan.black), 0.25 + 3.0 / 49.0, 1e-12);
}

TEST(InkPlan, ALineEndsAtBlackCells) {
  // Cell 13, right of the child, is black and takes a strip of 1/14 by 1 m of the line; the line's
  // corners lie on the white cells above and below it.
  const InkPlan plan = ink_plan(single_child({0.0, 1.0 / 14.0}, {1, 5, 13}, {5, 6, 7}), 0);
  EXPECT_NEAR(area_of(plan.black), 18.0 / 49.0 - 1.0 / 14.0, 1e-12);
}

TEST(InkPlan, InkThatOverlapsCountsOnce) {
  // A line of 1/4 inside covers the child's ring of 1/7 and 3/28 of its outer inner cells. Black
  // cell 7 (row 1, column 2) is 1/7 wide and lies from 2/7 on, so clear of the line; cell 1 (row 0)
  // lies from 1/7 to 2/7 and is covered down to 1/4.
  const double line = 1.0 - 0.25;
  const InkPlan clear = ink_plan(single_child({0.25, 0.0}, {1, 5, 6}, {7, 8, 12}), 0);
  EXPECT_NEAR(area_of(clear.black), line + 3.0 / 49.0, 1e-12);
  const InkPlan covered = ink_plan(single_child({0.25, 0.0}, {1, 5, 6}, {1, 7, 8}), 0);
  EXPECT_NEAR(area_of(covered.black), line + 2.0 / 49.0 + (2.0 / 7.0 - 0.25) / 7.0, 1e-12);
}

TEST(InkPlan, CoatsAreDisjointAndInkLiesOnWhite) {
  for (const LineWidth line : {LineWidth{}, kPaperLine, LineWidth{0.25, 0.25}}) {
    MarkerSet set = three_layers();
    set.line = line;
    const InkPlan plan = ink_plan(set, 0);
    for (const auto* coat : {&plan.white, &plan.black})
      for (std::size_t i = 0; i < coat->size(); ++i) {
        EXPECT_GT((*coat)[i].area(), 0.0);
        for (std::size_t j = 0; j < i; ++j) EXPECT_FALSE(overlap((*coat)[i], (*coat)[j]));
      }
    for (const Rect& ink : plan.black) {
      double on_white = 0.0;
      for (const Rect& white : plan.white)
        if (overlap(ink, white))
          on_white += (std::min(ink.x1, white.x1) - std::max(ink.x0, white.x0)) *
                      (std::min(ink.y1, white.y1) - std::max(ink.y0, white.y0));
      EXPECT_NEAR(on_white, ink.area(), 1e-12);
    }
  }
}

TEST(InkPlan, RefusesParentsThatAreNotThere) {
  for (const int index : {-1, 1}) {
    EXPECT_THROW(ink_plan(three_layers(), index), std::invalid_argument);
    EXPECT_THROW(InkMap(three_layers(), index), std::invalid_argument);
  }
}

// --- White shares -------------------------------------------------------------------------------

TEST(InkMap, SharesByHand) {
  const InkMap map(single_child({0.0, 1.0 / 14.0}, {1, 2, 5}, {5, 6, 7}), 0);
  // The child's cell (3, 3): 3 black cells of 49. Its neighbour on the left, (2, 3): a strip of
  // 1/14; at (4, 4): the line's corner. Border: black. Cell 0 at (1, 1): white. Cell 1 at (2, 1):
  // black.
  EXPECT_NEAR(map.white_share({3, 3, 4, 4}), 46.0 / 49.0, 1e-12);
  EXPECT_NEAR(map.white_share({2, 3, 3, 4}), 13.0 / 14.0, 1e-12);
  EXPECT_NEAR(map.white_share({4, 4, 5, 5}), 195.0 / 196.0, 1e-12);
  EXPECT_NEAR(map.white_share({0, 0, 1, 1}), 0.0, 1e-12);
  EXPECT_NEAR(map.white_share({1, 1, 2, 2}), 1.0, 1e-12);
  EXPECT_NEAR(map.white_share({2, 1, 3, 2}), 0.0, 1e-12);
  // Paper around the square is white: of 2 x 1 m, half lie outside.
  EXPECT_NEAR(map.white_share({-1, 0, 1, 1}), 0.5, 1e-12);
  EXPECT_NEAR(map.white_share({-9, -9, -8, -8}), 1.0, 1e-12);
  // All of it: 22 white cells less the ink, on 49; and seen from very far.
  EXPECT_NEAR(map.white_share({0, 0, 7, 7}), (22.0 - 18.0 / 49.0) / 49.0, 1e-12);
  EXPECT_NEAR(map.white_share({-1e100, -1e100, 1e100, 1e100}), 1.0, 1e-12);
}

TEST(InkMap, RefusesEmptyRectangles) {
  const InkMap map(three_layers(), 0);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const Rect& rect : {Rect{0, 0, 0, 1}, Rect{1, 0, 0, 1}, Rect{0, 0, nan, 1}})
    EXPECT_THROW(map.white_share(rect), std::invalid_argument);
}

/// The picture from the definition alone, pixel by pixel: white is what lies on a white cell of the
/// parent and on no descendant's black cell or line.
class Raster {
 public:
  Raster(const MarkerSet& set, int size)
      : size_(size), white_(static_cast<std::size_t>(size) * static_cast<std::size_t>(size)) {
    const auto placed = place(set);
    const double pixel = placed.front().side_m / size;
    for (int y = 0; y < size; ++y)
      for (int x = 0; x < size; ++x)
        white_[index(x, y)] =
            is_white(set.line, placed, Eigen::Vector2d((x + 0.5) * pixel, (y + 0.5) * pixel));
  }

  double white_share(int x0, int y0, int x1, int y1) const {
    int count = 0;
    for (int y = y0; y < y1; ++y)
      for (int x = x0; x < x1; ++x) count += white_[index(x, y)];
    return static_cast<double>(count) / ((x1 - x0) * (y1 - y0));
  }

  int size() const { return size_; }

 private:
  std::size_t index(int x, int y) const { return static_cast<std::size_t>(y * size_ + x); }

  static bool on_black_cell(const PlacedMarker& marker, const Eigen::Vector2d& at) {
    const Eigen::Vector2d cell = at / marker.cell_side_m();
    const int column = static_cast<int>(std::floor(cell.x())) - 1;
    const int row = static_cast<int>(std::floor(cell.y())) - 1;
    const int n = marker.code.cells;
    if (column < 0 || row < 0 || column >= n || row >= n) return marker.layer == 1;
    return !marker.code.white(row * n + column);
  }

  static bool is_white(const LineWidth& line, const std::vector<PlacedMarker>& placed,
                       const Eigen::Vector2d& point) {
    for (const PlacedMarker& marker : placed) {
      const Eigen::Vector2d at = point - marker.origin_m;
      if (on_black_cell(marker, at)) return false;
      if (marker.layer == 1) continue;
      // How far outside the square's border, in sides; negative inside.
      const double outside =
          (at / marker.side_m - Eigen::Vector2d(0.5, 0.5)).cwiseAbs().maxCoeff() - 0.5;
      if (outside < line.outside && outside > -line.inside) return false;
    }
    return true;
  }

  int size_;
  std::vector<std::uint8_t> white_;
};

/// Compares all cells of all markers with a raster on whose pixels every edge falls.
void expect_same_as_raster(const MarkerSet& set, int size) {
  const Raster raster(set, size);
  const auto placed = place(set);
  const auto predicted = predicted_cells(set);
  ASSERT_EQ(predicted.size(), placed.size());
  const double pixels_per_metre = size / placed.front().side_m;
  for (std::size_t i = 0; i < placed.size(); ++i) {
    const int across = placed[i].code.cells + 2;
    ASSERT_EQ(predicted[i].size(), static_cast<std::size_t>(across * across));
    const auto pixel = [&](double origin, int cell) {
      return static_cast<int>(
          std::lround((origin + cell * placed[i].cell_side_m()) * pixels_per_metre));
    };
    for (int row = 0; row < across; ++row)
      for (int column = 0; column < across; ++column)
        EXPECT_NEAR(predicted[i][static_cast<std::size_t>(row * across + column)],
                    raster.white_share(pixel(placed[i].origin_m.x(), column),
                                       pixel(placed[i].origin_m.y(), row),
                                       pixel(placed[i].origin_m.x(), column + 1),
                                       pixel(placed[i].origin_m.y(), row + 1)),
                    1e-9)
            << "marker " << i << " row " << row << " column " << column;
  }
}

TEST(PredictedCells, AgreeWithARasterForOurLine) {
  // Side 1/49 of the parent, line 1/14 of that: edges fall on 1/686. The cells of the last layer
  // fall on 1/343.
  MarkerSet set = three_layers();
  set.line = {0.0, 1.0 / 14.0};
  expect_same_as_raster(set, 686);
}

TEST(PredictedCells, AgreeWithARasterForThePapersLine) {
  // Lines at 1/224 of the parent, cells at 1/49: both fall on 1/1568.
  MarkerSet set = three_layers();
  set.line = kPaperLine;
  set.parents[0].marker.children[0].children.clear();
  expect_same_as_raster(set, 1568);
}

TEST(PredictedCells, AgreeWithARasterWhereChildrenShareEdgesAndLinesAreWide) {
  MarkerSet set = three_layers();
  set.line = {1.0 / 14.0, 1.0 / 7.0};
  set.parents[0].marker.children[1].cell = 7;
  set.parents[0].marker.children.push_back({1, 8, code_with_black({1, 2, 3, 8, 9}), {}});
  validate(set);
  expect_same_as_raster(set, 686);
}

TEST(PredictedCells, ListEveryParent) {
  MarkerSet set = three_layers();
  set.parents.push_back({0.3, {1, -1, code_with_black({1, 2, 6}, 6), {}}});
  const auto cells = predicted_cells(set);
  ASSERT_EQ(cells.size(), 5U);
  // 6 x 6 cells and a ring: cell 1 is row 1, column 2 of 8 x 8.
  ASSERT_EQ(cells[4].size(), 64U);
  EXPECT_NEAR(cells[4][1 * 8 + 2], 0.0, 1e-12);
  EXPECT_NEAR(cells[4][1 * 8 + 1], 1.0, 1e-12);
  EXPECT_NEAR(cells[4][0], 0.0, 1e-12);
}

TEST(InkMap, SharesOfPartsAddUp) {
  const InkMap map(three_layers(), 0);
  std::mt19937_64 random(2);
  std::uniform_real_distribution<double> unit(-0.2, 1.8);
  for (int trial = 0; trial < 500; ++trial) {
    const auto [x0, x2] = std::minmax({unit(random), unit(random)});
    const auto [y0, y1] = std::minmax({unit(random), unit(random)});
    const double x1 = (x0 + x2) / 2.0;
    const double left = map.white_share({x0, y0, x1, y1});
    const double right = map.white_share({x1, y0, x2, y1});
    EXPECT_NEAR(map.white_share({x0, y0, x2, y1}), (left + right) / 2.0, 1e-7);
  }
}

}  // namespace
}  // namespace harco
