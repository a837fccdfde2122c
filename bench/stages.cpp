// How long each stage of detection and pose takes by itself, with Google Benchmark: stages of
// whole frames (content, width), and poses of a single marker by its side in pixels. Rates and
// counters are of what a stage goes through: pixels, regions, quads.
#include <cmath>
#include <map>
#include <optional>
#include <tuple>
#include <vector>

#include <benchmark/benchmark.h>

#include "detect/cells.hpp"
#include "detect/codebook.hpp"
#include "detect/covered_squares.hpp"
#include "detect/edges.hpp"
#include "detect/pyramid.hpp"
#include "detect/recovery.hpp"
#include "detect/shapes.hpp"
#include "detect/square_homography.hpp"
#include "frames.hpp"
#include "harco/geometry.hpp"
#include "harco/harco.hpp"
#include "lab/render.hpp"
#include "pose/align.hpp"
#include "pose/ink_outline.hpp"
#include "pose/joint.hpp"
#include "pose/observation.hpp"

namespace {

using namespace harco;
using benchmark::State;

const MarkerSet& markers() {
  static const MarkerSet set = bench::apriltag_set();
  return set;
}

/// The frame that a benchmark's arguments (content, width, height) name, made once.
const Image& frame_of(const State& state) {
  static std::map<std::tuple<std::int64_t, std::int64_t>, bench::Frame> frames;
  const auto key = std::tuple(state.range(0), state.range(1));
  const auto known = frames.find(key);
  if (known != frames.end()) return known->second.image;
  const bench::Size size{static_cast<int>(state.range(1)), static_cast<int>(state.range(2))};
  return frames
      .emplace(key,
               bench::make_frame(markers(), size, static_cast<bench::Content>(state.range(0)), 3))
      .first->second.image;
}

void frames(benchmark::internal::Benchmark* stage) {
  for (const auto content : {bench::Content::one, bench::Content::texture})
    for (const auto& [width, height] : {std::pair(750, 480), std::pair(1920, 1080)})
      stage->Args({static_cast<std::int64_t>(content), width, height});
  stage->ArgNames({"content", "w", "h"})->Unit(benchmark::kMicrosecond);
}

/// How many things a stage went through in each frame.
void count(State& state, const char* what, std::size_t each) {
  state.counters[what] = static_cast<double>(each);
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(each));
}

// What the stage before leaves, made once for those behind it.

detect::Threshold threshold_of(const Image& image) {
  detect::Threshold threshold;
  threshold.measure(image.view());
  return threshold;
}

/// Of markers of 10 pixels on, as the detector asks for.
detect::RegionLimits limits() { return {5, 28, 25.0}; }

/// A region and its rows.
struct Kept {
  explicit Kept(const detect::Region& from)
      : left(from.left, from.left + from.rows),
        right(from.right, from.right + from.rows),
        region(from) {}
  std::vector<std::int32_t> left, right;
  detect::Region region;
};

std::vector<Kept> regions_of(const detect::Threshold& threshold) {
  detect::ConvexRegions regions;
  regions.start(threshold, detect::Threshold::kMiddleLevel, limits());
  std::vector<Kept> all;
  while (const detect::Region* region = regions.next()) all.emplace_back(*region);
  for (Kept& kept : all) {
    kept.region.left = kept.left.data();
    kept.region.right = kept.right.data();
  }
  return all;
}

void threshold(State& state) {
  const Image& image = frame_of(state);
  detect::Threshold threshold;
  for (auto _ : state) threshold.measure(image.view());
  count(state, "pixels", image.pixels.size());
}
BENCHMARK(threshold)->Apply(frames);

/// Dark ones of the middle level.
void regions(State& state) {
  const detect::Threshold threshold = threshold_of(frame_of(state));
  detect::ConvexRegions regions;
  std::size_t found = 0;
  for (auto _ : state) {
    found = 0;
    regions.start(threshold, detect::Threshold::kMiddleLevel, limits());
    while (regions.next()) ++found;
  }
  count(state, "regions", found);
}
BENCHMARK(regions)->Apply(frames);

void region_quad(State& state) {
  const detect::Threshold threshold = threshold_of(frame_of(state));
  const std::vector<Kept> all = regions_of(threshold);
  detect::RegionQuad quad;
  quad.start(threshold, detect::Threshold::kMiddleLevel);
  for (auto _ : state)
    for (const Kept& kept : all) benchmark::DoNotOptimize(quad.fit(kept.region));
  count(state, "regions", all.size());
}
BENCHMARK(region_quad)->Apply(frames);

/// Of every quad: sides fitted, cells read, the code looked up.
void edges_and_decoding(State& state) {
  const ImageView image = frame_of(state).view();
  const detect::Lens lens;
  const std::vector<PlacedMarker> placed = place(markers());
  const int n = markers().cells;
  const detect::Codebook book(n, placed, false);
  detect::Workers alone;
  detect::ShapeFinder shapes;
  shapes.find(image, {10.0, false, true}, alone);
  std::vector<detect::Match> matches;
  for (auto _ : state)
    for (const detect::Shape& shape : shapes.shapes()) {
      const auto fitted =
          detect::fit_edges(image, lens, shape.corners, {false, 1.0 / (n + 2), 0.0});
      if (!fitted) continue;
      Eigen::Matrix3d image_H_cells = detect::square_homography(fitted->corners);
      image_H_cells.leftCols<2>() /= n + 2;
      const auto seen = detect::sample_cells(image, lens, image_H_cells, n,
                                             detect::shortest_side(fitted->corners) / (n + 2));
      if (!seen) continue;
      const auto grid = detect::read_cells(*seen, 0.8, false, 1);
      if (!grid) continue;
      matches.clear();
      book.find(detect::read_bits(*grid, 0.42), 1, matches);
      benchmark::DoNotOptimize(matches.data());
    }
  count(state, "quads", shapes.shapes().size());
}
BENCHMARK(edges_and_decoding)->Apply(frames);

/// Squares of what is straight in the picture, and each of them held against all markers.
void covered_search(State& state) {
  const ImageView image = frame_of(state).view();
  const std::vector<PlacedMarker> placed = place(markers());
  const auto predicted = predicted_cells(markers());
  const detect::Lens lens;
  detect::Workers alone;
  detect::CoveredSquares covered;
  detect::Recovery recovery(markers(), placed, predicted);
  detect::Pyramid pyramid;
  std::size_t squares = 0;
  for (auto _ : state) {
    squares = 0;
    pyramid.build(image);
    for (const auto& quad : covered.find(pyramid, lens, 80.0, 16, 12, std::nullopt, alone)) {
      const auto glimpse = recovery.glimpse(pyramid, lens, quad.corners, 0);
      if (glimpse) benchmark::DoNotOptimize(recovery.at(pyramid, lens, *glimpse, 0.0));
      ++squares;
    }
  }
  count(state, "squares", squares);
}
BENCHMARK(covered_search)->Apply(frames);

/// All of detection, by content and the number of threads.
void detection(State& state) {
  const Image& image = frame_of(state);
  DetectorOptions options;
  options.threads = static_cast<int>(state.range(3));
  Detector detector(markers(), options);
  std::vector<Detection> detections;
  for (auto _ : state) detector.detect(image.view(), detections);
  count(state, "pixels", image.pixels.size());
}
BENCHMARK(detection)
    ->ArgsProduct({{static_cast<std::int64_t>(bench::Content::one),
                    static_cast<std::int64_t>(bench::Content::texture)},
                   {1920},
                   {1080},
                   {1, 2, 4}})
    ->ArgNames({"content", "w", "h", "threads"})
    ->Unit(benchmark::kMicrosecond)
    ->UseRealTime();

/// One marker, tilted by 30 degrees, of so many pixels of side.
struct View {
  Camera camera = Camera::pinhole(1280, 960, 1000.0);
  Image image;
  std::vector<Detection> detections;
  std::vector<Observation> observations;

  explicit View(double side_px) {
    lab::Scene scene;
    scene.camera = camera;
    const double side = markers().parents[0].side_m;
    const double distance = camera.fx * side / side_px;
    scene.parents = {{0, lab::look_at_marker({0.5 * side, 0.5 * side}, distance, 0.52, 0.4, 0.3)}};
    image = lab::render(scene, markers(), 1);
    detections = Detector(markers(), camera).detect(image.view());
    observations = observe(detections, markers(), place(markers()), camera);
  }
};

void sides(benchmark::internal::Benchmark* stage) {
  for (const int side : {50, 200, 600}) stage->Arg(side);
  stage->ArgName("side")->Unit(benchmark::kMicrosecond);
}

void corner_pose(State& state) {
  const View view(static_cast<double>(state.range(0)));
  if (view.observations.empty()) return state.SkipWithError("the marker isn't found");
  for (auto _ : state) benchmark::DoNotOptimize(solve_joint(view.observations));
}
BENCHMARK(corner_pose)->Apply(sides);

void alignment(State& state) {
  const View view(static_cast<double>(state.range(0)));
  const auto start = view.observations.empty() ? std::nullopt : solve_joint(view.observations);
  if (!start) return state.SkipWithError("the marker isn't found");
  const InkOutline outline(ink_plan(markers(), 0));
  const Parent& parent = markers().parents[0];
  Aligner aligner;
  for (auto _ : state) {
    aligner.refill();
    benchmark::DoNotOptimize(aligner.align(view.image.view(), outline,
                                           parent.side_m / (parent.marker.code.cells + 2),
                                           view.camera, start->camera_T_marker, start->covariance));
  }
}
BENCHMARK(alignment)->Apply(sides);

/// PoseEstimator::estimate, all that it does.
void pose(State& state) {
  const View view(static_cast<double>(state.range(0)));
  PoseEstimator estimator(markers());
  for (auto _ : state)
    benchmark::DoNotOptimize(estimator.estimate(view.image.view(), view.detections, view.camera));
}
BENCHMARK(pose)->Apply(sides);

}  // namespace

BENCHMARK_MAIN();
