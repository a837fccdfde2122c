// What is left when part of the marker is covered: share of frames with a right pose while blobs of
// any grey hide a growing share of the marker; with --others, also in how many of as many frames of
// another set's markers one of ours was found. Prints a table.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "harco/harco.hpp"
#include "lab/blobs.hpp"
#include "lab/render.hpp"

namespace {

using namespace harco;

struct Settings {
  std::string markers;
  std::string others;  // another set, if it is to be shown as well
  int frames = 60;
  double tilt_deg = 40.0;
  int first = 0;
  std::vector<double> sides{120.0, 250.0, 400.0};  // pixels, as seen frontally
  std::vector<double> shares{0.0, 0.3, 0.5, 0.7};  // covered
  std::string dump;  // file name of a picture of each frame without a right pose
};

struct Count {
  int frames = 0, right = 0, wrong = 0, markers = 0, false_finds = 0;
};

/// Greatest distance in pixels, over the parent's corners, between where two poses see them.
double worst_corner_px(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b, double side,
                       const Camera& camera) {
  double worst = 0.0;
  for (const auto& [x, y] : {std::pair{0.0, 0.0}, {side, 0.0}, {side, side}, {0.0, side}}) {
    const auto pa = camera.project(a * Eigen::Vector3d(x, y, 0.0));
    const auto pb = camera.project(b * Eigen::Vector3d(x, y, 0.0));
    if (!pa || !pb) return 1e9;
    worst = std::max(worst, (*pa - *pb).norm());
  }
  return worst;
}

void save(const Image& image, const std::string& file) {
  std::ofstream out(file, std::ios::binary);
  out << "P5\n" << image.width << ' ' << image.height << "\n255\n";
  out.write(reinterpret_cast<const char*>(image.pixels.data()),
            static_cast<std::streamsize>(image.pixels.size()));
}

/// `others` may be empty.
Count measure(Detector& detector, const MarkerSet& others, const Settings& settings,
              const Camera& camera, double side_px, double share, int most_blobs) {
  const MarkerSet& markers = detector.markers();
  const double side = markers.parents.front().side_m;
  Count count;
  for (int frame = settings.first; frame < settings.first + settings.frames; ++frame) {
    std::mt19937_64 random(static_cast<std::uint64_t>(frame) * 7919U + 13U);
    std::uniform_real_distribution<double> unit(0.0, 1.0);
    const auto between = [&](double a, double b) { return a + (b - a) * unit(random); };
    lab::Scene scene;
    scene.camera = camera;
    scene.grey = between(60.0, 180.0);
    const double turn = 2.0 * std::numbers::pi;
    scene.parents.push_back(
        {0, lab::look_at_marker(Eigen::Vector2d(0.5, 0.5) * side, camera.fx * side / side_px,
                                between(0.0, settings.tilt_deg) * std::numbers::pi / 180.0,
                                turn * unit(random), turn * unit(random))});
    const Eigen::Isometry3d& truth = scene.parents.front().camera_T_marker;
    lab::FloatImage exact = lab::render_exact(scene, markers);
    const auto blobs = lab::cover(side, share, most_blobs, random);
    lab::draw_blobs(exact, blobs, camera, truth, scene.psf_sigma_px);
    const Image image = lab::expose(exact, scene.noise_sigma, random());
    ++count.frames;
    bool right = false;
    const auto detections = detector.detect(image.view());
    count.markers += static_cast<int>(detections.size());
    for (const Pose& pose : estimate_poses(image.view(), detections, markers, camera)) {
      const bool near =
          worst_corner_px(pose.camera_T_marker, truth, side, camera) < 0.5 + 0.01 * side_px;
      right |= near;
      if (!near) ++count.wrong;
    }
    count.right += right;
    if (!others.parents.empty()) {
      scene.parents.front().parent_index = frame % static_cast<int>(others.parents.size());
      lab::FloatImage other = lab::render_exact(scene, others);
      lab::draw_blobs(other, blobs, camera, truth, scene.psf_sigma_px);
      const Image shown = lab::expose(other, scene.noise_sigma, random());
      count.false_finds += !detector.detect(shown.view()).empty();
    }
    if (!right && !settings.dump.empty())
      save(image, settings.dump + "-" + std::to_string(static_cast<int>(side_px)) + "-" +
                      std::to_string(static_cast<int>(100 * share)) + "-" +
                      std::to_string(most_blobs) + "-" + std::to_string(frame) + ".pgm");
  }
  return count;
}

}  // namespace

int main(int argc, char** argv) {
  Settings settings;
  CLI::App app("Share of frames with a right pose while blobs cover a share of the marker.");
  app.add_option("markers", settings.markers, "markers.json")->required();
  app.add_option("--frames", settings.frames, "frames of each case");
  app.add_option("--first", settings.first, "number of the first frame");
  app.add_option("--sides", settings.sides, "the marker's sides in pixels")->delimiter(',');
  app.add_option("--shares", settings.shares, "shares covered, 0 to below 1")->delimiter(',');
  app.add_option("--tilt", settings.tilt_deg, "greatest tilt, degrees");
  app.add_option("--dump", settings.dump, "start of the names of pictures that failed");
  app.add_option("--others", settings.others, "markers.json of another set, shown as large");
  CLI11_PARSE(app, argc, argv);
  const MarkerSet markers = load_markers(settings.markers);
  MarkerSet others = settings.others.empty() ? MarkerSet() : load_markers(settings.others);
  for (Parent& parent : others.parents) parent.side_m = markers.parents.front().side_m;
  const Camera camera = Camera::pinhole(750, 480, 700.0);
  Detector detector(markers, camera);
  std::printf("%6s %8s %10s | %8s %7s %8s %7s\n", "side", "covered", "blobs", "right %", "wrong",
              "markers", "false");
  for (const double side_px : settings.sides)
    for (const double share : settings.shares)
      for (const int blobs : {1, 1000}) {
        if (share == 0.0 && blobs > 1) continue;
        const Count count = measure(detector, others, settings, camera, side_px, share, blobs);
        std::printf("%6.0f %7.0f%% %10s | %8.1f %7d %8.1f %7d\n", side_px, 100.0 * share,
                    blobs == 1 ? "one" : "many", 100.0 * count.right / count.frames, count.wrong,
                    static_cast<double>(count.markers) / count.frames, count.false_finds);
        std::fflush(stdout);
      }
  return 0;
}
