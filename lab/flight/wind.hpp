// Wind that a vehicle feels: a mean and gusts about it.
#pragma once

#include <cstdint>
#include <random>

#include <Eigen/Core>

namespace harco::lab {

/// Gusts as first-order processes, the low-altitude shape of Dryden's longitudinal spectrum.
struct WindOptions {
  Eigen::Vector3d mean_mps = Eigen::Vector3d::Zero();  ///< world frame (z down)
  double gust_mps = 0.0;  ///< standard deviation of the level components; the vertical has half
  double gust_length_m = 40.0;  ///< over which gusts change
};

class Wind {
 public:
  Wind(const WindOptions& options, std::uint64_t seed);

  /// Moves on by a time and returns the wind then, metres a second.
  Eigen::Vector3d step(double dt_s);

 private:
  WindOptions options_;
  std::mt19937_64 random_;
  std::normal_distribution<double> normal_;
  Eigen::Vector3d gust_;
};

}  // namespace harco::lab
