#include "harco/layout.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <set>
#include <stdexcept>
#include <vector>

#include <gtest/gtest.h>

#include "harco/dictionary.hpp"
#include "harco/draw.hpp"
#include "harco/geometry.hpp"

namespace harco {
namespace {

CodeSearch quick() {
  CodeSearch search;
  search.effort = 0.02;
  return search;
}

const MarkerSet& coded_carpet() {
  static const MarkerSet set = generate_codes(without_codes(carpet(5), 1, 63.0), quick()).markers;
  return set;
}

bool inside(const PlacedMarker& marker, const Eigen::Vector2d& point, double margin = 0.0) {
  const Eigen::Vector2d at = (point - marker.origin_m) / marker.side_m;
  return at.minCoeff() > -margin && at.maxCoeff() < 1.0 + margin;
}

bool cell_is_white(const PlacedMarker& marker, const Eigen::Vector2d& point) {
  const Eigen::Vector2d at = (point - marker.origin_m) / marker.cell_side_m();
  const int column = static_cast<int>(at.x()) - 1;
  const int row = static_cast<int>(at.y()) - 1;
  const int n = marker.code.cells;
  if (column < 0 || row < 0 || column >= n || row >= n) return marker.layer > 1;
  return marker.code.white(row * n + column);
}

TEST(UniformLayout, HasTheChildrenAskedFor) {
  const Marker layout = uniform_layout(6, {{1, 2}, {35}});
  EXPECT_EQ(layout.code.cells, 6);
  ASSERT_EQ(layout.children.size(), 2U);
  EXPECT_EQ(layout.children[1].cell, 2);
  ASSERT_EQ(layout.children[1].children.size(), 1U);
  EXPECT_EQ(layout.children[1].children[0].cell, 35);
  EXPECT_TRUE(layout.children[1].children[0].children.empty());
  EXPECT_TRUE(uniform_layout(4, {}).children.empty());
  EXPECT_THROW(uniform_layout(9, {}), std::invalid_argument);
  EXPECT_THROW(carpet(3), std::invalid_argument);
}

TEST(Carpet, CountsByHand) {
  // 13 of 25 cells have a child that has nine; the other 12 have eight and one that has one.
  EXPECT_EQ(place(without_codes(carpet(5), 1, 1.0)).size(), 1U + 13U * 10U + 12U * 10U);
  // 18 and 18 of 36.
  EXPECT_EQ(place(without_codes(carpet(6), 2, 1.0)).size(), 2U * (1U + 36U * 10U));
}

TEST(Carpet, SmallChildrenStandTwoSidesApart) {
  // A parent of 63 m: cells of 9 m from 9 to 54, small children of 1 m in every third metre.
  std::set<std::pair<int, int>> places;
  for (const PlacedMarker& marker : place(without_codes(carpet(5), 1, 63.0))) {
    if (std::abs(marker.side_m - 1.0) > 1e-9) continue;
    places.emplace(std::lround(marker.origin_m.x()), std::lround(marker.origin_m.y()));
  }
  std::set<std::pair<int, int>> expected;
  for (int x = 10; x < 54; x += 3)
    for (int y = 10; y < 54; y += 3) {
      // The middles of every other cell hold a larger one.
      const bool middle = x % 9 == 4 && y % 9 == 4;
      if (!middle || (x / 9 + y / 9) % 2 == 0) expected.emplace(x, y);
    }
  EXPECT_EQ(places, expected);
}

TEST(Carpet, CodesAreDifferentAndAsFarApartAsReported) {
  const CodedMarkers made = generate_codes(without_codes(carpet(5), 2, 1.0), quick());
  ASSERT_EQ(made.dictionaries.size(), 3U);
  EXPECT_EQ(made.dictionaries[0].count, 2);
  EXPECT_EQ(made.dictionaries[1].count, 450);
  EXPECT_EQ(made.dictionaries[2].count, 50);
  std::vector<std::vector<Code>> codes(3);
  std::set<int> ids;
  for (const PlacedMarker& marker : place(made.markers)) {
    codes[marker.layer == 1 ? 0 : marker.code.cells == 5 ? 1 : 2].push_back(marker.code);
    if (marker.layer == 1) continue;
    EXPECT_TRUE(ids.insert(marker.id).second);
    const BlackRange black = default_child_black(marker.code.cells);
    EXPECT_GE(marker.code.black_count(), black.least);
    EXPECT_LE(marker.code.black_count(), black.most);
  }
  EXPECT_EQ(*ids.rbegin(), 499);
  for (std::size_t i = 0; i < 3; ++i)
    EXPECT_EQ(dictionary_distance(codes[i]), made.dictionaries[i].distance);
  EXPECT_GE(made.dictionaries[1].distance, 3);
  EXPECT_GE(made.dictionaries[2].distance, 7);
}

/// What is seen at a point: a line where there is one and no sibling, else the cell of the smallest
/// marker there.
TEST(Carpet, InkIsWhereTheTreeHasIt) {
  const MarkerSet& set = coded_carpet();
  const std::vector<PlacedMarker> placed = place(set);
  const InkMap ink(set, 0);
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> unit(9.0, 54.0);
  for (int i = 0; i < 20000; ++i) {
    const Eigen::Vector2d point(unit(random), unit(random));
    const PlacedMarker* smallest = &placed.front();
    for (const PlacedMarker& marker : placed)
      if (inside(marker, point) && marker.side_m < smallest->side_m) smallest = &marker;
    bool white = cell_is_white(*smallest, point);
    for (const PlacedMarker& marker : placed) {
      if (marker.layer == 1 || inside(marker, point) || !inside(marker, point, set.line.outside))
        continue;
      const bool sibling =
          std::any_of(placed.begin(), placed.end(), [&](const PlacedMarker& other) {
            return other.container == marker.container && inside(other, point);
          });
      if (!sibling) white = false;
    }
    const double share =
        ink.white_share({point.x() - 1e-4, point.y() - 1e-4, point.x() + 1e-4, point.y() + 1e-4});
    if (share == 0.0 || share == 1.0) {
      EXPECT_EQ(share == 1.0, white) << point.transpose();
    }
  }
}

TEST(Carpet, RingsAreWhiteLinesBlackAndNoSiblingsOverlap) {
  const MarkerSet& set = coded_carpet();
  const std::vector<PlacedMarker> placed = place(set);
  const InkMap ink(set, 0);
  for (const PlacedMarker& child : placed) {
    if (child.layer == 1) continue;
    const double side = child.side_m;
    // Its own children's lines reach a little into it.
    const double ring = child.cell_side_m() * (1.0 - set.line.outside);
    const double line = set.line.outside * side;
    const Eigen::Vector2d a = child.origin_m;
    const Eigen::Vector2d b = a + Eigen::Vector2d(side, side);
    for (const Rect& strip :
         {Rect{a.x(), a.y(), b.x(), a.y() + ring}, Rect{a.x(), b.y() - ring, b.x(), b.y()},
          Rect{a.x(), a.y(), a.x() + ring, b.y()}, Rect{b.x() - ring, a.y(), b.x(), b.y()}})
      EXPECT_NEAR(ink.white_share(strip), 1.0, 1e-9) << child.id;
    for (const Rect& strip :
         {Rect{a.x(), a.y() - line, b.x(), a.y()}, Rect{a.x(), b.y(), b.x(), b.y() + line},
          Rect{a.x() - line, a.y(), a.x(), b.y()}, Rect{b.x(), a.y(), b.x() + line, b.y()}})
      EXPECT_NEAR(ink.white_share(strip), 0.0, 1e-9) << child.id;
    for (const PlacedMarker& other : placed) {
      if (&other == &child || other.container != child.container) continue;
      const double apart =
          (other.origin_m - a + 0.5 * (other.side_m - side) * Eigen::Vector2d(1, 1))
              .cwiseAbs()
              .maxCoeff();
      EXPECT_GE(apart, 0.5 * (side + other.side_m) * (1.0 - 1e-9));
    }
  }
}

TEST(Carpet, ParentStaysReadable) {
  const MarkerSet& set = coded_carpet();
  const Code& code = set.parents[0].marker.code;
  const std::vector<double> cells = predicted_cells(set).front();
  EXPECT_LT(code.black_count(), 25);
  for (int cell = 0; cell < 25; ++cell) {
    const double share = cells[static_cast<std::size_t>((cell / 5 + 1) * 7 + cell % 5 + 1)];
    if (code.white(cell)) {
      EXPECT_GT(share, 0.6) << cell;  // between four children: their lines alone take 0.27
    } else {
      EXPECT_LT(share, 0.2) << cell;
    }
  }
}

/// A child in a black cell of a child: the cell's ink leaves out its square.
TEST(Parts, LieOnAWhiteSquareInBlackCellsOfAnyLayer) {
  Code parent{5, 0x1ffffff & ~(1U << 1) & ~(1U << 5) & ~(1U << 6)};
  Code child = parent;
  Code small{5, 0x1ffffff & ~(1U << 1) & ~(1U << 2) & ~(1U << 5)};
  MarkerSet set;
  set.parents.push_back({49.0, {0, -1, parent, {{0, 12, child, {{1, 6, small, {}, 3, 4}}}}}});
  validate(set);
  const InkMap ink(set, 0);
  // The child's cell 6 is 1 m wide and begins at 21 + 2; the small one is its middle third.
  const double third = 1.0 / 3.0;
  EXPECT_NEAR(ink.white_share({23, 23, 24, 23 + third}), 0.0, 1e-9);
  EXPECT_NEAR(ink.white_share({23, 23, 23 + third, 24}), 0.0, 1e-9);
  EXPECT_NEAR(ink.white_share({23 + third, 23 + third, 24 - third, 24 - third}), 46.0 / 49.0, 1e-9);
  EXPECT_NEAR(predicted_cells(set)[1][2 * 7 + 2], 46.0 / 49.0 / 9.0, 1e-9);
}

TEST(GenerateCodes, RefusesWhatCannotBe) {
  EXPECT_THROW(generate_codes({}, quick()), std::invalid_argument);
  CodeSearch search = quick();
  search.effort = -1.0;
  EXPECT_THROW(generate_codes(without_codes(carpet(5), 1, 1.0), search), std::invalid_argument);
  search = quick();
  search.child_distance = 30;
  EXPECT_THROW(generate_codes(without_codes(carpet(5), 1, 1.0), search), std::invalid_argument);
  EXPECT_THROW(generate_codes(without_codes(carpet(5), 100, 1.0), quick()), std::invalid_argument);
  // The first child has its own where the second has none, and no other of their n admits both.
  Marker layout = uniform_layout(5, {{0, 4}, {7}});
  layout.children[1].children[0].cell = 8;
  for (Marker& child : layout.children) child.children[0].code.cells = 4;
  EXPECT_THROW(generate_codes(without_codes(layout, 1, 1.0), quick()), std::invalid_argument);
}

TEST(GenerateCodes, CarpetDrawsExactly) {
  // The smallest, of 14 pixels, have lines of one; 189 of them along the side.
  RasterOptions options;
  options.min_size_px = 0;
  const Raster drawn = raster(coded_carpet(), 0, options);
  EXPECT_EQ(drawn.image.width, 189 * 14 * 9 / 7);
  EXPECT_EQ(drawn.line.outside, 1.0 / 14.0);
  EXPECT_TRUE(print_warnings(coded_carpet()).empty());
  // Lines of half a cell are whole from two pixels a cell on, for any n.
  const MarkerSet fine =
      generate_codes(without_codes(carpet(6), 1, 1.4, default_line(6)), quick()).markers;
  EXPECT_EQ(raster(fine, 0, options).image.width, 8 * 9 * 3 * 16 * 10 / 8);
}

}  // namespace
}  // namespace harco
