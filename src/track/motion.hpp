// What is believed of a marker's motion, and how it goes on while nobody looks.
#pragma once

#include <Eigen/Core>

#include "harco/filter.hpp"

namespace harco::track {

using Vector6d = Eigen::Matrix<double, 6, 1>;

/// Places of the parts of an error state. Each has six rows: three that shift, three that turn.
enum Part { kPose = 0, kRate = 6, kSway = 12, kSwayRate = 18 };
constexpr int kMostStates = 24;

/// Covariance of an error state: 12 x 12, with a swell 24 x 24. No heap.
using Covariance =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMostStates, kMostStates>;
using ErrorState = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMostStates, 1>;

/// In reference axes, the camera in their origin. An error e of it means: t + e_t, R Exp(e_R), all
/// else + e.
struct Estimate {
  double time_s = 0.0;
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Vector6d rate = Vector6d::Zero();  ///< steady: velocity, then turn rate on the marker's side
  Vector6d sway = Vector6d::Zero();  ///< how far the swell has carried it; pose includes it
  Vector6d sway_rate = Vector6d::Zero();
  Covariance covariance;

  bool has_swell() const { return covariance.rows() == kMostStates; }
};

/// How a marker moves: FilterOptions for one swell, or none, and a camera whose attitude is either
/// known or not.
class Motion {
 public:
  /// `swell` has a period.
  Motion(const FilterOptions& options, const std::optional<Swell>& swell);

  /// The first pose, its covariance and what is expected of all else.
  Estimate start(double time_s, const Eigen::Isometry3d& pose, const Matrix6d& covariance) const;

  /// The same marker later. Throws nothing; `time_s` must not be earlier.
  Estimate advance(Estimate estimate, double time_s) const;

  /// The same without its covariance, which stays what it was: quick.
  Estimate foretell(Estimate estimate, double time_s) const;

 private:
  /// Moves the estimate on; returns by how far: shift, turn.
  Vector6d move(Estimate& estimate, double dt) const;
  void spread_error(Estimate& estimate, const Vector6d& moved, double dt) const;
  Matrix6d spread(const Estimate& estimate, double shift, double marker, double camera) const;

  FilterOptions options_;
  std::optional<Swell> swell_;
};

}  // namespace harco::track
