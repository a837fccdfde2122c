// The families as their makers' own detectors read them.
#include "families.hpp"

#include <numbers>
#include <random>
#include <stdexcept>

#include <gtest/gtest.h>
#include <opencv2/aruco.hpp>

#include "lab/render.hpp"
#include "other_detectors.hpp"

namespace harco::cli {
namespace {

constexpr double kSide = 1.0;

/// What load_family gives, without loading the module.
Family family_of(const std::string& name) {
  Family family;
  harco_load_family(name, family);
  return family;
}

MarkerSet only(int id, const Code& code) {
  MarkerSet markers;
  markers.cells = code.cells;
  markers.parents.push_back({kSide, Marker{id, -1, code, {}}});
  return markers;
}

/// The marker, turned about the optical axis and tilted, and where its corners are.
struct Picture {
  Image image;
  std::array<Eigen::Vector2d, 4> corners;
};

Picture photograph(const MarkerSet& markers, double roll) {
  lab::Scene scene;
  scene.camera = Camera::pinhole(400, 400, 600.0);
  // OpenCV takes the edge of a narrow sheet for the marker and drops the real one beside it.
  scene.quiet_zone_cells = 3.0;
  const Eigen::Isometry3d pose = lab::look_at_marker({kSide / 2, kSide / 2}, 3.0, 0.3, 0.7, roll);
  scene.parents.push_back({0, pose});
  Picture picture{lab::render(scene, markers, 1), {}};
  const auto corners = place(markers).front().corners_m();
  for (std::size_t i = 0; i < 4; ++i)
    picture.corners[i] =
        *scene.camera.project(pose * Eigen::Vector3d(corners[i].x(), corners[i].y(), 0.0));
  return picture;
}

void expect_read(const std::vector<test::Reading>& readings, int id, const Picture& picture) {
  // Small codes are also found where there is nothing: only what is seen of this square counts.
  std::vector<int> ids;
  for (const test::Reading& reading : readings) {
    double off = 0.0;
    for (std::size_t i = 0; i < 4; ++i)
      off = std::max(off, (reading.corners[i] - picture.corners[i]).norm());
    if (off < 2.0) ids.push_back(reading.id);
  }
  EXPECT_EQ(ids, std::vector<int>{id});
}

/// Some markers of a family, in all four turns.
template <typename Read>
void expect_family_is_read(const std::string& name, std::size_t count, Read read) {
  SCOPED_TRACE(name);
  const Family family = family_of(name);
  ASSERT_EQ(family.codes.size(), count);
  std::mt19937 random(3);
  for (int trial = 0; trial < 8; ++trial) {
    const int id = static_cast<int>(random() % count);
    SCOPED_TRACE(id);
    const double roll = 0.2 + trial * std::numbers::pi / 2;
    const Picture picture = photograph(only(id, family.codes[static_cast<std::size_t>(id)]), roll);
    expect_read(read(picture.image), id, picture);
  }
}

TEST(Families, OfArucoAreReadByOpenCv) {
  const std::array<int, 4> sizes{50, 100, 250, 1000};
  for (int n = 4; n <= 7; ++n)
    for (std::size_t i = 0; i < sizes.size(); ++i) {
      const std::string square = std::to_string(n) + "x" + std::to_string(n);
      // OpenCV numbers them in this order.
      const int dictionary = cv::aruco::DICT_4X4_50 + (n - 4) * 4 + static_cast<int>(i);
      expect_family_is_read(
          "aruco:" + square + "_" + std::to_string(sizes[i]), static_cast<std::size_t>(sizes[i]),
          [&](const Image& image) { return test::read_by_opencv(image, dictionary); });
    }
}

TEST(Families, OriginalArucoIsReadByOpenCv) {
  expect_family_is_read("aruco:original", 1024, [](const Image& image) {
    return test::read_by_opencv(image, cv::aruco::DICT_ARUCO_ORIGINAL);
  });
}

TEST(Families, OfAprilTagAreReadByLibapriltag) {
  const std::array<std::pair<const char*, std::size_t>, 4> families{
      {{"16h5", 30}, {"25h9", 35}, {"36h10", 2320}, {"36h11", 587}}};
  for (const auto& [name, count] : families)
    expect_family_is_read(
        std::string("apriltag:") + name, count,
        [&, n = name](const Image& image) { return test::read_by_apriltag(image, n); });
}

TEST(Families, AprilTagZeroLooksAsItsMakersPrintIt) {
  EXPECT_EQ(family_of("apriltag:36h11").codes.front(), parse_code("110101"
                                                                  "011101"
                                                                  "011000"
                                                                  "101000"
                                                                  "010110"
                                                                  "000100"));
}

TEST(Families, NamesAreForgiving) {
  const Family plain = family_of("aruco:6x6_250");
  EXPECT_EQ(family_of("aruco:DICT_6X6_250").codes, plain.codes);
  EXPECT_EQ(family_of("ArUco:6X6_250").codes, plain.codes);
  EXPECT_EQ(family_of("aruco:DICT_ARUCO_ORIGINAL").codes, family_of("aruco:original").codes);
  EXPECT_EQ(family_of("apriltag:tag36h11").codes, family_of("apriltag:36h11").codes);
}

/// Only one code of all families can't tell its direction, and no two are the same.
TEST(Families, CodesCanBeToldApart) {
  for (const char* name : {"aruco:4x4_1000", "aruco:5x5_1000", "aruco:6x6_1000", "aruco:7x7_1000",
                           "aruco:original", "apriltag:16h5", "apriltag:25h9", "apriltag:36h11"}) {
    const Family family = family_of(name);
    std::vector<int> undirected;
    for (std::size_t i = 0; i < family.codes.size(); ++i) {
      if (inner_distance(family.codes[i]) == 0) undirected.push_back(static_cast<int>(i));
      for (std::size_t j = 0; j < i; ++j)
        ASSERT_GT(distance(family.codes[i], family.codes[j]), 0) << name << " " << i << " " << j;
    }
    const bool original = family.name == "aruco:original";
    EXPECT_EQ(undirected, original ? std::vector<int>{1023} : std::vector<int>{}) << name;
  }
}

TEST(Families, OthersAreRefusedWithTheReason) {
  const auto message = [](const char* name) -> std::string {
    try {
      family_of(name);
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "";
  };
  for (const char* name : {"standard41h12", "standard52h13", "circle21h7", "circle49h12",
                           "custom48h12", "tagStandard41h12"})
    EXPECT_NE(message((std::string("apriltag:") + name).c_str()).find("one-cell black border"),
              std::string::npos)
        << name;
  EXPECT_NE(message("apriltag:99h1").find("36h11"), std::string::npos);
  EXPECT_NE(message("aruco:9x9_50").find("4x4_50"), std::string::npos);
  EXPECT_NE(message("6x6_250").find("aruco:"), std::string::npos);
  EXPECT_NE(message("").find("aruco:"), std::string::npos);
  EXPECT_NE(message("aruco:").find("4x4_50"), std::string::npos);
#if CV_VERSION_MAJOR == 4 && CV_VERSION_MINOR < 8
  EXPECT_NE(message("aruco:mip_36h12").find(CV_VERSION), std::string::npos);
#endif
}

}  // namespace
}  // namespace harco::cli
