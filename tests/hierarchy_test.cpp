#include "hierarchy.hpp"

#include <array>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <random>
#include <set>
#include <stdexcept>
#include <string>

#include <gtest/gtest.h>
#include <opencv2/aruco.hpp>

#include "families.hpp"
#include "lab/render.hpp"
#include "number_list.hpp"
#include "other_detectors.hpp"

namespace harco::cli {
namespace {

using Cells = std::vector<int>;

TEST(ParseList, TakesNumbersAndRanges) {
  EXPECT_EQ(parse_list("0-3,7", 10, "--ids"), (Cells{0, 1, 2, 3, 7}));
  EXPECT_EQ(parse_list("5", 10, "--ids"), Cells{5});
  EXPECT_EQ(parse_list("9,2-2", 10, "--ids"), (Cells{9, 2}));
}

TEST(ParseList, RefusesEverythingElseAndSaysWhere) {
  for (const char* text : {"", ",", "1,", "a", "1-", "-1", "1-2-3", "3-1", "1,1", "0-3,2", "10",
                           "0-10", "1.5", " 1", "99999999999999"}) {
    try {
      parse_list(text, 10, "--ids");
      ADD_FAILURE() << "'" << text << "' was taken";
    } catch (const std::invalid_argument& error) {
      EXPECT_NE(std::string(error.what()).find("--ids '" + std::string(text) + "'"),
                std::string::npos);
    }
  }
}

TEST(ChildLayout, OfAnAllWhiteMarkerIsTheQuincunx) {
  const Code white{5, (std::uint64_t{1} << 25) - 1};
  EXPECT_EQ(child_cells(white, parse_child_layout("spread", 5)), quincunx(5));
  EXPECT_EQ(child_cells(white, parse_child_layout("spread:1", 5)), Cells{12});
  EXPECT_EQ(child_cells(white, parse_child_layout("checkerboard", 5)), checkerboard(5));
}

TEST(ChildLayout, TakesOnlyWhiteCells) {
  const Code code = parse_code(
      "1000"
      "0110"
      "0110"
      "0001");
  // Spread: of the four middle cells the first, then the corner farthest from it.
  EXPECT_EQ(child_cells(code, parse_child_layout("quincunx", 4)), (Cells{0, 5, 15}));
  EXPECT_EQ(child_cells(code, parse_child_layout("0-3,10", 4)), (Cells{0, 10}));
  EXPECT_EQ(child_cells(code, parse_child_layout("spread:2", 4)), (Cells{5, 15}));
  EXPECT_EQ(child_cells(code, parse_child_layout("1,2", 4)), Cells{});
}

TEST(ChildLayout, SpreadSharesNoEdgeAndIsAsLargeAsAskedFor) {
  std::mt19937_64 random(11);
  for (int trial = 0; trial < 2000; ++trial) {
    const int n = 4 + trial % 4;
    const Code code{n, random() & ((std::uint64_t{1} << (n * n)) - 1)};
    const int most = 1 + trial % 9;
    const Cells cells = child_cells(code, {most, std::nullopt});
    EXPECT_LE(static_cast<int>(cells.size()), most);
    EXPECT_EQ(cells.empty(), code.bits == 0);
    for (const int a : cells) {
      EXPECT_TRUE(code.white(a));
      for (const int b : cells)
        EXPECT_NE(std::abs(a / n - b / n) + std::abs(a % n - b % n), 1) << to_string(code);
    }
    if (static_cast<int>(cells.size()) == most) continue;
    // Fewer only where every other white cell touches one of them.
    for (int other = 0; other < n * n; ++other) {
      if (!code.white(other)) continue;
      const bool near = std::any_of(cells.begin(), cells.end(), [&](int cell) {
        return std::abs(other / n - cell / n) + std::abs(other % n - cell % n) <= 1;
      });
      EXPECT_TRUE(near) << to_string(code);
    }
  }
}

TEST(ChildLayout, OtherWordsAreRefused) {
  for (const char* text : {"", "spread:", "spread:0", "spread:x", "ring", "16", "0,0", "3-1"})
    EXPECT_THROW(parse_child_layout(text, 4), std::invalid_argument) << text;
}

TEST(Hierarchy, NeedsParentsAndTwoLayers) {
  EXPECT_THROW(codes_for_hierarchy({}, {}), std::invalid_argument);
  HierarchyOptions flat;
  flat.layers = 1;
  EXPECT_THROW(codes_for_hierarchy({parse_code("1000011001100001")}, flat), std::invalid_argument);
}

// --- Other detectors still read the parents -----------------------------------------------------

constexpr double kSide = 1.0;

MarkerSet hierarchy(const std::string& family, int layers) {
  Family read;
  harco_load_family(family, read);
  read.codes.resize(8);
  HierarchyOptions options;
  options.layers = layers;
  DictionaryOptions codes = codes_for_hierarchy(read.codes, options);
  codes.child_distance = 4;  // soon found
  return build_markers(generate_dictionary(codes), kSide);
}

/// Every parent at every size (in pixels of its side), tilted and turned.
template <typename Read>
void expect_parents_are_read(const std::string& family, Read read) {
  for (const int layers : {2, 3}) {
    const MarkerSet markers = hierarchy(family, layers);
    ASSERT_EQ(markers.layers(), layers);
    for (const double size : {40.0, 90.0, 250.0})
      for (std::size_t i = 0; i < markers.parents.size(); ++i) {
        SCOPED_TRACE(family + ", " + std::to_string(layers) + " layers, parent " +
                     std::to_string(i) + ", " + std::to_string(size) + " px");
        lab::Scene scene;
        scene.camera = Camera::pinhole(480, 480, 600.0);
        scene.quiet_zone_cells = 3.0;
        const auto turn = static_cast<double>(i);
        const Eigen::Isometry3d pose = lab::look_at_marker(
            {kSide / 2, kSide / 2}, 600.0 * kSide / size, 0.35, turn, 1.6 * turn);
        scene.parents.push_back({static_cast<int>(i), pose});

        std::array<Eigen::Vector2d, 4> corners;
        for (std::size_t k = 0; k < 4; ++k) {
          const Eigen::Vector2d at = place(markers).front().corners_m()[k];
          corners[k] = *scene.camera.project(pose * Eigen::Vector3d(at.x(), at.y(), 0.0));
        }
        Cells ids;
        for (const test::Reading& reading : read(lab::render(scene, markers, i))) {
          double off = 0.0;
          for (std::size_t k = 0; k < 4; ++k)
            off = std::max(off, (reading.corners[k] - corners[k]).norm());
          if (off < 2.0) ids.push_back(reading.id);
        }
        EXPECT_EQ(ids, Cells{static_cast<int>(i)});
      }
  }
}

TEST(Hierarchy, OfArucoParentsIsReadByOpenCv) {
  const std::array<std::pair<const char*, int>, 4> families{
      {{"aruco:4x4_50", cv::aruco::DICT_4X4_50},
       {"aruco:5x5_250", cv::aruco::DICT_5X5_250},
       {"aruco:6x6_250", cv::aruco::DICT_6X6_250},
       {"aruco:7x7_1000", cv::aruco::DICT_7X7_1000}}};
  for (const auto& [family, number] : families)
    expect_parents_are_read(family, [dictionary = number](const Image& image) {
      return test::read_by_opencv(image, dictionary);
    });
}

TEST(Hierarchy, OfAprilTagParentsIsReadByLibapriltag) {
  for (const char* name : {"25h9", "36h11"})
    expect_parents_are_read(std::string("apriltag:") + name, [&](const Image& image) {
      return test::read_by_apriltag(image, name);
    });
}

/// AprilTag's detector takes one sample in the middle of each cell: it must be white at any depth.
TEST(Hierarchy, TheMiddleOfEveryChildIsWhite) {
  const MarkerSet markers = hierarchy("apriltag:36h11", 3);
  int children = 0;
  for (const PlacedMarker& placed : place(markers)) {
    if (placed.layer == 1) continue;
    ++children;
    EXPECT_TRUE(placed.code.white(12)) << placed.id;
  }
  EXPECT_EQ(children, 8 * (5 + 25));
}

}  // namespace
}  // namespace harco::cli
