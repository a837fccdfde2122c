// Markers of which only parts are seen, and markers that only a larger one leads to.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <stdexcept>
#include <utility>
#include <vector>

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "detect/cell_votes.hpp"
#include "detect/edge_template.hpp"
#include "detect/likeness.hpp"
#include "detect/prediction.hpp"
#include "detect/pyramid.hpp"
#include "detect/quad.hpp"
#include "detect/registration.hpp"
#include "detect/relations.hpp"
#include "detect/segments.hpp"
#include "detect/side_quads.hpp"
#include "detect/step_map.hpp"
#include "detect/threshold.hpp"
#include "harco/detect.hpp"
#include "harco/dictionary.hpp"
#include "harco/geometry.hpp"
#include "harco/pose.hpp"
#include "lab/blobs.hpp"
#include "lab/render.hpp"
#include "sample_markers.hpp"

namespace harco {
namespace {

using detect::Point;
using detect::Segment;
using Eigen::Vector2d;

constexpr double kDegree = std::numbers::pi / 180.0;

/// A dark half plane, blurred by pixels only: dark on the right-hand side of the way from `at` on
/// in direction `way`.
Image half_plane(int width, int height, const Point& at, const Point& way, double dark,
                 double bright) {
  constexpr int kFine = 8;
  Image image(width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      int inside = 0;
      for (int j = 0; j < kFine; ++j)
        for (int i = 0; i < kFine; ++i) {
          const Point point(x + (i + 0.5) / kFine - 0.5, y + (j + 0.5) / kFine - 0.5);
          inside += way.x() * (point.y() - at.y()) - way.y() * (point.x() - at.x()) > 0.0;
        }
      const double share = static_cast<double>(inside) / (kFine * kFine);
      image.row(y)[x] = static_cast<std::uint8_t>(std::lround(bright + share * (dark - bright)));
    }
  return image;
}

void cover_with(Image& image, int left, int top, int right, int bottom, std::uint8_t grey) {
  for (int y = top; y < bottom; ++y) std::fill(image.row(y) + left, image.row(y) + right, grey);
}

Image transposed(const Image& image) {
  Image turned(image.height, image.width);
  for (int y = 0; y < image.height; ++y)
    for (int x = 0; x < image.width; ++x) turned.row(x)[y] = image.row(y)[x];
  return turned;
}

using Places = std::vector<std::array<int, 2>>;

Places steps_of(const Image& image, bool along_rows) {
  detect::StepMap map;
  map.find(image.view(), along_rows, 3, 20);
  Places places;
  map.for_each([&](int s, int t) { places.push_back({s, t}); });
  return places;
}

TEST(Steps, StandInARowOfThree) {
  Image image(40, 60, 200);
  const auto draw = [&](int row, int from, int to) {
    cover_with(image, from, row, to, row + 1, 50);
  };
  // As far apart as may be, and farther.
  draw(4, 20, 30);
  draw(6, 23, 30);
  draw(8, 26, 30);
  draw(14, 12, 20);
  draw(16, 16, 20);
  draw(18, 20, 30);
  // Only two; three of which one goes the other way.
  draw(24, 10, 40);
  draw(26, 10, 40);
  draw(34, 10, 40);
  draw(36, 0, 11);
  draw(38, 10, 40);
  // Rows between scan lines don't count.
  draw(45, 10, 40);
  draw(47, 10, 40);
  draw(49, 10, 40);
  // By the last dark or bright pixel; where the dark ends, three go straight down.
  const Places expected{{4, 19}, {4, 29}, {6, 22}, {6, 29}, {8, 25}, {8, 29}};
  EXPECT_EQ(steps_of(image, true), expected);
  EXPECT_EQ(steps_of(transposed(image), false), expected);
}

TEST(Steps, AreCountedByEveryEighthScanLine) {
  Image image(40, 60, 200);
  cover_with(image, 10, 0, 20, 60, 50);
  detect::StepMap map;
  // On rows 2, 18, 34 and 50 two each.
  EXPECT_EQ(map.count_roughly(image.view(), 2, 20), 8 * 8);
  EXPECT_EQ(map.count_roughly(image.view(), 2, 151), 0);
}

TEST(Steps, AreTheSameAlongRowsAndColumns) {
  std::mt19937 random(11);
  std::size_t found = 0;
  for (const auto& [width, height] : {std::pair(203, 130), std::pair(64, 71), std::pair(9, 40)}) {
    Image image(width, height, 128);
    for (int k = 0; k < 60; ++k) {
      const int x = static_cast<int>(random() % static_cast<unsigned>(width - 8));
      const int y = static_cast<int>(random() % static_cast<unsigned>(height - 8));
      cover_with(image, x, y, x + 8, y + 8, static_cast<std::uint8_t>(random() % 256U));
    }
    const Places along_rows = steps_of(image, true);
    found += along_rows.size();
    EXPECT_EQ(along_rows, steps_of(transposed(image), false)) << width;
  }
  EXPECT_GT(found, 50U);
}

double beside(const Segment& segment, const Point& at, const Point& way) {
  const auto off = [&](const Point& point) {
    const Point d = point - at;
    return std::abs(way.x() * d.y() - way.y() * d.x());
  };
  return std::max(off(segment.a), off(segment.b));
}

TEST(Segments, LieOnTheEdgeWhateverItsDirection) {
  detect::Workers alone;
  detect::SegmentFinder finder;
  const Point middle(40.3, 39.6);
  for (int k = 0; k < 24; ++k) {
    const double angle = (15.0 * k + 2.0) * kDegree;
    const Point way(std::cos(angle), std::sin(angle));
    const Image image = half_plane(80, 80, middle, way, 40, 190);
    const auto& segments = finder.find(image.view(), 6.0, 20, alone);
    ASSERT_EQ(segments.size(), 1U) << k;
    const Segment& segment = segments.front();
    EXPECT_GT(segment.length(), 70.0) << k;
    EXPECT_GT(segment.direction().dot(way), 0.9999) << k;  // the dark lies on its right
    EXPECT_LT(beside(segment, middle, way), 0.1) << k;
    EXPECT_NEAR(segment.dark, 40.0, 1.0);
    EXPECT_NEAR(segment.bright, 190.0, 1.0);
  }
}

TEST(Segments, EndWhereSomethingCoversTheEdge) {
  detect::Workers alone;
  detect::SegmentFinder finder;
  const Point way = Point(0.2, 1.0).normalized();
  Image image = half_plane(80, 80, {40, 40}, way, 40, 190);
  cover_with(image, 0, 30, 80, 50, 120);
  std::vector<Segment> parts;
  for (const Segment& segment : finder.find(image.view(), 6.0, 20, alone))
    if (segment.direction().dot(way) > 0.999) parts.push_back(segment);
  ASSERT_EQ(parts.size(), 2U);
  EXPECT_NEAR(parts[0].b.y(), 28.5, 1.5);
  EXPECT_NEAR(parts[1].a.y(), 51.5, 2.0);
  for (const Segment& part : parts) EXPECT_LT(beside(part, {40, 40}, way), 0.15);
  // Shorter ones don't count.
  EXPECT_TRUE(finder.find(image.view(), 85.0, 20, alone).empty());
}

TEST(Segments, NeedContrastEvennessAndStraightness) {
  detect::Workers alone;
  detect::SegmentFinder finder;
  const Image faint = half_plane(60, 60, {30, 30}, {0, 1}, 100, 118);
  EXPECT_TRUE(finder.find(faint.view(), 6.0, 20, alone).empty());
  EXPECT_EQ(finder.find(faint.view(), 6.0, 15, alone).size(), 1U);
  Image thin = half_plane(60, 60, {30, 30}, {0, 1}, 40, 190);
  cover_with(thin, 28, 0, 29, 60, 190);  // of the dark, one column is left
  for (const Segment& segment : finder.find(thin.view(), 6.0, 20, alone))
    EXPECT_GT(std::abs(segment.a.x() - 29.5), 1.0);
  // The outline of a disc has no straight part.
  Image disc(60, 60, 190);
  for (int y = 0; y < 60; ++y)
    for (int x = 0; x < 60; ++x)
      if (std::hypot(x - 30.0, y - 30.0) < 12.0) disc.row(y)[x] = 40;
  for (const Segment& segment : finder.find(disc.view(), 6.0, 20, alone))
    EXPECT_LT(segment.length(), 12.0);
}

TEST(Segments, AreTheSameWithAnyNumberOfThreads) {
  std::mt19937 random(5);
  Image image(203, 117, 128);
  for (int k = 0; k < 120; ++k) {
    const int x = static_cast<int>(random() % 180U);
    const int y = static_cast<int>(random() % 100U);
    const int width = static_cast<int>(4U + random() % 19U);
    const int height = static_cast<int>(4U + random() % 13U);
    cover_with(image, x, y, x + width, y + height, static_cast<std::uint8_t>(random() % 256U));
  }
  detect::Workers alone;
  detect::Workers three(3);
  detect::SegmentFinder first;
  detect::SegmentFinder second;
  const auto& a = first.find(image.view(), 6.0, 20, alone);
  const auto& b = second.find(image.view(), 6.0, 20, three);
  ASSERT_GT(a.size(), 20U);
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a[i].a, b[i].a);
    EXPECT_EQ(a[i].b, b[i].b);
  }
}

TEST(Segments, SmallImagesHaveNone) {
  detect::Workers alone;
  detect::SegmentFinder finder;
  for (const int size : {1, 2, 5, 6, 7, 9})
    EXPECT_TRUE(finder.find(Image(size, size, 9).view(), 6.0, 20, alone).empty()) << size;
}

/// Parts of the four sides of a quad, clockwise.
std::vector<Segment> parts(const detect::Quad& quad, const std::vector<std::array<double, 3>>& of) {
  std::vector<Segment> segments;
  for (const auto& [side, from, to] : of) {
    const auto i = static_cast<std::size_t>(side);
    const Point way = quad[(i + 1) % 4] - quad[i];
    segments.push_back({quad[i] + from * way, quad[i] + to * way, 30.0, 200.0});
  }
  return segments;
}

double worst_corner(const detect::Quad& a, const detect::Quad& b) {
  double best = 1e9;
  for (std::size_t turn = 0; turn < 4; ++turn) {
    double worst = 0.0;
    for (std::size_t i = 0; i < 4; ++i) worst = std::max(worst, (a[i] - b[(i + turn) % 4]).norm());
    best = std::min(best, worst);
  }
  return best;
}

std::vector<detect::SideQuad> side_quads(const std::vector<Segment>& segments, double least_side_px,
                                         std::size_t most,
                                         const std::optional<Eigen::Matrix3d>& calibration) {
  return detect::SideQuadFinder().find(segments, least_side_px, most, calibration);
}

TEST(SideQuads, PartsOfFourSidesMakeASquare) {
  const detect::Quad quad{{{100, 100}, {300, 120}, {280, 310}, {90, 290}}};
  const auto quads = side_quads(
      parts(quad, {{0, 0.1, 0.3}, {0, 0.6, 0.7}, {1, 0.2, 0.5}, {2, 0.5, 0.9}, {3, 0.3, 0.6}}),
      40.0, 10, std::nullopt);
  ASSERT_FALSE(quads.empty());
  EXPECT_LT(worst_corner(quads.front().corners, quad), 1e-6);
  EXPECT_NEAR(quads.front().seen, 0.33, 0.02);
}

TEST(SideQuads, SidesOfOneSquareAreInOneLight) {
  const detect::Quad quad{{{100, 100}, {300, 120}, {280, 310}, {90, 290}}};
  auto seen = parts(quad, {{0, 0.1, 0.5}, {1, 0.2, 0.5}, {2, 0.5, 0.9}, {3, 0.3, 0.6}});
  EXPECT_FALSE(side_quads(seen, 40.0, 10, std::nullopt).empty());
  seen[2].dark = 110.0;
  EXPECT_TRUE(side_quads(seen, 40.0, 10, std::nullopt).empty());
}

// As along the squares of a chessboard.
TEST(SideQuads, TheDarkLiesInsideAllAlong) {
  const detect::Quad quad{{{100, 100}, {300, 120}, {280, 310}, {90, 290}}};
  auto seen =
      parts(quad, {{0, 0.1, 0.3}, {0, 0.5, 0.7}, {1, 0.2, 0.5}, {2, 0.5, 0.9}, {3, 0.3, 0.6}});
  EXPECT_FALSE(side_quads(seen, 40.0, 10, std::nullopt).empty());
  const Point way = quad[1] - quad[0];
  seen.push_back({quad[0] + 0.5 * way, quad[0] + 0.3 * way, 30.0, 200.0});
  EXPECT_TRUE(side_quads(seen, 40.0, 10, std::nullopt).empty());
}

TEST(SideQuads, AreToldOnce) {
  const detect::Quad quad{{{100, 100}, {300, 120}, {280, 310}, {90, 290}}};
  auto seen = parts(quad, {{0, 0.1, 0.5}, {1, 0.2, 0.5}, {2, 0.5, 0.9}, {3, 0.3, 0.6}});
  // Two edges three pixels apart make two lines, and squares that are nearly one.
  seen.push_back({seen[0].a + Point(0, 3), seen[0].b + Point(0, 3), 30.0, 200.0});
  EXPECT_EQ(side_quads(seen, 40.0, 10, std::nullopt).size(), 1U);
}

TEST(SideQuads, TheCameraCompletesASquareOfThreeSides) {
  const Camera camera = Camera::pinhole(750, 480, 700.0);
  const Eigen::Isometry3d pose = lab::look_at_marker({0.5, 0.5}, 2.5, 35 * kDegree, 0.6, 1.1);
  detect::Quad quad;
  const std::array<Vector2d, 4> square{{{0, 0}, {1, 0}, {1, 1}, {0, 1}}};
  for (std::size_t i = 0; i < 4; ++i)
    quad[i] = *camera.project(pose * Eigen::Vector3d(square[i].x(), square[i].y(), 0.0));
  const auto seen = parts(quad, {{3, 0.2, 0.9}, {0, 0.1, 0.8}, {1, 0.1, 0.6}});
  EXPECT_TRUE(side_quads(seen, 40.0, 10, std::nullopt).empty());
  const auto quads = side_quads(seen, 40.0, 10, camera.matrix());
  ASSERT_FALSE(quads.empty());
  EXPECT_LT(worst_corner(quads.front().corners, quad), 1e-6);
}

MarkerSet layers(int count) {
  DictionaryOptions options;
  options.child_cells.assign(static_cast<std::size_t>(count - 1), quincunx(5));
  options.effort = 0.05;
  return build_markers(generate_dictionary(options), 1.0);
}

TEST(EdgeTemplate, HoldsEveryEdgeOfASingleMarkerOnce) {
  MarkerSet set = layers(1);
  const Code& code = set.parents[0].marker.code;
  int expected = 0;  // pairs of neighbouring cells of different colours, the black ring included
  const auto white = [&](int row, int column) {
    return row >= 0 && column >= 0 && row < 5 && column < 5 && code.white(row * 5 + column);
  };
  for (int row = -1; row < 5; ++row)
    for (int column = -1; column < 5; ++column) {
      expected += white(row, column) != white(row, column + 1);
      expected += white(row, column) != white(row + 1, column);
    }
  const auto edges = detect::edge_template(InkMap(set, 0), set, 0);
  const auto border = std::count_if(edges.begin(), edges.end(),
                                    [](const detect::TemplateEdge& e) { return e.border; });
  EXPECT_EQ(border, 4 * 7);
  EXPECT_EQ(static_cast<int>(edges.size()) - border, expected);
  for (const detect::TemplateEdge& edge : edges) {
    EXPECT_NEAR(edge.length(), 1.0 / 7.0, 1e-12);
    EXPECT_NEAR(edge.black, 1.0 / 7.0, 1e-9);  // a cell's width, or farther: as far as is looked
    EXPECT_NEAR(edge.white, 1.0 / 7.0, 1e-9);
  }
}

TEST(Registration, TurnsWithItsLight) {
  detect::Registration registration;
  registration.image_H_unit << 100, 3, 40, 2, 90, 30, 0.01, 0.02, 1.0;
  registration.levels.black = {20, 3, 5};
  registration.levels.white = {200, -30, 10};
  for (int turns = 0; turns < 4; ++turns) {
    const detect::Registration turned = detect::turned(registration, turns);
    const auto before = detect::corners_of(registration.image_H_unit);
    const auto after = detect::corners_of(turned.image_H_unit);
    for (std::size_t i = 0; i < 4; ++i)
      EXPECT_LT((after[i] - before[(i + static_cast<std::size_t>(turns)) % 4]).norm(), 1e-9);
    // The upright corner (0, 0) is corner `turns` of the one before.
    const std::array<Vector2d, 4> unit{{{0, 0}, {1, 0}, {1, 1}, {0, 1}}};
    const Vector2d corner = unit[static_cast<std::size_t>(turns)];
    EXPECT_NEAR(turned.levels.black_at({0, 0}), registration.levels.black_at(corner), 1e-9);
    EXPECT_NEAR(turned.levels.white_at({0, 0}), registration.levels.white_at(corner), 1e-9);
  }
}

TEST(Pyramid, HalvesAndKeepsPlaces) {
  Image image(9, 6);
  for (int y = 0; y < 6; ++y)
    for (int x = 0; x < 9; ++x) image.row(y)[x] = static_cast<std::uint8_t>(20 * x + 4 * y);
  detect::Pyramid pyramid;
  pyramid.build(image.view());
  ASSERT_EQ(pyramid.levels(), 3);  // 9 x 6, 4 x 3, 2 x 1
  EXPECT_EQ(pyramid.level(1).width(), 4);
  EXPECT_EQ(pyramid.level(2).height(), 1);
  EXPECT_EQ(pyramid.level(1)(1, 2), (40 + 60 + 40 + 60 + 2 * 16 + 2 * 20) / 4);
  // The first pixel of half the size lies between the first two of either row.
  EXPECT_LT((detect::Pyramid::in_whole({0, 0}, 1) - Point(0.5, 0.5)).norm(), 1e-12);
  EXPECT_LT((detect::Pyramid::in_level({5.5, 1.5}, 2) - Point(1.0, 0.0)).norm(), 1e-12);
}

TEST(Pyramid, RowsMadeByOthersAreTheSame) {
  // Of sizes that leave a part of a band, of a pair of rows, and nothing.
  for (const int height : {1, 2, 9, 14, 64}) {
    Image image(70, height);
    for (std::size_t i = 0; i < image.pixels.size(); ++i)
      image.pixels[i] = static_cast<std::uint8_t>(i * 37 % 251);
    detect::Pyramid alone;
    alone.build(image.view(), 2);
    detect::Pyramid pyramid;
    pyramid.begin(image.view());
    detect::Workers workers;
    detect::Threshold threshold;
    threshold.measure(image.view(), detect::Threshold::kAll, workers, &pyramid);
    ASSERT_EQ(pyramid.levels(), alone.levels()) << height;
    for (int y = 0; alone.levels() > 1 && y < height / 2; ++y)
      for (int x = 0; x < 35; ++x)
        ASSERT_EQ(pyramid.level(1)(x, y), alone.level(1)(x, y)) << height << ": " << x << ", " << y;
  }
}

TEST(Quads, ThatAreNearlyOneAreOne) {
  const detect::Quad quad{{{0, 0}, {100, 0}, {100, 100}, {0, 100}}};
  const detect::Quad turned{{{100, 1}, {101, 100}, {0, 100}, {0, 0}}};
  const detect::Quad other{{{0, 0}, {100, 0}, {100, 100}, {0, 104}}};
  EXPECT_EQ(detect::different({quad, turned, other, quad}, 0.02).size(), 2U);
  EXPECT_EQ(detect::different({quad, turned, other, quad}, 0.005).size(), 3U);
}

/// A marker's picture, as blurred as an image of 180 pixels has it.
struct Blurred {
  detect::Texels texels;
  detect::BlurredPicture picture;
};
Blurred blurred_picture(const MarkerSet& set) {
  Blurred blurred;
  detect::blur_picture(detect::picture_of(ink_plan(set, 0)), 0.6,
                       set.parents[0].marker.code.cells + 2, blurred.texels, blurred.picture);
  return blurred;
}

TEST(Likeness, PicturesAreAsWhiteAsTheirInk) {
  for (const int count : {1, 3}) {
    const MarkerSet set = layers(count);
    const InkMap ink(set, 0);
    const detect::Texels picture = detect::picture_of(ink.plan());
    const double texel = ink.plan().square.width() / detect::kTexelsAcross;
    for (int row = 0; row < detect::kTexelsAcross; ++row)
      for (int column = 0; column < detect::kTexelsAcross; ++column)
        ASSERT_NEAR(
            picture[detect::texel_index(row, column)],
            ink.white_share({column * texel, row * texel, (column + 1) * texel, (row + 1) * texel}),
            1e-5)
            << count << " layers, row " << row << ", column " << column;
  }
}

TEST(Likeness, IsThatOfWhatIsSeen) {
  const MarkerSet set = layers(2);
  const auto [texels, picture] = blurred_picture(set);
  const detect::Likeness whole = detect::likeness(picture.blocks, picture);
  // Five of 25 cells hold a child; a cell is 18 texels wide, a block four.
  EXPECT_EQ(whole.patterned + whole.even, 23 * 23);
  EXPECT_GT(whole.patterned, 5 * 16);
  for (int turns = 1; turns < 4; ++turns) {
    detect::Blocks turned;
    detect::turn(picture.blocks, turns, turned);
    EXPECT_LT(detect::likeness(turned, picture).patterned, whole.patterned / 2);
    detect::Blocks back;
    detect::turn(turned, 4 - turns, back);
    EXPECT_EQ(back.texels, picture.blocks.texels);
  }
  // The right half is covered, then beyond the image.
  for (const float hidden : {0.5F, std::numeric_limits<float>::quiet_NaN()}) {
    detect::Texels half = texels;
    for (int row = 0; row < detect::kTexelsAcross; ++row)
      for (int column = detect::kTexelsAcross / 2; column < detect::kTexelsAcross; ++column)
        half[detect::texel_index(row, column)] = hidden;
    detect::Blocks seen;
    detect::cut(half, 7, seen);
    const detect::Likeness left = detect::likeness(seen, picture);
    EXPECT_NEAR(left.patterned, whole.patterned / 2, whole.patterned / 5);
    EXPECT_GT(left.patterned, 0);
  }
}

TEST(Likeness, TurnsBlocksAsTheSquareIsTurned) {
  detect::Texels texels(detect::texel_index(detect::kTexelsAcross, 0));
  for (std::size_t i = 0; i < texels.size(); ++i)
    texels[i] = static_cast<float>(i % 61) / 61.0F + static_cast<float>(i % 17) / 17.0F;
  constexpr int kLast = detect::kTexelsAcross - 1;
  for (const int cells : {6, 7, 8, 11}) {
    detect::Blocks blocks;
    detect::cut(texels, cells, blocks);
    detect::Texels quarter(texels.size());
    for (int row = 0; row <= kLast; ++row)
      for (int column = 0; column <= kLast; ++column)
        quarter[detect::texel_index(row, column)] =
            texels[detect::texel_index(column, kLast - row)];
    detect::Blocks expected;
    detect::cut(quarter, cells, expected);
    detect::Blocks turned;
    detect::turn(blocks, 1, turned);
    EXPECT_EQ(turned.across, expected.across) << cells;
    EXPECT_EQ(turned.texels, expected.texels) << cells;
  }
}

// A cell of such a marker is sixteen texels wide, four blocks.
TEST(Likeness, SeesThePatternOfSixBySixCells) {
  MarkerSet set = layers(1);
  set.cells = 6;
  set.parents[0].marker.code = parse_code("110100101101001010110101001011011010");
  const auto blurred = blurred_picture(set);
  EXPECT_GT(detect::likeness(blurred.picture.blocks, blurred.picture).patterned, 100);
}

TEST(Likeness, UnwarpsTheImageAsTheRegistrationSays) {
  const MarkerSet set = layers(2);
  lab::Scene scene;
  scene.camera = Camera::pinhole(750, 480, 700.0);
  scene.parents = {{0, lab::look_at_marker({0.5, 0.5}, 1.8, 20 * kDegree, 0.3, 0.4)}};
  const Image image = lab::render(scene, set, 1);
  detect::Quad quad;
  const std::array<Vector2d, 4> square{{{0, 0}, {1, 0}, {1, 1}, {0, 1}}};
  for (std::size_t i = 0; i < 4; ++i)
    quad[i] = *scene.camera.project(scene.parents[0].camera_T_marker *
                                    Eigen::Vector3d(square[i].x(), square[i].y(), 0.0));
  detect::FitMemory memory;
  const auto registration = detect::fit_border(image.view(), detect::Lens(), quad, 7, memory);
  ASSERT_TRUE(registration);
  detect::Pyramid pyramid;
  pyramid.build(image.view());
  detect::Unwarped unwarped;
  detect::unwarp(pyramid, detect::Lens(), *registration, 7, unwarped);
  detect::Blocks seen;
  detect::cut(unwarped.texels, 7, seen);
  detect::Texels texels;
  detect::BlurredPicture picture;
  detect::blur_picture(detect::picture_of(ink_plan(set, 0)), unwarped.blur, 7, texels, picture);
  const detect::Likeness likeness = detect::likeness(seen, picture);
  EXPECT_GT(likeness.patterned + likeness.even, 0.97 * 23 * 23);
}

TEST(CellVotes, SpeakForTheMarkerOnlyIfItIsTheOne) {
  const MarkerSet set = layers(2);
  const double texel = set.parents[0].side_m / detect::kTexelsAcross;
  std::vector<detect::CellSquare> children;
  int black = 0;
  for (const PlacedMarker& marker : place(set)) {
    if (marker.layer != 2) continue;
    children.push_back({marker.origin_m / texel, marker.side_m / texel, 7});
    black += marker.code.black_count();
  }
  const detect::Texels picture = blurred_picture(set).texels;
  const detect::CellVotes own = detect::cell_votes(picture, picture, children);
  EXPECT_EQ(own.predicted, black);
  EXPECT_EQ(own.confirmed, black);
  EXPECT_EQ(own.wrong, 0);
  // Children turned by a half are others.
  const detect::Texels turned(picture.rbegin(), picture.rend());
  const detect::CellVotes others = detect::cell_votes(turned, picture, children);
  EXPECT_LT(others.confirmed, black / 2);
  EXPECT_GT(others.wrong, others.confirmed);
  // Whatever is of one grey says nothing.
  const detect::Texels grey(picture.size(), 0.5F);
  const detect::CellVotes nothing = detect::cell_votes(grey, picture, children);
  EXPECT_EQ(nothing.confirmed + nothing.wrong, 0);
}

TEST(Prediction, CarriesCornersAndTheirErrorsOverTheSheet) {
  const MarkerSet set = layers(2);
  const auto placed = place(set);
  const Camera camera = Camera::pinhole(750, 480, 700.0);
  const Eigen::Isometry3d pose = lab::look_at_marker({0.5, 0.5}, 2.0, 30 * kDegree, 0.4, 0.2);
  const auto corners_of = [&](const PlacedMarker& marker) {
    std::array<Vector2d, 4> pixels;
    for (std::size_t i = 0; i < 4; ++i) {
      const Vector2d corner = marker.corners_m()[i];
      pixels[i] = *camera.project(pose * Eigen::Vector3d(corner.x(), corner.y(), 0.0));
    }
    return pixels;
  };
  Detection seen;
  seen.placed = 1;
  seen.corners = corners_of(placed[1]);
  seen.corner_covariance = Matrix8d::Identity() * 0.01;
  const auto prediction = detect::Prediction::from(seen, placed[1], detect::Lens());
  ASSERT_TRUE(prediction);
  const auto itself = prediction->of(placed[1]);
  ASSERT_TRUE(itself);
  EXPECT_LT((itself->covariance - seen.corner_covariance).norm(), 1e-4);
  const auto parent = prediction->of(placed[0]);
  ASSERT_TRUE(parent);
  for (std::size_t i = 0; i < 4; ++i)
    EXPECT_LT((parent->corners[i] - corners_of(placed[0])[i]).norm(), 1e-6);
  // The first child lies at its parent's first corner: the farther, the less is known.
  EXPECT_GT(parent->covariance(4, 4), 10.0 * parent->covariance(0, 0));
  EXPECT_GT(parent->covariance(0, 0), 0.01);
}

/// Poses of a marker at `range` (1 m is 700 pixels) while blobs of all greys cover `share` of it.
struct Survivors {
  int right = 0;
  int wrong = 0;
  int frames = 0;
};
Survivors cover_and_look(double share, int most_blobs, int frames, double range = 2.8) {
  const MarkerSet set = layers(3);
  const Camera camera = Camera::pinhole(750, 480, 700.0);
  Detector detector(set, camera);
  PoseOptions options;
  options.align = false;
  Survivors result;
  for (; result.frames < frames; ++result.frames) {
    std::mt19937_64 random(static_cast<std::uint64_t>(result.frames) + 77U);
    std::uniform_real_distribution<double> unit(0.0, 1.0);
    lab::Scene scene;
    scene.camera = camera;
    scene.grey = 60.0 + 120.0 * unit(random);
    scene.parents.push_back({0, lab::look_at_marker({0.5, 0.5}, range, 40 * kDegree * unit(random),
                                                    2 * std::numbers::pi * unit(random),
                                                    2 * std::numbers::pi * unit(random))});
    const Eigen::Isometry3d& truth = scene.parents[0].camera_T_marker;
    lab::FloatImage exact = lab::render_exact(scene, set);
    lab::draw_blobs(exact, lab::cover(1.0, share, most_blobs, random), camera, truth, 0.6);
    const Image image = lab::expose(exact, 2.0, random());
    bool right = false;
    for (const Pose& pose :
         estimate_poses(image.view(), detector.detect(image.view()), set, camera, options)) {
      double worst = 0.0;
      for (const Vector2d& corner :
           {Vector2d(0, 0), Vector2d(1, 0), Vector2d(1, 1), Vector2d(0, 1)}) {
        const Eigen::Vector3d point(corner.x(), corner.y(), 0.0);
        worst = std::max(
            worst, (*camera.project(pose.camera_T_marker * point) - *camera.project(truth * point))
                       .norm());
      }
      right |= worst < 3.0;
      result.wrong += worst >= 3.0;
    }
    result.right += right;
  }
  return result;
}

TEST(Covered, HalfOfTheMarkerWillDo) {
  const Survivors many = cover_and_look(0.5, 1000, 12);
  EXPECT_GE(many.right, 11);
  EXPECT_EQ(many.wrong, 0);
  const Survivors one = cover_and_look(0.5, 1, 8);
  EXPECT_GE(one.right, 7);
  EXPECT_EQ(one.wrong, 0);
}

TEST(Covered, ThreeTenthsOfTheMarkerOftenDo) {
  const Survivors many = cover_and_look(0.7, 1000, 12);
  EXPECT_GE(many.right, 8);
  EXPECT_EQ(many.wrong, 0);
}

// Children of 17 pixels, no quad of which is left whole.
TEST(Covered, SmallMarkersToo) {
  const Survivors many = cover_and_look(0.7, 1000, 8, 5.8);
  EXPECT_GE(many.right, 5);
  EXPECT_EQ(many.wrong, 0);
  const Survivors one = cover_and_look(0.5, 1, 4, 5.8);
  EXPECT_EQ(one.right, 4);
  EXPECT_EQ(one.wrong, 0);
}

// Markers of 400 pixels that the image cuts besides.
TEST(Covered, HalfWillDoAtTheImagesBorderToo) {
  const Survivors many = cover_and_look(0.5, 1000, 12, 1.75);
  EXPECT_GE(many.right, 10);
  EXPECT_EQ(many.wrong, 0);
}

// A search that the frame before has made likely gives the same as one that nobody expected.
TEST(Covered, TheFrameBeforeChangesNothing) {
  const MarkerSet set = layers(1);
  const Camera camera = Camera::pinhole(750, 480, 700.0);
  std::vector<Image> frames;
  for (const std::uint64_t seed : {5U, 6U}) {
    std::mt19937_64 random(seed);
    lab::Scene scene;
    scene.camera = camera;
    scene.parents.push_back({0, lab::look_at_marker({0.5, 0.5}, 3.0, 0.2, 0.0, 0.0)});
    lab::FloatImage exact = lab::render_exact(scene, set);
    lab::draw_blobs(exact, lab::cover(1.0, 0.4, 1, random), camera,
                    scene.parents[0].camera_T_marker, 0.6);
    frames.push_back(lab::expose(exact, 2.0, seed));
  }
  Detector fresh(set, camera);
  Detector used(set, camera);
  used.detect(frames[0].view());
  const std::vector<Detection> expected = fresh.detect(frames[1].view());
  const std::vector<Detection> found = used.detect(frames[1].view());
  ASSERT_EQ(expected.size(), 1U);
  EXPECT_LT(expected[0].visible, 1.0);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].corners, expected[0].corners);
}

// One black square without cells, and more than are looked at.
TEST(Covered, ThereIsABudgetOfSquares) {
  Detector detector(layers(1));
  for (const int count : {1, 12}) {
    Image image(750, 480, 200);
    for (int i = 0; i < count; ++i) {
      const int left = 40 + 170 * (i % 4);
      const int top = 30 + 150 * (i / 4);
      cover_with(image, left, top, left + 110, top + 110, 30);
    }
    EXPECT_TRUE(detector.detect(image.view()).empty());
    EXPECT_EQ(detector.statistics().budget_reached, count > 1) << count;
  }
}

// As those of AprilTag 36h11.
TEST(Covered, MarkersOfSixBySixCellsToo) {
  MarkerSet set = layers(1);
  set.cells = 6;
  set.parents[0].marker.code = parse_code("110101110110000010100111010100001101");
  lab::Scene scene;
  scene.camera = Camera::pinhole(750, 480, 700.0);
  Detector detector(set, scene.camera);
  for (std::uint64_t frame = 0; frame < 5; ++frame) {
    const auto turn = static_cast<double>(frame);
    scene.parents = {{0, lab::look_at_marker({0.5, 0.5}, 2.2 + 0.5 * turn, 25 * kDegree, 0.7 * turn,
                                             0.4 * turn)}};
    lab::FloatImage exact = lab::render_exact(scene, set);
    std::mt19937_64 random(frame);
    lab::draw_blobs(exact, lab::cover(1.0, 0.3, 1000, random), scene.camera,
                    scene.parents[0].camera_T_marker, 0.6);
    const auto detections = detector.detect(lab::expose(exact, 2.0, frame).view());
    ASSERT_EQ(detections.size(), 1U) << frame;
    EXPECT_LT(detections[0].visible, 1.0) << frame;
    for (std::size_t i = 0; i < 4; ++i) {
      const Vector2d corner = detector.placed()[0].corners_m()[i];
      const Eigen::Vector3d point(corner.x(), corner.y(), 0.0);
      EXPECT_LT((detections[0].corners[i] -
                 *scene.camera.project(scene.parents[0].camera_T_marker * point))
                    .norm(),
                1.0)
          << frame;
    }
  }
}

// The other code differs in five cells. Their edges show that nothing covers them.
TEST(Covered, AMarkerOfAnotherCodeIsNotACoveredOne) {
  MarkerSet set = layers(1);
  set.parents[0].marker.code = parse_code("1101110001101110110011001");
  MarkerSet others = set;
  others.parents[0].marker.code = parse_code("1101100011111110110110001");
  lab::Scene scene;
  scene.camera = Camera::pinhole(750, 480, 700.0);
  Detector detector(set, scene.camera);
  for (int turn = 0; turn < 12; ++turn) {
    const Eigen::Isometry3d pose =
        lab::look_at_marker({0.5, 0.5}, 1.6 + 0.15 * turn, 20 * kDegree, 0.5 * turn, 0.4 * turn);
    scene.parents = {{0, pose}};
    EXPECT_TRUE(detector.detect(lab::render(scene, others, 1).view()).empty()) << turn;
    EXPECT_FALSE(detector.detect(lab::render(scene, set, 1).view()).empty()) << turn;
  }
}

// Blobs hide what contradicts; the cells of the children that are left still do.
TEST(Covered, NorIsACoveredMarkerOfAnotherSet) {
  const MarkerSet set = layers(2);
  MarkerSet others = set;
  for (const int cell : {1, 7, 11, 16, 18})
    others.parents[0].marker.code.bits ^= std::uint64_t{1} << cell;
  for (std::size_t i = 0; i < 5; ++i)
    others.parents[0].marker.children[i].code = set.parents[0].marker.children[(i + 1) % 5].code;
  lab::Scene scene;
  scene.camera = Camera::pinhole(750, 480, 700.0);
  Detector detector(set, scene.camera);
  int right = 0;
  for (std::size_t frame = 0; frame < 5; ++frame) {
    std::mt19937_64 random(frame);
    const auto turn = static_cast<double>(frame);
    scene.parents = {{0, lab::look_at_marker({0.5, 0.5}, 2.0 + 0.4 * turn, 25 * kDegree, 0.7 * turn,
                                             0.4 * turn)}};
    const auto blobs = lab::cover(1.0, 0.3, 1000, random);
    const auto seen = [&](const MarkerSet& shown) {
      lab::FloatImage exact = lab::render_exact(scene, shown);
      lab::draw_blobs(exact, blobs, scene.camera, scene.parents[0].camera_T_marker, 0.6);
      const auto detections = detector.detect(lab::expose(exact, 2.0, frame).view());
      return std::any_of(detections.begin(), detections.end(),
                         [](const Detection& detection) { return detection.visible < 1.0; });
    };
    EXPECT_FALSE(seen(others)) << frame;
    right += seen(set);
  }
  EXPECT_EQ(right, 5);
}

lab::Scene far_away(double side_px) {
  lab::Scene scene;
  scene.camera = Camera::pinhole(750, 480, 700.0);
  scene.parents.push_back(
      {0, lab::look_at_marker({0.5, 0.5}, 700.0 / side_px, 20 * kDegree, 0.3, 0.4)});
  return scene;
}

TEST(Relations, WhatIsPartlyCoveredHasToAgreeWithWhatIsWhole) {
  const MarkerSet set = test::three_layers();
  const std::vector<PlacedMarker> placed = place(set);
  // A pixel is two millimetres; the child lies 0.3 of its side beside its place.
  const auto seen = [&](std::size_t index, const Vector2d& shift_m) {
    Detection detection;
    detection.placed = static_cast<int>(index);
    detection.layer = placed[index].layer;
    for (std::size_t i = 0; i < 4; ++i)
      detection.corners[i] = (placed[index].corners_m()[i] + shift_m) / 0.002;
    return detection;
  };
  const detect::Lens lens;
  const detect::Relations relations(placed, lens);
  Detection parent = seen(0, {0.0, 0.0});
  const Detection child = seen(1, {0.3 * placed[1].side_m, 0.0});
  EXPECT_FALSE(relations.agree(parent, child));
  EXPECT_FALSE(relations.contradict(parent, child));
  parent.visible = 0.3;
  EXPECT_TRUE(relations.contradict(parent, child));
  EXPECT_FALSE(relations.contradict(parent, seen(1, {0.0, 0.0})));
}

TEST(Inferred, SmallChildrenAreConfirmedWhereTheParentSaysTheyAre) {
  const MarkerSet set = layers(2);
  const lab::Scene scene = far_away(78.0);  // children of 11 pixels
  const Image image = lab::render(scene, set, 1);
  DetectorOptions options;
  options.infer = false;
  const std::size_t measured = Detector(set, options).detect(image.view()).size();
  EXPECT_LT(measured, 6U);
  const auto detections = Detector(set).detect(image.view());
  EXPECT_EQ(detections.size(), 6U);
  const auto placed = place(set);
  for (const Detection& detection : detections)
    for (std::size_t i = 0; i < 4; ++i) {
      const Vector2d corner = placed[static_cast<std::size_t>(detection.placed)].corners_m()[i];
      const Eigen::Vector3d point(corner.x(), corner.y(), 0.0);
      EXPECT_LT(
          (detection.corners[i] - *scene.camera.project(scene.parents[0].camera_T_marker * point))
              .norm(),
          detection.inferred ? 0.2 : 1.0);
    }
  // They are no evidence of their own.
  for (const Pose& pose : estimate_poses({}, detections, set, scene.camera)) {
    EXPECT_EQ(pose.markers, static_cast<int>(measured));
    for (const int index : pose.detections)
      EXPECT_FALSE(detections[static_cast<std::size_t>(index)].inferred);
  }
}

TEST(Inferred, WhatIsCoveredIsRefuted) {
  const MarkerSet set = layers(2);
  const lab::Scene scene = far_away(78.0);
  lab::FloatImage exact = lab::render_exact(scene, set);
  const PlacedMarker middle = place(set)[3];
  const Vector2d centre = middle.origin_m + Vector2d::Constant(0.5 * middle.side_m);
  lab::draw_blobs(exact, {{centre, 0.5 * middle.side_m, 130.0}}, scene.camera,
                  scene.parents[0].camera_T_marker, 0.6);
  const Image image = lab::expose(exact, 2.0, 5);
  for (const Detection& detection : Detector(set).detect(image.view()))
    EXPECT_NE(detection.placed, 3);
}

TEST(Blobs, CoverWhatTheyPromise) {
  std::mt19937_64 random(3);
  const auto one = lab::cover(2.0, 0.5, 1, random);
  ASSERT_EQ(one.size(), 1U);
  EXPECT_NEAR(std::numbers::pi * one[0].radius * one[0].radius, 2.0, 1e-9);
  EXPECT_GE(one[0].centre.minCoeff(), one[0].radius - 1e-12);
  EXPECT_LE(one[0].centre.maxCoeff(), 2.0 - one[0].radius + 1e-12);
  EXPECT_GT(lab::cover(2.0, 0.7, 1000, random).size(), 5U);
  EXPECT_TRUE(lab::cover(2.0, 0.0, 1000, random).empty());
  EXPECT_THROW(lab::cover(2.0, 1.0, 10, random), std::invalid_argument);
}

}  // namespace
}  // namespace harco
