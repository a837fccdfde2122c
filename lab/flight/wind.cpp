#include "wind.hpp"

#include <algorithm>
#include <cmath>

namespace harco::lab {
namespace {

Eigen::Vector3d spread(const WindOptions& options) {
  return options.gust_mps * Eigen::Vector3d(1.0, 1.0, 0.5);
}

}  // namespace

Wind::Wind(const WindOptions& options, std::uint64_t seed) : options_(options), random_(seed) {
  for (int i = 0; i < 3; ++i) gust_[i] = spread(options)[i] * normal_(random_);
}

Eigen::Vector3d Wind::step(double dt_s) {
  // Gusts drift past with the wind; in still air they change by themselves.
  const double speed = std::max(2.0, options_.mean_mps.norm());
  const double keep = std::exp(-dt_s * speed / options_.gust_length_m);
  const double fresh = std::sqrt(1.0 - keep * keep);
  for (int i = 0; i < 3; ++i)
    gust_[i] = keep * gust_[i] + fresh * spread(options_)[i] * normal_(random_);
  return options_.mean_mps + gust_;
}

}  // namespace harco::lab
