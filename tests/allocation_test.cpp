// Once its memory has grown, the detector allocates nothing.
#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <new>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "harco/harco.hpp"
#include "lab/blobs.hpp"
#include "lab/render.hpp"

namespace {

std::atomic<long> allocations{0};

void* counted(std::size_t size) noexcept {
  ++allocations;
  return std::malloc(size == 0 ? 1 : size);
}

void* counted_or_thrown(std::size_t size) {
  if (void* memory = counted(size)) return memory;
  throw std::bad_alloc();
}

}  // namespace

void* operator new(std::size_t size) { return counted_or_thrown(size); }
void* operator new[](std::size_t size) { return counted_or_thrown(size); }
void* operator new(std::size_t size, const std::nothrow_t&) noexcept { return counted(size); }
void* operator new[](std::size_t size, const std::nothrow_t&) noexcept { return counted(size); }
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete[](void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
void operator delete[](void* memory, std::size_t) noexcept { std::free(memory); }
void operator delete(void* memory, const std::nothrow_t&) noexcept { std::free(memory); }
void operator delete[](void* memory, const std::nothrow_t&) noexcept { std::free(memory); }

namespace harco {
namespace {

MarkerSet marker_set(int layers) {
  DictionaryOptions options;
  options.child_cells.assign(static_cast<std::size_t>(layers - 1), quincunx(options.cells));
  options.effort = 0.05;
  return build_markers(generate_dictionary(options), 1.6);
}

/// Allocations of one more frame after two alike.
long allocations_in(Detector& detector, const Image& image, std::vector<Detection>& detections) {
  detector.detect(image.view(), detections);
  detector.detect(image.view(), detections);
  const long before = allocations;
  detector.detect(image.view(), detections);
  return allocations - before;
}

TEST(Allocations, AreCounted) {
  const long before = allocations;
  const std::vector<int> some(100);
  EXPECT_EQ(allocations - before, 1);
  EXPECT_EQ(some.size(), 100U);
}

TEST(Allocations, AreNoneInFramesWithMarkers) {
  const MarkerSet set = marker_set(3);
  lab::Scene scene;
  scene.camera = Camera::pinhole(750, 480, 700.0);
  Detector detector(set);
  std::vector<Detection> detections;
  for (const double distance : {0.5, 2.0, 6.0}) {
    scene.parents = {{0, lab::look_at_marker({0.8, 0.8}, distance, 0.3, 0.4, 0.5)}};
    const Image image = lab::render(scene, set, 1);
    EXPECT_EQ(allocations_in(detector, image, detections), 0) << distance;
    EXPECT_FALSE(detections.empty()) << distance;
  }
}

TEST(Allocations, AreNoneInFramesOfNoise) {
  Detector detector(marker_set(2));
  Image image(640, 480, 0);
  std::uint32_t state = 1;
  for (std::uint8_t& pixel : image.pixels)
    pixel = static_cast<std::uint8_t>((state = state * 1664525U + 1013904223U) >> 24);
  std::vector<Detection> detections;
  EXPECT_EQ(allocations_in(detector, image, detections), 0);
}

TEST(Allocations, AreNoneInFramesWithCoveredMarkers) {
  const MarkerSet set = marker_set(3);
  lab::Scene scene;
  scene.camera = Camera::pinhole(750, 480, 700.0);
  DetectorOptions options;
  options.camera = scene.camera;
  Detector detector(set, options);
  std::vector<Detection> detections;
  for (const double distance : {3.0, 4.5, 9.0}) {
    scene.parents = {{0, lab::look_at_marker({0.8, 0.8}, distance, 0.3, 0.4, 0.5)}};
    lab::FloatImage exact = lab::render_exact(scene, set);
    std::mt19937_64 random(11);
    lab::draw_blobs(exact, lab::cover(1.6, 0.5, 1000, random), scene.camera,
                    scene.parents[0].camera_T_marker, 0.6);
    const Image image = lab::expose(exact, 2.0, 3);
    EXPECT_EQ(allocations_in(detector, image, detections), 0) << distance;
    EXPECT_TRUE(std::any_of(detections.begin(), detections.end(), [](const Detection& detection) {
      return detection.visible < 1.0;
    })) << distance;
  }
}

/// Who of several threads gets which part of a frame is chance, so each one's memory may take some
/// frames to grow.
TEST(Allocations, EndWithSeveralThreadsToo) {
  constexpr int kEnough = 20;
  const MarkerSet set = marker_set(2);
  lab::Scene scene;
  scene.camera = Camera::pinhole(750, 480, 700.0);
  scene.parents = {{0, lab::look_at_marker({0.8, 0.8}, 2.0, 0.3, 0.4, 0.5)}};
  const Image image = lab::render(scene, set, 1);
  DetectorOptions options;
  options.threads = 2;
  Detector detector(set, options);
  std::vector<Detection> detections;
  int frames_without = 0;
  for (int frame = 0; frame < 1000 && frames_without < kEnough; ++frame) {
    const long before = allocations;
    detector.detect(image.view(), detections);
    frames_without = allocations == before ? frames_without + 1 : 0;
  }
  EXPECT_EQ(frames_without, kEnough);
}

}  // namespace
}  // namespace harco
