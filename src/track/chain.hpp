// The filter for one model of motion: measurements in order of time, and what was believed after
// each of them.
#pragma once

#include <deque>
#include <optional>

#include "harco/filter.hpp"
#include "track/measurement.hpp"
#include "track/motion.hpp"

namespace harco::track {

/// A pose in reference axes.
struct Measurement {
  double time_s = 0.0;
  Pose pose;
};

/// What was believed after a measurement.
struct Belief {
  Estimate estimate;
  int accepted = 0;         ///< measurements that counted up to here
  double measured_s = 0.0;  ///< time of the last of them
  /// Log of the odds that this is the right one of a flat marker's two poses.
  double branch = 0.0;
};

class Chain {
 public:
  Chain(const FilterOptions& options, const std::optional<Swell>& swell);

  Verdict add(const Measurement& measurement);

  /// What is believed at a time, none of its future being known. Null before the history.
  std::optional<Belief> at(double time_s) const;

  const Motion& motion() const { return motion_; }

  /// After the newest measurement; null before the first.
  const Belief* newest() const { return links_.empty() ? nullptr : &links_.back().after; }

 private:
  struct Link {
    Measurement measurement;
    Belief after;
  };

  Belief first(const Measurement& measurement) const;
  Belief next(const Belief& before, const Measurement& measurement) const;
  Verdict refuse(const Measurement& measurement, Verdict verdict);
  void restart(const Measurement& measurement, int accepted);
  void forget();

  FilterOptions options_;
  Motion motion_;
  double gate_;                      ///< squared Mahalanobis distance
  std::deque<Link> links_;           ///< ascending in time
  std::deque<Measurement> refused_;  ///< the last ones in a row, as they came
};

/// The value that χ² of six degrees of freedom exceeds with this probability, 0 < p < 1.
double chi_squared_six(double probability);

}  // namespace harco::track
