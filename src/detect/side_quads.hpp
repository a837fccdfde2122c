// Squares of which only parts of the sides are seen.
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "detect/quad.hpp"
#include "detect/segments.hpp"

namespace harco::detect {

/// A quad that segments suggest, dark inside.
struct SideQuad {
  Quad corners;
  double seen = 0.0;  ///< share of its outline that the segments cover, 0 ... 1
};

/// Convex quads of at least `least_side_px` mean side on whose every side some segment lies, all of
/// them between about the same dark and the same bright; those with the longest seen outline first,
/// none twice, at most `most`. The search is bounded: of many segments, the longest take part.
///
/// With the calibration matrix of the camera (of ideal pixels, see Lens), squares of which three
/// sides are seen as well: two interpretation planes meet in the direction of the sides between,
/// the third gives the other direction, and a square's sides are equal.
std::vector<SideQuad> side_quads(const std::vector<Segment>& segments, double least_side_px,
                                 std::size_t most,
                                 const std::optional<Eigen::Matrix3d>& calibration);

}  // namespace harco::detect
