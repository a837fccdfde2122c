// The detector's stages one by one, on input whose answer is known by hand.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <random>
#include <vector>

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "detect/bands.hpp"
#include "detect/cells.hpp"
#include "detect/codebook.hpp"
#include "detect/edges.hpp"
#include "detect/median.hpp"
#include "detect/profiles.hpp"
#include "detect/quad.hpp"
#include "detect/region_quad.hpp"
#include "detect/sample.hpp"
#include "detect/shapes.hpp"
#include "detect/square_homography.hpp"
#include "detect/threshold.hpp"
#include "harco/geometry.hpp"

namespace harco::detect {
namespace {

Image square_image(int size, int from, int to, std::uint8_t outside, std::uint8_t inside) {
  Image image(size, size, outside);
  for (int y = from; y < to; ++y)
    for (int x = from; x < to; ++x) image.row(y)[x] = inside;
  return image;
}

/// A quad that was fitted to a region, and the points of its border.
struct Fitted {
  Quad corners;
  bool dark;
  std::vector<Point> border;
};

std::vector<Fitted> quads_of(const Image& image,
                             const std::vector<std::size_t>& levels = {Threshold::kMiddleLevel,
                                                                       Threshold::kLineLevel},
                             const RegionLimits& limits = {}) {
  Threshold threshold;
  threshold.measure(image.view());
  ConvexRegions regions;
  RegionQuad quad;
  std::vector<Fitted> all;
  for (const std::size_t level : levels) {
    quad.start(threshold, level);
    regions.start(threshold, level, limits);
    while (const Region* region = regions.next())
      if (const auto corners = quad.fit(*region))
        all.push_back({*corners, region->dark, quad.border_of(*region)});
  }
  return all;
}

/// How far the corner that is farthest from all of `truth` lies from the nearest of them.
double farthest(const Quad& corners, const Quad& truth) {
  double most = 0.0;
  for (const Point& corner : corners) {
    double nearest = 1e9;
    for (const Point& other : truth) nearest = std::min(nearest, (other - corner).norm());
    most = std::max(most, nearest);
  }
  return most;
}

TEST(Threshold, LiesBetweenTheExtremesNearby) {
  const Image image = square_image(24, 8, 16, 200, 40);
  Threshold threshold;
  threshold.measure(image.view());
  // At 8 / 16: 40 + 0.5 * (200 - 40) = 120; at 11 / 16: 40 + 110 = 150; at 5 / 16: 40 + 50 = 90.
  const std::array<int, 3> at{120, 150, 90};
  for (std::size_t level = 0; level < at.size(); ++level) {
    EXPECT_EQ(threshold.distance(level, 10, 10), (40 - at[level]) * Threshold::kScale);
    EXPECT_EQ(threshold.distance(level, 5, 5), (200 - at[level]) * Threshold::kScale);
  }
  // Beyond the image everything is bright.
  EXPECT_GT(threshold.distance(0, -1, 10), 0);
  EXPECT_GT(threshold.distance(0, 10, 24), 0);
}

TEST(Threshold, TakesWhatHasNoContrastForBright) {
  const Image image = square_image(24, 8, 16, 105, 95);
  Threshold threshold;
  threshold.measure(image.view());
  for (int y = -1; y <= 24; ++y)
    for (int x = -1; x <= 24; ++x) {
      EXPECT_GT(threshold.distance(0, x, y), 0);
      EXPECT_FALSE(threshold.map(0).dark(x, y));
    }
}

TEST(Threshold, MapsAgreeWithDistances) {
  std::mt19937 random(3);
  for (const int width : {1, 3, 63, 64, 65, 150}) {
    Image image(width, 41);
    for (std::uint8_t& pixel : image.pixels) pixel = static_cast<std::uint8_t>(random());
    Threshold threshold;
    threshold.measure(image.view());
    for (std::size_t level = 0; level < Threshold::kLevels.size(); ++level)
      for (int y = -1; y <= image.height; ++y)
        for (int x = -1; x <= image.width; ++x)
          ASSERT_EQ(threshold.map(level).dark(x, y), threshold.distance(level, x, y) < 0)
              << width << ": " << x << ", " << y;
  }
}

TEST(Threshold, KnowsNoiseFromContrast) {
  std::mt19937 random(5);
  for (const double sigma : {2.0, 8.0}) {
    std::normal_distribution<double> noise(0.0, sigma);
    Image image = square_image(256, 100, 150, 200, 60);
    for (std::uint8_t& pixel : image.pixels)
      pixel = static_cast<std::uint8_t>(std::lround(pixel + noise(random)));
    Threshold threshold;
    threshold.measure(image.view());
    EXPECT_NEAR(threshold.noise(), sigma, 0.15 * sigma);
  }
  Threshold even;
  even.measure(Image(64, 64, 90).view());
  EXPECT_EQ(even.noise(), 0.0);
  // 6 * 5 = 30, but no less than 16 and no more than 60.
  EXPECT_EQ(contrast_above_noise(0.0), 16);
  EXPECT_EQ(contrast_above_noise(5.0), 30);
  EXPECT_EQ(contrast_above_noise(40.0), 60);
}

TEST(Edges, DontMoveInLightThatChangesAlongThem) {
  // As above, but the light falls to a third from left to right.
  const double from = 20.3;
  const double to = 59.8;
  Image image(80, 80);
  const auto covered = [&](int i) {
    return std::clamp(std::min(i + 0.5, to) - std::max(i - 0.5, from), 0.0, 1.0);
  };
  for (int y = 0; y < 80; ++y)
    for (int x = 0; x < 80; ++x) {
      const double light = 1.0 - 0.67 * x / 80.0;
      image.row(y)[x] =
          static_cast<std::uint8_t>(std::lround(light * (230.0 - 200.0 * covered(x) * covered(y))));
    }
  SideProfile profile;
  profile.cell_share = 1.0 / 7.0;
  const Quad rough{{{20.9, 19.8}, {59.2, 20.6}, {60.3, 59.5}, {20.0, 60.3}}};
  const auto fitted = fit_edges(image.view(), Lens(), rough, profile);
  ASSERT_TRUE(fitted);
  const Quad truth{{{from, from}, {to, from}, {to, to}, {from, to}}};
  for (std::size_t i = 0; i < 4; ++i) EXPECT_LT((fitted->corners[i] - truth[i]).norm(), 0.06);
}

constexpr std::size_t kDark = Threshold::kMiddleLevel;
constexpr std::size_t kBright = Threshold::kLineLevel;

/// What a region is; its rows are gone.
std::vector<Region> regions_of(const Image& image, std::size_t level,
                               const RegionLimits& limits = {}) {
  Threshold threshold;
  threshold.measure(image.view());
  ConvexRegions regions;
  regions.start(threshold, level, limits);
  std::vector<Region> all;
  while (const Region* region = regions.next()) all.push_back(*region);
  for (Region& region : all) region.left = region.right = nullptr;
  return all;
}

/// The shade's own outline, where it begins, is a pixel wide.
const RegionLimits kNoLines{5, 20, 0.0};

void fill(Image& image, int left, int top, int right, int bottom, std::uint8_t grey) {
  for (int y = top; y < bottom; ++y)
    for (int x = left; x < right; ++x) image.row(y)[x] = grey;
}

TEST(ConvexRegions, KnowTheirBoxAndTheirCorners) {
  Image image(40, 40, 200);
  fill(image, 8, 10, 28, 25, 0);
  fill(image, 12, 14, 24, 21, 200);
  const std::vector<Region> dark = regions_of(image, kDark);
  ASSERT_EQ(dark.size(), 1U);
  EXPECT_EQ(dark[0].y, 10);
  EXPECT_EQ(dark[0].columns, 20);
  EXPECT_EQ(dark[0].rows, 15);
  EXPECT_EQ(dark[0].corners, (kernels::OutlineCorners{{{28, 15}, {8, 15}, {8, 0}, {28, 0}}}));
  const std::vector<Region> bright = regions_of(image, kBright);
  ASSERT_EQ(bright.size(), 1U);
  EXPECT_EQ(bright[0].y, 14);
  EXPECT_EQ(bright[0].rows, 7);
}

TEST(ConvexRegions, AreAsWideAsTheyAre) {
  // Rows longer than a word, and a diamond whose rows grow by many pixels.
  Image wide(400, 60, 200);
  fill(wide, 20, 20, 380, 40, 0);
  ASSERT_EQ(regions_of(wide, kDark).size(), 1U);
  EXPECT_EQ(regions_of(wide, kDark)[0].columns, 360);
  Image diamond(400, 60, 200);
  for (int y = 0; y < 20; ++y) {
    fill(diamond, 200 - 8 * y - 4, 10 + y, 200 + 8 * y + 4, 11 + y, 0);
    fill(diamond, 200 - 8 * y - 4, 49 - y, 200 + 8 * y + 4, 50 - y, 0);
  }
  ASSERT_EQ(regions_of(diamond, kDark).size(), 1U);
  EXPECT_EQ(regions_of(diamond, kDark)[0].columns, 312);
}

TEST(ConvexRegions, DoNotRiseAgainBesideTheirTop) {
  // A U: from the top of either arm, what is met below comes down from elsewhere.
  Image image(60, 60, 200);
  fill(image, 10, 10, 20, 40, 0);
  fill(image, 30, 20, 40, 40, 0);
  fill(image, 10, 40, 40, 50, 0);
  EXPECT_TRUE(regions_of(image, kDark).empty());
}

TEST(ConvexRegions, AreNotThoseThatTheImageCuts) {
  for (const auto& [left, top] : {std::pair{0, 10}, {10, 0}, {30, 10}, {10, 30}}) {
    Image image(40, 40, 200);
    fill(image, left, top, left + 10, top + 10, 0);
    EXPECT_TRUE(regions_of(image, kDark).empty()) << left << ' ' << top;
  }
}

TEST(ConvexRegions, AreAsHighAsIsAskedFor) {
  Image image(60, 60, 200);
  fill(image, 10, 10, 40, 22, 0);
  RegionLimits limits;
  limits.least_extent = 12;
  EXPECT_EQ(regions_of(image, kDark, limits).size(), 1U);
  limits.least_extent = 13;
  EXPECT_TRUE(regions_of(image, kDark, limits).empty());
}

TEST(ConvexRegions, AtTheLowLevelAreThoseBesideAThirdGrey) {
  // White in the shade (90) between black and sunlit ground (240): dark in the middle of the two.
  Image image(60, 60, 240);
  fill(image, 15, 15, 45, 45, 90);
  fill(image, 20, 20, 40, 40, 10);
  ASSERT_EQ(regions_of(image, Threshold::kLowLevel, kNoLines).size(), 1U);
  EXPECT_EQ(regions_of(image, Threshold::kLowLevel, kNoLines)[0].columns, 20);
  // Without it the middle level finds the same.
  fill(image, 0, 0, 60, 60, 90);
  fill(image, 20, 20, 40, 40, 10);
  EXPECT_EQ(regions_of(image, kDark).size(), 1U);
  EXPECT_TRUE(regions_of(image, Threshold::kLowLevel, kNoLines).empty());
}

TEST(ConvexRegions, OfEverySecondRowAreSeenAtOddAndAtEvenRows) {
  // Beside a third grey.
  for (const int top : {20, 21}) {
    Image image(60, 60, 240);
    fill(image, 15, 15, 45, 45, 90);
    fill(image, 20, top, 40, 40, 10);
    const std::vector<Region> regions = regions_of(image, Threshold::kLowLevel, kNoLines);
    ASSERT_EQ(regions.size(), 1U);
    EXPECT_EQ(regions[0].row_step, 2);
    EXPECT_EQ(regions[0].y, (top + 1) / 2 * 2);
    EXPECT_EQ(regions[0].columns, 20);
    EXPECT_NEAR(regions[0].height(), 40 - top, 1);
    // The rows between are looked at where sides are fitted.
    const auto quads = quads_of(image, {Threshold::kLowLevel}, kNoLines);
    ASSERT_EQ(quads.size(), 1U);
    const double above = top - 0.5;
    const Quad truth{{{19.5, above}, {39.5, above}, {39.5, 39.5}, {19.5, 39.5}}};
    EXPECT_LT(farthest(quads[0].corners, truth), 0.6);
  }
}

TEST(ConvexRegions, OfEverySecondRowBeginNowhereBeyondACorner) {
  Image image(60, 60, 240);
  fill(image, 15, 15, 45, 45, 90);
  fill(image, 20, 20, 40, 40, 10);
  fill(image, 17, 17, 20, 20, 10);  // touches the upper left corner of that
  const auto quads = quads_of(image, {Threshold::kLowLevel}, kNoLines);
  ASSERT_EQ(quads.size(), 1U);
  const Quad truth{{{19.5, 19.5}, {39.5, 19.5}, {39.5, 39.5}, {19.5, 39.5}}};
  EXPECT_LT(farthest(quads[0].corners, truth), 0.6);
}

TEST(ConvexRegions, OfEverySecondRowEndAtAGapOfOneRow) {
  // What lies below the gap, at the same even rows, isn't part of it.
  Image image(80, 70, 240);
  fill(image, 25, 15, 55, 55, 90);
  fill(image, 30, 20, 50, 39, 10);
  fill(image, 27, 40, 53, 50, 10);
  const std::vector<Region> regions = regions_of(image, Threshold::kLowLevel, kNoLines);
  ASSERT_EQ(regions.size(), 1U);
  EXPECT_EQ(regions[0].columns, 20);
  EXPECT_NEAR(regions[0].height(), 19, 1);
}

TEST(ConvexRegions, BeginBelowASteepEdge) {
  // From white to black, row by row. Three rows of 40 are more than 6 / 16 of the whole contrast;
  // three of 10 are less than that of the contrast in the twelve rows nearby.
  for (const auto& [step, count] : {std::pair{40, 1U}, {10, 0U}}) {
    Image image(60, 80, 200);
    for (int y = 20; y < 60; ++y)
      fill(image, 15, y, 45, y + 1, static_cast<std::uint8_t>(std::max(0, 200 - step * (y - 19))));
    EXPECT_EQ(regions_of(image, kDark).size(), count) << step;
  }
}

TEST(ConvexRegions, HaveNoBaysAlongTheirSides) {
  // Row by row the ends of both are the same.
  Image image(80, 40, 200);
  fill(image, 10, 10, 26, 26, 0);
  fill(image, 50, 10, 66, 26, 0);
  EXPECT_EQ(regions_of(image, kDark).size(), 2U);
  fill(image, 52, 13, 64, 26, 200);
  const std::vector<Region> regions = regions_of(image, kDark);
  ASSERT_EQ(regions.size(), 1U);
  EXPECT_EQ(std::min(regions[0].corners[0].x, regions[0].corners[2].x), 10);
}

TEST(Shapes, InTheShadeLieWhereTheyAreInTheImage) {
  Image image(121, 95, 240);
  fill(image, 26, 25, 81, 76, 90);
  fill(image, 31, 30, 76, 71, 10);
  Workers alone;
  ShapeFinder finder;
  finder.find(image.view(), {10.0, 6, 0}, alone);
  const Quad truth{{{30.5, 29.5}, {75.5, 29.5}, {75.5, 70.5}, {30.5, 70.5}}};
  int found = 0;
  for (const Shape& shape : finder.shapes()) {
    if (mean_side(shape.corners) > 48.0) continue;  // the shade
    ++found;
    for (const Point& corner : truth) {
      double nearest = 1e9;
      for (const Point& other : shape.corners) nearest = std::min(nearest, (other - corner).norm());
      EXPECT_LT(nearest, 1.2);
    }
  }
  EXPECT_EQ(found, 1);
}

TEST(Shapes, HaveAPixelForEachCell) {
  // 30 x 7 pixels: enough for the five cells of one marker, not for the eight of another.
  Image image(80, 60, 220);
  fill(image, 20, 20, 50, 27, 10);
  Workers alone;
  ShapeFinder finder;
  finder.find(image.view(), {10.0, 5, 0}, alone);
  EXPECT_EQ(finder.shapes().size(), 1U);
  finder.find(image.view(), {10.0, 8, 0}, alone);
  EXPECT_TRUE(finder.shapes().empty());
  finder.find(image.view(), {10.0, 0, 5}, alone);
  EXPECT_TRUE(finder.shapes().empty());
}

TEST(Cells, StandOutFromTheRingOrNot) {
  constexpr int kCells = 4;
  constexpr int kPx = 5;
  Image image(60, 60, 200);
  fill(image, 10, 10, 10 + 6 * kPx, 10 + 6 * kPx, 20);
  const double last = 10 + 6 * kPx - 0.5;
  const Quad square{{{9.5, 9.5}, {last, 9.5}, {last, last}, {9.5, last}}};
  EXPECT_FALSE(has_bright_cells(image.view(), square, kCells, 1));
  // One cell, of paper in deep shade: 20 + 0.15 * 180 = 47 is just enough.
  const int left = 10 + 3 * kPx;
  fill(image, left, left, left + kPx, left + kPx, 46);
  EXPECT_FALSE(has_bright_cells(image.view(), square, kCells, 1));
  fill(image, left, left, left + kPx, left + kPx, 47);
  EXPECT_TRUE(has_bright_cells(image.view(), square, kCells, 1));
  EXPECT_FALSE(has_bright_cells(image.view(), square, kCells, 2));
  fill(image, left + kPx, left, left + 2 * kPx, left + kPx, 47);
  EXPECT_TRUE(has_bright_cells(image.view(), square, kCells, 2));
  // Cells of the ring don't count.
  fill(image, left, left, left + 2 * kPx, left + kPx, 20);
  fill(image, 10, 10, 10 + kPx, 10 + kPx, 200);
  EXPECT_FALSE(has_bright_cells(image.view(), square, kCells, 1));
}

TEST(RegionQuad, LiesAtHalfPixels) {
  const auto quads = quads_of(square_image(32, 10, 20, 200, 0));
  ASSERT_EQ(quads.size(), 1U);
  EXPECT_TRUE(quads[0].dark);
  EXPECT_EQ(quads[0].border.size(), 40U);
  const Quad truth{{{9.5, 9.5}, {19.5, 9.5}, {19.5, 19.5}, {9.5, 19.5}}};
  EXPECT_LT(farthest(quads[0].corners, truth), 1e-9);
  EXPECT_NEAR(area(quads[0].corners), 100.0, 1e-9);
}

TEST(RegionQuad, TellsDarkFromBright) {
  Image image = square_image(40, 8, 32, 200, 0);
  fill(image, 12, 12, 28, 28, 200);
  const auto quads = quads_of(image);
  ASSERT_EQ(quads.size(), 2U);
  EXPECT_TRUE(quads[0].dark);
  EXPECT_FALSE(quads[1].dark);
  // At 11 / 16 of the grey: 3 / 16 of a pixel inside of the pixels' borders.
  const double from = 11.5 + 3.0 / 16.0;
  const double to = 27.5 - 3.0 / 16.0;
  const Quad truth{{{from, from}, {to, from}, {to, to}, {from, to}}};
  EXPECT_LT(farthest(quads[1].corners, truth), 1e-9);
  EXPECT_GT(area(quads[1].corners), 0.0);
}

TEST(RegionQuad, SeesTheGreyBetweenPixels) {
  // The left column of the square is 3/4 bright: its border moves right, to where the grey passes
  // the threshold of 100 between 150 and 0.
  Image image = square_image(32, 10, 20, 200, 0);
  fill(image, 10, 10, 11, 20, 150);
  const auto quads = quads_of(image, {kDark});
  ASSERT_EQ(quads.size(), 1U);
  double left = 100.0;
  for (const Point& corner : quads[0].corners) left = std::min(left, corner.x());
  EXPECT_NEAR(left, 10.0 + 50.0 / 150.0, 1e-9);
}

TEST(RegionQuad, HasNoBaysOnMostOfASide) {
  // From below: the rows' ends are those of a square. Of half of the side or less, the rest tells.
  for (const auto& [width, count] : {std::pair{0, 1U}, {30, 1U}, {50, 0U}}) {
    Image image = square_image(120, 20, 100, 200, 0);
    fill(image, 60 - width / 2, 70, 60 + width / 2, 100, 200);
    const auto quads = quads_of(image, {kDark});
    ASSERT_EQ(quads.size(), count) << width;
    const Quad truth{{{19.5, 19.5}, {99.5, 19.5}, {99.5, 99.5}, {19.5, 99.5}}};
    for (const Fitted& quad : quads) EXPECT_LT(farthest(quad.corners, truth), 1e-9);
  }
}

TEST(RegionQuad, GoesAroundBumpsOfARow) {
  // Two along the upper side: from the top of one, the other isn't part of the rows looked at.
  Image image = square_image(60, 20, 42, 200, 0);
  fill(image, 25, 19, 30, 20, 0);
  fill(image, 34, 19, 39, 20, 0);
  const auto quads = quads_of(image, {kDark});
  ASSERT_FALSE(quads.empty());
  for (const Fitted& quad : quads) {
    std::array<int, 2> bumps{};
    for (const Point& point : quad.border)
      if (point.y() < 19.0) ++bumps[point.x() > 32.0 ? 1 : 0];
    EXPECT_EQ(bumps, (std::array<int, 2>{5, 5}));
  }
}

/// Dark where the point is inside the polygon (clockwise on the screen).
Image polygon_image(int size, const std::vector<Point>& corners) {
  Image image(size, size, 200);
  for (int y = 0; y < size; ++y)
    for (int x = 0; x < size; ++x) {
      bool inside = true;
      for (std::size_t i = 0; i < corners.size(); ++i) {
        const Point side = corners[(i + 1) % corners.size()] - corners[i];
        const Point to = Point(x, y) - corners[i];
        inside = inside && side.x() * to.y() - side.y() * to.x() >= 0.0;
      }
      if (inside) image.row(y)[x] = 0;
    }
  return image;
}

/// A regular polygon.
std::vector<Point> polygon(int corners, double radius, double degrees) {
  std::vector<Point> all;
  for (int i = 0; i < corners; ++i) {
    const double angle = degrees * std::numbers::pi / 180.0 + 2.0 * std::numbers::pi * i / corners;
    all.emplace_back(64.3 + radius * std::cos(angle), 63.8 + radius * std::sin(angle));
  }
  return all;
}

TEST(RegionQuad, IsFoundAtEveryTurn) {
  for (int degrees = 0; degrees < 90; degrees += 3)
    for (const double half : {5.0, 9.0, 40.0}) {
      const std::vector<Point> corners = polygon(4, std::numbers::sqrt2 * half, degrees);
      // Dark inside bright, and the other way round in a dark frame.
      Image image = polygon_image(128, corners);
      for (const bool dark : {true, false}) {
        const auto quads = quads_of(image, {dark ? kDark : kBright});
        ASSERT_EQ(quads.size(), 1U) << degrees << " degrees, " << half;
        EXPECT_EQ(quads[0].dark, dark);
        EXPECT_LT(farthest(quads[0].corners, {corners[0], corners[1], corners[2], corners[3]}), 1.0)
            << degrees << " degrees, " << half;
        EXPECT_TRUE(convex(quads[0].corners));
        for (std::uint8_t& pixel : image.pixels) pixel = static_cast<std::uint8_t>(200 - pixel);
      }
    }
}

TEST(RegionQuad, RefusesWhatIsNone) {
  // A letter C, a square at the image's edge, other polygons, a circle.
  Image image = square_image(80, 20, 60, 200, 0);
  fill(image, 30, 30, 60, 50, 200);
  EXPECT_TRUE(quads_of(image).empty());
  EXPECT_TRUE(quads_of(square_image(40, 0, 20, 200, 0)).empty());
  for (const int corners : {3, 5, 6, 60})
    for (const double degrees : {0.0, 7.0, 45.0})
      EXPECT_TRUE(quads_of(polygon_image(128, polygon(corners, 30.0, degrees))).empty())
          << corners << " corners";
}

TEST(RegionQuad, KnowsNoLessThanTheAreaAskedFor) {
  const Image image = square_image(32, 10, 20, 200, 0);
  Threshold threshold;
  threshold.measure(image.view());
  ConvexRegions regions;
  regions.start(threshold, kDark, {});
  RegionQuad quad;
  quad.start(threshold, kDark);
  const Region* region = regions.next();
  ASSERT_TRUE(region);
  // The corners of the border are cut at 45 degrees: 100 - 4 * 0.125.
  EXPECT_TRUE(quad.fit(*region, 99.4));
  EXPECT_FALSE(quad.fit(*region, 99.6));
}

TEST(Quad, IntersectsLines) {
  const auto point = intersection({0, 0}, {2, 2}, {0, 4}, {4, 0});
  ASSERT_TRUE(point);
  EXPECT_NEAR((*point - Point(2, 2)).norm(), 0.0, 1e-12);
  EXPECT_FALSE(intersection({0, 0}, {1, 1}, {0, 1}, {1, 2}));
}

TEST(SquareHomography, MapsTheUnitSquareToTheCorners) {
  const Quad quad{{{3, 4}, {50, 8}, {61, 58}, {-5, 40}}};
  const Eigen::Matrix3d H = square_homography(quad);
  const std::array<Eigen::Vector3d, 4> square{{{0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}}};
  for (std::size_t i = 0; i < 4; ++i) {
    const Eigen::Vector3d h = H * square[i];
    EXPECT_GT(h.z(), 0.0);
    EXPECT_NEAR((h.head<2>() / h.z() - quad[i]).norm(), 0.0, 1e-9);
  }
}

TEST(Sample, IsBilinear) {
  Image image(3, 2);
  image.row(0)[0] = 10;
  image.row(0)[1] = 20;
  image.row(1)[0] = 30;
  image.row(1)[1] = 80;
  // Between the four: 0.75 * (0.5 * 10 + 0.5 * 20) + 0.25 * (0.5 * 30 + 0.5 * 80) = 25.
  EXPECT_DOUBLE_EQ(*sample(image.view(), 0.5, 0.25), 25.0);
  EXPECT_DOUBLE_EQ(*sample(image.view(), 0.0, 1.0), 30.0);
  EXPECT_FALSE(sample(image.view(), -0.01, 0.0));
  EXPECT_FALSE(sample(image.view(), 2.01, 0.0));
  EXPECT_FALSE(sample(image.view(), std::nan(""), 0.0));
}

TEST(Median, IsTheMiddleOneOrTheUpperOfTwo) {
  const std::vector<float> odd{7.0F, 255.0F, 3.0F, 0.0F, 200.0F};
  EXPECT_EQ(middle_of(odd.data(), 5, 256.0F, 16), 7.0F);
  EXPECT_EQ(middle_of(odd.data(), 1, 256.0F, 16), 7.0F);
  EXPECT_EQ(middle_of(odd.data(), 4, 256.0F, 16), 7.0F);  // 0, 3, 7, 255
  const std::vector<float> same(96, 12.25F);
  EXPECT_EQ(middle_of(same.data(), 96, 256.0F, 16), 12.25F);
  const std::vector<float> between{0.3F, 0.1F, 0.2F};
  EXPECT_NEAR(middle_of(between.data(), 3, 1.0F, 16), 0.2F, 2e-5);
}

/// Greys of 20 positions two pixels apart at one step, without anything across.
Profiles one_step(const std::vector<float>& greys) {
  Profiles profiles;
  profiles.along.resize(static_cast<Eigen::Index>(greys.size()));
  for (int i = 0; i < profiles.count(); ++i) {
    profiles.along(i) = 2.0F * static_cast<float>(i) - 19.0F;
    profiles.grey(i, 0) = greys[static_cast<std::size_t>(i)];
  }
  return profiles;
}

TEST(Profiles, LevelsFollowTheLightAndNotWhatHidesIt) {
  std::vector<float> greys;
  for (int i = 0; i < 20; ++i) greys.push_back(100.0F + 3.0F * static_cast<float>(i));
  for (const std::size_t hidden : {3U, 4U, 12U}) greys[hidden] = 10.0F;
  const Linear level = level_at(one_step(greys), 0);
  EXPECT_NEAR(level.middle, 128.5, 0.1);
  EXPECT_NEAR(level.slope, 1.5, 0.01);
  EXPECT_NEAR(level.at(-19.0), 100.0, 0.2);
  // What is even but for noise has no slope.
  for (std::size_t i = 0; i < greys.size(); ++i) greys[i] = i % 2 == 0 ? 59.0F : 61.0F;
  const Linear even = level_at(one_step(greys), 0);
  EXPECT_EQ(even.slope, 0.0);
  EXPECT_NEAR(even.middle, 60.0, 1e-4);
  EXPECT_EQ(median_at(one_step(greys), 0), 61.0F);
}

TEST(Profiles, LevelsNearbyAreMediansOfFive) {
  const Profiles profiles = one_step({9.0F, 1.0F, 5.0F, 7.0F, 3.0F, 200.0F, 4.0F});
  const Positions levels = levels_nearby(profiles, 0);
  const std::vector<float> expected{5.0F,   // of 5 1 9 1 5
                                    5.0F,   // of 1 9 1 5 7: mirrored at the end
                                    5.0F,   // of 9 1 5 7 3
                                    5.0F,   // of 1 5 7 3 200
                                    5.0F,   // of 5 7 3 200 4
                                    7.0F,   // of 7 3 200 4 200, mirrored
                                    4.0F};  // of 3 200 4 200 3
  ASSERT_EQ(levels.size(), 7);
  for (Eigen::Index i = 0; i < levels.size(); ++i)
    EXPECT_EQ(levels(i), expected[static_cast<std::size_t>(i)]) << i;
}

TEST(Profiles, AreReadAcrossASideFromTheInsideOut) {
  // Grey is 4 x + 3 y; the side runs to the right at y = 20.25, so its outside lies above it.
  Image image(60, 40);
  for (int y = 0; y < 40; ++y)
    for (int x = 0; x < 60; ++x)
      image.row(y)[x] = static_cast<std::uint8_t>(std::min(255, 4 * x + 3 * y));
  const Point a(5.0, 20.25), b(35.0, 20.25);
  Profiles profiles = read_profiles(image.view(), Lens(), a, b, {4, 6}, 8);
  ASSERT_EQ(profiles.count(), 8);
  EXPECT_EQ(profiles.across(), 11);
  for (int i = 0; i < 8; ++i) {
    // The side is 30 long, 3.3 of it left out at either end: positions 23.4 / 8 = 2.925 apart.
    const double x = 5.0 + 3.3 + 2.925 * (i + 0.5);
    EXPECT_NEAR(profiles.along(i), x - 20.0, 1e-5);
    for (int k = -4; k <= 6; ++k)
      EXPECT_NEAR(profiles.at(k)(i), 4.0 * x + 3.0 * (20.25 - 0.5 * k), 0.005);
  }
  // Means over two pixels, of light that changes evenly: the same, two steps less on either side.
  const float before = profiles.at(1)(3);
  widen_pixels(profiles);
  EXPECT_EQ(profiles.inward, 2);
  EXPECT_EQ(profiles.outward, 4);
  EXPECT_NEAR(profiles.at(1)(3), before, 1e-3);
  // Where the image ends, profiles that leave it are missing.
  EXPECT_EQ(read_profiles(image.view(), Lens(), {5.0, 2.0}, {35.0, 2.0}, {4, 6}, 8).count(), 0);
  EXPECT_EQ(read_profiles(image.view(), Lens(), {5.0, 0.5}, {35.0, 10.5}, {4, 6}, 8).count(), 7);
}

TEST(Edges, AreTakenOutOfTheirBlur) {
  // Across a child's side: dark cells, its white ring from -3 to 0, a line of 0.6 pixels, white
  // again; blurred, in light that grows outwards.
  const double step = 0.5, first = -4.0, sigma = 0.9, offset = 0.137;
  const auto after = [&](double x) { return 0.5 * std::erfc(-x / sigma / std::sqrt(2.0)); };
  const auto grey = [&](double x, double dark_cells) {
    return (1.0 + 0.002 * x) * (dark_cells + (200.0 - dark_cells) * after(x - offset + 3.0) -
                                170.0 * after(x - offset) + 160.0 * after(x - offset - 0.6));
  };
  Profile profile(17), beside(17);
  for (Eigen::Index k = 0; k < profile.size(); ++k) {
    profile(k) = grey(first + step * static_cast<double>(k), 60.0);
    beside(k) = grey(first + step * static_cast<double>(k), 90.0);
  }
  Bands bands;
  bands.first_spread = 0.01;
  bands.light_spread = 0.01;
  for (const double border : {-3.0, 0.0, 0.6}) bands.add(border);
  const auto filter = fit_bands(profile, first, step, bands);
  ASSERT_TRUE(filter);
  EXPECT_NEAR(filter->offset, offset, 2e-3);
  EXPECT_NEAR(filter->sigma, sigma, 0.02);
  EXPECT_NEAR(filter->position(profile), offset, 2e-3);
  // Other cells within the ring don't move the side.
  EXPECT_NEAR(filter->position(beside), offset, 5e-3);
}

TEST(Edges, LieWhereTheGreyUnderAStepSaysSo) {
  // A dark square from 20.3 to 59.8 in pixel edges, its border pixels grey by the area covered.
  const double from = 20.3;
  const double to = 59.8;
  Image image(80, 80, 200);
  const auto covered = [&](int i) {
    return std::clamp(std::min(i + 0.5, to) - std::max(i - 0.5, from), 0.0, 1.0);
  };
  for (int y = 0; y < 80; ++y)
    for (int x = 0; x < 80; ++x)
      image.row(y)[x] =
          static_cast<std::uint8_t>(std::lround(200.0 - 180.0 * covered(x) * covered(y)));
  SideProfile profile;
  profile.cell_share = 1.0 / 7.0;
  const Quad rough{{{20.9, 19.8}, {59.2, 20.6}, {60.3, 59.5}, {20.0, 60.3}}};
  const auto fitted = fit_edges(image.view(), Lens(), rough, profile);
  ASSERT_TRUE(fitted);
  const Quad truth{{{from, from}, {to, from}, {to, to}, {from, to}}};
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_LT((fitted->corners[i] - truth[i]).norm(), 0.02);
  }
  EXPECT_GT(fitted->covariance.llt().matrixLLT().diagonal().minCoeff(), 0.0);
  // A camera is never so sharp as this: its blur is what the sides are taken out of.
  const auto sharp = sharpen_edges(image.view(), Lens(), fitted->corners, profile);
  ASSERT_TRUE(sharp);
  for (std::size_t i = 0; i < 4; ++i) EXPECT_LT((sharp->corners[i] - truth[i]).norm(), 0.04);
  EXPECT_LT(sharp->covariance.trace(), 0.01);
  EXPECT_LT(sharp->covariance.trace(), fitted->covariance.trace());
  // The same edges are no child's: there, bright has to lie inside.
  profile.bright_inside = true;
  profile.line_share = 1.0 / 14.0;
  EXPECT_FALSE(fit_edges(image.view(), Lens(), rough, profile));
}

MarkerSet small_set() {
  MarkerSet set;
  set.cells = 4;
  set.parents = {{0.1, {3, -1, parse_code("1100101000110111"), {}}},
                 {0.1, {8, -1, parse_code("0001110101110100"), {}}}};
  return set;
}

TEST(Codebook, FindsCodesInEveryTurn) {
  const MarkerSet set = small_set();
  const std::vector<PlacedMarker> placed = place(set);
  const Codebook book(4, placed, false);
  EXPECT_TRUE(Codebook(4, placed, true).empty());
  EXPECT_TRUE(Codebook(5, placed, false).empty());
  for (int i = 0; i < 2; ++i)
    for (int turns = 0; turns < 4; ++turns) {
      const Code seen = rotated(placed[static_cast<std::size_t>(i)].code, turns);
      std::vector<Match> matches;
      book.find(seen.bits, 0, matches);
      ASSERT_EQ(matches.size(), 1U);
      EXPECT_EQ(matches[0].placed, i);
      EXPECT_EQ(matches[0].turns, turns);
      matches.clear();
      book.find(seen.bits ^ 1U, 0, matches);
      EXPECT_TRUE(matches.empty());
      book.find(seen.bits ^ 1U, 1, matches);
      ASSERT_FALSE(matches.empty());
      EXPECT_EQ(matches[0].errors, 1);
    }
}

TEST(Codebook, NeverCorrectsBeyondHalfTheDistance) {
  const MarkerSet set = small_set();
  const std::vector<PlacedMarker> placed = place(set);
  int least = distance(placed[0].code, placed[1].code);
  for (const PlacedMarker& marker : placed) least = std::min(least, inner_distance(marker.code));
  EXPECT_EQ(Codebook(4, placed, false).safe_errors(), (least - 1) / 2);
}

/// The marker drawn upright with cells of 10 pixels, its corner at pixel edge (20, 20).
Image drawn(const std::vector<double>& predicted, std::uint8_t black, std::uint8_t white) {
  Image image(100, 100, white);
  for (int row = 0; row < 6; ++row)
    for (int column = 0; column < 6; ++column)
      for (int y = 0; y < 10; ++y)
        for (int x = 0; x < 10; ++x)
          image.row(20 + row * 10 + y)[20 + column * 10 + x] =
              predicted[static_cast<std::size_t>(row * 6 + column)] > 0.5 ? white : black;
  return image;
}

Eigen::Matrix3d where_drawn() {
  Eigen::Matrix3d image_H_cells;
  image_H_cells << 10, 0, 19.5, 0, 10, 19.5, 0, 0, 1;
  return image_H_cells;
}

TEST(Cells, AreReadWhereTheyAreAndJudgedAgainstThePrediction) {
  const MarkerSet set = small_set();
  const std::vector<double> predicted = predicted_cells(set)[0];
  const Image image = drawn(predicted, 30, 220);
  Eigen::Matrix3d image_H_cells = where_drawn();
  const auto greys = sample_cells(image.view(), Lens(), image_H_cells, 4, 10.0);
  ASSERT_TRUE(greys);
  const auto grid = read_cells(*greys, 0.8, false, 4);
  ASSERT_TRUE(grid);
  EXPECT_NEAR(grid->contrast, 190.0, 1e-6);
  EXPECT_EQ(wrong_ring_cells(*grid, false), 0);
  EXPECT_EQ(wrong_ring_cells(*grid, true), 20);
  EXPECT_EQ(read_bits(*grid, 0.42), place(set)[0].code.bits);
  EXPECT_NEAR(agreement(*grid, predicted, 0), 1.0, 1e-9);
  EXPECT_LT(agreement(*grid, predicted, 1), 0.9);

  // A camera turned by a quarter sees the code turned; the prediction turned along agrees again.
  Eigen::Matrix3d turned;
  turned << 0, 10, 19.5, -10, 0, 79.5, 0, 0, 1;  // cells' x runs up the image
  const auto from_there = sample_cells(image.view(), Lens(), turned, 4, 10.0);
  ASSERT_TRUE(from_there);
  const auto seen = read_cells(*from_there, 0.8, false, 4);
  ASSERT_TRUE(seen);
  EXPECT_EQ(read_bits(*seen, 0.42), rotated(place(set)[0].code, 1).bits);
  EXPECT_NEAR(agreement(*seen, predicted, 1), 1.0, 1e-9);

  image_H_cells(0, 2) = 60.0;  // partly outside of the image
  EXPECT_FALSE(sample_cells(image.view(), Lens(), image_H_cells, 4, 10.0));
}

TEST(Cells, AreReadAcrossAShadowsEdge) {
  const MarkerSet set = small_set();
  const std::vector<double> predicted = predicted_cells(set)[0];
  Image image = drawn(predicted, 30, 220);
  // From the fourth column of cells on there is a third of the light: paper of 73, ink of 10.
  for (int y = 0; y < 100; ++y)
    for (int x = 50; x < 100; ++x) image.row(y)[x] = static_cast<std::uint8_t>(image.row(y)[x] / 3);
  const std::uint64_t code = place(set)[0].code.bits;
  const auto greys = sample_cells(image.view(), Lens(), where_drawn(), 4, 10.0);
  ASSERT_TRUE(greys);
  const auto plain = read_cells(*greys, 0.8, false, 4);
  ASSERT_TRUE(plain);
  EXPECT_LT(agreement(*plain, predicted, 0), 0.95);

  const auto shaded = read_shaded_cells(*greys, 0.8);
  ASSERT_TRUE(shaded);
  EXPECT_GT(shaded->threshold, 30.0);
  EXPECT_LT(shaded->threshold, 73.0);
  EXPECT_EQ(read_bits(shaded->seen.greys, shaded->threshold), code);
  // The ring's middle grey lies between 10 and 30.
  const CellGrid even = in_even_light(*shaded, predicted, 0);
  EXPECT_GT(agreement(even, predicted, 0), 0.97);
  EXPECT_LT(agreement(in_even_light(*shaded, predicted, 1), predicted, 1), 0.9);

  // Paper as dark as the ring somewhere: no light explains that.
  for (int y = 0; y < 100; ++y)
    for (int x = 70; x < 100; ++x) image.row(y)[x] = 8;
  const auto spoilt = sample_cells(image.view(), Lens(), where_drawn(), 4, 10.0);
  ASSERT_TRUE(spoilt);
  EXPECT_FALSE(read_shaded_cells(*spoilt, 0.8));
}

}  // namespace
}  // namespace harco::detect
