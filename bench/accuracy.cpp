// How near poses come to the best that their picture allows. Random scenes, drawn exact to the area
// of each pixel, with blur, noise and rounding; for each its Cramer-Rao bound; and the errors of
// HArCo, of OpenCV's ArUco, of AprilTag and of a board of 24 ArUco markers, all squares of the same
// size in the same places. docs/accuracy.md explains the table.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <functional>
#include <iostream>
#include <optional>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include <CLI/CLI.hpp>
#include <Eigen/Dense>
#include <opencv2/core/utility.hpp>

#include "harco/harco.hpp"
#include "lab/bound.hpp"
#include "lab/render.hpp"
#include "rivals.hpp"
#include "trials.hpp"

namespace {

using namespace harco;

using namespace harco::bench;

constexpr double kSideM = 1.0;
constexpr double kFlipRad = 10.0 * kDegree;
// Quantiles 50, 90 and 99 % of the chi-square law with six degrees of freedom.
constexpr std::array<double, 3> kChiSquare{5.348, 10.645, 16.812};

struct Options {
  std::vector<double> sides_px{30, 60, 120, 200, 420};
  std::vector<double> tilts_deg{0, 50};
  int frames = 40;
  double psf_px = 0.6;
  double noise = 2.0;
  std::uint64_t seed = 1;
  unsigned threads = std::max(1U, std::thread::hardware_concurrency());
  std::string markers;
  std::string csv;
};

/// What is printed in the square: one picture and one bound each.
enum class Print { harco, aruco, apriltag, board };
constexpr int kPrints = 4;

enum class Method {
  paper,
  corners,
  aligned,
  aruco,
  apriltag,
  board_averaged,
  board_joint,
  board_edges
};
constexpr int kMethods = 8;

struct MethodInfo {
  const char* name;  ///< in the table
  const char* key;   ///< in the CSV
};
constexpr std::array<MethodInfo, kMethods> kMethodInfo{{
    {"HArCo, the paper's fusion", "harco_paper"},
    {"HArCo, joint corners", "harco_corners"},
    {"HArCo, aligned", "harco_aligned"},
    {"ArUco, sub-pixel, IPPE", "aruco"},
    {"AprilTag 3 36h11, IPPE", "apriltag"},
    {"board of 24, averaged", "board_averaged"},
    {"board of 24, joint", "board_joint"},
    {"board of 24, joint, edges", "board_edges"},
}};

/// One method in one frame.
struct Outcome {
  bool found = false;
  Parts error;
  Parts bound;
  std::optional<double> nees;

  bool flipped() const { return found && error.rotation > kFlipRad; }
  bool good() const { return found && !flipped(); }
};

struct Frame {
  double side_px = 0.0, tilt_deg = 0.0;
  std::array<Outcome, kMethods> outcomes;
};

Outcome outcome_of(const std::optional<Estimate>& estimate, const Eigen::Isometry3d& truth,
                   const Matrix6d& bound) {
  const Eigen::Vector3d sight = truth.translation().normalized();
  Outcome outcome;
  outcome.bound = parts_of(bound, sight);
  if (!estimate) return outcome;
  outcome.found = true;
  const Vector6d error = error_of(estimate->pose, truth);
  outcome.error = parts_of(error, sight);
  outcome.nees = normalised_error_squared(*estimate, truth);
  return outcome;
}

std::optional<Estimate> first_of(const std::vector<Pose>& poses) {
  if (poses.empty()) return std::nullopt;
  return Estimate{poses.front().camera_T_marker, poses.front().covariance};
}

std::optional<Estimate> plain(const std::optional<Eigen::Isometry3d>& pose) {
  if (!pose) return std::nullopt;
  return Estimate{*pose, std::nullopt};
}

/// Draws frames and has every method look at them. One a thread.
class Referee {
 public:
  Referee(const Options& options, const MarkerSet& markers)
      : options_(options),
        camera_(Camera::pinhole(750, 480, 700.0)),
        detector_(markers, with_camera(camera_)),
        sheets_{lab::sheet_of(markers, 0, 2.0), lab::aruco_sheet(kSideM),
                bench::apriltag_sheet(kSideM), lab::aruco_board_sheet(kSideM)} {}

  /// The same numbers give the same frame.
  Frame judge(double side_px, int number) {
    std::seed_seq seed{options_.seed, static_cast<std::uint64_t>(std::lround(1000.0 * side_px)),
                       static_cast<std::uint64_t>(number)};
    std::mt19937_64 random(seed);
    std::uniform_real_distribution<double> unit(0.0, 1.0);
    Frame frame;
    frame.side_px = side_px;
    frame.tilt_deg = options_.tilts_deg[0] + (options_.tilts_deg[1] - options_.tilts_deg[0]) *
                                                 (number + unit(random)) / options_.frames;
    lab::Scene scene;
    scene.camera = camera_;
    scene.psf_sigma_px = options_.psf_px;
    scene.noise_sigma = options_.noise;
    scene.black = 15.0 + 35.0 * unit(random);
    scene.white = 180.0 + 55.0 * unit(random);
    scene.grey = scene.white;
    const Eigen::Isometry3d truth =
        random_pose(camera_, kSideM, side_px, frame.tilt_deg * kDegree, random);
    for (int print = 0; print < kPrints; ++print) {
      scene.parents = {{print, truth}};
      const Matrix6d bound = lab::pose_bound(scene, sheets_);
      const Image image = lab::render(scene, sheets_, random());
      const auto note = [&](Method method, const std::optional<Estimate>& estimate) {
        frame.outcomes[static_cast<std::size_t>(method)] = outcome_of(estimate, truth, bound);
      };
      switch (static_cast<Print>(print)) {
        case Print::harco: {
          const auto seen = detector_.detect(image.view());
          const auto solve = [&](const PoseOptions& how) {
            return first_of(estimate_poses(image.view(), seen, detector_.markers(), camera_, how));
          };
          note(Method::paper, solve({Fusion::paper, false}));
          note(Method::corners, solve({Fusion::joint, false}));
          note(Method::aligned, solve({Fusion::joint, true}));
          break;
        }
        case Print::aruco:
          note(Method::aruco, plain(lab::aruco_pose(image, camera_, kSideM, side_px)));
          break;
        case Print::apriltag:
          note(Method::apriltag, plain(bench::apriltag_pose(image, camera_, kSideM)));
          break;
        case Print::board: {
          using lab::Refinement;
          const auto poses = [&](Refinement refinement) {
            return lab::aruco_board_poses(image, camera_, kSideM, side_px, refinement);
          };
          const lab::BoardPoses sub_pixel = poses(Refinement::sub_pixel);
          note(Method::board_averaged, plain(sub_pixel.averaged));
          note(Method::board_joint, plain(sub_pixel.joint));
          note(Method::board_edges, plain(poses(Refinement::edges).joint));
          break;
        }
      }
    }
    return frame;
  }

 private:
  static DetectorOptions with_camera(const Camera& camera) {
    DetectorOptions options;
    options.camera = camera;
    return options;
  }

  const Options& options_;
  Camera camera_;
  Detector detector_;
  std::vector<lab::Sheet> sheets_;  ///< in the order of Print
};

/// All frames, whatever the number of threads.
std::vector<Frame> judge_all(const Options& options, const MarkerSet& markers) {
  const auto per_side = static_cast<std::size_t>(options.frames);
  std::vector<Frame> frames(options.sides_px.size() * per_side);
  std::vector<Referee> referees;
  for (unsigned t = 0; t < options.threads; ++t) referees.emplace_back(options, markers);
  for_all(frames.size(), options.threads, [&](unsigned thread, std::size_t i) {
    frames[i] =
        referees[thread].judge(options.sides_px[i / per_side], static_cast<int>(i % per_side));
  });
  return frames;
}

/// One method over the frames of one side.
class Row {
 public:
  Row(const std::vector<Frame>& frames, double side_px, std::size_t method) {
    for (const Frame& frame : frames)
      if (frame.side_px == side_px) outcomes_.push_back(frame.outcomes[method]);
  }

  double share(bool (*test)(const Outcome&)) const {
    return static_cast<double>(std::count_if(outcomes_.begin(), outcomes_.end(), test)) /
           static_cast<double>(outcomes_.size());
  }

  /// Of `value` over the frames with a pose that is not flipped.
  std::vector<double> of_good(const std::function<double(const Outcome&)>& value) const {
    std::vector<double> values;
    for (const Outcome& outcome : outcomes_)
      if (outcome.good()) values.push_back(value(outcome));
    return values;
  }

  double root_mean_square(const std::function<double(const Outcome&)>& value) const {
    return std::sqrt(mean(of_good([&](const Outcome& o) { return value(o) * value(o); })));
  }

  double ratio_rms(double Parts::*part) const {
    return root_mean_square([part](const Outcome& o) { return o.error.*part / o.bound.*part; });
  }
  double ratio_median(double Parts::*part) const {
    return median(of_good([part](const Outcome& o) { return o.error.*part / o.bound.*part; }));
  }
  double error_rms(double Parts::*part) const {
    return root_mean_square([part](const Outcome& o) { return o.error.*part; });
  }

  /// Flips included: a covariance has to answer for them.
  std::vector<double> nees() const {
    std::vector<double> values;
    for (const Outcome& outcome : outcomes_)
      if (outcome.nees) values.push_back(*outcome.nees);
    return values;
  }

 private:
  std::vector<Outcome> outcomes_;
};

void print_table(const std::vector<Frame>& frames, const std::vector<double>& sides_px) {
  constexpr std::array parts{&Parts::rotation, &Parts::lateral, &Parts::depth};
  for (const double side : sides_px) {
    std::printf("\nside %.0f px\n%-26s %6s %6s | %-21s | %-21s | %-27s\n", side, "", "found",
                "flips", "RMSE / bound", "median error / bound", "RMSE");
    std::printf("%-26s %6s %6s | %6s %7s %6s | %6s %7s %6s | %7s %9s %9s\n", "", "%", "%", "rot",
                "lateral", "depth", "rot", "lateral", "depth", "rot deg", "lateral %", "depth %");
    for (std::size_t method = 0; method < kMethods; ++method) {
      const Row row(frames, side, method);
      std::printf("%-26s %6.1f %6.1f |", kMethodInfo[method].name,
                  100.0 * row.share([](const Outcome& o) { return o.found; }),
                  100.0 * row.share([](const Outcome& o) { return o.flipped(); }));
      for (const auto part : parts)
        std::printf(" %*s", part == &Parts::lateral ? 7 : 6, number(row.ratio_rms(part)).c_str());
      std::printf(" |");
      for (const auto part : parts)
        std::printf(" %*s", part == &Parts::lateral ? 7 : 6,
                    number(row.ratio_median(part)).c_str());
      const double percent = 100.0 * side / (700.0 * kSideM);  // of the distance
      std::printf(" | %7.4f %9.5f %9.5f\n", row.error_rms(&Parts::rotation) / kDegree,
                  percent * row.error_rms(&Parts::lateral), percent * row.error_rms(&Parts::depth));
    }
  }

  std::printf("\nNormalised error squared: the mean should be 6, the shares 50, 90 and 99 %%\n");
  std::printf("%-26s %7s %7s %7s | %6s %6s %6s\n", "", "side px", "mean", "median", "50 %", "90 %",
              "99 %");
  for (std::size_t method = 0; method < kMethods; ++method)
    for (const double side : sides_px) {
      const std::vector<double> nees = Row(frames, side, method).nees();
      if (nees.empty()) continue;
      std::printf("%-26s %7.0f %7s %7s |", kMethodInfo[method].name, side,
                  number(mean(nees)).c_str(), number(median(nees)).c_str());
      for (const double quantile : kChiSquare)
        std::printf(" %6.1f", 100.0 * share_below(nees, quantile));
      std::printf("\n");
    }
}

void write_csv(const std::vector<Frame>& frames, const std::string& file) {
  std::ofstream out(file);
  out << "method,side_px,tilt_deg,found,flip,rotation_rad,lateral_m,depth_m,"
         "rotation_bound_rad,lateral_bound_m,depth_bound_m,nees\n";
  for (const Frame& frame : frames)
    for (std::size_t method = 0; method < kMethods; ++method) {
      const Outcome& o = frame.outcomes[method];
      out << kMethodInfo[method].key << ',' << frame.side_px << ',' << frame.tilt_deg << ','
          << o.found << ',' << o.flipped() << ',';
      if (o.found)
        out << o.error.rotation << ',' << o.error.lateral << ',' << o.error.depth;
      else
        out << ",,";
      out << ',' << o.bound.rotation << ',' << o.bound.lateral << ',' << o.bound.depth << ',';
      if (o.nees) out << *o.nees;
      out << '\n';
    }
  out.close();
  if (!out) throw Error(file + ": can't be written");
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  CLI::App app("Errors of poses over the Cramer-Rao bound of their picture, beside other systems'");
  app.add_option("--sides", options.sides_px, "sides of the square in px, seen straight on")
      ->delimiter(',')
      ->check(CLI::Range(10.0, 450.0))
      ->capture_default_str();
  app.add_option("--tilts", options.tilts_deg, "least and greatest tilt in degrees")
      ->delimiter(',')
      ->expected(2)
      ->check(CLI::Range(0.0, 80.0))
      ->capture_default_str();
  app.add_option("--frames", options.frames, "frames for each side")
      ->check(CLI::Range(1, 1000000))
      ->capture_default_str();
  app.add_option("--psf", options.psf_px, "sigma of the blur in px")
      ->check(CLI::Range(0.0, 5.0))
      ->capture_default_str();
  app.add_option("--noise", options.noise, "sigma of the noise in grey levels")
      ->check(CLI::Range(0.0, 50.0))
      ->capture_default_str();
  app.add_option("--seed", options.seed, "of everything random")->capture_default_str();
  app.add_option("--threads", options.threads)->check(CLI::Range(1U, 256U))->capture_default_str();
  app.add_option("--markers", options.markers,
                 "markers.json, its first parent scaled to the side (three layers of our own)")
      ->check(CLI::ExistingFile);
  app.add_option("--csv", options.csv, "file for the outcome of every method in every frame");
  CLI11_PARSE(app, argc, argv);
  try {
    cv::setNumThreads(1);
    const MarkerSet markers =
        options.markers.empty() ? default_markers(kSideM) : markers_from(options.markers, kSideM);
    const std::vector<Frame> frames = judge_all(options, markers);
    std::printf("%d frames a side, tilt %g to %g degrees, blur %g px, noise %g of 255\n",
                options.frames, options.tilts_deg[0], options.tilts_deg[1], options.psf_px,
                options.noise);
    print_table(frames, options.sides_px);
    if (!options.csv.empty()) write_csv(frames, options.csv);
  } catch (const std::exception& problem) {
    std::cerr << "accuracy: " << problem.what() << '\n';
    return 2;
  }
  return 0;
}
