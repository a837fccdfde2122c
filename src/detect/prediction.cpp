#include "detect/prediction.hpp"

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "detect/square_homography.hpp"

namespace harco::detect {
namespace {

constexpr double kMove = 0.01;  // pixels, for differences

std::optional<Point> seen_at(const Eigen::Matrix3d& H, const Point& square) {
  const Eigen::Vector3d h = H * square.homogeneous();
  if (!(h.z() > 1e-3)) return std::nullopt;
  return Point(h.hnormalized());
}

}  // namespace

std::optional<Prediction> Prediction::from(const Detection& seen, const PlacedMarker& marker,
                                           const Lens& lens) {
  Prediction prediction;
  prediction.marker_ = &marker;
  Quad ideal;
  Matrix8d by_pixel = Matrix8d::Zero();
  for (std::size_t i = 0; i < 4; ++i) {
    const auto corner = lens.to_ideal(seen.corners[i]);
    if (!corner) return std::nullopt;
    ideal[i] = *corner;
    const auto at = static_cast<Eigen::Index>(2 * i);
    by_pixel.block<2, 2>(at, at) = lens.from_ideal_jacobian(*corner).inverse();
  }
  prediction.covariance_ = by_pixel * seen.corner_covariance * by_pixel.transpose();
  prediction.image_H_square_ = square_homography(ideal);
  for (std::size_t i = 0; i < 8; ++i) {
    Quad moved = ideal;
    moved[i / 2](static_cast<Eigen::Index>(i % 2)) += kMove;
    prediction.moved_[i] = square_homography(moved);
  }
  return prediction;
}

std::optional<PredictedQuad> Prediction::of(const PlacedMarker& other) const {
  PredictedQuad quad;
  Matrix8d by_corners;
  for (std::size_t i = 0; i < 4; ++i) {
    const Point square = (other.corners_m()[i] - marker_->origin_m) / marker_->side_m;
    const auto corner = seen_at(image_H_square_, square);
    if (!corner) return std::nullopt;
    quad.corners[i] = *corner;
    for (std::size_t k = 0; k < 8; ++k) {
      const auto there = seen_at(moved_[k], square);
      if (!there) return std::nullopt;
      by_corners.block<2, 1>(static_cast<Eigen::Index>(2 * i), static_cast<Eigen::Index>(k)) =
          (*there - *corner) / kMove;
    }
  }
  quad.covariance = by_corners * covariance_ * by_corners.transpose();
  return quad;
}

}  // namespace harco::detect
