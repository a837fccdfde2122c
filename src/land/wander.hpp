// Eq. 19 with amplitudes that wander: a Gaussian process, filtered sample by sample.
//
// Each coefficient of a cos(alpha t) + b sin(alpha t) is a process of its own with mean zero, the
// variance that the fitted amplitude asks for, and the kernel (1 + l h) exp(-l h) over a time h
// (Matern 3/2: smooth, as a deck's motion is). l is the fade rate; with l = 0 the filter is the
// recursive form of the linear least squares around the fit, and its covariance theirs.
#pragma once

#include <Eigen/Core>

#include "harco/deck.hpp"

namespace harco {

class Wander {
 public:
  /// What is known at a time: the mean; for every sinusoid a, da/dt, b, db/dt; then the corrections
  /// of all alphas.
  struct State {
    double time_s = 0.0;
    Eigen::VectorXd mean;
    Eigen::MatrixXd covariance;
  };

  /// `motion_variance` is that of the samples without their noise: sinusoids of nearly one rate may
  /// be fitted with large amplitudes that cancel, and never count for more than twice of it.
  Wander(const OscillationFit& fit, double fade_rate, double motion_variance);

  double fade_rate() const { return fade_rate_; }

  State before_all(double time_s) const;
  void advance(State& state, double time_s) const;
  /// Takes a value at the state's time with an error of standard deviation `sd`; one that
  /// contradicts the state by far counts the less.
  void learn(State& state, double value, double sd) const;

  /// Vectors whose product with the state at a time is the value then, and its rate of change.
  Eigen::VectorXd value_row(double time_s) const;
  Eigen::VectorXd rate_row(double time_s) const;
  /// What a row for h seconds later is for the state now.
  Eigen::VectorXd seen_before(const Eigen::VectorXd& row, double h) const;
  /// The product of that with a vector, without making it.
  double seen_before_dot(const Eigen::VectorXd& row, double h, const Eigen::VectorXd& by) const;
  /// Variance that its product gains in these h seconds by wandering.
  double gained_variance(const Eigen::VectorXd& row, double h) const;

 private:
  struct Step;
  struct Left {
    double value, rate;
  };
  Step step(double h) const;
  Left left(double since_s) const;
  int order() const { return base_.order(); }
  Eigen::Index coefficient(int i) const { return 1 + 2 * i; }  ///< of 2 M; its rate follows it
  Eigen::Index alpha(int i) const { return 1 + 4 * order() + i; }
  double variance(int coefficient) const;

  Oscillation base_;
  double fade_rate_;
  double swell_;          ///< variance of the motion over what the fitted amplitudes have
  double mean_variance_;  ///< of the mean before all samples
};

}  // namespace harco
