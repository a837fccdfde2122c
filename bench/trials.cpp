#include "trials.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <exception>
#include <numbers>
#include <stdexcept>
#include <thread>

#include <Eigen/Dense>

#include "lab/render.hpp"

namespace harco::bench {

Vector6d error_of(const Eigen::Isometry3d& estimate, const Eigen::Isometry3d& truth) {
  const Eigen::AngleAxisd turn(estimate.linear().transpose() * truth.linear());
  Vector6d error;
  error << truth.translation() - estimate.translation(), turn.angle() * turn.axis();
  return error;
}

Parts parts_of(const Vector6d& error, const Eigen::Vector3d& sight) {
  const double depth = sight.dot(error.head<3>());
  return {error.tail<3>().norm(), (error.head<3>() - depth * sight).norm(), std::abs(depth)};
}

Parts parts_of(const Matrix6d& covariance, const Eigen::Vector3d& sight) {
  const Eigen::Matrix3d place = covariance.topLeftCorner<3, 3>();
  const double depth = sight.dot(place * sight);
  return {std::sqrt(covariance.bottomRightCorner<3, 3>().trace()), std::sqrt(place.trace() - depth),
          std::sqrt(depth)};
}

std::optional<double> normalised_error_squared(const Estimate& estimate,
                                               const Eigen::Isometry3d& truth) {
  if (!estimate.covariance) return std::nullopt;
  const Vector6d error = error_of(estimate.pose, truth);
  return error.dot(estimate.covariance->ldlt().solve(error));
}

double chi_square_6(double x) {
  const double half = 0.5 * x;
  return 1.0 - std::exp(-half) * (1.0 + half + 0.5 * half * half);
}

Eigen::Isometry3d random_pose(const Camera& camera, double side_m, double side_px, double tilt_rad,
                              std::mt19937_64& random) {
  constexpr double kMarginPx = 8.0;
  constexpr int kTrials = 1000000;
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  const double distance = camera.fx * side_m / side_px;
  for (int trial = 0; trial < kTrials; ++trial) {
    const double axis = 2.0 * std::numbers::pi * unit(random);
    const double roll = 2.0 * std::numbers::pi * unit(random);
    Eigen::Isometry3d pose =
        lab::look_at_marker({side_m / 2, side_m / 2}, distance, tilt_rad, axis, roll);
    const Eigen::Vector2d middle(camera.width * unit(random), camera.height * unit(random));
    pose.pretranslate(distance *
                      (camera.unproject(middle)->homogeneous() - Eigen::Vector3d::UnitZ()));
    bool inside = true;
    for (const double x : {0.0, side_m})
      for (const double y : {0.0, side_m}) {
        const auto pixel = camera.project(pose * Eigen::Vector3d(x, y, 0.0));
        inside = inside && pixel && pixel->x() > kMarginPx && pixel->y() > kMarginPx &&
                 pixel->x() < camera.width - kMarginPx && pixel->y() < camera.height - kMarginPx;
      }
    // From a side, a tilted plane far off the axis may show its back.
    if (inside && pose.inverse().translation().z() < 0.0) return pose;
  }
  throw std::invalid_argument("a square of this size does not fit into the picture");
}

MarkerSet default_markers(double side_m) {
  DictionaryOptions options;
  options.child_cells = {quincunx(5), quincunx(5)};
  options.effort = 0.1;
  return build_markers(generate_dictionary(options), side_m);
}

MarkerSet markers_from(const std::string& file, double side_m) {
  MarkerSet markers = load_markers(file);
  markers.parents.resize(1);
  markers.parents.front().side_m = side_m;
  return markers;
}

double mean(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double value : values) sum += value;
  return values.empty() ? std::nan("") : sum / static_cast<double>(values.size());
}

double median(std::vector<double> values) {
  if (values.empty()) return std::nan("");
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

double share_below(const std::vector<double>& values, double limit) {
  const auto below =
      std::count_if(values.begin(), values.end(), [&](double value) { return value < limit; });
  return static_cast<double>(below) / static_cast<double>(values.size());
}

std::string number(double value) {
  char text[32];
  const int decimals = value < 10.0 ? 2 : value < 100.0 ? 1 : 0;
  std::snprintf(text, sizeof text, "%.*f", decimals, value);
  return std::isnan(value) ? "-" : text;
}

void for_all(std::size_t count, unsigned threads,
             const std::function<void(unsigned thread, std::size_t i)>& work) {
  std::atomic<std::size_t> next{0};
  std::vector<std::exception_ptr> failures(threads);
  std::vector<std::thread> running;
  for (unsigned t = 0; t < threads; ++t)
    running.emplace_back([&, t] {
      try {
        for (std::size_t i = next++; i < count; i = next++) work(t, i);
      } catch (...) {
        failures[t] = std::current_exception();
        next = count;
      }
    });
  for (std::thread& thread : running) thread.join();
  for (const std::exception_ptr& failure : failures)
    if (failure) std::rethrow_exception(failure);
}

}  // namespace harco::bench
