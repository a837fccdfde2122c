#include "lab/experiments/setup.hpp"

#include <cmath>
#include <limits>
#include <map>
#include <memory>
#include <mutex>
#include <numbers>
#include <utility>

#include <fmt/format.h>

#include "harco/dictionary.hpp"
#include "harco/layout.hpp"

namespace harco::lab {

Camera paper_camera(double focal_px) { return Camera::pinhole(750, 480, focal_px); }

CameraEffects paper_effects() {
  CameraEffects effects;
  effects.exposure_s = 0.004;
  return effects;
}

Stage stage_of(const Sheet& sheet) {
  return stage_of(std::vector<Sheet>{sheet}, {Eigen::Isometry3d::Identity()});
}

Stage stage_of(const std::vector<Sheet>& sheets,
               const std::vector<Eigen::Isometry3d>& world_T_sheet) {
  constexpr double kPixelsASide = 200.0;  // of the ground's picture
  static const auto ground = std::make_shared<const Photo>(made_up_ground(512, 110.0, 30.0, 1));
  Stage stage;
  Surface surface;
  surface.photo = ground;
  surface.metres_per_pixel = sheets.front().ink.square.width() / kPixelsASide;
  stage.surfaces.push_back(surface);
  for (std::size_t i = 0; i < sheets.size(); ++i) {
    StagedSheet staged;
    staged.sheet = sheets[i];
    staged.world_T_marker = still(world_T_sheet[i]);
    stage.sheets.push_back(staged);
  }
  return stage;
}

Image Studio::shoot(const Stage& stage, const Motion& camera_T_world, double time_s,
                    std::uint64_t seed) const {
  const Motion world_T_camera = [&](double t) -> Eigen::Isometry3d {
    return camera_T_world(t).inverse();
  };
  return camera_.shoot(stage, world_T_camera, time_s, seed).image;
}

MarkerSet paper_markers(int layers, double side_m, int parents) {
  constexpr int kCells = 5;
  constexpr double kEffort = 0.1;  // of the search for codes: a tenth of a second
  static std::mutex mutex;
  static std::map<std::pair<int, int>, MarkerSet> made;
  const std::lock_guard lock(mutex);
  MarkerSet& set = made[{layers, parents}];
  if (set.parents.empty()) {
    const Marker layout = make_layout(LayoutKind::quincunx, kCells, layers);
    CodeSearch search;
    search.effort = kEffort;
    set = generate_codes(without_codes(layout, parents, side_m, default_line(kCells)), search)
              .markers;
  }
  MarkerSet markers = set;
  for (Parent& parent : markers.parents) parent.side_m = side_m;
  return markers;
}

Vector6d pose_error(const Eigen::Isometry3d& estimate, const Eigen::Isometry3d& truth) {
  const Eigen::AngleAxisd turn(estimate.linear() * truth.linear().transpose());
  Vector6d error;
  error << estimate.translation() - truth.translation(), turn.angle() * turn.axis();
  return error;
}

Vector6d coordinates(const Eigen::Isometry3d& pose) {
  const Eigen::Matrix3d r = pose.linear();
  Vector6d all;
  all << pose.translation(), std::atan2(r(2, 1), r(2, 2)),
      std::atan2(-r(2, 0), std::hypot(r(2, 1), r(2, 2))), std::atan2(r(1, 0), r(0, 0));
  return all;
}

std::optional<Eigen::Isometry3d> pose_by(Fusion fusion, const Image& image,
                                         const std::vector<Detection>& detections,
                                         const MarkerSet& markers, const Camera& camera) {
  PoseOptions options;
  options.fusion = fusion;
  const int wanted = markers.parents.front().marker.id;
  for (const Pose& pose : estimate_poses(image.view(), detections, markers, camera, options))
    if (pose.parent == wanted) return pose.camera_T_marker;
  return std::nullopt;
}

bool is_right(const Eigen::Isometry3d& estimate, const Eigen::Isometry3d& truth) {
  const Vector6d error = pose_error(estimate, truth);
  return error.head<3>().norm() < 0.05 * truth.translation().norm() &&
         error.tail<3>().norm() < 5.0 * kDegree;
}

int layers_seen(const std::vector<Detection>& detections) {
  unsigned seen = 0;
  for (const Detection& detection : detections)
    if (!detection.inferred) seen |= 1U << static_cast<unsigned>(detection.layer - 1);
  return static_cast<int>(seen);
}

double RootMeanSquare::value() const {
  return count_ > 0 ? std::sqrt(sum_ / count_) : std::numeric_limits<double>::quiet_NaN();
}

std::mt19937_64 generator(const std::string& experiment, int item) {
  std::vector<std::uint32_t> numbers{static_cast<std::uint32_t>(item)};
  for (const char c : experiment) numbers.push_back(static_cast<unsigned char>(c));
  std::seed_seq seed(numbers.begin(), numbers.end());
  return std::mt19937_64(seed);
}

double uniform(std::mt19937_64& random, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(random);
}

Wander::Wander(std::mt19937_64& random, double low_hz, double high_hz) {
  for (Sine& sine : sines_)
    sine = {0.5 * std::sqrt(2.0 / static_cast<double>(sines_.size())),
            2.0 * std::numbers::pi * uniform(random, low_hz, high_hz),
            uniform(random, 0.0, 2.0 * std::numbers::pi)};
}

double Wander::operator()(double time_s) const {
  double sum = 0.0;
  for (const Sine& sine : sines_) sum += sine.amplitude * std::sin(sine.rate * time_s + sine.phase);
  return sum;
}

Json to_json(const std::vector<double>& values) {
  Json json = Json::array();
  for (const double value : values)
    json.push_back(std::isfinite(value) ? Json(std::stod(fmt::format("{:.5g}", value))) : Json());
  return json;
}

std::vector<double> numbers(const Json& json) {
  std::vector<double> values;
  for (const Json& value : json)
    values.push_back(value.is_null() ? std::numeric_limits<double>::quiet_NaN()
                                     : value.get<double>());
  return values;
}

std::string text(double value, int digits) {
  if (!std::isfinite(value)) return "-";
  // Fixed notation, which reads better than exponents.
  const double size = std::abs(value);
  const int before = size > 0.0 ? static_cast<int>(std::floor(std::log10(size))) + 1 : 1;
  return fmt::format("{:.{}f}", value, std::max(0, digits - before));
}

std::string percent(int count, int of) {
  return of > 0 ? fmt::format("{:.3g} %", 100.0 * count / of) : "-";
}

}  // namespace harco::lab
