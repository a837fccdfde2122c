#include "random_scene.hpp"

#include <algorithm>
#include <cmath>

#include "trials.hpp"

namespace harco::bench {
namespace {

double evenly(const Interval& interval, std::mt19937_64& random) {
  return std::uniform_real_distribution<double>(interval.low, interval.high)(random);
}

double evenly_in_logarithm(const Interval& interval, std::mt19937_64& random) {
  return std::exp(evenly({std::log(interval.low), std::log(interval.high)}, random));
}

Camera random_camera(double distorted, std::mt19937_64& random) {
  Camera camera = Camera::pinhole(1600, 1200, evenly({1000.0, 1400.0}, random));
  camera.cx += evenly({-20.0, 20.0}, random);
  camera.cy += evenly({-20.0, 20.0}, random);
  const bool distorts = evenly({0.0, 1.0}, random) < distorted;
  const double k1 = evenly({-0.25, 0.1}, random);
  const double p1 = evenly({-1e-3, 1e-3}, random);
  if (distorts) camera.coefficients = {k1, -0.4 * k1, p1, -p1};
  return camera;
}

/// The part of the picture that holds the marker, and half its side around it.
void cut_out(const Eigen::Isometry3d& pose, double side_m, Camera& camera) {
  Eigen::Array2d low(camera.width, camera.height), high(0.0, 0.0);
  for (const double x : {-0.5, 1.5})
    for (const double y : {-0.5, 1.5}) {
      const auto pixel = camera.project(pose * Eigen::Vector3d(x * side_m, y * side_m, 0.0));
      if (!pixel) return;
      low = low.min(pixel->array());
      high = high.max(pixel->array());
    }
  low = (low - 8.0).floor().max(0.0);
  high = (high + 8.0).ceil().min(Eigen::Array2d(camera.width, camera.height));
  camera.width = static_cast<int>(high.x() - low.x());
  camera.height = static_cast<int>(high.y() - low.y());
  camera.cx -= low.x();
  camera.cy -= low.y();
}

/// Upright patches of random size and grey.
Image patches(int width, int height, double size_px, std::mt19937_64& random) {
  constexpr int kPatches = 60;
  Image image(width, height);
  std::fill(image.pixels.begin(), image.pixels.end(), std::uint8_t{120});
  for (int i = 0; i < kPatches; ++i) {
    const auto size = [&] { return static_cast<int>(evenly({2.0, size_px}, random)); };
    const auto grey = static_cast<std::uint8_t>(evenly({30.0, 220.0}, random));
    const int x0 = static_cast<int>(evenly({0.0, double(width)}, random)), x1 = x0 + size();
    const int y0 = static_cast<int>(evenly({0.0, double(height)}, random)), y1 = y0 + size();
    for (int y = y0; y < std::min(y1, height); ++y)
      for (int x = x0; x < std::min(x1, width); ++x) image.row(y)[x] = grey;
  }
  return image;
}

}  // namespace

RandomScene random_scene(const SceneLaw& law, double side_m, std::mt19937_64& random) {
  RandomScene drawn;
  drawn.side_px = evenly_in_logarithm(law.side_px, random);
  drawn.tilt_deg = evenly(law.tilt_deg, random);
  lab::Scene& scene = drawn.scene;
  scene.camera = random_camera(law.distorted, random);
  drawn.camera_T_marker =
      random_pose(scene.camera, side_m, drawn.side_px, drawn.tilt_deg * kDegree, random);
  cut_out(drawn.camera_T_marker, side_m, scene.camera);
  scene.parents = {{0, drawn.camera_T_marker}};
  scene.quiet_zone_cells = evenly({1.0, 2.0}, random);
  scene.black = evenly({10.0, 50.0}, random);
  scene.white = evenly({150.0, 220.0}, random);
  scene.gain_left = evenly({0.85, 1.15}, random);
  scene.gain_right = evenly({0.85, 1.15}, random);
  scene.psf_sigma_px = evenly_in_logarithm(law.psf_px, random);
  scene.noise_sigma = evenly_in_logarithm(law.noise, random);
  scene.background =
      patches(scene.camera.width, scene.camera.height, 0.5 * drawn.side_px + 4.0, random);
  return drawn;
}

}  // namespace harco::bench
