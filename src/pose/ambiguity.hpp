// A plane seen from afar has two poses: its tilt and, nearly, the mirrored one. What tells which.
#pragma once

#include <Eigen/Geometry>

#include "harco/camera.hpp"
#include "harco/image.hpp"
#include "harco/pose.hpp"
#include "pose/ink_outline.hpp"
#include "pose/patch_painter.hpp"

namespace harco {

/// What predicts a picture.
struct Look {
  Eigen::Isometry3d camera_T_marker;
  Blur blur;
};

/// Log-likelihood of the image's grey values around the marker under `a` over that under `b`, each
/// with its own best levels of black and white, which may vary linearly over the marker and, as in
/// a shadow, from place to place. Noise is taken to be what the better one leaves unexplained; what
/// fits under neither, such as an occluder, counts for neither. `quiet_m` is the width of the paper
/// around the square. Zero where too little is seen to tell.
double picture_ratio(const ImageView& image, const InkOutline& outline, double quiet_m,
                     const Camera& camera, const Look& a, const Look& b);

/// Log of what gravity thinks of `a` over what it thinks of `b`.
double gravity_ratio(const GravityPrior& gravity, const Eigen::Isometry3d& a,
                     const Eigen::Isometry3d& b);

/// Angle between two orientations, radians.
double angle_between(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b);

/// Gives the pose a second solution, with the log-likelihood ratio of the first over it. The
/// likelier one becomes the pose; its covariance, that of one solution alone beforehand, grows by
/// the way to the other, weighted by the other's probability. Where the ratio decides
/// (kDecidedLogRatio), no alternative is named.
void add_alternative(Pose& pose, const Eigen::Isometry3d& second, double ratio);

/// The same for a pose that has an alternative, when other evidence changes the ratio.
void change_ratio(Pose& pose, double ratio);

}  // namespace harco
