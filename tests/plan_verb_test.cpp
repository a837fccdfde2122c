#include <algorithm>
#include <filesystem>
#include <iterator>
#include <string>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "command.hpp"

namespace harco::test {
namespace {

const std::string kExample =
    "plan --near 0.1 --far 35 --size 750x480 --focal 700 --side 1.6 "
    "--aim 0 --parent-px 16 ";

nlohmann::json json_of(const std::string& arguments) {
  const CommandResult result = run_harco(arguments + " --json");
  EXPECT_EQ(result.status, 0) << result.errors;
  return nlohmann::json::parse(result.output);
}

bool contains(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

TEST(PlanVerb, PrintsTheTableAndTheNextCommand) {
  const CommandResult result = run_harco(kExample);
  EXPECT_EQ(result.status, 0);
  EXPECT_EQ(result.errors, "");
  EXPECT_TRUE(contains(result.output, "3 layers of 5 x 5 cells, side 1.6 m")) << result.output;
  // Layer 2: 1.6 / 7 m; the values are derived in plan_test.cpp.
  EXPECT_TRUE(contains(result.output,
                       "    2    0.2286 m    0.423 m to   10.0 m     3.37 x   2.29 px    88 %    "
                       "16.3 mm\n"))
      << result.output;
  EXPECT_TRUE(contains(result.output,
                       "\n  harco generate --layers 3 --parents 1 --side 1.6 --out marker\n"));
}

TEST(PlanVerb, JsonSaysTheSame) {
  const auto json = json_of(kExample);
  ASSERT_EQ(json["layers"].size(), 3U);
  EXPECT_DOUBLE_EQ(json["side_m"], 1.6);
  EXPECT_NEAR(json["layers"][0]["nearest_m"], 2.59259, 1e-5);
  EXPECT_NEAR(json["layers"][1]["overlap"], 3.375, 1e-9);
  EXPECT_TRUE(json["layers"][0]["line_mm"].is_null());
  EXPECT_TRUE(json["layers"][2]["overlap"].is_null());
  EXPECT_EQ(json["command"], "harco generate --layers 3 --parents 1 --side 1.6 --out marker");
  EXPECT_FALSE(json["warnings"].empty());
}

TEST(PlanVerb, FieldOfViewFocalLengthAndCameraFileAgree) {
  const auto with_focal = json_of("plan --near 0.1 --far 5 --size 640x480 --focal 320");
  // tan(45 degrees) = 1: 640 / 2 / 1 = 320 px.
  const auto with_fov = json_of("plan --near 0.1 --far 5 --size 640x480 --fov 90");
  EXPECT_NEAR(with_focal["layers"][0]["nearest_m"], with_fov["layers"][0]["nearest_m"], 1e-9);

  const TemporaryFolder folder;
  write_file(folder / "camera.yaml",
             "image_width: 640\nimage_height: 480\n"
             "camera_matrix: {rows: 3, cols: 3, data: [320, 0, 319.5, 0, 320, 239.5, 0, 0, 1]}\n");
  const auto with_file =
      json_of("plan --near 0.1 --far 5 --camera " + (folder / "camera.yaml").string());
  EXPECT_EQ(with_focal, with_file);
}

TEST(PlanVerb, AsksForTheSideThatIsNeeded) {
  // 35 * 14 / 700 = 0.7 m.
  EXPECT_DOUBLE_EQ(json_of("plan --near 0.1 --far 35 --size 750x480 --focal 700")["side_m"], 0.7);
}

TEST(PlanVerb, RecommendsALayoutForViewsBesideTheCentre) {
  const std::string wanted = "plan --near 0.1 --far 35 --size 750x480 --focal 700 ";
  const auto json = json_of(wanted);
  EXPECT_EQ(json["layout"], "carpet");
  EXPECT_EQ(json["markers"], 251);
  EXPECT_EQ(json["command"],
            "harco generate --layers 3 --parents 1 --side 0.7 --out marker --children carpet");
  EXPECT_LE(json["beside"]["nearest_m"], 0.1);
  EXPECT_NEAR(json["beside"]["farthest_m"], 35.0, 1e-9);
  const CommandResult table = run_harco(wanted);
  EXPECT_TRUE(contains(table.output, "Layout: carpet, 251 markers\n")) << table.output;
  EXPECT_TRUE(contains(table.output, "up to  35% of the side beside:  0.0")) << table.output;
  // Over the centre, the paper's layout does.
  EXPECT_EQ(json_of(wanted + "--aim 0")["layout"], "quincunx");
}

TEST(PlanVerb, NextCommandCarriesWhatDiffersFromTheDefault) {
  const auto json = json_of(kExample + "--cells 6 --line-inside 0.03125 --line-outside 0.05");
  EXPECT_EQ(json["command"],
            "harco generate --layers 3 --parents 1 --side 1.6 --out marker --cells 6 "
            "--line-inside 0.03125 --line-outside 0.05");
}

TEST(PlanVerb, NextCommandKeepsToAlphaAndLayout) {
  const std::string plain = "harco generate --layers 3 --parents 1 --side 1.6 --out marker";
  // 0.09 * 49 = 4.41 black cells.
  EXPECT_EQ(json_of(kExample + "--alpha 0.09")["command"], plain + " --max-black 4");
  EXPECT_EQ(json_of(kExample + "--layout checkerboard")["command"],
            plain + " --children checkerboard");
  EXPECT_EQ(json_of(kExample + "--layout carpet --cells 6")["command"],
            plain + " --cells 6 --children carpet");
  // One layer has no children.
  const auto single = json_of(kExample + "--alpha 0.09 --layers 1");
  EXPECT_EQ(single["command"], "harco generate --layers 1 --parents 1 --side 1.6 --out marker");
}

TEST(PlanVerb, WarnsInTheTable) {
  const CommandResult result =
      run_harco("plan --near 0.1 --far 35 --size 750x480 --focal 700 --side 0.5 --parent-px 16");
  EXPECT_EQ(result.status, 0);
  EXPECT_TRUE(contains(result.output, "\nserious: the parent is detected only up to 21.9 m"))
      << result.output;
}

TEST(PlanVerb, DrawsAChart) {
  const TemporaryFolder folder;
  const CommandResult result = run_harco(kExample + "--plot " + (folder / "chart.svg").string());
  EXPECT_EQ(result.status, 0) << result.errors;
  const std::string svg = read_file(folder / "chart.svg");
  EXPECT_EQ(svg.rfind("<svg ", 0), 0U);
  EXPECT_TRUE(contains(svg, "</svg>\n"));
  for (const char* part : {">layer 3: 0.0327 m<", ">432 px<", ">16 px<", ">3.9 x<", ">35.0 m<"})
    EXPECT_TRUE(contains(svg, part)) << part;
  // Nothing else is left in the folder.
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path()), {}), 1);

  const CommandResult gap = run_harco(
      "plan --near 0.02 --far 100 --size 320x240 --focal 280 --cells 8 --child-px 24 --aim 0 "
      "--parent-px 16 "
      "--plot " +
      (folder / "gap.svg").string());
  EXPECT_EQ(gap.status, 0) << gap.errors;
  EXPECT_TRUE(contains(read_file(folder / "gap.svg"), ">gap: 6.67 m to 7.41 m<"));
}

/// One line on standard error that contains `part`, nothing on standard output, exit status 2.
void expect_refused(const std::string& arguments, const std::string& part) {
  const CommandResult result = run_harco(arguments);
  EXPECT_EQ(result.status, 2) << arguments;
  EXPECT_EQ(result.output, "") << arguments;
  EXPECT_EQ(std::count(result.errors.begin(), result.errors.end(), '\n'), 1) << result.errors;
  EXPECT_TRUE(contains(result.errors, part)) << arguments << ": " << result.errors;
}

TEST(PlanVerb, RefusesWhatMakesNoSenseInOneLine) {
  const std::string range = "plan --near 0.1 --far 35 ";
  const std::string camera = "--size 750x480 --focal 700 ";
  expect_refused("plan " + camera, "--near");
  expect_refused("plan --near 35 --far 0.1 " + camera, "nearest distance must be less");
  expect_refused("plan --near 0.1 --far nan " + camera, "farthest distance");
  expect_refused("plan --near x --far 1 " + camera, "--near");
  expect_refused(range, "a camera is needed");
  expect_refused(range + "--size 750x480", "a camera is needed");
  expect_refused(range + camera + "--fov 60", "a camera is needed");
  expect_refused(range + "--size 750 --focal 700", "--size: '750'");
  expect_refused(range + "--size 750x480x3 --focal 700", "--size: '750x480x3'");
  expect_refused(range + "--size 0x480 --focal 700", "image width");
  expect_refused(range + "--size 750x480 --fov 180", "--fov");
  expect_refused(range + "--size 750x480 --focal -1", "focal length");
  expect_refused(range + "--camera /nowhere/camera.yaml", "/nowhere/camera.yaml");
  expect_refused(range + "--camera a.yaml " + camera, "--camera");
  expect_refused(kExample + "--alpha 1", "alpha");
  expect_refused(kExample + "--layout rug", "--layout");
  expect_refused(kExample + "--layout carpet --layers 2", "carpet has 3");
  expect_refused(range + camera + "--aim 0.7", "aim");
  expect_refused(range + camera + "--side 0", "side");
  expect_refused(range + camera + "--side nan", "side");
  expect_refused(kExample + "--cells 3", "cells");
  expect_refused(kExample + "--line-inside 0 --line-outside 0", "line");
  expect_refused(kExample + "--printer-dpi 0", "--printer-dpi");
  expect_refused(kExample + "--plot /nowhere/chart.svg", "/nowhere/chart.svg");
}

}  // namespace
}  // namespace harco::test
