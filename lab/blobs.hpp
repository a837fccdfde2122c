// Things that lie on a marker and hide part of it.
#pragma once

#include <random>
#include <vector>

#include <Eigen/Geometry>

#include "coverage.hpp"
#include "harco/camera.hpp"

namespace harco::lab {

/// A round patch in the marker's plane (metres), of one grey.
struct Blob {
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();
  double radius = 0.0;
  double grey = 0.0;
};

/// Blobs that together cover `share` (0 ... 1) of the square of side `side_m` at the marker frame's
/// origin, to about one percent: one wholly inside the square where `most` is 1 and it fits, else
/// many, of radii from 0.06 to 0.2 of the side with centres on the square. Throws
/// std::invalid_argument for a share out of range.
std::vector<Blob> cover(double side_m, double share, int most, std::mt19937_64& random);

/// Draws them over a picture, later ones over earlier ones, with edges as soft as the lens's blur.
void draw_blobs(FloatImage& picture, const std::vector<Blob>& blobs, const Camera& camera,
                const Eigen::Isometry3d& camera_T_marker, double psf_sigma_px);

}  // namespace harco::lab
