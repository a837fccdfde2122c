#include "detect/covered_squares.hpp"

namespace harco::detect {
namespace {

// The shortest straight edge that tells something, in pixels of the half picture.
constexpr double kLeastSegment = 6.0;

}  // namespace

const std::vector<SideQuad>& CoveredSquares::find(const Pyramid& image, const Lens& lens,
                                                  double least_side_px, int least_contrast,
                                                  std::size_t most,
                                                  const std::optional<Eigen::Matrix3d>& calibration,
                                                  Workers& workers, DetectionTrace* trace) {
  segments_.clear();
  const ImageView half = image.levels() < 2 ? ImageView() : image.level(1);
  for (const Segment& seen : finder_.find(half, kLeastSegment, least_contrast, workers)) {
    Segment segment = seen;
    segment.a = Pyramid::in_whole(seen.a, 1);
    segment.b = Pyramid::in_whole(seen.b, 1);
    if (trace) trace->contours.push_back({segment.a, segment.b});
    const auto a = lens.to_ideal(segment.a);
    const auto b = lens.to_ideal(segment.b);
    if (!a || !b) continue;
    segment.a = *a;
    segment.b = *b;
    segments_.push_back(segment);
  }
  return side_quads_.find(segments_, least_side_px, most, calibration);
}

}  // namespace harco::detect
