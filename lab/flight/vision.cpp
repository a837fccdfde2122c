#include "vision.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace harco::lab {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;

/// Errors (dt, w) of a pose, as its covariance has them.
Eigen::Matrix<double, 6, 1> error_of(const Isometry3d& estimate, const Isometry3d& truth) {
  Eigen::Matrix<double, 6, 1> error;
  error.head<3>() = truth.translation() - estimate.translation();
  const Eigen::AngleAxisd turn(Eigen::Matrix3d(estimate.linear().transpose() * truth.linear()));
  error.tail<3>() = turn.angle() * turn.axis();
  return error;
}

double middle_of(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

}  // namespace

Isometry3d VisionSetup::deck_T_marker() const {
  Isometry3d pose = Isometry3d::Identity();
  pose.translation() = -touchdown_point();
  return pose;
}

Vector3d VisionSetup::touchdown_point() const {
  const double half = 0.5 * markers.parents.front().side_m;
  return {half, half, 0.0};
}

ImageVision::ImageVision(const VisionSetup& setup)
    : setup_(setup),
      simulator_(setup.camera, setup.effects),
      detector_(setup.markers, setup.camera),
      estimator_(setup.markers) {}

Sight ImageVision::look(const Motion& world_T_camera, const Motion& world_T_deck, double time_s,
                        const Vector3d& gravity, std::uint64_t seed) {
  Stage stage = setup_.stage;
  if (setup_.deck_surface) {
    stage.surfaces.push_back(*setup_.deck_surface);
    stage.surfaces.back().world_T_surface = world_T_deck;
  }
  StagedSheet sheet;
  sheet.sheet = sheet_of(setup_.markers, 0);
  const Isometry3d deck_T_marker = setup_.deck_T_marker();
  sheet.world_T_marker = [=](double t) { return world_T_deck(t) * deck_T_marker; };
  stage.sheets.push_back(std::move(sheet));
  Shot shot = simulator_.shoot(stage, world_T_camera, time_s, seed);

  Sight sight;
  sight.truth = shot.camera_T_marker.front();
  sight.detections = detector_.detect(shot.image.view());
  PoseOptions options;
  GravityPrior prior;
  prior.in_camera = gravity;
  options.gravity = prior;
  const auto poses =
      estimator_.estimate(shot.image.view(), sight.detections, setup_.camera, options);
  if (!poses.empty()) {
    sight.pose = poses.front();
    for (const int i : poses.front().detections)
      sight.layers.push_back(sight.detections[static_cast<std::size_t>(i)].layer);
    std::sort(sight.layers.begin(), sight.layers.end());
  }
  sight.image = std::move(shot.image);
  return sight;
}

ModelledVision::ModelledVision(const VisionSetup& setup, int pictures, std::uint64_t seed)
    : middle_(setup.touchdown_point()) {
  constexpr int kHeights = 12;
  constexpr double kLowest_m = 0.15, kHighest_m = 8.0;
  ImageVision images(setup);
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  for (int i = 0; i < kHeights; ++i) {
    Height level{kLowest_m * std::pow(kHighest_m / kLowest_m, i / (kHeights - 1.0)), 1.0, {}};
    std::vector<double> squares;
    for (int k = 0; k < pictures; ++k) {
      const Vector3d place(0.06 * level.height_m * normal(random) + 0.02 * normal(random),
                           0.06 * level.height_m * normal(random) + 0.02 * normal(random),
                           -level.height_m * (1.0 + 0.1 * normal(random)));
      const Vector3d speed(0.1 * normal(random), 0.1 * normal(random), 0.3 * normal(random));
      const Vector3d turn(0.05 * normal(random), 0.05 * normal(random), 0.02 * normal(random));
      const Vector3d rate(0.1 * normal(random), 0.1 * normal(random), 0.02 * normal(random));
      const Vector3d tilt(0.06 * normal(random), 0.06 * normal(random), 0.0);
      const Isometry3d body_T_camera = Mount::looking_down();
      const auto rotation = [](const Vector3d& v) {
        return Eigen::AngleAxisd(v.norm(), v.normalized()).toRotationMatrix();
      };
      const Motion camera = [=](double t) {
        Isometry3d pose = Isometry3d::Identity();
        pose.translation() = place + speed * t;
        pose.linear() = rotation(turn) * rotation(rate * t + Vector3d::Constant(1e-15));
        return pose * body_T_camera;
      };
      Isometry3d deck = Isometry3d::Identity();
      deck.linear() = rotation(tilt);
      const Vector3d gravity = camera(0.0).linear().transpose() * Vector3d::UnitZ();
      const Sight sight = images.look(camera, still(deck), 0.0, gravity, random());
      Record record;
      if (sight.pose && sight.pose->covariance) {
        record.covariance = sight.pose->covariance;
        record.layers = sight.layers;
        const auto error = error_of(sight.pose->camera_T_marker, sight.truth);
        squares.push_back(error.dot(record.covariance->ldlt().solve(error)) / 6.0);
      }
      level.records.push_back(std::move(record));
    }
    // The median of chi squared over its six degrees of freedom is 0.891.
    if (!squares.empty()) level.scale = std::sqrt(std::max(1.0, middle_of(squares) / 0.891));
    heights_.push_back(std::move(level));
  }
}

Sight ModelledVision::look(const Isometry3d& camera_T_marker, std::uint64_t seed) const {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  const double height_m = (camera_T_marker * middle_).norm();
  const auto off = [&](const Height& level) {
    return std::abs(std::log(level.height_m / height_m));
  };
  const Height& level =
      *std::min_element(heights_.begin(), heights_.end(),
                        [&](const Height& a, const Height& b) { return off(a) < off(b); });
  const Record& record = level.records[random() % level.records.size()];
  Sight sight;
  sight.truth = camera_T_marker;
  if (!record.covariance) return sight;
  const Matrix6d root = record.covariance->llt().matrixL();
  Eigen::Matrix<double, 6, 1> error;
  for (int i = 0; i < 6; ++i) error[i] = normal(random);
  error = level.scale * (root * error).eval();
  Pose pose;
  pose.camera_T_marker = camera_T_marker;
  pose.camera_T_marker.translation() -= error.head<3>();
  const Vector3d turn = -error.tail<3>();
  pose.camera_T_marker.linear() =
      camera_T_marker.linear() *
      Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix();
  pose.covariance = record.covariance;
  pose.aligned = true;
  pose.markers = static_cast<int>(record.layers.size());
  sight.pose = pose;
  sight.layers = record.layers;
  return sight;
}

double ModelledVision::error_scale() const {
  double sum = 0.0;
  for (const Height& level : heights_) sum += level.scale * level.scale;
  return std::sqrt(sum / static_cast<double>(heights_.size()));
}

double ModelledVision::dropouts() const {
  double lost = 0.0, all = 0.0;
  for (const Height& level : heights_)
    for (const Record& record : level.records) {
      lost += record.covariance ? 0.0 : 1.0;
      all += 1.0;
    }
  return lost / all;
}

VisionSetup landing_setup(const MarkerSet& markers, bool on_ship) {
  VisionSetup setup;
  setup.camera = Camera::pinhole(750, 480, 350.0);
  setup.effects.exposure_s = 0.003;
  setup.markers = markers;
  static const auto ground = std::make_shared<const Photo>(made_up_ground(512, 105.0, 35.0, 5));
  Surface around;
  around.photo = ground;
  around.metres_per_pixel = on_ship ? 0.05 : 0.01;
  if (on_ship) {
    Isometry3d sea = Isometry3d::Identity();
    sea.translation().z() = 6.0;  // below the deck
    around.world_T_surface = still(sea);
  }
  setup.stage.surfaces.push_back(around);
  if (on_ship) {
    static const auto steel = std::make_shared<const Photo>(made_up_ground(512, 90.0, 14.0, 6));
    Surface deck;
    deck.photo = steel;
    deck.metres_per_pixel = 0.01;
    deck.extent = Rect{-4.0, -4.0, 4.0, 4.0};
    setup.deck_surface = deck;
  }
  return setup;
}

}  // namespace harco::lab
