// From how near to how far one marker gives a pose: frames at distances in even steps of their
// logarithm, looking at the marker's centre (or, with an offset, beside it). Prints for each
// stretch of distance the share of frames with a pose, the layers in use and the errors, for both
// fusions.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <numbers>
#include <random>
#include <set>
#include <string>
#include <vector>

#include "harco/harco.hpp"
#include "lab/render.hpp"

namespace {

using namespace harco;

constexpr double kDegree = std::numbers::pi / 180.0;

struct Errors {
  std::vector<double> distance_percent;
  std::vector<double> rotation_deg;
  std::vector<double> normalised;  // squared, over 6 degrees of freedom

  void add(const Pose& pose, const Eigen::Isometry3d& truth) {
    const Eigen::Vector3d dt = truth.translation() - pose.camera_T_marker.translation();
    const Eigen::AngleAxisd turn(pose.camera_T_marker.rotation().transpose() * truth.rotation());
    distance_percent.push_back(100.0 * dt.norm() / truth.translation().norm());
    rotation_deg.push_back(std::abs(turn.angle()) / kDegree);
    if (pose.covariance) {
      Eigen::Matrix<double, 6, 1> error;
      error << dt, turn.axis() * turn.angle();
      normalised.push_back(error.dot(pose.covariance->ldlt().solve(error)));
    }
  }
};

double quantile(std::vector<double> values, double q) {
  if (values.empty()) return std::nan("");
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(q * static_cast<double>(values.size() - 1))];
}

double mean(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double value : values) sum += value;
  return values.empty() ? std::nan("") : sum / static_cast<double>(values.size());
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) {
    std::fprintf(stderr,
                 "usage: range MARKERS.json [NEAR_M FAR_M [FRAMES_A_STRETCH [AIM [TILT_DEG]]]]\n"
                 "AIM: how far beside the centre the camera aims, in sides (0); tilted up to "
                 "TILT_DEG (15)\n");
    return 2;
  }
  const MarkerSet markers = load_markers(argv[1]);
  const double near_m = argc > 3 ? std::atof(argv[2]) : 0.1;
  const double far_m = argc > 3 ? std::atof(argv[3]) : 35.0;
  const int frames = argc > 4 ? std::atoi(argv[4]) : 40;
  const double offset = argc > 5 ? std::atof(argv[5]) : 0.0;
  const double tilt_deg = argc > 6 ? std::atof(argv[6]) : 15.0;
  const double side = markers.parents.front().side_m;
  const Camera camera = Camera::pinhole(750, 480, 700.0);
  DetectorOptions options;
  options.camera = camera;
  Detector detector(markers, options);

  std::printf("%15s | %6s %-7s | %21s | %21s | %6s | %21s\n", "distance m", "pose %", "layers",
              "joint: dist % med/max", "rot deg med/max", "NEES", "paper: % / deg, max");
  const int stretches = 14;
  int gapless = 0;  // the longest run of stretches with a pose in every frame
  int run = 0;
  for (int i = 0; i < stretches; ++i) {
    const double from = near_m * std::pow(far_m / near_m, double(i) / stretches);
    const double to = near_m * std::pow(far_m / near_m, (i + 1.0) / stretches);
    Errors joint;
    Errors paper;
    std::set<int> layers;
    int posed = 0;
    for (int k = 0; k < frames; ++k) {
      std::mt19937_64 random(static_cast<std::uint64_t>(i * 10007 + k));
      std::uniform_real_distribution<double> unit(0.0, 1.0);
      const double distance = from * std::pow(to / from, (k + 0.5) / frames);
      lab::Scene scene;
      scene.camera = camera;
      scene.grey = 60.0 + 140.0 * unit(random);
      const Eigen::Vector2d aim(0.5 + offset * (2.0 * unit(random) - 1.0),
                                0.5 + offset * (2.0 * unit(random) - 1.0));
      const Eigen::Isometry3d truth = lab::look_at_marker(
          side * aim, distance, tilt_deg * kDegree * unit(random),
          2.0 * std::numbers::pi * unit(random), 2.0 * std::numbers::pi * unit(random));
      scene.parents = {{0, truth}};
      const Image image = lab::render(scene, markers, random());
      const std::vector<Detection> detections = detector.detect(image.view());
      for (const Detection& detection : detections) layers.insert(detection.layer);
      const auto poses = estimate_poses(image.view(), detections, markers, camera);
      if (!poses.empty()) {
        ++posed;
        joint.add(poses.front(), truth);
      }
      const auto fused = estimate_poses(image.view(), detections, markers, camera, {Fusion::paper});
      if (!fused.empty()) paper.add(fused.front(), truth);
    }
    run = posed == frames ? run + 1 : 0;
    gapless = std::max(gapless, run);
    std::string used;
    for (const int layer : layers) used += std::to_string(layer);
    std::printf(
        "%6.2f … %6.2f | %6.1f %-7s | %10.4f %10.4f | %10.4f %10.4f | %6.1f | %10.3f %10.2f\n",
        from, to, 100.0 * posed / frames, used.c_str(), quantile(joint.distance_percent, 0.5),
        quantile(joint.distance_percent, 1.0), quantile(joint.rotation_deg, 0.5),
        quantile(joint.rotation_deg, 1.0), mean(joint.normalised),
        quantile(paper.distance_percent, 1.0), quantile(paper.rotation_deg, 1.0));
    std::fflush(stdout);
  }
  std::printf("a pose in every frame over a range ratio of %.0f\n",
              std::pow(far_m / near_m, double(gapless) / stretches));
  return 0;
}
