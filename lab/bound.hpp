// How well a pose can be known from a picture at all: the Cramer-Rao bound.
#pragma once

#include <functional>
#include <vector>

#include "harco/pose.hpp"
#include "render.hpp"

namespace harco::lab {

/// Fisher information of the pose of scene.parents[placed] in one picture, of (dt, w) as in
/// Pose::covariance: t + dt in metres of the camera frame, R Exp(w). Sum over the pixels of
/// gradient x gradient^T / variance, the gradient by central differences of render_exact and the
/// variance that of noise and rounding, noise_sigma² + 1/12. All else of the scene counts as known.
/// Of the picture around the paper nothing is used, nor the paper's own edges: it is taken to be
/// white paper without end, and without a background. Throws std::invalid_argument for a scene or
/// an index that makes no sense.
Matrix6d pose_information(const Scene& scene, const std::vector<Sheet>& sheets, int placed = 0);

/// What light, lens and sensor make of an exact picture, before its noise. It stays where it is
/// when the sheet moves.
using Effect = std::function<void(FloatImage&)>;

/// Its inverse: no unbiased estimate from one picture has a smaller covariance. Throws
/// std::invalid_argument if the picture doesn't fix all of the pose.
Matrix6d pose_bound(const Scene& scene, const std::vector<Sheet>& sheets, int placed = 0);
Matrix6d pose_bound(const Scene& scene, const std::vector<Sheet>& sheets, const Effect& effect,
                    int placed = 0);

}  // namespace harco::lab
