#include "pose/observation.hpp"

#include <cmath>
#include <optional>
#include <stdexcept>
#include <string>

#include <Eigen/Cholesky>
#include <Eigen/LU>

namespace harco {
namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;

double cross(const Vector2d& a, const Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }

bool finite_and_convex(const std::array<Vector2d, 4>& corners) {
  constexpr double kLeastArea = 1e-9;  // square pixels: no marker, but safely not degenerate
  for (std::size_t i = 0; i < 4; ++i) {
    const Vector2d side = corners[(i + 1) % 4] - corners[i];
    const Vector2d next = corners[(i + 2) % 4] - corners[(i + 1) % 4];
    if (!corners[i].allFinite() || !(cross(side, next) > kLeastArea)) return false;
  }
  return true;
}

bool positive_definite(const Matrix8d& covariance) {
  return covariance.allFinite() && covariance.llt().info() == Eigen::Success;
}

void check(const Detection& detection, std::size_t index, const MarkerSet& markers,
           const std::vector<PlacedMarker>& placed) {
  const auto require = [&](bool condition, const char* what) {
    if (!condition) throw std::invalid_argument("detection " + std::to_string(index) + ": " + what);
  };
  require(detection.placed >= 0 && static_cast<std::size_t>(detection.placed) < placed.size(),
          "not of this marker set");
  const PlacedMarker& marker = placed[static_cast<std::size_t>(detection.placed)];
  const Parent& parent = markers.parents[static_cast<std::size_t>(marker.parent_index)];
  require(detection.id == marker.id && detection.layer == marker.layer &&
              detection.parent == parent.marker.id,
          "not of this marker set");
  require(finite_and_convex(detection.corners),
          "its corners are not those of a marker seen from the front");
  require(positive_definite(detection.corner_covariance),
          "its corners' covariance is not positive definite");
}

std::optional<Observation> observation(const Detection& detection, const PlacedMarker& marker,
                                       const Camera& camera) {
  Observation seen;
  seen.placed = detection.placed;
  seen.area_px = quad_area(detection.corners);
  const std::array<Vector2d, 4> corners = marker.corners_m();
  Matrix8d undistorted = Matrix8d::Zero();
  for (std::size_t i = 0; i < 4; ++i) {
    const auto column = static_cast<Eigen::Index>(i);
    Matrix2d jacobian;
    const std::optional<Vector2d> image = camera.unproject(detection.corners[i], &jacobian);
    if (!image) return std::nullopt;
    seen.plane.col(column) = corners[i];
    seen.image.col(column) = *image;
    undistorted.block<2, 2>(2 * column, 2 * column) = jacobian;
  }
  seen.covariance = undistorted * detection.corner_covariance * undistorted.transpose();
  const Eigen::LLT<Matrix8d> cholesky(seen.covariance);
  if (cholesky.info() != Eigen::Success) return std::nullopt;
  seen.whitening = cholesky.matrixL().solve(Matrix8d::Identity());
  return seen;
}

}  // namespace

double quad_area(const std::array<Vector2d, 4>& corners) {
  return 0.5 * cross(corners[2] - corners[0], corners[3] - corners[1]);
}

std::vector<Observation> observe(const std::vector<Detection>& detections, const MarkerSet& markers,
                                 const std::vector<PlacedMarker>& placed, const Camera& camera) {
  std::vector<Observation> observations;
  observations.reserve(detections.size());
  for (std::size_t i = 0; i < detections.size(); ++i) {
    check(detections[i], i, markers, placed);
    if (detections[i].tentative || detections[i].inferred) continue;
    const PlacedMarker& marker = placed[static_cast<std::size_t>(detections[i].placed)];
    std::optional<Observation> seen = observation(detections[i], marker, camera);
    if (!seen) continue;
    seen->detection = static_cast<int>(i);
    observations.push_back(*seen);
  }
  return observations;
}

double reprojection_rms_px(const Eigen::Isometry3d& pose,
                           const std::vector<Observation>& observations,
                           const std::vector<Detection>& detections, const Camera& camera) {
  double sum = 0.0;
  for (const Observation& seen : observations)
    for (std::size_t i = 0; i < 4; ++i) {
      const auto column = static_cast<Eigen::Index>(i);
      const Eigen::Vector3d point =
          pose * Eigen::Vector3d(seen.plane(0, column), seen.plane(1, column), 0.0);
      const Vector2d lens = camera.distort(point.head<2>() / point.z());
      const Vector2d pixel(camera.fx * lens.x() + camera.cx, camera.fy * lens.y() + camera.cy);
      sum +=
          (pixel - detections[static_cast<std::size_t>(seen.detection)].corners[i]).squaredNorm();
    }
  return std::sqrt(sum / static_cast<double>(8 * observations.size()));
}

}  // namespace harco
