// How a deck moves: samples made from poses, and the sum of sinusoids that fits them (paper,
// section 4.6, Eq. 19). Library harco::land.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "harco/pose.hpp"

namespace harco {

/// The camera at the moment of an image, as the vehicle knows it. The level frame has z along
/// gravity, downwards; where its x axis heads doesn't matter.
struct CameraState {
  Eigen::Matrix3d level_R_camera = Eigen::Matrix3d::Identity();
  /// Of w (radians, camera side), where the true attitude is level_R_camera Exp(w).
  Eigen::Matrix3d attitude_covariance = Eigen::Matrix3d::Zero();
  /// Upwards, metres, from any fixed level. Left at 0 if unknown: then the camera counts as
  /// hovering still, and its own climbing appears as the deck's heave.
  double height_m = 0.0;
  double height_sd_m = 0.0;  ///< standard deviation of height_m, metres
};

/// What is fitted and foretold, in the order of vectors.
enum DeckAxis { kRoll = 0, kPitch = 1, kHeave = 2 };

/// One look at the deck.
struct DeckSample {
  double time_s = 0.0;  ///< of the image, by any clock that runs evenly
  /// Roll and pitch, radians: the angles of level_R_marker = Rz(yaw) Ry(pitch) Rx(roll), about the
  /// marker's x and y axis; both are zero where the marker lies level, face up. Heave, metres: how
  /// high the marker's touchdown point is, on the scale of CameraState::height_m.
  Eigen::Vector3d motion = Eigen::Vector3d::Zero();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  ///< of motion
};

/// What a pose says about the deck that carries the marker. `touchdown_point` (marker frame,
/// metres) is the point whose heave counts. The covariance follows, to first order, from the pose's
/// and the camera's. Throws std::invalid_argument for a pose without covariance, and for anything
/// that isn't finite.
DeckSample deck_sample(const Pose& pose, const CameraState& camera, double time_s,
                       const Eigen::Vector3d& touchdown_point = Eigen::Vector3d::Zero());

/// A term of Eq. 19: amplitude sin(rate (t - epoch) + phase).
struct Sinusoid {
  double amplitude = 0.0;  ///< A_i, in the unit of what oscillates, not negative
  double rate = 0.0;       ///< alpha_i, rad/s, positive
  double phase = 0.0;      ///< beta_i, radians, -pi … pi
};

/// Eq. 19: y(t) = A_0 + sum of sinusoids. The paper counts time from zero, this from `epoch_s`:
/// clocks may count from 1970, and phases would drown in that.
struct Oscillation {
  double epoch_s = 0.0;
  double mean = 0.0;  ///< A_0
  std::vector<Sinusoid> parts;

  int order() const { return static_cast<int>(parts.size()); }  ///< M
  double value(double time_s) const;
  double rate(double time_s) const;  ///< dy/dt
  /// dy/dp for p = (A_0, A_1, alpha_1, beta_1, A_2, …).
  Eigen::VectorXd gradient(double time_s) const;
};

/// One value of what oscillates.
struct SeriesSample {
  double time_s = 0.0;
  double value = 0.0;
  double sd = 1.0;  ///< standard deviation of its error, positive; to the fit only ratios matter
};

/// How Eq. 19 is fitted.
struct OscillationOptions {
  int max_order = 4;           ///< most sinusoids sought, 0 … 12
  double min_period_s = 1.5;   ///< shortest period sought, positive
  double max_period_s = 25.0;  ///< longest; what is slower looks like a change of the mean
  int max_iterations = 50;     ///< of least squares per order, positive: bounds the time
};

/// Eq. 19, fitted.
struct OscillationFit {
  Oscillation oscillation;
  /// Of (A_0, A_1, alpha_1, beta_1, …), to first order, scaled by the residuals. It holds where
  /// these are independent, that is, where the deck does move by Eq. 19.
  Eigen::MatrixXd covariance;
  double scale = 1.0;         ///< root mean square of residuals over their standard deviations
  double rms = 0.0;           ///< root mean square of residuals, in the unit of what oscillates
  double bic = 0.0;           ///< Bayesian information criterion; the smallest is the best
  std::vector<bool> outlier;  ///< one a sample: beyond four robust standard deviations
};

/// Fits of order 0, 1, 2, … up to the most that options and samples allow (two samples a
/// parameter). Each starts from the one before it and the strongest line in the spectrum of its
/// residuals (weighted least squares, so times may be irregular and have gaps), then moves all
/// parameters by robust non-linear least squares. Samples in any order of time. Throws
/// std::invalid_argument for options out of range, values that are not finite, standard deviations
/// that are not positive, fewer than four samples, and samples of one time only.
std::vector<OscillationFit> fit_orders(std::vector<SeriesSample> samples,
                                       const OscillationOptions& options = {});

/// The one of them with the best information criterion.
OscillationFit fit_oscillation(const std::vector<SeriesSample>& samples,
                               const OscillationOptions& options = {});

/// The same order again with other samples, starting from what was found before.
OscillationFit refit_oscillation(std::vector<SeriesSample> samples, const Oscillation& start,
                                 const OscillationOptions& options = {});

}  // namespace harco
