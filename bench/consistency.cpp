// Whether covariances are honest. Over random scenes of all kinds the squared error, normalised by
// the covariance that came with the pose, should follow the chi-square law of six degrees of
// freedom: for poses from corners alone and for aligned ones, at every size. The paper's fusion
// gives no covariance, so it has no part in this. docs/accuracy.md explains the table.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <iostream>
#include <optional>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include <CLI/CLI.hpp>

#include "harco/harco.hpp"
#include "lab/render.hpp"
#include "random_scene.hpp"
#include "trials.hpp"

namespace {

using namespace harco;
using namespace harco::bench;

constexpr double kSideM = 1.0;
constexpr double kFlipRad = 10.0 * kDegree;
// Quantiles 50, 90 and 99 % of the chi-square law with six degrees of freedom.
constexpr std::array<double, 3> kChiSquare{5.348, 10.645, 16.812};

struct Options {
  std::vector<double> sides_px{20, 30, 45, 70, 110, 180, 300, 500, 700};
  std::vector<double> tilts_deg{0, 60};
  std::vector<double> psf_px{0.4, 1.5};
  std::vector<double> noise{0.5, 8};
  double distorted = 0.5;
  int frames = 200;
  std::uint64_t seed = 1;
  unsigned threads = std::max(1U, std::thread::hardware_concurrency());
  std::string markers;
  std::string csv;
};

enum class Method { corners, aligned };
constexpr std::array<const char*, 2> kMethods{"corners", "aligned"};

struct Outcome {
  bool found = false;
  bool flipped = false;  ///< more than 10 degrees off
  bool undecided = false;
  std::optional<double> nees;
};

struct Frame {
  std::size_t bin = 0;
  RandomScene drawn;
  std::array<Outcome, kMethods.size()> outcomes;
};

Outcome outcome_of(const std::vector<Pose>& poses, const Eigen::Isometry3d& truth) {
  Outcome outcome;
  if (poses.empty()) return outcome;
  const Pose& pose = poses.front();
  outcome.found = true;
  outcome.flipped = error_of(pose.camera_T_marker, truth).tail<3>().norm() > kFlipRad;
  outcome.undecided = pose.alternative.has_value();
  outcome.nees = normalised_error_squared({pose.camera_T_marker, pose.covariance}, truth);
  return outcome;
}

/// The same numbers give the same frame.
Frame judge(const Options& options, const MarkerSet& markers, std::size_t bin, int number) {
  std::seed_seq seed{options.seed, static_cast<std::uint64_t>(bin),
                     static_cast<std::uint64_t>(number)};
  std::mt19937_64 random(seed);
  Frame frame;
  frame.bin = bin;
  const SceneLaw law{{options.sides_px[bin], options.sides_px[bin + 1]},
                     {options.tilts_deg[0], options.tilts_deg[1]},
                     {options.psf_px[0], options.psf_px[1]},
                     {options.noise[0], options.noise[1]},
                     options.distorted};
  frame.drawn = random_scene(law, kSideM, random);
  lab::Scene& scene = frame.drawn.scene;
  const Image image = lab::render(scene, markers, random());
  Detector detector(markers, scene.camera);
  const std::vector<Detection> seen = detector.detect(image.view());
  for (std::size_t method = 0; method < kMethods.size(); ++method) {
    PoseOptions how;
    how.align = static_cast<Method>(method) == Method::aligned;
    frame.outcomes[method] =
        outcome_of(estimate_poses(image.view(), seen, markers, scene.camera, how),
                   frame.drawn.camera_T_marker);
  }
  scene.background.reset();  // the outcomes need no pictures
  return frame;
}

/// Greatest distance between the values' distribution and the chi-square law's (Kolmogorov).
double kolmogorov_distance(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const auto count = static_cast<double>(values.size());
  double distance = 0.0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const double law = chi_square_6(values[i]);
    const auto below = static_cast<double>(i);
    distance = std::max({distance, law - below / count, (below + 1.0) / count - law});
  }
  return distance;
}

/// Outcomes of one method in the bins from `first` to before `last`.
void print_row(const std::vector<Frame>& frames, std::size_t method, std::size_t first,
               std::size_t last, const std::string& name) {
  std::vector<double> nees;
  int all = 0, found = 0, flips = 0, undecided = 0;
  for (const Frame& frame : frames) {
    if (frame.bin < first || frame.bin >= last) continue;
    const Outcome& outcome = frame.outcomes[method];
    ++all;
    found += outcome.found ? 1 : 0;
    flips += outcome.flipped ? 1 : 0;
    undecided += outcome.undecided ? 1 : 0;
    if (outcome.nees) nees.push_back(*outcome.nees);
  }
  const auto percent = [](int part, int whole) { return 100.0 * part / std::max(1, whole); };
  std::printf("%-8s %9s | %6.1f %6.2f %6.2f | %7s %7s |", kMethods[method], name.c_str(),
              percent(found, all), percent(flips, found), percent(undecided, found),
              number(mean(nees)).c_str(), number(median(nees)).c_str());
  for (const double quantile : kChiSquare)
    std::printf(" %6.1f", 100.0 * share_below(nees, quantile));
  std::printf(" | %6.3f %6.3f\n", kolmogorov_distance(nees),
              1.36 / std::sqrt(static_cast<double>(nees.size())));
}

void print_table(const std::vector<Frame>& frames, const std::vector<double>& sides_px) {
  std::printf(
      "\nNormalised error squared: the mean should be 6, the median 5.35, the shares 50, 90 and\n"
      "99 %%; its distance from the chi-square law (Kolmogorov) stays below the limit in 95 %% of\n"
      "measurements of an honest covariance. Fusion of the paper: no covariance.\n\n"
      "%-8s %9s | %6s %6s %6s | %7s %7s | %6s %6s %6s | %6s %6s\n",
      "pose", "side px", "found", "flip %", "open %", "mean", "median", "50 %", "90 %", "99 %",
      "dist.", "limit");
  const std::size_t bins = sides_px.size() - 1;
  for (std::size_t method = 0; method < kMethods.size(); ++method) {
    for (std::size_t bin = 0; bin < bins; ++bin) {
      char name[32];
      std::snprintf(name, sizeof name, "%g-%g", sides_px[bin], sides_px[bin + 1]);
      print_row(frames, method, bin, bin + 1, name);
    }
    print_row(frames, method, 0, bins, "all");
  }
}

void write_csv(const std::vector<Frame>& frames, const std::string& file) {
  std::ofstream out(file);
  out << "method,bin,side_px,tilt_deg,psf_px,noise,distorted,found,flip,undecided,nees\n";
  for (const Frame& frame : frames)
    for (std::size_t method = 0; method < kMethods.size(); ++method) {
      const Outcome& o = frame.outcomes[method];
      const lab::Scene& scene = frame.drawn.scene;
      out << kMethods[method] << ',' << frame.bin << ',' << frame.drawn.side_px << ','
          << frame.drawn.tilt_deg << ',' << scene.psf_sigma_px << ',' << scene.noise_sigma << ','
          << scene.camera.has_distortion() << ',' << o.found << ',' << o.flipped << ','
          << o.undecided << ',';
      if (o.nees) out << *o.nees;
      out << '\n';
    }
  out.close();
  if (!out) throw Error(file + ": can't be written");
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  CLI::App app("Whether the covariances of poses are honest, over random scenes");
  const auto interval = [&](const char* name, std::vector<double>& values, const char* help,
                            double low, double high) {
    app.add_option(name, values, help)
        ->delimiter(',')
        ->expected(2)
        ->check(CLI::Range(low, high))
        ->capture_default_str();
  };
  app.add_option("--sides", options.sides_px, "bounds of the bins of sides, in px seen straight on")
      ->delimiter(',')
      ->check(CLI::Range(10.0, 1000.0))
      ->capture_default_str();
  interval("--tilts", options.tilts_deg, "least and greatest tilt in degrees", 0.0, 80.0);
  interval("--psf", options.psf_px, "least and greatest sigma of the blur in px", 0.1, 5.0);
  interval("--noise", options.noise, "least and greatest sigma of the noise in grey levels", 0.1,
           50.0);
  app.add_option("--distorted", options.distorted, "share of lenses that distort")
      ->check(CLI::Range(0.0, 1.0))
      ->capture_default_str();
  app.add_option("--frames", options.frames, "frames for each bin")
      ->check(CLI::Range(1, 1000000))
      ->capture_default_str();
  app.add_option("--seed", options.seed, "of everything random")->capture_default_str();
  app.add_option("--threads", options.threads)->check(CLI::Range(1U, 256U))->capture_default_str();
  app.add_option("--markers", options.markers,
                 "markers.json, its first parent scaled to the side (three layers of our own)")
      ->check(CLI::ExistingFile);
  app.add_option("--csv", options.csv, "file for the outcome of both methods in every frame");
  CLI11_PARSE(app, argc, argv);
  try {
    if (options.sides_px.size() < 2 ||
        !std::is_sorted(options.sides_px.begin(), options.sides_px.end()))
      throw std::invalid_argument("--sides: two or more, ascending");
    const MarkerSet markers =
        options.markers.empty() ? default_markers(kSideM) : markers_from(options.markers, kSideM);
    const auto per_bin = static_cast<std::size_t>(options.frames);
    std::vector<Frame> frames(per_bin * (options.sides_px.size() - 1));
    for_all(frames.size(), options.threads, [&](unsigned, std::size_t i) {
      frames[i] = judge(options, markers, i / per_bin, static_cast<int>(i % per_bin));
    });
    print_table(frames, options.sides_px);
    if (!options.csv.empty()) write_csv(frames, options.csv);
  } catch (const std::exception& problem) {
    std::cerr << "consistency: " << problem.what() << '\n';
    return 2;
  }
  return 0;
}
