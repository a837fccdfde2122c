// The detector against photographs: markers of every kind of difficulty set before real
// surroundings, each with the least number of pictures in which they must be found, and pictures
// without markers in which nothing may be. The numbers only ever get stricter.
#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <iostream>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "harco/harco.hpp"
#include "lab/photo_scene.hpp"
#include "lab/render.hpp"

namespace harco {
namespace {

namespace fs = std::filesystem;

constexpr double kDegree = std::numbers::pi / 180.0;
constexpr int kFrames = 40;

const MarkerSet& three_layers() {
  static const MarkerSet set = [] {
    DictionaryOptions options;
    options.child_cells = {quincunx(5), quincunx(5)};
    options.child_distance = 6;  // soon found
    return build_markers(generate_dictionary(options), 1.6);
  }();
  return set;
}

/// The pictures of opencv-doc's samples in which no marker is printed.
const std::vector<std::pair<std::string, Image>>& photographs() {
  static const auto all = [] {
    std::vector<fs::path> files;
    for (const auto& entry : fs::recursive_directory_iterator("/usr/share/doc/opencv-doc/examples"))
      files.push_back(entry.path());
    std::sort(files.begin(), files.end());
    std::vector<std::pair<std::string, Image>> pictures;
    for (const fs::path& file : files) {
      const std::string name = file.filename().string();
      const bool picture =
          name.find(".jpg") != std::string::npos || name.find(".png") != std::string::npos;
      if (picture && name.find("aruco") == std::string::npos)
        pictures.emplace_back(name, lab::load_grey(file));
    }
    return pictures;
  }();
  return all;
}

/// A part of a photograph, 750 x 480 pixels; smaller ones are repeated.
Image background(std::mt19937_64& random) {
  const auto& pictures = photographs();
  const Image& from = pictures[random() % pictures.size()].second;
  const int x0 = static_cast<int>(random() % static_cast<std::uint64_t>(from.width));
  const int y0 = static_cast<int>(random() % static_cast<std::uint64_t>(from.height));
  Image image(750, 480);
  for (int y = 0; y < image.height; ++y)
    for (int x = 0; x < image.width; ++x)
      image.row(y)[x] = from.row((y0 + y) % from.height)[(x0 + x) % from.width];
  return image;
}

struct Kind {
  const char* name;
  int layer;
  double least_px, most_px;  ///< side if seen frontally
  double least_tilt_deg, most_tilt_deg;
  double psf_px, noise, black, white, gain_right;
  int least_found;  ///< of kFrames
};

/// For the names of the tests.
void PrintTo(const Kind& kind, std::ostream* out) { *out << kind.name; }

class BlackBox : public ::testing::TestWithParam<Kind> {};

TEST_P(BlackBox, FindsAtLeast) {
  ASSERT_FALSE(photographs().empty()) << "needs the package opencv-doc";
  const Kind& kind = GetParam();
  const MarkerSet& set = three_layers();
  Detector detector(set);
  const std::vector<PlacedMarker>& placed = detector.placed();
  int found = 0;
  int wrong = 0;
  for (int frame = 0; frame < kFrames; ++frame) {
    std::mt19937_64 random(static_cast<std::uint64_t>(frame));
    std::uniform_real_distribution<double> unit(0.0, 1.0);
    const auto between = [&](double a, double b) { return a + (b - a) * unit(random); };
    std::vector<std::size_t> layer;
    for (std::size_t i = 0; i < placed.size(); ++i)
      if (placed[i].layer == kind.layer) layer.push_back(i);
    const std::size_t wanted = layer[random() % layer.size()];
    const PlacedMarker& marker = placed[wanted];

    lab::Scene scene;
    scene.camera = Camera::pinhole(750, 480, 700.0);
    scene.background = background(random);
    if (kind.white < 100.0)  // as little light on the surroundings
      for (std::uint8_t& grey : scene.background->pixels)
        grey = static_cast<std::uint8_t>(grey * kind.white / 255.0);
    scene.psf_sigma_px = kind.psf_px;
    scene.noise_sigma = kind.noise;
    scene.black = kind.black;
    scene.white = kind.white;
    scene.gain_right = kind.gain_right;
    const double distance = 700.0 * marker.side_m / between(kind.least_px, kind.most_px);
    const Eigen::Vector2d aim =
        marker.origin_m + marker.side_m * Eigen::Vector2d(unit(random), unit(random));
    scene.parents = {
        {0, lab::look_at_marker(
                aim, distance, kDegree * between(kind.least_tilt_deg, kind.most_tilt_deg),
                2.0 * std::numbers::pi * unit(random), 2.0 * std::numbers::pi * unit(random))}};
    const Image image = lab::render(scene, set, random());
    for (const Detection& detection : detector.detect(image.view())) {
      const auto corners = placed[static_cast<std::size_t>(detection.placed)].corners_m();
      double error = 0.0;
      for (std::size_t i = 0; i < 4; ++i) {
        const auto pixel =
            scene.camera.project(scene.parents[0].camera_T_marker *
                                 Eigen::Vector3d(corners[i].x(), corners[i].y(), 0.0));
        error = std::max(error, pixel ? (*pixel - detection.corners[i]).norm() : 1e9);
      }
      wrong += error > 3.0;
      found += error <= 3.0 && detection.placed == static_cast<int>(wanted);
    }
  }
  std::cout << kind.name << ": " << found << " of " << kFrames << '\n';
  EXPECT_GE(found, kind.least_found);
  EXPECT_EQ(wrong, 0);
}

INSTANTIATE_TEST_SUITE_P(
    Kinds, BlackBox,
    ::testing::Values(
        // name, layer, px from, to, tilt from, to, blur, noise, black, white, gain, least
        Kind{"small parents", 1, 16, 24, 0, 20, 0.6, 2, 25, 220, 1.0, 40},
        Kind{"small children", 2, 16, 24, 0, 20, 0.6, 2, 25, 220, 1.0, 40},
        Kind{"small grandchildren", 3, 16, 24, 0, 20, 0.6, 2, 25, 220, 1.0, 40},
        Kind{"steep parents", 1, 24, 60, 45, 65, 0.6, 2, 25, 220, 1.0, 40},
        Kind{"steep children", 2, 32, 60, 45, 60, 0.6, 2, 25, 220, 1.0, 40},
        Kind{"out of focus", 1, 40, 100, 0, 45, 1.8, 2, 25, 220, 1.0, 40},
        Kind{"noise at night", 1, 24, 100, 0, 45, 0.6, 8, 12, 70, 1.0, 40},
        Kind{"light from one side", 1, 40, 200, 0, 45, 0.6, 2, 25, 240, 0.3, 37}),
    [](const auto& kind) {
      std::string name = kind.param.name;
      std::replace(name.begin(), name.end(), ' ', '_');
      return name;
    });

TEST(BlackBox, NothingInPicturesWithoutMarkers) {
  ASSERT_GT(photographs().size(), 40U) << "needs the package opencv-doc";
  Detector detector(three_layers());
  for (const auto& [name, image] : photographs())
    EXPECT_TRUE(detector.detect(image.view()).empty()) << name;
}

}  // namespace
}  // namespace harco
