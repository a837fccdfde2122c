#include "harco/pose.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "pose/align.hpp"
#include "pose/ambiguity.hpp"
#include "pose/group.hpp"
#include "pose/paper.hpp"

namespace harco {
namespace {

/// What the two kinds of fusion have in common.
Pose describe(const Eigen::Isometry3d& camera_T_marker, int parent,
              const std::vector<Observation>& members, const std::vector<Detection>& detections,
              const Camera& camera) {
  Pose pose;
  pose.parent = parent;
  pose.camera_T_marker = camera_T_marker;
  pose.rms_px = reprojection_rms_px(camera_T_marker, members, detections, camera);
  pose.markers = static_cast<int>(members.size());
  for (const Observation& seen : members) pose.detections.push_back(seen.detection);
  std::sort(pose.detections.begin(), pose.detections.end());
  return pose;
}

// Corners and gravity that make a second solution so much less likely (in log-likelihood) leave
// nothing for the image to decide.
constexpr double kExcludedLogRatio = 12.0;

// Of two solutions: an alignment that doesn't explain so much of the pixels, and leaves the corners
// it came from by more pixels, root mean square, has slid into something else.
constexpr double kConvincingShare = 0.88, kMostApartPx = 0.35;

// Solutions closer than this, in radians, are one.
constexpr double kSameSolution = 0.005;

/// One of the two solutions, from corners or aligned.
struct Solution {
  Eigen::Isometry3d camera_T_marker;
  std::optional<Alignment> alignment;
};

/// All that the poses of one parent are made from.
struct Evidence {
  const ImageView& image;
  const Camera& camera;
  const PoseOptions& options;
  const std::vector<Detection>& detections;
  int parent = 0;
  double cell_m = 0.0;
  Aligner& aligner;
  std::optional<InkOutline> outline;  ///< there if poses shall be aligned

  Solution solution(const Eigen::Isometry3d& from_corners, const Matrix6d& covariance) const {
    Solution found{from_corners, std::nullopt};
    if (outline)
      found.alignment = aligner.align(image, *outline, cell_m, camera, from_corners, covariance);
    if (found.alignment) found.camera_T_marker = found.alignment->camera_T_marker;
    return found;
  }

  /// The same where corners leave two solutions: what then slides away from them is none.
  Solution one_of_two(const Eigen::Isometry3d& from_corners, const Matrix6d& covariance,
                      const std::vector<Observation>& used) const {
    const Solution found = solution(from_corners, covariance);
    const bool stands =
        !found.alignment || found.alignment->share > kConvincingShare ||
        reprojection_rms_px(found.camera_T_marker, used, detections, camera) < kMostApartPx;
    return stands ? found : Solution{from_corners, std::nullopt};
  }

  /// Where one of them is aligned at least.
  double picture(const Solution& a, const Solution& b) const {
    const Blur& blur = a.alignment ? a.alignment->blur : b.alignment->blur;
    return picture_ratio(image, *outline, cell_m, camera, {a.camera_T_marker, blur},
                         {b.camera_T_marker, b.alignment ? b.alignment->blur : blur});
  }

  double gravity(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b) const {
    return options.gravity ? gravity_ratio(*options.gravity, a, b) : 0.0;
  }
};

/// Alignment replaces the corners' solution where there is one; where two solutions are possible,
/// the image and gravity are asked.
Pose joint_pose(const Group& group, const Evidence& evidence) {
  std::vector<Observation> used;
  for (std::size_t k = 0; k < group.members.size(); ++k)
    if (group.pose.used[k]) used.push_back(group.members[k]);

  double ratio = group.pose.log_likelihood_ratio;
  const bool two =
      group.pose.second &&
      ratio + evidence.gravity(group.pose.camera_T_marker, *group.pose.second) < kExcludedLogRatio;
  Solution first =
      two ? evidence.one_of_two(group.pose.camera_T_marker, group.pose.covariance, used)
          : evidence.solution(group.pose.camera_T_marker, group.pose.covariance);
  std::optional<Solution> second;
  if (two) second = evidence.one_of_two(*group.pose.second, group.pose.covariance, used);
  if (second && angle_between(first.camera_T_marker, second->camera_T_marker) < kSameSolution)
    second.reset();
  if (second) {
    if (first.alignment || second->alignment) ratio = evidence.picture(first, *second);
    ratio += evidence.gravity(first.camera_T_marker, second->camera_T_marker);
    if (ratio < 0.0) {
      std::swap(first, *second);
      ratio = -ratio;
    }
  }

  Pose pose =
      describe(first.camera_T_marker, evidence.parent, used, evidence.detections, evidence.camera);
  pose.covariance = first.alignment ? first.alignment->covariance : group.pose.covariance;
  pose.aligned = first.alignment.has_value();
  if (first.alignment) pose.share_used = first.alignment->share;
  if (second) add_alternative(pose, second->camera_T_marker, ratio);
  return pose;
}

Pose paper_pose(const Group& group, int parent, const std::vector<Detection>& detections,
                const Camera& camera) {
  return describe(average_of_homography_poses(group.members), parent, group.members, detections,
                  camera);
}

double seen_area(const Pose& pose, const std::vector<Detection>& detections) {
  double area = 0.0;
  for (const int index : pose.detections)
    area += quad_area(detections[static_cast<std::size_t>(index)].corners);
  return area;
}

void check(const GravityPrior& gravity) {
  for (const Eigen::Vector3d& direction : {gravity.in_camera, gravity.in_marker})
    if (!direction.allFinite() || !(direction.norm() > 0.0))
      throw std::invalid_argument("gravity: has no direction");
  if (!(gravity.sigma_rad > 0.0) || !std::isfinite(gravity.sigma_rad))
    throw std::invalid_argument("gravity: sigma must be positive");
}

}  // namespace

std::vector<Pose> estimate_poses(const ImageView& image, const std::vector<Detection>& detections,
                                 const MarkerSet& markers, const Camera& camera,
                                 const PoseOptions& options) {
  validate(camera);
  if (!image.empty() && (image.width() != camera.width || image.height() != camera.height))
    throw std::invalid_argument("estimate_poses: the image's size is not the camera's");
  if (options.gravity) check(*options.gravity);
  if (detections.empty()) return {};

  const std::vector<PlacedMarker> placed = place(markers);
  std::vector<std::vector<Observation>> by_parent(markers.parents.size());
  for (const Observation& seen : observe(detections, markers, placed, camera)) {
    const int parent = placed[static_cast<std::size_t>(seen.placed)].parent_index;
    by_parent[static_cast<std::size_t>(parent)].push_back(seen);
  }

  std::vector<Pose> poses;
  Aligner aligner;
  for (std::size_t i = 0; i < by_parent.size(); ++i) {
    if (by_parent[i].empty()) continue;
    const Parent& parent = markers.parents[i];
    Evidence evidence{image,      camera,           options,
                      detections, parent.marker.id, parent.side_m / (parent.marker.code.cells + 2),
                      aligner,    std::nullopt};
    if (options.align && options.fusion == Fusion::joint && !image.empty())
      evidence.outline.emplace(ink_plan(markers, static_cast<int>(i)));
    for (const Group& group : group_by_sheet(by_parent[i], detections, parent.side_m))
      poses.push_back(options.fusion == Fusion::paper
                          ? paper_pose(group, parent.marker.id, detections, camera)
                          : joint_pose(group, evidence));
  }
  std::stable_sort(poses.begin(), poses.end(), [&](const Pose& a, const Pose& b) {
    return seen_area(a, detections) > seen_area(b, detections);
  });
  return poses;
}

}  // namespace harco
