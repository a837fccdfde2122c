// How small a marker may be: share of frames in which parents and children of growing size are
// found, at several tilts, with the median error of their corners. Prints a table.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "harco/harco.hpp"
#include "lab/render.hpp"

namespace {

using namespace harco;

struct Count {
  int frames = 0;
  int found = 0;
  int wrong = 0;
  std::vector<double> errors;
};

double median(std::vector<double> values) {
  if (values.empty()) return std::nan("");
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

double rms_error(const Detection& detection, const PlacedMarker& marker, const Camera& camera,
                 const Eigen::Isometry3d& camera_T_marker) {
  double sum = 0.0;
  for (std::size_t i = 0; i < 4; ++i) {
    const Eigen::Vector2d corner = marker.corners_m()[i];
    const auto pixel =
        camera.project(camera_T_marker * Eigen::Vector3d(corner.x(), corner.y(), 0.0));
    sum += (*pixel - detection.corners[i]).squaredNorm() / 8.0;
  }
  return std::sqrt(sum);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) {
    std::fprintf(stderr, "usage: recall MARKERS.json [FRAMES]\n");
    return 2;
  }
  const MarkerSet markers = load_markers(argv[1]);
  const int frames = argc > 2 ? std::atoi(argv[2]) : 100;
  const std::vector<PlacedMarker> placed = place(markers);
  const Camera camera = Camera::pinhole(750, 480, 700.0);
  Detector detector(markers);
  std::printf("%-6s %5s %5s | %7s %6s %10s\n", "layer", "tilt", "px", "found %", "wrong",
              "corner px");
  for (int layer = 1; layer <= std::min(2, markers.layers()); ++layer)
    for (const double tilt_deg : {0.0, 30.0, 45.0, 60.0})
      for (const double side_px :
           {11.0, 12.0, 13.0, 14.0, 16.0, 18.0, 20.0, 25.0, 32.0, 50.0, 100.0, 250.0}) {
        Count count;
        for (int i = 0; i < frames; ++i) {
          std::mt19937_64 random(static_cast<std::uint64_t>(i * 1000 + layer));
          std::uniform_real_distribution<double> unit(0.0, 1.0);
          std::vector<std::size_t> candidates;
          for (std::size_t k = 0; k < placed.size(); ++k)
            if (placed[k].layer == layer) candidates.push_back(k);
          const std::size_t pick = candidates[static_cast<std::size_t>(
              unit(random) * static_cast<double>(candidates.size()))];
          const PlacedMarker& marker = placed[pick];
          const Eigen::Vector2d aim =
              marker.origin_m + marker.side_m * Eigen::Vector2d(unit(random), unit(random));
          lab::Scene scene;
          scene.camera = camera;
          scene.grey = 110.0;
          const double distance = camera.fx * marker.side_m / side_px;
          scene.parents.push_back(
              {marker.parent_index,
               lab::look_at_marker(aim, distance, tilt_deg * std::numbers::pi / 180.0,
                                   unit(random) * 2.0 * std::numbers::pi,
                                   unit(random) * 2.0 * std::numbers::pi)});
          const Image image = lab::render(scene, markers, random());
          ++count.frames;
          for (const Detection& detection : detector.detect(image.view())) {
            const double error =
                rms_error(detection, placed[static_cast<std::size_t>(detection.placed)], camera,
                          scene.parents[0].camera_T_marker);
            if (error > 3.0) ++count.wrong;
            if (detection.placed == static_cast<int>(pick) && !detection.inferred && error < 3.0) {
              ++count.found;
              count.errors.push_back(error);
            }
          }
        }
        std::printf("%-6d %5.0f %5.0f | %7.1f %6d %10.3f\n", layer, tilt_deg, side_px,
                    100.0 * count.found / count.frames, count.wrong, median(count.errors));
        std::fflush(stdout);
      }
  return 0;
}
