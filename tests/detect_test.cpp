// The detector as its users see it: pictures in, detections out.
#include "harco/detect.hpp"

#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <stdexcept>

#include <gtest/gtest.h>

#include "harco/dictionary.hpp"
#include "lab/render.hpp"

namespace harco {
namespace {

constexpr double kDegree = std::numbers::pi / 180.0;

MarkerSet make_set(int cells, int layers, LineWidth line = {}) {
  DictionaryOptions options;
  options.cells = cells;
  options.child_cells.assign(static_cast<std::size_t>(layers - 1), quincunx(cells));
  options.effort = 0.05;
  return build_markers(generate_dictionary(options), 1.6, line);
}

std::array<Eigen::Vector2d, 4> truth(const PlacedMarker& marker, const lab::Scene& scene) {
  std::array<Eigen::Vector2d, 4> pixels;
  for (std::size_t i = 0; i < 4; ++i) {
    const Eigen::Vector2d corner = marker.corners_m()[i];
    pixels[i] = scene.camera
                    .project(scene.parents[0].camera_T_marker *
                             Eigen::Vector3d(corner.x(), corner.y(), 0.0))
                    .value_or(Eigen::Vector2d(-1e6, -1e6));
  }
  return pixels;
}

double side(const std::array<Eigen::Vector2d, 4>& corners) {
  double shortest = 1e9;
  for (std::size_t i = 0; i < 4; ++i)
    shortest = std::min(shortest, (corners[(i + 1) % 4] - corners[i]).norm());
  return shortest;
}

bool inside(const std::array<Eigen::Vector2d, 4>& corners, const Camera& camera, double margin) {
  for (const Eigen::Vector2d& c : corners)
    if (c.x() < margin || c.y() < margin || c.x() > camera.width - 1 - margin ||
        c.y() > camera.height - 1 - margin)
      return false;
  return true;
}

/// Every marker that shows whole and large enough is found, with its corners in the right order;
/// nothing else is.
void expect_round_trip(const MarkerSet& set, const lab::Scene& scene, std::uint64_t seed,
                       double least_side_px, double tolerance_px) {
  DetectorOptions options;
  options.camera = scene.camera;
  Detector detector(set, options);
  const Image image = lab::render(scene, set, seed);
  const std::vector<Detection> detections = detector.detect(image.view());
  std::vector<bool> seen(detector.placed().size(), false);
  for (const Detection& detection : detections) {
    const auto index = static_cast<std::size_t>(detection.placed);
    const PlacedMarker& marker = detector.placed()[index];
    EXPECT_EQ(detection.id, marker.id);
    EXPECT_EQ(detection.layer, marker.layer);
    EXPECT_FALSE(seen[index]) << "found twice";
    seen[index] = true;
    const auto expected = truth(marker, scene);
    // Blur mixes what stands near the border of a very small child into it; see edges.cpp.
    const double allowed = side(expected) < 16.0 ? 1.0 : side(expected) < 24.0 ? 0.5 : tolerance_px;
    for (std::size_t i = 0; i < 4; ++i)
      EXPECT_LT((detection.corners[i] - expected[i]).norm(), allowed)
          << "layer " << marker.layer << " id " << marker.id << " corner " << i;
    EXPECT_GT(detection.quality, 0.75);
    EXPECT_LE(detection.quality, 1.0);
  }
  for (std::size_t i = 0; i < seen.size(); ++i) {
    const auto expected = truth(detector.placed()[i], scene);
    const double margin = detector.placed()[i].layer == 1 ? 0.25 * side(expected) : 6.0;
    if (inside(expected, scene.camera, margin) && side(expected) > least_side_px) {
      EXPECT_TRUE(seen[i]) << "layer " << detector.placed()[i].layer << " id "
                           << detector.placed()[i].id << " of " << side(expected) << " px";
    }
  }
}

struct Case {
  int cells;
  int layers;
};

class RoundTrip : public ::testing::TestWithParam<Case> {};

TEST_P(RoundTrip, DrawnMarkersAreFoundWhereTheyAre) {
  const MarkerSet set = make_set(GetParam().cells, GetParam().layers);
  std::mt19937_64 random(static_cast<std::uint64_t>(GetParam().cells * 10 + GetParam().layers));
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  for (int trial = 0; trial < 12; ++trial) {
    lab::Scene scene;
    scene.camera = Camera::pinhole(750, 480, 700.0);
    const double distance = 0.4 * std::pow(20.0 / 0.4, unit(random));
    const Eigen::Vector2d aim(1.6 * unit(random), 1.6 * unit(random));
    scene.parents.push_back({0, lab::look_at_marker(aim, distance, 40.0 * kDegree * unit(random),
                                                    2.0 * std::numbers::pi * unit(random),
                                                    2.0 * std::numbers::pi * unit(random))});
    expect_round_trip(set, scene, random(), 3.2 * (GetParam().cells + 2), 0.15);
  }
}

INSTANTIATE_TEST_SUITE_P(Sets, RoundTrip,
                         ::testing::Values(Case{4, 1}, Case{4, 2}, Case{5, 1}, Case{5, 2},
                                           Case{5, 3}, Case{6, 2}, Case{7, 1}, Case{8, 1}));

TEST(Detector, SaysWhenAFrameHasTooManyQuads) {
  MarkerSet set;
  set.cells = 5;
  set.parents = {{0.1, {4, -1, parse_code("1010101100111010011011011"), {}}}};
  Detector detector(set);
  Image wall(750, 480, 220);
  EXPECT_TRUE(detector.detect(wall.view()).empty());
  EXPECT_EQ(detector.statistics().quads, 0U);
  EXPECT_FALSE(detector.statistics().budget_reached);
  // 37 x 24 = 888 dark tiles that stand apart; the budget is 300 + 360.
  for (int y = 0; y < wall.height; ++y)
    for (int x = 0; x < wall.width; ++x)
      if (x % 20 >= 4 && x % 20 < 16 && y % 20 >= 4 && y % 20 < 16 && x < 740) wall.row(y)[x] = 20;
  EXPECT_TRUE(detector.detect(wall.view()).empty());
  EXPECT_EQ(detector.statistics().quads, 888U);
  EXPECT_TRUE(detector.statistics().budget_reached);
}

TEST(Detector, FindsMarkersThroughADistortingLens) {
  const MarkerSet set = make_set(5, 2);
  lab::Scene scene;
  scene.camera = Camera::pinhole(750, 480, 500.0);
  scene.camera.coefficients = {-0.28, 0.08, 0.001, -0.0005};
  for (const double distance : {2.0, 3.0, 5.0}) {
    scene.parents = {{0, lab::look_at_marker({0.5, 0.6}, distance, 0.4, 1.0, 0.3)}};
    expect_round_trip(set, scene, 5, 25.0, 0.15);
  }
}

TEST(Detector, ReadsThePapersLineToo) {
  const MarkerSet set = make_set(5, 2, kPaperLine);
  lab::Scene scene;
  scene.camera = Camera::pinhole(750, 480, 700.0);
  scene.parents = {{0, lab::look_at_marker({0.8, 0.8}, 3.0, 0.3, 1.0, 0.3)}};
  expect_round_trip(set, scene, 5, 30.0, 0.2);
}

TEST(Detector, FindsNothingWhereNothingIs) {
  Detector detector(make_set(5, 3));
  std::mt19937 random(3);
  Image noise(320, 240);
  for (std::uint8_t& pixel : noise.pixels) pixel = static_cast<std::uint8_t>(random());
  EXPECT_TRUE(detector.detect(noise.view()).empty());
  Image board(320, 240);
  for (int y = 0; y < 240; ++y)
    for (int x = 0; x < 320; ++x) board.row(y)[x] = ((x / 20 + y / 20) % 2) != 0 ? 230 : 20;
  EXPECT_TRUE(detector.detect(board.view()).empty());
  for (const int size : {1, 2, 3, 5, 17}) {
    const Image tiny(size, size, 128);
    EXPECT_TRUE(detector.detect(tiny.view()).empty());
  }
}

TEST(Detector, NeverInventsACornerThatTheImageCutsOff) {
  const MarkerSet set = make_set(5, 1);
  Detector detector(set);
  for (int step = 0; step <= 40; ++step) {
    lab::Scene scene;
    scene.camera = Camera::pinhole(320, 240, 300.0);
    // The marker slides out of the image; 0.8 m aside at 4 m are 60 px.
    scene.parents = {{0, lab::look_at_marker({0.8 + 0.1 * step, 0.8}, 4.0)}};
    const Image image = lab::render(scene, set, 1);
    for (const Detection& detection : detector.detect(image.view())) {
      const auto expected = truth(detector.placed()[0], scene);
      for (std::size_t i = 0; i < 4; ++i)
        EXPECT_LT((detection.corners[i] - expected[i]).norm(), 0.2);
    }
  }
}

TEST(Detector, GivesTheSameForTheSame) {
  const MarkerSet set = make_set(5, 2);
  lab::Scene scene;
  scene.camera = Camera::pinhole(640, 480, 600.0);
  scene.parents = {{0, lab::look_at_marker({0.8, 0.8}, 3.0, 0.5, 1.0, 2.0)}};
  const Image image = lab::render(scene, set, 1);
  Detector once(set);
  Detector again(set);
  again.detect(Image(64, 48, 10).view());  // scratch of another size
  const auto a = once.detect(image.view());
  const auto b = again.detect(image.view());
  ASSERT_EQ(a.size(), b.size());
  ASSERT_FALSE(a.empty());
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a[i].placed, b[i].placed);
    for (std::size_t k = 0; k < 4; ++k) EXPECT_EQ(a[i].corners[k], b[i].corners[k]);
  }
}

TEST(Detector, SeesTwoCopiesOfOneSheet) {
  const MarkerSet set = make_set(5, 1);
  lab::Scene scene;
  scene.camera = Camera::pinhole(750, 480, 700.0);
  scene.parents = {{0, lab::look_at_marker({3.0, 0.8}, 10.0)},
                   {0, lab::look_at_marker({-1.0, 0.8}, 10.0)}};
  Detector detector(set);
  EXPECT_EQ(detector.detect(lab::render(scene, set, 1).view()).size(), 2U);
}

TEST(Detector, ExplainsEveryCandidate) {
  const MarkerSet set = make_set(5, 2);
  lab::Scene scene;
  scene.camera = Camera::pinhole(640, 480, 600.0);
  scene.parents = {{0, lab::look_at_marker({0.8, 0.8}, 3.0)}};
  Detector detector(set);
  DetectionTrace trace;
  const auto detections = detector.detect(lab::render(scene, set, 1).view(), &trace);
  EXPECT_FALSE(trace.binary.empty());
  EXPECT_EQ(trace.binary[0].width, 640);
  EXPECT_FALSE(trace.contours.empty());
  std::size_t accepted = 0;
  for (const Candidate& candidate : trace.candidates)
    accepted += candidate.rejection == Rejection::none;
  EXPECT_EQ(accepted, detections.size());
}

TEST(Detector, RefusesMisuse) {
  const MarkerSet set = make_set(5, 1);
  EXPECT_THROW(Detector(MarkerSet{}), std::invalid_argument);
  DetectorOptions options;
  options.min_side_px = 0.0;
  EXPECT_THROW(Detector(set, options), std::invalid_argument);
  options.min_side_px = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(Detector(set, options), std::invalid_argument);
  options = {};
  options.min_quality = 1.5;
  EXPECT_THROW(Detector(set, options), std::invalid_argument);
  options = {};
  options.max_bit_errors = -1;
  EXPECT_THROW(Detector(set, options), std::invalid_argument);
  options = {};
  options.camera = Camera::pinhole(640, 480, 500.0);
  Detector detector(set, options);
  EXPECT_THROW(detector.detect(ImageView()), std::invalid_argument);
  EXPECT_THROW(detector.detect(Image(320, 240).view()), std::invalid_argument);
}

}  // namespace
}  // namespace harco
