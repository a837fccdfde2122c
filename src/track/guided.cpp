#include "harco/guided.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "track/so3.hpp"

namespace harco {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

// Regions begin and end at whole tiles of the detector, so that it sees in them what it would see
// in all of the image.
constexpr int kTile = 32;
// Around a parent's square, as a share of its side: its white rim.
constexpr double kRim = 0.2;
// A marker may come out smaller than expected by this factor.
constexpr double kLeastOfSide = 0.6;

struct Seen {
  Vector2d pixel;
  double sd_px;  ///< in the direction in which it is the least certain
};

/// Where a point of the marker should be seen.
std::optional<Seen> seen(const TrackState& state, const Vector3d& point, const Camera& camera) {
  const Matrix3d rotation = state.camera_T_marker.linear();
  Eigen::Matrix<double, 2, 3> pixel_by_point;
  const auto pixel = camera.project(state.camera_T_marker * point, &pixel_by_point);
  if (!pixel) return std::nullopt;
  Eigen::Matrix<double, 3, 6> point_by_pose;
  point_by_pose << Matrix3d::Identity(), -rotation * so3::hat(point);
  const Eigen::Matrix<double, 2, 6> jacobian = pixel_by_point * point_by_pose;
  const Eigen::Matrix2d covariance =
      jacobian * state.covariance.topLeftCorner<6, 6>() * jacobian.transpose();
  return Seen{*pixel, std::sqrt(std::max(covariance.trace(), 0.0))};
}

/// Side of the smallest marker of the tree as a share of the root's.
double least_side(const Marker& marker, int cells) {
  const int n = marker.code.cells > 0 ? marker.code.cells : cells;
  double least = 1.0;
  for (const Marker& child : marker.children)
    least = std::min(least, least_side(child, n) / ((n + 2) * child.parts));
  return least;
}

const Parent* find_parent(const MarkerSet& markers, int id) {
  for (const Parent& parent : markers.parents)
    if (parent.marker.id == id) return &parent;
  return nullptr;
}

bool all_found(const std::vector<Track>& tracks, const std::vector<Detection>& detections) {
  return std::all_of(tracks.begin(), tracks.end(), [&](const Track& track) {
    return std::any_of(detections.begin(), detections.end(), [&](const Detection& detection) {
      return detection.parent == track.parent && !detection.tentative;
    });
  });
}

}  // namespace

std::optional<Region> expected_region(const std::vector<Track>& tracks, const MarkerSet& markers,
                                      const Camera& camera, const GuideOptions& options) {
  if (tracks.empty()) return std::nullopt;
  Vector2d low(camera.width, camera.height), high(-1.0, -1.0);
  double least = camera.width + camera.height;
  for (const Track& track : tracks) {
    const Parent* parent = find_parent(markers, track.parent);
    if (parent == nullptr || track.state.status != TrackStatus::tracking) return std::nullopt;
    const double rim = kRim * parent->side_m, far = parent->side_m + rim;
    std::vector<Vector2d> corners;
    for (const Vector3d& point : {Vector3d(-rim, -rim, 0.0), Vector3d(far, -rim, 0.0),
                                  Vector3d(far, far, 0.0), Vector3d(-rim, far, 0.0)}) {
      const auto corner = seen(track.state, point, camera);
      if (!corner) return std::nullopt;
      const double room = options.sigmas * corner->sd_px + options.margin_px;
      low = low.cwiseMin(corner->pixel - Vector2d::Constant(room));
      high = high.cwiseMax(corner->pixel + Vector2d::Constant(room));
      corners.push_back(corner->pixel);
    }
    for (std::size_t i = 0; i < 4; ++i)
      least = std::min(least, (corners[(i + 1) % 4] - corners[i]).norm() / (1.0 + 2.0 * kRim) *
                                  least_side(parent->marker, 0));
  }
  const auto tile = [](double pixel, int size, double up) {
    const double bounded = std::clamp(pixel, 0.0, static_cast<double>(size));
    return std::min(static_cast<int>(std::floor(bounded / kTile + up)) * kTile, size);
  };
  Region region;
  region.x = tile(low.x(), camera.width, 0.0);
  region.y = tile(low.y(), camera.height, 0.0);
  region.width = tile(high.x() + 1.0, camera.width, 1.0) - region.x;
  region.height = tile(high.y() + 1.0, camera.height, 1.0) - region.y;
  region.min_side_px = kLeastOfSide * least;
  if (region.width < kTile || region.height < kTile) return std::nullopt;
  return region;
}

GuidedDetector::GuidedDetector(MarkerSet markers, const DetectorOptions& options,
                               const GuideOptions& guide)
    : detector_(std::move(markers), options), guide_(guide) {
  if (!options.camera) throw std::invalid_argument("guided detector: needs a camera");
  if (guide.full_every < 1 || !(guide.sigmas >= 0.0) || !(guide.margin_px >= 0.0) ||
      !(guide.most_share >= 0.0))
    throw std::invalid_argument("guided detector: a guide option is out of range");
}

std::vector<Detection> GuidedDetector::detect(const ImageView& image,
                                              const std::vector<Track>& tracks,
                                              DetectionTrace* trace) {
  const Camera& camera = *detector_.options().camera;
  const auto region = expected_region(tracks, detector_.markers(), camera, guide_);
  const double whole = static_cast<double>(camera.width) * camera.height;
  const bool worth_it =
      region && static_cast<double>(region->width) * region->height <= guide_.most_share * whole;
  if (worth_it && since_full_ + 1 < guide_.full_every) {
    std::vector<Detection> detections = detector_.detect(image, *region, trace);
    if (all_found(tracks, detections)) {
      ++since_full_;
      return detections;
    }
  }
  since_full_ = 0;
  return detector_.detect(image, trace);
}

}  // namespace harco
