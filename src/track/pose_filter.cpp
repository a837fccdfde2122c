#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

#include <Eigen/LU>

#include "harco/filter.hpp"
#include "track/chain.hpp"
#include "track/foresight.hpp"

namespace harco {
namespace {

using track::Belief;
using track::Chain;
using track::Foresight;
using track::Measurement;

// Periods tried where none is given: so far apart that the damping bridges what lies between.
constexpr std::array kPeriods{3.5, 4.5, 6.0, 8.0, 10.5, 14.0};

void require(bool holds, const char* what) {
  if (!holds) throw std::invalid_argument(std::string("filter: ") + what);
}

bool positive(double value) { return value > 0.0 && std::isfinite(value); }
bool not_negative(double value) { return value >= 0.0 && std::isfinite(value); }

void check(const FilterOptions& options) {
  require(positive(options.acceleration), "acceleration must be positive");
  require(positive(options.marker_turning), "marker_turning must be positive");
  require(not_negative(options.camera_turning), "camera_turning must not be negative");
  require(positive(options.speed), "speed must be positive");
  require(positive(options.marker_turn_rate), "marker_turn_rate must be positive");
  require(not_negative(options.camera_turn_rate), "camera_turn_rate must not be negative");
  require(options.gate > 0.0 && options.gate < 1.0, "gate must lie between 0 and 1");
  require(options.confirm >= 1, "confirm must be at least 1");
  require(options.replace >= 1, "replace must be at least 1");
  require(not_negative(options.tracking_s), "tracking_s must not be negative");
  require(positive(options.coast_s), "coast_s must be positive");
  require(not_negative(options.history_s), "history_s must not be negative");
  if (!options.swell) return;
  const Swell& swell = *options.swell;
  require(not_negative(swell.period_s), "the swell's period_s must not be negative");
  require(swell.damping > 0.0 && swell.damping < 1.0,
          "the swell's damping must lie between 0 and 1");
  require(positive(swell.shift_sd_m), "the swell's shift_sd_m must be positive");
  require(positive(swell.turn_sd_rad), "the swell's turn_sd_rad must be positive");
}

bool is_pose(const Eigen::Isometry3d& pose) {
  constexpr double kTolerance = 1e-6;
  const Eigen::Matrix3d rotation = pose.linear();
  return pose.translation().allFinite() && rotation.allFinite() &&
         (rotation * rotation.transpose()).isIdentity(kTolerance) && rotation.determinant() > 0.0;
}

/// A covariance of (dt, w) with dt in other axes.
Matrix6d turned(const Eigen::Matrix3d& rotation, const Matrix6d& covariance) {
  Matrix6d both = Matrix6d::Identity();
  both.topLeftCorner<3, 3>() = rotation;
  return both * covariance * both.transpose();
}

}  // namespace

const char* to_string(TrackStatus status) {
  switch (status) {
    case TrackStatus::searching:
      return "searching";
    case TrackStatus::tracking:
      return "tracking";
    case TrackStatus::coasting:
      return "coasting";
    case TrackStatus::lost:
      return "lost";
  }
  return "unknown";
}

const char* to_string(Verdict verdict) {
  switch (verdict) {
    case Verdict::started:
      return "started";
    case Verdict::accepted:
      return "accepted";
    case Verdict::refused:
      return "refused";
    case Verdict::replaced:
      return "replaced";
    case Verdict::too_late:
      return "too_late";
  }
  return "unknown";
}

struct PoseFilter::Impl {
  explicit Impl(const FilterOptions& given) : options(given) {
    check(options);
    const auto add_model = [&](const std::optional<Swell>& swell) {
      models.push_back({Chain(options, swell), swell, Foresight(options.swell.value_or(Swell{}))});
    };
    if (!options.swell || options.swell->period_s > 0.0) {
      add_model(options.swell);
      return;
    }
    add_model(std::nullopt);
    for (const double period : kPeriods) {
      Swell swell = *options.swell;
      swell.period_s = period;
      add_model(swell);
    }
  }

  Eigen::Isometry3d reference(const CameraPose& camera) const {
    require(camera.has_value() == options.camera_known,
            options.camera_known ? "camera_known is set, but no pose of the camera given"
                                 : "a pose of the camera is given, but camera_known isn't set");
    if (!camera) return Eigen::Isometry3d::Identity();
    require(is_pose(*camera), "the camera's pose is none");
    return *camera;
  }

  Measurement measurement(const Pose& pose, double time_s, const CameraPose& camera) const {
    require(std::isfinite(time_s), "the time must be finite");
    require(pose.covariance.has_value(), "the pose has no covariance");
    require(pose.covariance->allFinite(), "the pose's covariance must be finite");
    require(is_pose(pose.camera_T_marker), "the marker's pose is none");
    require(!pose.alternative || is_pose(*pose.alternative), "the alternative is no pose");
    const Eigen::Isometry3d reference_T_camera = reference(camera);
    Measurement measurement{time_s, pose};
    measurement.pose.camera_T_marker = reference_T_camera * pose.camera_T_marker;
    measurement.pose.covariance = turned(reference_T_camera.linear(), *pose.covariance);
    if (pose.alternative) measurement.pose.alternative = reference_T_camera * *pose.alternative;
    return measurement;
  }

  TrackStatus status(const Belief& belief, double time_s) const {
    const double blind_s = time_s - belief.measured_s;
    if (blind_s > options.coast_s) return TrackStatus::lost;
    if (belief.accepted < options.confirm) return TrackStatus::searching;
    return blind_s > options.tracking_s ? TrackStatus::coasting : TrackStatus::tracking;
  }

  /// A chain, the swell that it believes in, and how well that foretells.
  struct Model {
    Chain chain;
    std::optional<Swell> swell;
    Foresight foresight;
  };
  const Model& best() const { return models[chosen]; }

  FilterOptions options;
  std::vector<Model> models;
  std::size_t chosen = 0;
};

PoseFilter::PoseFilter(const FilterOptions& options) : impl_(std::make_unique<Impl>(options)) {}
PoseFilter::~PoseFilter() = default;
PoseFilter::PoseFilter(PoseFilter&&) noexcept = default;
PoseFilter& PoseFilter::operator=(PoseFilter&&) noexcept = default;

Verdict PoseFilter::add(const Pose& pose, double time_s, const CameraPose& reference_T_camera) {
  const Measurement measurement = impl_->measurement(pose, time_s, reference_T_camera);
  std::vector<Impl::Model>& models = impl_->models;
  if (models.size() == 1) return models[0].chain.add(measurement);

  std::array<Verdict, kPeriods.size() + 1> verdicts{};
  for (std::size_t i = 0; i < models.size(); ++i) {
    auto& [chain, swell, foresight] = models[i];
    verdicts[i] = chain.add(measurement);
    if (verdicts[i] == Verdict::accepted)
      foresight.compare(chain.motion(), time_s, measurement.pose.camera_T_marker);
    foresight.promise(chain.motion(), chain.newest()->estimate);
    if (foresight.error() < models[impl_->chosen].foresight.error()) impl_->chosen = i;
  }
  return verdicts[impl_->chosen];
}

std::optional<TrackState> PoseFilter::at(double time_s,
                                         const CameraPose& reference_T_camera) const {
  require(std::isfinite(time_s), "the time must be finite");
  const Eigen::Isometry3d camera_T_reference = impl_->reference(reference_T_camera).inverse();
  const Eigen::Matrix3d camera_R_reference = camera_T_reference.linear();
  const Chain& chain = impl_->best().chain;
  if (chain.newest() == nullptr || status(time_s) == TrackStatus::lost) return std::nullopt;
  const std::optional<Belief> belief = chain.at(time_s);
  if (!belief) return std::nullopt;
  const track::Estimate& estimate = belief->estimate;

  TrackState state;
  state.time_s = time_s;
  state.measured_s = belief->measured_s;
  state.status = impl_->status(*belief, time_s);
  state.camera_T_marker.linear() = camera_R_reference * estimate.rotation;
  state.camera_T_marker.translation() = camera_T_reference * estimate.translation;
  const track::Vector6d rate = estimate.rate + estimate.sway_rate;
  state.velocity = camera_R_reference * rate.head<3>();
  state.turn_rate = rate.tail<3>();

  // Pose and velocity of all states together, in the camera's axes.
  using Rows = Eigen::Matrix<double, 12, Eigen::Dynamic, 0, 12, track::kMostStates>;
  Rows told = Rows::Zero(12, estimate.covariance.cols());
  told.leftCols<12>().setIdentity();
  if (estimate.has_swell()) told.block<6, 6>(track::kRate, track::kSwayRate).setIdentity();
  for (const int row : {track::kPose, track::kRate})
    told.middleRows<3>(row) = (camera_R_reference * told.middleRows<3>(row)).eval();
  state.covariance = told * estimate.covariance * told.transpose();
  return state;
}

TrackStatus PoseFilter::status(double time_s) const {
  const Belief* newest = impl_->best().chain.newest();
  return newest == nullptr ? TrackStatus::searching : impl_->status(*newest, time_s);
}

std::optional<double> PoseFilter::distance(const Pose& pose, double time_s,
                                           const CameraPose& reference_T_camera) const {
  const Measurement measurement = impl_->measurement(pose, time_s, reference_T_camera);
  const Chain& chain = impl_->best().chain;
  if (chain.newest() == nullptr || status(time_s) == TrackStatus::lost) return std::nullopt;
  const std::optional<Belief> belief = chain.at(time_s);
  if (!belief) return std::nullopt;
  const Pose chosen = track::weighed(belief->estimate, measurement.pose);
  return track::innovation(belief->estimate, chosen.camera_T_marker, *chosen.covariance).distance();
}

std::optional<double> PoseFilter::swell_period_s() const {
  const std::optional<Swell>& swell = impl_->best().swell;
  if (!swell) return std::nullopt;
  return swell->period_s;
}

}  // namespace harco
