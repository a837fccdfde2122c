// Squares of which parts are covered or out of view, by what is straight of their sides.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "detect/lens.hpp"
#include "detect/pyramid.hpp"
#include "detect/segments.hpp"
#include "detect/side_quads.hpp"
#include "detect/workers.hpp"
#include "harco/detect.hpp"

namespace harco::detect {

/// Looks in the picture at half its size: what is straight of a side is long enough there, and of
/// texture there is a quarter.
class CoveredSquares {
 public:
  /// The most promising ones, at most `most`, in pixels of the ideal camera. With a calibration,
  /// three sides do. Valid until the next call.
  /// `least_contrast` (grey levels) has to lie between both sides of what is taken for an edge.
  const std::vector<SideQuad>& find(const Pyramid& image, const Lens& lens, double least_side_px,
                                    int least_contrast, std::size_t most,
                                    const std::optional<Eigen::Matrix3d>& calibration,
                                    Workers& workers, DetectionTrace* trace = nullptr);

 private:
  SegmentFinder finder_;
  SideQuadFinder side_quads_;
  std::vector<Segment> segments_;
};

}  // namespace harco::detect
