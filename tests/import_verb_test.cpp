// harco import as a user runs it.
#include <cmath>
#include <filesystem>
#include <set>
#include <string>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <opencv2/aruco.hpp>
#include <opencv2/imgcodecs.hpp>

#include "command.hpp"
#include "harco/marker.hpp"
#include "other_detectors.hpp"

namespace harco {
namespace {

namespace fs = std::filesystem;
using test::CommandResult;
using test::run_harco;
using test::TemporaryFolder;

std::string in(const fs::path& folder) { return " --out '" + folder.string() + "'"; }

std::vector<int> parent_ids(const MarkerSet& markers) {
  std::vector<int> ids;
  for (const Parent& parent : markers.parents) ids.push_back(parent.marker.id);
  return ids;
}

Image read_png(const fs::path& file) {
  const cv::Mat grey = cv::imread(file.string(), cv::IMREAD_UNCHANGED);
  EXPECT_EQ(grey.type(), CV_8U) << file;
  Image image(grey.cols, grey.rows);
  std::copy(grey.begin<unsigned char>(), grey.end<unsigned char>(), image.pixels.begin());
  return image;
}

/// The one reading has the parent's id, and its corners are where marker-ID.png.json says.
void expect_read(const std::vector<test::Reading>& readings, const fs::path& folder,
                 const Parent& parent) {
  const int id = parent.marker.id;
  const auto json = nlohmann::json::parse(
      test::read_file(folder / ("marker-" + std::to_string(id) + ".png.json")));
  const double side = parent.side_m * json["pixels_per_metre"].get<double>();
  const Eigen::Vector2d origin(json["origin_px"][0].get<double>() - 0.5,
                               json["origin_px"][1].get<double>() - 0.5);
  ASSERT_EQ(readings.size(), 1U);
  EXPECT_EQ(readings.front().id, id);
  const std::array<Eigen::Vector2d, 4> corners{origin, origin + Eigen::Vector2d(side, 0.0),
                                               origin + Eigen::Vector2d(side, side),
                                               origin + Eigen::Vector2d(0.0, side)};
  for (std::size_t i = 0; i < 4; ++i)
    EXPECT_LT((readings.front().corners[i] - corners[i]).norm(), 1.5) << "corner " << i;
}

TEST(ImportVerb, TakesPlainArucoMarkers) {
  const TemporaryFolder folder;
  const CommandResult result =
      run_harco("import aruco:6x6_250 --side 0.2 --ids 0-2,23" + in(folder.path()));
  ASSERT_EQ(result.status, 0) << result.errors;
  const MarkerSet markers = load_markers(folder / "markers.json");
  EXPECT_EQ(parent_ids(markers), (std::vector<int>{0, 1, 2, 23}));
  EXPECT_EQ(markers.cells, 6);
  EXPECT_EQ(markers.layers(), 1);
  for (const Parent& parent : markers.parents) {
    EXPECT_EQ(parent.side_m, 0.2);
    const std::string name = "marker-" + std::to_string(parent.marker.id);
    for (const char* ending : {".svg", ".pdf", ".png", ".png.json"})
      EXPECT_TRUE(fs::exists(folder / (name + ending))) << name << ending;
    const Image picture = read_png(folder / (name + ".png"));
    expect_read(test::read_by_opencv(picture, cv::aruco::DICT_6X6_250), folder.path(), parent);
  }
}

void expect_sound_hierarchy(const MarkerSet& markers, int layers) {
  EXPECT_EQ(markers.layers(), layers);
  std::set<int> ids;
  std::size_t children = 0;
  for (const PlacedMarker& placed : place(markers)) {
    if (placed.layer == 1) continue;
    EXPECT_EQ(placed.code.cells, 5);
    ids.insert(placed.id);
    ++children;
  }
  EXPECT_EQ(ids.size(), children);
  for (const Parent& parent : markers.parents) {
    EXPECT_GE(parent.marker.children.size(), 3U);
    EXPECT_LE(parent.marker.children.size(), 5U);
  }
}

TEST(ImportVerb, MakesArucoMarkersHierarchicalThatOpenCvStillReads) {
  const TemporaryFolder folder;
  const CommandResult result =
      run_harco("import aruco:4x4_50 --layers 3 --side 0.3 --ids 4,11" + in(folder.path()));
  ASSERT_EQ(result.status, 0) << result.errors;
  const MarkerSet markers = load_markers(folder / "markers.json");
  EXPECT_EQ(parent_ids(markers), (std::vector<int>{4, 11}));
  expect_sound_hierarchy(markers, 3);
  for (const Parent& parent : markers.parents) {
    const Image picture =
        read_png(folder / ("marker-" + std::to_string(parent.marker.id) + ".png"));
    expect_read(test::read_by_opencv(picture, cv::aruco::DICT_4X4_50), folder.path(), parent);
  }
}

TEST(ImportVerb, MakesAprilTagsHierarchicalThatLibapriltagStillReads) {
  const TemporaryFolder folder;
  const CommandResult result =
      run_harco("import apriltag:36h11 --layers 3 --side 0.16 --ids 0,586" + in(folder.path()));
  ASSERT_EQ(result.status, 0) << result.errors;
  const MarkerSet markers = load_markers(folder / "markers.json");
  EXPECT_EQ(parent_ids(markers), (std::vector<int>{0, 586}));
  expect_sound_hierarchy(markers, 3);
  for (const Parent& parent : markers.parents) {
    const Image picture =
        read_png(folder / ("marker-" + std::to_string(parent.marker.id) + ".png"));
    expect_read(test::read_by_apriltag(picture, "36h11"), folder.path(), parent);
  }
}

TEST(ImportVerb, ChoosesChildrenAsToldAndTheSameWithTheSameSeed) {
  const TemporaryFolder a, b, c;
  const std::string verb =
      "import aruco:5x5_50 --layers 2 --side 0.3 --ids 3 --children checkerboard "
      "--child-cells 6 --no-drawings";
  ASSERT_EQ(run_harco(verb + " --seed 5" + in(a.path())).status, 0);
  ASSERT_EQ(run_harco(verb + " --seed 5" + in(b.path())).status, 0);
  ASSERT_EQ(run_harco(verb + " --seed 6" + in(c.path())).status, 0);
  const std::string description = test::read_file(a / "markers.json");
  EXPECT_EQ(description, test::read_file(b / "markers.json"));
  EXPECT_NE(description, test::read_file(c / "markers.json"));
  const MarkerSet markers = parse_markers(description);
  for (const Marker& child : markers.parents.front().marker.children) {
    EXPECT_EQ((child.cell / 5 + child.cell % 5) % 2, 0);
    EXPECT_EQ(child.code.cells, 6);
  }
  EXPECT_FALSE(markers.parents.front().marker.children.empty());
}

TEST(ImportVerb, TakesAWholeFamilyAndNothingButItsDescription) {
  const TemporaryFolder folder;
  const CommandResult result =
      run_harco("import aruco:7x7_1000 --side 0.2 --no-drawings" + in(folder.path()));
  ASSERT_EQ(result.status, 0) << result.errors;
  EXPECT_EQ(load_markers(folder / "markers.json").parents.size(), 1000U);
  EXPECT_EQ(std::distance(fs::directory_iterator(folder.path()), fs::directory_iterator()), 1);
}

TEST(ImportVerb, LeavesOutWhatHasNoDirectionAndSaysSo) {
  const TemporaryFolder folder;
  const CommandResult result =
      run_harco("import aruco:original --side 0.2 --no-drawings" + in(folder.path()));
  ASSERT_EQ(result.status, 0) << result.errors;
  EXPECT_NE(result.errors.find("1023"), std::string::npos);
  EXPECT_EQ(load_markers(folder / "markers.json").parents.size(), 1023U);
}

TEST(ImportVerb, WarnsOfParentsWithoutChildren) {
  const TemporaryFolder folder;
  // Cell 0 is white in some of these, black in others.
  const CommandResult result = run_harco(
      "import aruco:4x4_50 --layers 2 --children 0 --side 0.2 --no-drawings" + in(folder.path()));
  ASSERT_EQ(result.status, 0) << result.errors;
  EXPECT_NE(result.errors.find("without children"), std::string::npos);
  for (const Parent& parent : load_markers(folder / "markers.json").parents)
    EXPECT_EQ(parent.marker.children.size(), parent.marker.code.white(0) ? 1U : 0U);
}

TEST(ImportVerb, RefusesBadInputInOneLineAndWritesNothing) {
  const TemporaryFolder folder;
  const fs::path out = folder / "out";
  const auto expect_refused = [&](const std::string& arguments, const std::string& reason) {
    const CommandResult result = run_harco("import " + arguments + in(out));
    EXPECT_EQ(result.status, 2) << arguments;
    EXPECT_NE(result.errors.find(reason), std::string::npos) << arguments << "\n" << result.errors;
    EXPECT_EQ(std::count(result.errors.begin(), result.errors.end(), '\n'), 1) << result.errors;
    EXPECT_FALSE(fs::exists(out)) << arguments;
  };
  expect_refused("aruco:9x9_50 --side 1", "aruco:9x9_50");
  expect_refused("apriltag:standard41h12 --side 1", "one-cell black border");
  expect_refused("rune:12 --side 1", "rune:12");
  expect_refused("--side 1", "family");
  expect_refused("aruco:4x4_50", "--side");
  for (const char* side : {"0", "-1", "nan", "inf", "1e-400", "wide"})
    expect_refused(std::string("aruco:4x4_50 --side ") + side, "--side");
  for (const char* ids : {"50", "x", "5-3", "1,1", "','"})
    expect_refused(std::string("aruco:4x4_50 --side 1 --ids ") + ids, "--ids");
  expect_refused("aruco:original --side 1 --ids 1023", "1023");
  for (const char* layers : {"0", "9", "two"})
    expect_refused(std::string("aruco:4x4_50 --side 1 --layers ") + layers, "--layers");
  expect_refused("aruco:4x4_50 --side 1 --layers 2 --children ring", "ring");
  expect_refused("aruco:4x4_50 --side 1 --layers 2 --child-cells 3", "--child-cells");
}

TEST(ImportVerb, RefusesAFolderThatIsAFile) {
  const TemporaryFolder folder;
  test::write_file(folder / "file", "kept");
  const CommandResult result = run_harco("import aruco:4x4_50 --side 1" + in(folder / "file"));
  EXPECT_EQ(result.status, 2);
  EXPECT_EQ(test::read_file(folder / "file"), "kept");
}

}  // namespace
}  // namespace harco
