// Any number of threads finds the same, to the last bit.
#include <cmath>
#include <cstdint>
#include <cstring>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "harco/detect.hpp"
#include "harco/dictionary.hpp"
#include "lab/blobs.hpp"
#include "lab/render.hpp"

namespace harco {
namespace {

constexpr double kTilt = 0.6;

MarkerSet marker_set() {
  DictionaryOptions options;
  options.parents = 4;
  options.child_cells = {quincunx(5)};
  options.effort = 0.05;
  return build_markers(generate_dictionary(options), 1.0);
}

lab::Scene scene_of(const Camera& camera, double distance) {
  lab::Scene scene;
  scene.camera = camera;
  scene.parents = {{0, lab::look_at_marker({0.5, 0.5}, distance, kTilt, 0.4, 0.5)}};
  return scene;
}

/// Squares of all sizes and greys, one over the other.
Image squares(int width, int height) {
  std::mt19937_64 random(5);
  const auto below = [&](int end) {
    return static_cast<int>(random() % static_cast<unsigned>(end));
  };
  Image image(width, height, 128);
  for (int i = 0; i < 1500; ++i) {
    const int side = 4 + below(40);
    const int left = below(width - side);
    const int top = below(height - side);
    const int grey = below(256);
    for (int y = top; y < top + side; ++y)
      std::memset(image.row(y) + left, grey, static_cast<std::size_t>(side));
  }
  return image;
}

Image noise(int width, int height) {
  std::mt19937_64 random(6);
  Image image(width, height);
  for (std::uint8_t& pixel : image.pixels) pixel = static_cast<std::uint8_t>(random() >> 56);
  return image;
}

struct Named {
  std::string name;
  Image image;
};

/// Frames that keep every stage busy, all of the camera's size.
std::vector<Named> frames(const MarkerSet& set, const Camera& camera) {
  std::vector<Named> all;
  for (const double distance : {0.8, 2.5, 12.0})
    all.push_back(
        {"at " + std::to_string(distance), lab::render(scene_of(camera, distance), set, 1)});
  lab::Scene several = scene_of(camera, 7.0);
  for (int parent = 1; parent < 4; ++parent)
    several.parents.push_back(
        {parent, lab::look_at_marker({-1.6 * parent + 3.0, 0.4}, 6.0 + parent, 0.2, 0.1, 0.0)});
  all.push_back({"several", lab::render(several, set, 2)});

  const lab::Scene scene = scene_of(camera, 2.8);
  std::mt19937_64 random(7);
  lab::FloatImage covered = lab::render_exact(scene, set);
  lab::draw_blobs(covered, lab::cover(1.0, 0.5, 1000, random), camera,
                  scene.parents[0].camera_T_marker, 0.6);
  all.push_back({"covered", lab::expose(covered, 2.0, 3)});
  all.push_back({"squares", squares(camera.width, camera.height)});
  all.push_back({"noise", noise(camera.width, camera.height)});
  return all;
}

void expect_same(const std::vector<Detection>& one, const std::vector<Detection>& other) {
  ASSERT_EQ(one.size(), other.size());
  for (std::size_t i = 0; i < one.size(); ++i) {
    EXPECT_EQ(one[i].placed, other[i].placed);
    EXPECT_EQ(one[i].corners, other[i].corners);
    EXPECT_EQ(one[i].corner_covariance, other[i].corner_covariance);
    EXPECT_EQ(one[i].bit_errors, other[i].bit_errors);
    EXPECT_EQ(one[i].quality, other[i].quality);
    EXPECT_EQ(one[i].inferred, other[i].inferred);
    EXPECT_EQ(one[i].visible, other[i].visible);
  }
}

void expect_same(const DetectionTrace& one, const DetectionTrace& other) {
  EXPECT_EQ(one.contours, other.contours);
  ASSERT_EQ(one.binary.size(), other.binary.size());
  for (std::size_t i = 0; i < one.binary.size(); ++i)
    EXPECT_EQ(one.binary[i].pixels, other.binary[i].pixels);
  ASSERT_EQ(one.candidates.size(), other.candidates.size());
  for (std::size_t i = 0; i < one.candidates.size(); ++i) {
    EXPECT_EQ(one.candidates[i].corners, other.candidates[i].corners);
    EXPECT_EQ(one.candidates[i].rejection, other.candidates[i].rejection);
    EXPECT_EQ(one.candidates[i].note, other.candidates[i].note);
  }
}

TEST(Threads, FindTheSame) {
  const MarkerSet set = marker_set();
  Camera camera = Camera::pinhole(750, 480, 700.0);
  camera.coefficients = {-0.05, 0.01};
  DetectorOptions options;
  options.camera = camera;
  Detector alone(set, options);
  std::vector<Named> pictures = frames(set, camera);
  // Once more, now that memory has been used.
  pictures.push_back(pictures.front());
  bool covered = false;
  for (const int threads : {2, 5}) {
    options.threads = threads;
    Detector several(set, options);
    for (const Named& picture : pictures) {
      SCOPED_TRACE(picture.name + ", " + std::to_string(threads) + " threads");
      DetectionTrace trace, other_trace;
      const auto detections = alone.detect(picture.image.view(), &trace);
      expect_same(detections, several.detect(picture.image.view(), &other_trace));
      expect_same(trace, other_trace);
      EXPECT_EQ(alone.statistics().noise, several.statistics().noise);
      EXPECT_EQ(alone.statistics().quads, several.statistics().quads);
      const Region region{100, 50, 500, 400, 0.0};
      expect_same(alone.detect(picture.image.view(), region),
                  several.detect(picture.image.view(), region));
      EXPECT_EQ(detections.empty(), picture.name == "squares" || picture.name == "noise");
      for (const Detection& detection : detections) covered |= detection.visible < 1.0;
    }
  }
  EXPECT_TRUE(covered);
}

TEST(Threads, MayBeMoreThanRows) {
  DetectorOptions options;
  options.threads = 16;
  Detector detector(marker_set(), options);
  for (const int size : {1, 2, 5, 9})
    EXPECT_TRUE(detector.detect(noise(size, size).view()).empty());
}

TEST(Threads, AreAtLeastOne) {
  for (const int threads : {-1, 0, DetectorOptions::kMostThreads + 1}) {
    DetectorOptions options;
    options.threads = threads;
    EXPECT_THROW(Detector(marker_set(), options), std::invalid_argument) << threads;
  }
}

}  // namespace
}  // namespace harco
