// What the measurements of poses share: random views, errors, and work on all threads.
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "harco/harco.hpp"

namespace harco::bench {

using Vector6d = Eigen::Matrix<double, 6, 1>;

constexpr double kDegree = 0.017453292519943295;

/// A pose and, where its method knows one, its covariance.
struct Estimate {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  std::optional<Matrix6d> covariance;
};

/// What must be added to the estimate to make it true, in the sense of Pose::covariance.
Vector6d error_of(const Eigen::Isometry3d& estimate, const Eigen::Isometry3d& truth);

/// Rotation in radians; translation in metres across the line of sight to the marker's origin and
/// along it.
struct Parts {
  double rotation = 0.0, lateral = 0.0, depth = 0.0;
};

/// Of an error as error_of gives it. `sight` is the direction to the marker's origin, of length 1.
Parts parts_of(const Vector6d& error, const Eigen::Vector3d& sight);

/// Root mean squares of errors with this covariance.
Parts parts_of(const Matrix6d& covariance, const Eigen::Vector3d& sight);

/// The normalised error squared; empty without a covariance.
std::optional<double> normalised_error_squared(const Estimate& estimate,
                                               const Eigen::Isometry3d& truth);

/// Distribution function of the chi-square law with six degrees of freedom.
double chi_square_6(double x);

/// A square of `side_px` (seen straight on), turned and placed at random, wholly in the picture.
/// Throws std::invalid_argument if it does not fit.
Eigen::Isometry3d random_pose(const Camera& camera, double side_m, double side_px, double tilt_rad,
                              std::mt19937_64& random);

/// Three layers with the paper's five children; the same every time.
MarkerSet default_markers(double side_m);

/// The first parent of a file, scaled to the side.
MarkerSet markers_from(const std::string& file, double side_m);

double mean(const std::vector<double>& values);  ///< NaN if there are none
double median(std::vector<double> values);       ///< NaN if there are none
double share_below(const std::vector<double>& values, double limit);

/// Three digits of anything; "-" for NaN.
std::string number(double value);

/// Calls work(thread, i) for every i below `count`, side by side. The first exception comes
/// through.
void for_all(std::size_t count, unsigned threads,
             const std::function<void(unsigned thread, std::size_t i)>& work);

}  // namespace harco::bench
