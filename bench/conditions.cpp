// What else a camera meets: shadows, defocus, tone curves, clipping. Random scenes as those of
// `accuracy`, each of them in even light and again under every condition, with the errors over the
// Cramer-Rao bound of the picture under that condition and over that in even light, and whether the
// covariance holds, and what the poses take of a thread's time. docs/accuracy.md explains the
// table.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <iostream>
#include <numbers>
#include <optional>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include <CLI/CLI.hpp>

#include "harco/harco.hpp"
#include "lab/bound.hpp"
#include "lab/render.hpp"
#include "lab/thread_time.hpp"
#include "trials.hpp"

namespace {

using namespace harco;
using namespace harco::bench;
using Eigen::Vector2d;

constexpr double kSideM = 1.0;
constexpr double kFlipRad = 10.0 * kDegree;
constexpr double kFocalPx = 700.0;

struct Options {
  std::vector<double> sides_px{30, 60, 120, 200, 420};
  std::vector<std::string> conditions;
  int frames = 40;
  double noise = 2.0;
  std::uint64_t seed = 1;
  unsigned threads = std::max(1U, std::thread::hardware_concurrency());
  std::string markers;
};

/// A random number between the two.
double between(double low, double high, std::mt19937_64& random) {
  return std::uniform_real_distribution<double>(low, high)(random);
}

/// Evenly in its logarithm.
double scale_between(double low, double high, std::mt19937_64& random) {
  return std::exp(between(std::log(low), std::log(high), random));
}

Vector2d any_way(std::mt19937_64& random) {
  const double angle = between(0.0, 2.0 * std::numbers::pi, random);
  return {std::cos(angle), std::sin(angle)};
}

/// How the marker is seen: what conditions are placed by.
struct View {
  Vector2d middle_px;
  double side_px = 0.0;
};

/// Multiplies every pixel by the light there.
template <typename Light>
lab::Effect lit_by(const Light& light) {
  return [light](lab::FloatImage& image) {
    for (int y = 0; y < image.height; ++y)
      for (int x = 0; x < image.width; ++x)
        image.row(y)[x] *= static_cast<float>(light(Vector2d(x, y)));
  };
}

/// Of a sun whose disc fades within `width` pixels: the share still seen `d` pixels inside of an
/// edge.
double sun_seen(double d, double width) {
  const double t = std::clamp(2.0 * d / width, -1.0, 1.0);
  return 1.0 - (std::acos(t) - t * std::sqrt(1.0 - t * t)) / std::numbers::pi;
}

lab::Effect gradient(const View& view, std::mt19937_64& random) {
  const double rise = between(0.3, 0.6, random) / view.side_px;
  return lit_by([=, way = any_way(random)](const Vector2d& p) {
    return std::max(0.1, 0.9 + rise * way.dot(p - view.middle_px));
  });
}

lab::Effect shadow(const View& view, double least_width, double most_width,
                   std::mt19937_64& random) {
  const double dark = between(0.35, 0.7, random);
  const double off = between(-0.35, 0.35, random) * view.side_px;
  const double width = scale_between(least_width, most_width, random);
  return lit_by([=, way = any_way(random)](const Vector2d& p) {
    return dark + (1.0 - dark) * sun_seen(way.dot(p - view.middle_px) - off, width);
  });
}

lab::Effect pole(const View& view, std::mt19937_64& random) {
  const double dark = between(0.35, 0.7, random);
  const double off = between(-0.35, 0.35, random) * view.side_px;
  const double half = between(0.08, 0.2, random) * view.side_px;
  const double width = scale_between(1.0, 0.06 * view.side_px + 2.0, random);
  return lit_by([=, way = any_way(random)](const Vector2d& p) {
    const double d = std::abs(way.dot(p - view.middle_px) - off) - half;
    return dark + (1.0 - dark) * sun_seen(d, width);
  });
}

/// A round head's, or a vehicle's own.
lab::Effect disc(const View& view, std::mt19937_64& random) {
  const double dark = between(0.35, 0.7, random);
  const double radius = between(0.25, 0.6, random) * view.side_px;
  const Vector2d middle =
      view.middle_px + between(0.0, 0.6, random) * view.side_px * any_way(random);
  const double width = scale_between(1.0, 0.1 * view.side_px + 2.0, random);
  return lit_by([=](const Vector2d& p) {
    return dark + (1.0 - dark) * sun_seen((p - middle).norm() - radius, width);
  });
}

lab::Effect leaves(const View& view, std::mt19937_64& random) {
  struct Leaf {
    Vector2d middle;
    double radius;
  };
  std::vector<Leaf> all;
  for (int i = 0; i < 14; ++i)
    all.push_back({view.middle_px + between(0.0, 0.7, random) * view.side_px * any_way(random),
                   between(0.03, 0.15, random) * view.side_px});
  const double dark = between(0.4, 0.7, random);
  const double width = 0.04 * view.side_px + 1.0;
  return lit_by([=](const Vector2d& p) {
    double seen = 1.0;
    for (const Leaf& leaf : all)
      seen = std::min(seen, sun_seen((p - leaf.middle).norm() - leaf.radius, width));
    return dark + (1.0 - dark) * seen;
  });
}

/// A lens out of focus spreads a point evenly over a disc.
lab::Effect defocus(double radius) {
  constexpr int kFine = 16;
  const int reach = static_cast<int>(std::ceil(radius + 0.5));
  struct Tap {
    int dx, dy;
    float weight;
  };
  std::vector<Tap> taps;
  double sum = 0.0;
  for (int dy = -reach; dy <= reach; ++dy)
    for (int dx = -reach; dx <= reach; ++dx) {
      int inside = 0;
      for (int j = 0; j < kFine; ++j)
        for (int i = 0; i < kFine; ++i)
          inside += std::hypot(dx + (i + 0.5) / kFine - 0.5, dy + (j + 0.5) / kFine - 0.5) < radius;
      if (inside == 0) continue;
      taps.push_back({dx, dy, static_cast<float>(inside)});
      sum += inside;
    }
  for (Tap& tap : taps) tap.weight /= static_cast<float>(sum);
  return [=](lab::FloatImage& image) {
    lab::FloatImage blurred = image;
    for (int y = reach; y < image.height - reach; ++y) {
      std::fill_n(blurred.row(y) + reach, image.width - 2 * reach, 0.0F);
      for (const Tap& tap : taps) {
        const float* from = image.row(y + tap.dy) + tap.dx;
        float* to = blurred.row(y);
        for (int x = reach; x < image.width - reach; ++x) to[x] += tap.weight * from[x];
      }
    }
    image = std::move(blurred);
  };
}

void apply_tone(lab::FloatImage& image) {
  for (float& value : image.pixels) value = 255.0F * std::pow(value / 255.0F, 1.0F / 2.2F);
}

lab::Effect overexposed(std::mt19937_64& random) {
  const auto gain = static_cast<float>(between(1.3, 1.8, random));
  return [gain](lab::FloatImage& image) {
    for (float& value : image.pixels) value = std::min(255.0F, gain * value);
  };
}

struct Condition {
  const char* name;
  lab::Effect (*draw)(const View& view, std::mt19937_64& random);
};
const std::array<Condition, 11> kConditions{{
    {"even light", [](const View&, std::mt19937_64&) { return lab::Effect(); }},
    {"gradient", gradient},
    {"shadow", [](const View& v, std::mt19937_64& r) { return shadow(v, 0.5, 4.0, r); }},
    {"soft shadow",
     [](const View& v, std::mt19937_64& r) {
       return shadow(v, 0.1 * v.side_px, 0.5 * v.side_px, r);
     }},
    {"pole", pole},
    {"disc", disc},
    {"leaves", leaves},
    {"defocus 1.5 px", [](const View&, std::mt19937_64&) { return defocus(1.5); }},
    {"defocus 3 px", [](const View&, std::mt19937_64&) { return defocus(3.0); }},
    {"tone curve", [](const View&, std::mt19937_64&) { return lab::Effect(apply_tone); }},
    {"overexposed", [](const View&, std::mt19937_64& r) { return overexposed(r); }},
}};

struct Outcome {
  std::size_t condition = 0;
  double side_px = 0.0;
  bool found = false, aligned = false, flipped = false;
  Parts error, bound, even_bound;
  std::optional<double> nees;
  double cost_ms = 0.0;  ///< of the poses
};

/// One scene under all of the conditions asked for.
class Trial {
 public:
  Trial(const Options& options, const MarkerSet& markers, const std::vector<std::size_t>& which)
      : options_(options),
        which_(which),
        camera_(Camera::pinhole(750, 480, kFocalPx)),
        detector_(markers, camera_),
        estimator_(markers),
        sheets_{lab::sheet_of(markers, 0, 2.0)} {}

  /// The same numbers give the same scene.
  std::vector<Outcome> judge(double side_px, int number) {
    std::seed_seq seed{options_.seed, static_cast<std::uint64_t>(std::lround(1000.0 * side_px)),
                       static_cast<std::uint64_t>(number)};
    std::mt19937_64 random(seed);
    lab::Scene scene;
    scene.camera = camera_;
    scene.noise_sigma = options_.noise;
    scene.black = between(15.0, 50.0, random);
    scene.white = between(180.0, 235.0, random);
    scene.grey = scene.white;
    const double tilt = 50.0 * (number + between(0.0, 1.0, random)) / options_.frames;
    truth_ = random_pose(camera_, kSideM, side_px, tilt * kDegree, random);
    scene.parents = {{0, truth_}};
    sight_ = truth_.translation().normalized();
    const View view{*camera_.project(truth_ * Eigen::Vector3d(0.5, 0.5, 0.0) * kSideM), side_px};
    const Parts even = parts_of(lab::pose_bound(scene, sheets_), sight_);
    const std::uint64_t seed_of_conditions = random();
    std::vector<Outcome> outcomes;
    for (const std::size_t condition : which_) {
      std::mt19937_64 own(seed_of_conditions + condition);
      const lab::Effect effect = kConditions[condition].draw(view, own);
      Outcome outcome;
      outcome.condition = condition;
      outcome.side_px = side_px;
      outcome.even_bound = even;
      outcome.bound = parts_of(lab::pose_bound(scene, sheets_, effect), sight_);
      lab::FloatImage exact = lab::render_exact(scene, sheets_);
      if (effect) effect(exact);
      look(lab::expose(exact, scene.noise_sigma, own()), outcome);
      outcomes.push_back(outcome);
    }
    return outcomes;
  }

 private:
  void look(const Image& image, Outcome& outcome) {
    const std::vector<Detection> detections = detector_.detect(image.view());
    const double begin = lab::thread_ms();
    const std::vector<Pose> poses = estimator_.estimate(image.view(), detections, camera_);
    outcome.cost_ms = lab::thread_ms() - begin;
    if (poses.empty()) return;
    const Pose& pose = poses.front();
    outcome.found = true;
    outcome.aligned = pose.aligned;
    outcome.error = parts_of(error_of(pose.camera_T_marker, truth_), sight_);
    outcome.flipped = outcome.error.rotation > kFlipRad;
    outcome.nees = normalised_error_squared({pose.camera_T_marker, pose.covariance}, truth_);
  }

  const Options& options_;
  const std::vector<std::size_t>& which_;
  Camera camera_;
  Detector detector_;
  PoseEstimator estimator_;
  std::vector<lab::Sheet> sheets_;
  Eigen::Isometry3d truth_ = Eigen::Isometry3d::Identity();
  Eigen::Vector3d sight_ = Eigen::Vector3d::UnitZ();
};

void print_row(const std::vector<Outcome>& all, double side_px, std::size_t condition) {
  std::vector<Outcome> here, good;
  for (const Outcome& o : all)
    if (o.side_px == side_px && o.condition == condition) {
      here.push_back(o);
      if (o.found && !o.flipped) good.push_back(o);
    }
  const auto percent = [&](auto test) {
    return 100.0 * static_cast<double>(std::count_if(here.begin(), here.end(), test)) /
           static_cast<double>(here.size());
  };
  std::printf("%5.0f %-15s | %6.1f %6.1f %6.1f |", side_px, kConditions[condition].name,
              percent([](const Outcome& o) { return o.found; }),
              percent([](const Outcome& o) { return o.aligned; }),
              percent([](const Outcome& o) { return o.flipped; }));
  for (const auto bound : {&Outcome::bound, &Outcome::even_bound}) {
    for (const auto part : {&Parts::rotation, &Parts::lateral, &Parts::depth}) {
      std::vector<double> squares;
      for (const Outcome& o : good) {
        const double ratio = o.error.*part / (o.*bound.*part);
        squares.push_back(ratio * ratio);
      }
      std::printf(" %6s", number(std::sqrt(mean(squares))).c_str());
    }
    std::printf(" |");
  }
  std::vector<double> nees;
  for (const Outcome& o : here)
    if (o.nees) nees.push_back(*o.nees);
  std::printf(" %6s %6s |", number(mean(nees)).c_str(), number(median(nees)).c_str());
  std::vector<double> costs;
  for (const Outcome& o : here)
    if (o.found) costs.push_back(o.cost_ms);
  const double most = costs.empty() ? std::nan("") : *std::max_element(costs.begin(), costs.end());
  std::printf(" %6s %6s\n", number(median(costs)).c_str(), number(most).c_str());
}

std::vector<std::size_t> asked_for(const std::vector<std::string>& names) {
  std::vector<std::size_t> which;
  for (std::size_t i = 0; i < kConditions.size(); ++i)
    if (names.empty() || std::find(names.begin(), names.end(), kConditions[i].name) != names.end())
      which.push_back(i);
  return which;
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  CLI::App app(
      "Errors and covariances of aligned poses in uneven light and through imperfect lenses");
  app.add_option("--sides", options.sides_px, "sides of the square in px, seen straight on")
      ->delimiter(',')
      ->check(CLI::Range(10.0, 450.0))
      ->capture_default_str();
  std::vector<std::string> names;
  for (const Condition& condition : kConditions) names.emplace_back(condition.name);
  app.add_option("--conditions", options.conditions, "which of them; all unless given")
      ->delimiter(',')
      ->check(CLI::IsMember(names));
  app.add_option("--frames", options.frames, "frames for each side and condition")
      ->check(CLI::Range(1, 1000000))
      ->capture_default_str();
  app.add_option("--noise", options.noise, "sigma of the noise in grey levels")
      ->check(CLI::Range(0.0, 50.0))
      ->capture_default_str();
  app.add_option("--seed", options.seed, "of everything random")->capture_default_str();
  app.add_option("--threads", options.threads)->check(CLI::Range(1U, 256U))->capture_default_str();
  app.add_option("--markers", options.markers,
                 "markers.json, its first parent scaled to the side (three layers of our own)")
      ->check(CLI::ExistingFile);
  CLI11_PARSE(app, argc, argv);
  try {
    const MarkerSet markers =
        options.markers.empty() ? default_markers(kSideM) : markers_from(options.markers, kSideM);
    const std::vector<std::size_t> which = asked_for(options.conditions);
    const auto per_side = static_cast<std::size_t>(options.frames);
    std::vector<std::vector<Outcome>> outcomes(options.sides_px.size() * per_side);
    std::vector<Trial> trials;
    for (unsigned t = 0; t < options.threads; ++t) trials.emplace_back(options, markers, which);
    for_all(outcomes.size(), options.threads, [&](unsigned thread, std::size_t i) {
      outcomes[i] =
          trials[thread].judge(options.sides_px[i / per_side], static_cast<int>(i % per_side));
    });
    std::vector<Outcome> all;
    for (const auto& some : outcomes) all.insert(all.end(), some.begin(), some.end());
    std::printf(
        "%d frames each, noise %g of 255\n\n%5s %-15s | %6s %6s %6s | %-20s | %-20s | %-13s | %s\n",
        options.frames, options.noise, "side", "", "found", "align.", "flips", "RMSE / bound",
        "RMSE / even bound", "NEES", "poses, ms");
    std::printf("%5s %-15s | %6s %6s %6s | %6s %6s %6s | %6s %6s %6s | %6s %6s | %6s %6s\n", "px",
                "", "%", "%", "%", "rot", "lat", "depth", "rot", "lat", "depth", "mean", "median",
                "median", "most");
    for (const double side : options.sides_px)
      for (const std::size_t condition : which) print_row(all, side, condition);
  } catch (const std::exception& problem) {
    std::cerr << "conditions: " << problem.what() << '\n';
    return 2;
  }
  return 0;
}
