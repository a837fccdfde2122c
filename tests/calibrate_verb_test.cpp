// The calibrate verb as a user runs it: on photographs of a chessboard, on rendered pictures of
// known cameras, and on wrong input of every kind.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <opencv2/aruco.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "command.hpp"
#include "harco/camera.hpp"
#include "harco/marker.hpp"
#include "lab/render.hpp"

namespace harco::test {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector2d;
using Eigen::Vector3d;
using nlohmann::json;

constexpr const char* kPhotos = "/usr/share/doc/opencv-doc/examples/data/";

bool contains(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

std::string pgm(const Image& image) {
  std::string text =
      "P5\n" + std::to_string(image.width) + " " + std::to_string(image.height) + "\n255\n";
  text.append(image.pixels.begin(), image.pixels.end());
  return text;
}

/// columns x rows squares, the top-left one black; `inside` draws into the white ones.
template <typename Inside>
lab::Sheet board(int columns, int rows, double square, const Inside& inside) {
  lab::Sheet sheet;
  sheet.ink.square = {0.0, 0.0, columns * square, rows * square};
  sheet.paper = {-square, -square, (columns + 1) * square, (rows + 1) * square};
  for (int row = 0; row < rows; ++row)
    for (int column = 0; column < columns; ++column) {
      if ((row + column) % 2 == 0) continue;
      const double x = column * square, y = row * square;
      sheet.ink.white.push_back({x, y, x + square, y + square});
      inside(x, y, sheet.ink.black);
    }
  return sheet;
}

lab::Sheet chessboard() {
  return board(10, 7, 0.025, [](double, double, std::vector<Rect>&) {});
}

lab::Sheet charuco() {
  const auto dictionary = cv::aruco::getPredefinedDictionary(cv::aruco::DICT_4X4_50);
  int id = 0;
  return board(7, 6, 0.04, [&](double x, double y, std::vector<Rect>& black) {
    constexpr int kCells = 6;
    constexpr double kCell = 0.03 / kCells;
    cv::Mat marker;
    cv::aruco::drawMarker(dictionary, id++, kCells, marker);
    for (int row = 0; row < kCells; ++row)
      for (int column = 0; column < kCells; ++column) {
        if (marker.at<unsigned char>(row, column) != 0) continue;
        const double left = x + 0.005 + column * kCell, top = y + 0.005 + row * kCell;
        black.push_back({left, top, left + kCell, top + kCell});
      }
  });
}

/// The target as large as `fill` of the image's height, aimed at a pixel, tilted and turned.
struct View {
  Vector2d pixel;
  double fill, tilt, tilt_axis, turn;
};

/// Aims all over the image, tilts to all sides.
std::vector<View> varied_views(const Camera& camera, int count) {
  std::mt19937 random(1);
  const auto between = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  std::vector<View> views;
  for (int i = 0; i < count; ++i) {
    const Vector2d place((i % 3 + between(0.1, 0.9)) / 3.0, (i / 3 % 3 + between(0.1, 0.9)) / 3.0);
    views.push_back({{camera.width * place.x(), camera.height * place.y()},
                     between(0.4, 0.6),
                     between(0.2, 0.7),
                     between(0.0, 6.28),
                     between(0.0, 6.28)});
  }
  return views;
}

class CalibrateVerb : public ::testing::Test {
 protected:
  std::string path(const std::string& name) const { return "'" + (folder_ / name).string() + "'"; }

  CommandResult calibrate(const std::string& arguments) const {
    return run_harco("calibrate " + arguments);
  }

  Image picture(const lab::Sheet& sheet, const Camera& camera, const View& view, int seed) const {
    const Rect& square = sheet.ink.square;
    const Vector2d middle(0.5 * square.width(), 0.5 * square.height());
    const double side = std::max(square.width(), square.height());
    const Vector3d ray = camera.unproject(view.pixel)->homogeneous();
    lab::Scene scene;
    scene.camera = camera;
    Eigen::Isometry3d pose =
        lab::look_at_marker(middle, camera.fy * side / (view.fill * camera.height), view.tilt,
                            view.tilt_axis, view.turn);
    pose = Eigen::Quaterniond::FromTwoVectors(Vector3d::UnitZ(), ray) * pose;
    scene.parents.push_back({0, pose});
    return lab::render(scene, std::vector{sheet}, static_cast<std::uint64_t>(seed));
  }

  /// Pictures as FOLDER/NN.pgm.
  void write_pictures(const std::string& name, const lab::Sheet& sheet, const Camera& camera,
                      const std::vector<View>& views) const {
    fs::create_directories(folder_ / name);
    for (std::size_t i = 0; i < views.size(); ++i)
      write_file(folder_ / name / (std::to_string(i) + ".pgm"),
                 pgm(picture(sheet, camera, views[i], static_cast<int>(i))));
  }

  /// A camera file that agrees with the truth within what the report states.
  void expect_recovered(const std::string& camera_file, const std::string& report_file,
                        const Camera& truth) const {
    const Camera found = load_camera(folder_ / camera_file);
    EXPECT_EQ(found.width, truth.width);
    EXPECT_EQ(found.height, truth.height);
    EXPECT_EQ(found.lens, truth.lens);
    const json report = json::parse(read_file(folder_ / report_file));
    const bool fisheye = truth.lens == LensModel::equidistant;
    std::vector<std::string> names{"fx", "fy", "cx", "cy"};
    std::vector<double> values{truth.fx, truth.fy, truth.cx, truth.cy};
    const std::vector<std::string> coefficients =
        fisheye ? std::vector<std::string>{"k1", "k2", "k3", "k4"}
                : std::vector<std::string>{"k1", "k2", "p1", "p2", "k3"};
    for (std::size_t i = 0; i < coefficients.size(); ++i) {
      names.push_back(coefficients[i]);
      values.push_back(truth.coefficients[i]);
    }
    for (std::size_t i = 0; i < names.size(); ++i) {
      const json& parameter = report["parameters"][names[i]];
      const double sigma = parameter["sigma"];
      EXPECT_GT(sigma, 0.0);
      EXPECT_LT(std::abs(double{parameter["value"]} - values[i]), 3.5 * sigma) << names[i];
    }
    EXPECT_LT(double{report["parameters"]["fx"]["sigma"]}, 2e-3 * truth.fx);
    EXPECT_NEAR(found.fx, report["parameters"]["fx"]["value"], 1e-9);
  }

  void expect_refused(const std::string& arguments, const std::string& what) const {
    const CommandResult result = calibrate(arguments + " --output " + path("refused.yaml"));
    EXPECT_EQ(result.status, 2) << arguments;
    EXPECT_EQ(std::count(result.errors.begin(), result.errors.end(), '\n'), 1) << result.errors;
    EXPECT_TRUE(contains(result.errors, what)) << arguments << ": " << result.errors;
    EXPECT_FALSE(fs::exists(folder_ / "refused.yaml"));
  }

  Camera pinhole() const {
    Camera camera = Camera::pinhole(640, 480, 480.0);
    camera.fy = 482.0;
    camera.cx = 325.0;
    camera.cy = 233.0;
    camera.coefficients = {-0.25, 0.09, 0.0008, -0.0005, -0.01};
    return camera;
  }

  TemporaryFolder folder_;
};

TEST_F(CalibrateVerb, PhotographsOfAChessboardGiveTheKnownCamera) {
  for (const std::string side : {"left", "right"}) {
    const CommandResult result =
        calibrate("--board chessboard:9x6 --square 0.025 --output " + path("camera.yaml") +
                  " --coverage " + path("coverage.png") + " --report " + path("report.json") + " " +
                  kPhotos + side + "0*.jpg " + kPhotos + side + "1*.jpg");
    ASSERT_EQ(result.status, 0) << result.errors;
    EXPECT_EQ(result.errors, "");
    // What OpenCV's own calibration of these pictures gives, whose noise is 0.2 px.
    const Camera camera = load_camera(folder_ / "camera.yaml");
    const bool left = side == "left";
    EXPECT_NEAR(camera.fx, left ? 533.0 : 537.0, 3.0);
    EXPECT_NEAR(camera.fy, left ? 533.0 : 537.0, 3.0);
    EXPECT_NEAR(camera.cx, left ? 342.0 : 327.0, 3.0);
    EXPECT_NEAR(camera.cy, left ? 234.0 : 249.0, 3.0);
    EXPECT_NEAR(camera.coefficients[0], left ? -0.28 : -0.295, 0.02);
    const json report = json::parse(read_file(folder_ / "report.json"));
    EXPECT_EQ(report["verdict"], "usable");
    EXPECT_LT(report["rms_px"], 0.21);
    EXPECT_LT(report["held_out_rms_px"], 0.25);
    EXPECT_EQ(report["pictures"].size(), 13U);
    // Of these pictures, nobody held the board into the corners.
    EXPECT_TRUE(contains(result.output, "corners of the image not covered")) << result.output;
    const cv::Mat coverage = cv::imread((folder_ / "coverage.png").string());
    EXPECT_EQ(coverage.size(), cv::Size(640, 480));

    const cv::FileStorage file((folder_ / "camera.yaml").string(), cv::FileStorage::READ);
    ASSERT_TRUE(file.isOpened());
    cv::Mat matrix, coefficients;
    file["camera_matrix"] >> matrix;
    file["distortion_coefficients"] >> coefficients;
    EXPECT_EQ(int{file["image_width"]}, 640);
    EXPECT_EQ(matrix.at<double>(0, 0), camera.fx);
    EXPECT_EQ(coefficients.total(), 5U);
  }
}

TEST_F(CalibrateVerb, RenderedBoardsGiveTheirCamera) {
  struct Case {
    const char* name;
    lab::Sheet sheet;
    const char* board;
  };
  const std::vector<Case> cases{
      {"chessboard", chessboard(), "--board chessboard:9x6 --square 0.025"},
      {"charuco", charuco(), "--board charuco:7x6:4x4_50 --square 0.04 --marker-side 0.03"}};
  for (const Case& one : cases) {
    write_pictures(one.name, one.sheet, pinhole(), varied_views(pinhole(), 12));
    const CommandResult result = calibrate(std::string(one.board) + " --output " + path("c.yaml") +
                                           " --report " + path("c.json") + " " + path(one.name));
    ASSERT_EQ(result.status, 0) << one.name << ": " << result.errors;
    expect_recovered("c.yaml", "c.json", pinhole());
    EXPECT_LT(json::parse(read_file(folder_ / "c.json"))["rms_px"], 0.08) << one.name;
  }
}

TEST_F(CalibrateVerb, OurOwnMarkerGivesPinholeAndFisheye) {
  ASSERT_EQ(run_harco("generate --layers 2 --parents 1 --children checkerboard --side 0.18 --out " +
                      path("deck"))
                .status,
            0);
  const lab::Sheet sheet = lab::sheet_of(load_markers(folder_ / "deck" / "markers.json"), 0);
  Camera fisheye = Camera::pinhole(800, 600, 260.0);
  fisheye.lens = LensModel::equidistant;
  fisheye.cx = 405.0;
  fisheye.coefficients = {-0.02, 0.006, -0.003, 0.0004};
  for (const bool wide : {false, true}) {
    const Camera camera = wide ? fisheye : pinhole();
    write_pictures(wide ? "wide" : "narrow", sheet, camera, varied_views(camera, 12));
    const CommandResult result = calibrate(
        "--markers " + path("deck/markers.json") + (wide ? " --model fisheye" : "") + " --output " +
        path("m.yaml") + " --report " + path("m.json") + " " + path(wide ? "wide" : "narrow"));
    ASSERT_EQ(result.status, 0) << result.errors;
    expect_recovered("m.yaml", "m.json", camera);
  }
}

TEST_F(CalibrateVerb, ParallelPicturesDontDetermineTheFocalLength) {
  std::vector<View> views;
  for (int i = 0; i < 6; ++i)
    views.push_back({{319.5 + 4.0 * i, 239.5}, 0.5 + 0.05 * i, 0.0, 0.0, 0.5 * i});
  write_pictures("flat", chessboard(), pinhole(), views);
  const std::string arguments =
      "--board chessboard:9x6 --square 0.025 --output " + path("flat.yaml") + " " + path("flat");
  const CommandResult result = calibrate(arguments);
  EXPECT_EQ(result.status, 2);
  EXPECT_TRUE(contains(result.output + result.errors, "all pictures are parallel"))
      << result.output << result.errors;
  EXPECT_EQ(std::count(result.errors.begin(), result.errors.end(), '\n'), 1) << result.errors;
  EXPECT_FALSE(fs::exists(folder_ / "flat.yaml"));
  EXPECT_EQ(calibrate("--force " + arguments).status, 0);
  EXPECT_NO_THROW(load_camera(folder_ / "flat.yaml"));
}

TEST_F(CalibrateVerb, AFilmGivesPicturesThatDiffer) {
  // A still hand, then another place, and so on: six places in eighteen frames.
  std::string stream;
  const std::vector<View> views = varied_views(pinhole(), 6);
  for (int i = 0; i < 18; ++i)
    stream += pgm(picture(chessboard(), pinhole(), views[static_cast<std::size_t>(i / 3)], i));
  write_file(folder_ / "film", stream);
  const CommandResult result =
      calibrate("--board chessboard:9x6 --square 0.025 --output " + path("film.yaml") +
                " --report " + path("film.json") + " pgm:- < " + path("film"));
  ASSERT_EQ(result.status, 0) << result.errors;
  const json report = json::parse(read_file(folder_ / "film.json"));
  // One picture a place, of those places where the whole board is in view.
  EXPECT_GE(report["pictures"].size(), 3U);
  EXPECT_LE(report["pictures"].size(), 6U);
  expect_recovered("film.yaml", "film.json", pinhole());
}

TEST_F(CalibrateVerb, WhatCantBeUsedIsNamedAndTheRestIsDone) {
  write_pictures("p", chessboard(), pinhole(), varied_views(pinhole(), 8));
  write_file(folder_ / "p" / "bad.png", "\x89PNG\r\n\x1a\nnothing");
  write_file(folder_ / "p" / "empty.pgm", pgm(Image(640, 480, 128)));
  write_file(folder_ / "p" / "small.pgm", pgm(Image(64, 48, 128)));
  const CommandResult result =
      calibrate("--jobs 2 --board chessboard:9x6 --square 0.025 --output " + path("c.yaml") + " " +
                path("p"));
  EXPECT_EQ(result.status, 1);
  EXPECT_EQ(std::count(result.errors.begin(), result.errors.end(), '\n'), 1) << result.errors;
  EXPECT_TRUE(contains(result.errors, "bad.png"));
  EXPECT_TRUE(contains(result.output, "empty.pgm: the target isn't found")) << result.output;
  EXPECT_TRUE(contains(result.output, "small.pgm: is 64 x 48 pixels")) << result.output;
  EXPECT_NO_THROW(load_camera(folder_ / "c.yaml"));
}

TEST_F(CalibrateVerb, RefusesWhatMakesNoSense) {
  write_pictures("p", chessboard(), pinhole(), varied_views(pinhole(), 3));
  const std::string pictures = " " + path("p");
  expect_refused(pictures, "needs --board or --markers");
  expect_refused("--board chessboard:9x6" + pictures, "needs --square");
  expect_refused("--board chessboard:9x6 --square -1" + pictures, "needs --square");
  expect_refused("--board chess --square 1" + pictures, "--board chess: is neither");
  expect_refused("--board chessboard:9xsix --square 1" + pictures, "is neither");
  expect_refused("--board chessboard:2x6 --square 1" + pictures, "at least 3 x 3");
  expect_refused("--board charuco:7x5 --square 1" + pictures, "is neither");
  expect_refused("--board charuco:7x5:9x9_9 --square 1" + pictures, "no such family");
  expect_refused("--board charuco:7x5:4x4_50 --square 1" + pictures, "needs --marker-side");
  expect_refused("--board chessboard:9x6 --square 1 --markers x.json" + pictures, "one of both");
  expect_refused("--markers " + path("none.json") + pictures, "none.json");
  expect_refused("--board chessboard:9x6 --square 1 --model wide" + pictures, "--model");
  expect_refused("--board chessboard:9x6 --square 1 " + path("missing"), "missing");
  expect_refused("--board chessboard:9x6 --square 1 --coverage " + path("c.nothing") + pictures,
                 ".nothing");
  expect_refused("--board chessboard:9x6 --square 1 --report " + path("no/r.json") + pictures,
                 "there is no folder");
  expect_refused("--board charuco:7x5:4x4_50 --square 0.04 --marker-side 0.03" + pictures,
                 "found in 0 of 3 pictures");
  // Who counts squares in place of inner corners is told.
  expect_refused("--board chessboard:10x7 --square 1" + pictures, "9 x 6 inner corners");
}

}  // namespace
}  // namespace harco::test
