#include <png.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "command.hpp"
#include "harco/dictionary.hpp"
#include "harco/draw.hpp"
#include "harco/marker.hpp"

namespace harco {
namespace {

using test::CommandResult;
using test::TemporaryFolder;

CommandResult generate(const std::string& arguments, const std::filesystem::path& out) {
  return test::run_harco("generate " + arguments + " --out '" + out.string() + "'");
}

std::set<std::string> names_in(const std::filesystem::path& folder) {
  std::set<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(folder))
    names.insert(entry.path().filename().string());
  return names;
}

/// The pixels of an 8-bit grey PNG; of any other, none.
Image read_grey_png(const std::filesystem::path& file) {
  png_image png{};
  png.version = PNG_IMAGE_VERSION;
  if (png_image_begin_read_from_file(&png, file.c_str()) == 0) return {};
  if (png.format != PNG_FORMAT_GRAY) {
    png_image_free(&png);
    return {};
  }
  Image image(static_cast<int>(png.width), static_cast<int>(png.height));
  if (png_image_finish_read(&png, nullptr, image.pixels.data(), 0, nullptr) == 0) return {};
  return image;
}

void expect_refused(const std::string& arguments, const std::string& because) {
  const TemporaryFolder folder;
  const CommandResult result = generate(arguments, folder / "set");
  EXPECT_EQ(result.status, 2) << arguments;
  EXPECT_EQ(result.output, "") << arguments;
  EXPECT_NE(result.errors.find(because), std::string::npos) << arguments << ": " << result.errors;
  EXPECT_EQ(std::count(result.errors.begin(), result.errors.end(), '\n'), 1) << result.errors;
  EXPECT_TRUE(names_in(folder.path()).empty()) << arguments;
}

TEST(Generate, AFolderHoldsOneSet) {
  const TemporaryFolder folder;
  ASSERT_EQ(generate("--layers 1 --parents 3 --side 0.1", folder / "set").status, 0);
  test::write_file(folder / "set" / "notes.txt", "mine");
  test::write_file(folder / "set" / "marker-9.svg", "of somebody else");
  ASSERT_EQ(generate("--layers 1 --parents 1 --side 0.1", folder / "set").status, 0);
  EXPECT_EQ(names_in(folder / "set"),
            (std::set<std::string>{"markers.json", "marker-0.svg", "marker-0.pdf", "marker-0.png",
                                   "marker-0.png.json", "notes.txt", "marker-9.svg"}));
}

TEST(Generate, WritesWhatTheContractSays) {
  const TemporaryFolder folder;
  const auto out = folder / "new/set";
  const CommandResult result = generate("--layers 3 --parents 2 --side 1.6 --tau 4", out);
  ASSERT_EQ(result.status, 0) << result.errors;
  EXPECT_EQ(result.errors, "");
  EXPECT_EQ(names_in(out),
            (std::set<std::string>{"markers.json", "marker-0.svg", "marker-0.pdf", "marker-0.png",
                                   "marker-0.png.json", "marker-1.svg", "marker-1.pdf",
                                   "marker-1.png", "marker-1.png.json"}));
  const MarkerSet markers = load_markers(out / "markers.json");
  ASSERT_EQ(markers.parents.size(), 2u);
  EXPECT_EQ(markers.layers(), 3);
  EXPECT_EQ(markers.cells, 5);
  EXPECT_EQ(place(markers).size(), 62u);
  for (int i = 0; i < 2; ++i) {
    const std::string name = "marker-" + std::to_string(i);
    const Raster expected = raster(markers, i);
    const Image drawn = read_grey_png(out / (name + ".png"));
    EXPECT_EQ(drawn.width, expected.image.width);
    EXPECT_TRUE(drawn.pixels == expected.image.pixels) << name;
    const auto json = nlohmann::json::parse(test::read_file(out / (name + ".png.json")));
    EXPECT_EQ(json["origin_px"], nlohmann::json({expected.origin_px.x(), expected.origin_px.y()}));
    EXPECT_EQ(json["pixels_per_metre"].get<double>(), expected.pixels_per_metre);
    const double side_px = 1.6 * json["pixels_per_metre"].get<double>();
    EXPECT_NEAR(side_px, std::round(side_px), 1e-9);

    SheetOptions sheet;
    sheet.set_name = "set";
    EXPECT_EQ(test::read_file(out / (name + ".svg")), draw_svg(markers, i, sheet));
    EXPECT_EQ(test::read_file(out / (name + ".pdf")), draw_pdf(markers, i, sheet));
  }
}

TEST(Generate, SaysTheDistanceReached) {
  const TemporaryFolder folder;
  const CommandResult result =
      generate("--layers 2 --parents 3 --side 0.5 --effort 0.1", folder / "set");
  ASSERT_EQ(result.status, 0) << result.errors;
  const MarkerSet markers = load_markers(folder / "set/markers.json");
  std::vector<Code> parents;
  std::vector<Code> children;
  for (const PlacedMarker& marker : place(markers))
    (marker.layer == 1 ? parents : children).push_back(marker.code);
  const auto says = [&](const std::string& line) {
    EXPECT_NE(result.output.find(line), std::string::npos) << line << "\n" << result.output;
  };
  says("parents:  3 codes, tau = " + std::to_string(dictionary_distance(parents)));
  says("children: 15 codes, tau = " + std::to_string(dictionary_distance(children)));
}

TEST(Generate, SameSeedSameFiles) {
  const TemporaryFolder folder;
  const std::string arguments = "--layers 2 --parents 1 --side 0.2 --effort 0.1 --seed ";
  const std::string set = "/markers.json";
  for (const char* run : {"7", "8"}) ASSERT_EQ(generate(arguments + run, folder / run).status, 0);
  ASSERT_EQ(generate(arguments + "7", folder / "again").status, 0);
  EXPECT_EQ(test::read_file(folder / ("7" + set)), test::read_file(folder / ("again" + set)));
  EXPECT_NE(test::read_file(folder / ("7" + set)), test::read_file(folder / ("8" + set)));
}

TEST(Generate, TakesCellsChildrenAndLines) {
  const TemporaryFolder folder;
  const CommandResult result = generate(
      "--layers 3 --parents 1 --side 1 --cells 6 --children checkerboard --children 0,35 "
      "--line paper --line-inside 0.05 --effort 0.1 --min-black 5 --max-black 8 "
      "--method mutation --page a3",
      folder / "set");
  ASSERT_EQ(result.status, 0) << result.errors;
  const MarkerSet markers = load_markers(folder / "set/markers.json");
  EXPECT_EQ(markers.cells, 6);
  EXPECT_EQ(markers.line.inside, 0.05);
  EXPECT_EQ(markers.line.outside, 1.0 / 32.0);
  const Marker& parent = markers.parents[0].marker;
  EXPECT_EQ(parent.children.size(), 18u);
  for (const Marker& child : parent.children) {
    EXPECT_EQ(child.children.size(), 2u);
    EXPECT_GE(child.code.black_count(), 5);
    EXPECT_LE(child.code.black_count(), 8);
  }
  EXPECT_NE(result.output.find("(a3) in"), std::string::npos) << result.output;
}

TEST(Generate, WarnsOfWhatPrintsBadly) {
  const TemporaryFolder folder;
  const CommandResult thin =
      generate("--layers 3 --parents 1 --side 0.05 --effort 0.1", folder / "thin");
  EXPECT_EQ(thin.status, 0);
  EXPECT_NE(thin.errors.find("0.073 mm"), std::string::npos) << thin.errors;
  const CommandResult close =
      generate("--layers 2 --parents 1 --side 1 --children 0,1 --effort 0.1", folder / "close");
  EXPECT_EQ(close.status, 0);
  EXPECT_NE(close.errors.find("share an edge"), std::string::npos) << close.errors;
}

TEST(Generate, ReplacesItsOwnFilesAndLeavesOthers) {
  const TemporaryFolder folder;
  const auto out = folder / "set";
  std::filesystem::create_directory(out);
  test::write_file(out / "notes.txt", "mine");
  test::write_file(out / "markers.json", "old");
  ASSERT_EQ(generate("--layers 1 --parents 1 --side 0.1 --effort 0.1", out).status, 0);
  EXPECT_EQ(test::read_file(out / "notes.txt"), "mine");
  EXPECT_EQ(load_markers(out / "markers.json").layers(), 1);
  EXPECT_EQ(names_in(out).size(), 6u);
}

TEST(Generate, RefusesNonsense) {
  expect_refused("--layers 0 --parents 1 --side 1", "--layers");
  expect_refused("--layers x --parents 1 --side 1", "--layers");
  expect_refused("--layers 2 --parents 0 --side 1", "--parents");
  for (const char* side : {"0", "-1", "nan", "inf", "1e400"})
    expect_refused(std::string("--layers 2 --parents 1 --side ") + side, "--side");
  expect_refused("--layers 2 --parents 1 --side big", "--side");
  expect_refused("--layers 2 --parents 1", "--side");
  const std::string good = "--layers 2 --parents 1 --side 1 ";
  expect_refused(good + "--cells 9", "--cells");
  expect_refused(good + "--children 0,99", "99");
  expect_refused(good + "--children 0,,4", "--children");
  expect_refused(good + "--children everywhere", "everywhere");
  expect_refused(good + "--children 0 --children 4", "--children");
  expect_refused(good + "--line thick", "--line");
  expect_refused(good + "--line-outside nan", "line width");
  expect_refused(good + "--line-outside 0.3", "line width");
  expect_refused(good + "--line-outside 0", "line width");
  expect_refused(good + "--page a9", "--page");
  expect_refused(good + "--page a4 --overlap 190", "overlap");
  expect_refused(good + "--overlap nan", "overlap");
  expect_refused(good + "--pixels-per-cell 1", "whole number of pixels");
  expect_refused(good + "--max-pixels 100", "126");
  expect_refused(good + "--tau 24", "24");
  expect_refused(good + "--min-black 30", "30");
  expect_refused(good + "--seed -1", "--seed");
  expect_refused(good + "--time-limit nan", "time");
  expect_refused(good + "--nonsense", "--nonsense");
  expect_refused("--layers 6 --parents 1 --side 9 --effort 1000", "pixels");
}

TEST(Generate, RefusesFoldersThatCannotBe) {
  const TemporaryFolder folder;
  test::write_file(folder / "file", "mine");
  std::filesystem::create_directories(folder / "set/marker-0.png");
  const auto refuses = [&](const std::filesystem::path& out) {
    const CommandResult result = generate("--layers 1 --parents 1 --side 1 --effort 0.1", out);
    EXPECT_EQ(result.status, 2) << out;
    EXPECT_NE(result.errors.find(out.filename().string()), std::string::npos) << result.errors;
  };
  refuses(folder / "file");
  refuses(folder / "file/below");
  refuses("/proc/harco");
  refuses(folder / "set");
  EXPECT_EQ(test::read_file(folder / "file"), "mine");
  EXPECT_EQ(names_in(folder / "set"), (std::set<std::string>{"marker-0.png"}));
}

TEST(Generate, KeepsTheBestWhenStopped) {
  // 155 children at a distance that no search reaches, for ever: only a stop ends it.
  const std::string endless = "--layers 4 --parents 1 --side 2 --effort 1e9 ";
  const TemporaryFolder folder;
  const CommandResult limited = generate(endless + "--time-limit 1", folder / "limited");
  EXPECT_EQ(limited.status, 0) << limited.errors;
  EXPECT_NE(limited.errors.find("stopped early"), std::string::npos) << limited.errors;
  EXPECT_EQ(place(load_markers(folder / "limited/markers.json")).size(), 156u);

  if (!test::has_program("timeout")) return;
  const CommandResult interrupted = test::run_shell(
      std::string("timeout --foreground --preserve-status -s INT 3 '") + HARCO_COMMAND +
      "' generate " + endless + "--out '" + (folder / "interrupted").string() + "'");
  EXPECT_EQ(interrupted.status, 0) << interrupted.errors;
  EXPECT_NE(interrupted.errors.find("stopped early"), std::string::npos) << interrupted.errors;
  EXPECT_EQ(place(load_markers(folder / "interrupted/markers.json")).size(), 156u);
}

}  // namespace
}  // namespace harco
