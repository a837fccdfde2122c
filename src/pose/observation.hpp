// A detection as the pose solvers see it.
#pragma once

#include <array>
#include <vector>

#include <Eigen/Core>

#include "harco/pose.hpp"

namespace harco {

/// One marker: its corners in the plane, and where they are seen, free of the lens's distortion.
struct Observation {
  int detection = 0;                  ///< index in the caller's list
  int placed = 0;                     ///< index into place(markers)
  Eigen::Matrix<double, 2, 4> plane;  ///< corners in the parent's frame, metres
  Eigen::Matrix<double, 2, 4> image;  ///< normalised image coordinates X/Z, Y/Z
  Matrix8d covariance;                ///< of `image`, column by column
  Matrix8d whitening;                 ///< W with W covariance W^T = I
  double area_px = 0.0;               ///< of the quad in the (distorted) image
};

/// Area of a quad with its corners in the order of Detection, in square pixels; positive if they
/// go round as they do in an image of a marker's front.
double quad_area(const std::array<Eigen::Vector2d, 4>& corners);

/// Detections as observations, in the order of the list. Tentative detections and
/// those beyond the lens's range are left out. Throws std::invalid_argument, naming the
/// detection, if one is not of this set or can't be one: corners that aren't finite and convex,
/// covariances that aren't positive definite.
std::vector<Observation> observe(const std::vector<Detection>& detections, const MarkerSet& markers,
                                 const std::vector<PlacedMarker>& placed, const Camera& camera);

/// Root mean square over the coordinates of what a pose leaves unexplained, measured in the
/// (distorted) image.
double reprojection_rms_px(const Eigen::Isometry3d& pose,
                           const std::vector<Observation>& observations,
                           const std::vector<Detection>& detections, const Camera& camera);

}  // namespace harco
