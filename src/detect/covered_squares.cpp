#include "detect/covered_squares.hpp"

#include <algorithm>

#include "detect/kernels/halve.hpp"

namespace harco::detect {
namespace {

// The shortest straight part of an outline that tells something, in pixels of the half picture.
constexpr double kLeastSegment = 6.0;
// The shortest outline: of what is left of a ring's side between two things that cover it.
constexpr std::size_t kLeastOutline = 24;
// How many squares are tried in a frame.
constexpr std::size_t kMostSquares = 20;

void halve(const ImageView& image, Image& half) {
  const int width = image.width() / 2;
  const int height = image.height() / 2;
  if (half.width != width || half.height != height) half = Image(width, height);
  for (int y = 0; y < height; ++y)
    kernels::halve_rows(image.row(2 * y), image.row(2 * y + 1), width, half.row(y));
}

/// A point of the half picture in pixels of the whole one.
Point in_whole(const Point& point) { return 2.0 * point + Point::Constant(0.5); }

}  // namespace

std::vector<SideQuad> CoveredSquares::find(const ImageView& image, double least_side_px,
                                           double contrast,
                                           const std::optional<Eigen::Matrix3d>& calibration,
                                           Workers& workers, DetectionTrace* trace) {
  if (image.width() < 2 || image.height() < 2) return {};
  halve(image, half_);
  threshold_.measure(half_.view(), workers);
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
    return !parts_dark_from_bright(image, segment, contrast);
  });
  return side_quads(segments_, least_side_px, kMostSquares, calibration);
}

}  // namespace harco::detect
