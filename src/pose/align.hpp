// The pose straight from the grey values: the marker's own description, blurred and lit, laid over
// the image.
#pragma once

#include <optional>

#include <Eigen/Geometry>

#include "harco/camera.hpp"
#include "harco/geometry.hpp"
#include "harco/image.hpp"
#include "harco/pose.hpp"

namespace harco {

/// What alignment found.
struct Alignment {
  Eigen::Isometry3d camera_T_marker = Eigen::Isometry3d::Identity();
  Matrix6d covariance = Matrix6d::Zero();  ///< of (dt, w) as in Pose, from the residuals
  double share = 0.0;    ///< of the pixels compared: how many fit, each by its weight, 0 ... 1
  double blur_px = 0.0;  ///< standard deviation of the blur, the pixel's own width included
  double noise = 0.0;    ///< grey levels, standard deviation of what remains
  double loss = 0.0;     ///< robust squared residuals in units of the noise
};

/// Least squares on the intensities near the marker's edges (Tukey's weights: pixels that don't
/// fit, such as an occluder's, are left out) over the pose, the blur and the levels of black and
/// white, which may vary linearly over the marker; where much doesn't fit, parts of the marker may
/// besides stand in different light. `cell_m` is the width of the paper around the square. Empty if
/// it doesn't converge near `start`, which is taken to be right to about a pixel, or if too little
/// of the marker fits: then the image doesn't bear the pose out.
std::optional<Alignment> align(const ImageView& image, const InkPlan& ink, double cell_m,
                               const Camera& camera, const Eigen::Isometry3d& start);

}  // namespace harco
