#include "detect/covered_squares.hpp"

#include <algorithm>

namespace harco::detect {
namespace {

// The shortest straight part of an outline that tells something, in pixels of the half picture.
constexpr double kLeastSegment = 6.0;
// The shortest outline: of what is left of a ring's side between two things that cover it.
constexpr std::size_t kLeastOutline = 24;
// How many squares are tried in a frame.
constexpr std::size_t kMostSquares = 20;

}  // namespace

std::vector<SideQuad> CoveredSquares::find(const Pyramid& image, double least_side_px,
                                           double contrast,
                                           const std::optional<Eigen::Matrix3d>& calibration,
                                           Workers& workers, DetectionTrace* trace) {
  if (image.levels() < 2) return {};
  const auto in_whole = [](const Point& point) { return Pyramid::in_whole(point, 1); };
  threshold_.measure(image.level(1), Threshold::kAll, workers);
  segments_.clear();
  follower_.start(threshold_, Threshold::kMiddleLevel, kLeastOutline);
  while (const Contour* contour = follower_.next()) {
    if (trace) {
      trace->contours.push_back(contour->points);
      for (Point& point : trace->contours.back()) point = in_whole(point);
    }
    append_segments(*contour, kLeastSegment, segments_);
  }
  for (Segment& segment : segments_) segment = {in_whole(segment.a), in_whole(segment.b)};
  std::erase_if(segments_, [&](const Segment& segment) {
    return !parts_dark_from_bright(image.level(0), segment, contrast);
  });
  return side_quads(segments_, least_side_px, kMostSquares, calibration);
}

}  // namespace harco::detect
