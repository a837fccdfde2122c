// The border between black and white, for formats that fill outlines. One outline for all ink
// leaves viewers no edges within the black (or white) along which a light seam could show.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "harco/geometry.hpp"

namespace harco {

/// Corners of a closed polygon, the last joined to the first.
using Loop = std::vector<Eigen::Vector2d>;

/// The outline of all black of a picture: polygons with axis-parallel sides, each with the black to
/// the right of its way (y down), so that holes turn against what they are in and both fill rules
/// give the same. Black squares that touch at a corner only stay apart.
std::vector<Loop> black_outline(const InkPlan& plan);

}  // namespace harco
