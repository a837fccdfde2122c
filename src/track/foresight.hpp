// How well a model of motion foretells: its promises against what came.
//
// A likelihood of the next frame's measurement would judge how well the model's noise suits the
// axes that don't move. What is wanted of a swell's period is a good guess a second or two ahead.
#pragma once

#include <deque>

#include <Eigen/Geometry>

#include "track/motion.hpp"

namespace harco::track {

class Foresight {
 public:
  /// Errors are told in units of what the swell does.
  explicit Foresight(const Swell& swell);

  /// Compares a pose that counted with what was promised for its time.
  void compare(const Motion& motion, double time_s, const Eigen::Isometry3d& pose);

  /// Remembers what is now promised for later.
  void promise(const Motion& motion, const Estimate& now);

  /// Mean squared error of the promises, the old ones counting less; one at most, and one while
  /// there are none.
  double error() const;

 private:
  Swell swell_;
  std::deque<Estimate> promises_;  ///< ascending in time, without covariance
  double sum_ = 0.0;
  double weight_ = 0.0;
};

}  // namespace harco::track
