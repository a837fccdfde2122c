#include "detect/relations.hpp"

#include <algorithm>
#include <utility>

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "detect/quad.hpp"
#include "detect/square_homography.hpp"

namespace harco::detect {
namespace {

// In sides of the smaller marker: closer is agreement, farther is contradiction.
constexpr double kAgree = 0.25;
constexpr double kContradict = 0.5;

std::pair<const Detection&, const Detection&> larger_first(const Detection& a, const Detection& b) {
  if (area(a.corners) >= area(b.corners)) return {a, b};
  return {b, a};
}

}  // namespace

std::optional<double> Relations::disagreement(const Detection& larger,
                                              const Detection& smaller) const {
  const PlacedMarker& from = placed_[static_cast<std::size_t>(larger.placed)];
  const PlacedMarker& to = placed_[static_cast<std::size_t>(smaller.placed)];
  Quad ideal;
  for (std::size_t i = 0; i < 4; ++i) {
    const auto corner = lens_.to_ideal(larger.corners[i]);
    if (!corner) return std::nullopt;
    ideal[i] = *corner;
  }
  const Eigen::Matrix3d image_H_square = square_homography(ideal);
  Quad expected;
  for (std::size_t i = 0; i < 4; ++i) {
    const Eigen::Vector2d square = (to.corners_m()[i] - from.origin_m) / from.side_m;
    const Eigen::Vector3d h = image_H_square * square.homogeneous();
    if (h.z() <= 0.0) return std::nullopt;
    const auto pixel = lens_.from_ideal(h.hnormalized());
    if (!pixel) return std::nullopt;
    expected[i] = *pixel;
  }
  double worst = 0.0;
  for (std::size_t i = 0; i < 4; ++i)
    worst = std::max(worst, (expected[i] - smaller.corners[i]).norm());
  return worst / mean_side(smaller.corners);
}

bool Relations::agree(const Detection& a, const Detection& b) const {
  if (a.parent != b.parent || a.placed == b.placed) return false;
  const auto [larger, smaller] = larger_first(a, b);
  const auto away = disagreement(larger, smaller);
  return away && *away < kAgree;
}

bool Relations::contradict(const Detection& a, const Detection& b) const {
  if (a.parent != b.parent) return false;
  const auto [larger, smaller] = larger_first(a, b);
  if (!contains(larger.corners, centre(smaller.corners))) return false;
  const auto away = disagreement(larger, smaller);
  // What was put together from remains has to agree with what was seen whole.
  const bool whole = larger.visible == 1.0 && smaller.visible == 1.0;
  return !away || *away > (whole ? kContradict : kAgree);
}

}  // namespace harco::detect
