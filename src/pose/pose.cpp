#include "harco/pose.hpp"

#include <algorithm>
#include <stdexcept>

#include "pose/align.hpp"
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

/// `alignment` replaces the corners' solution where there is one.
Pose joint_pose(const Group& group, const std::optional<Alignment>& alignment, int parent,
                const std::vector<Detection>& detections, const Camera& camera) {
  std::vector<Observation> used;
  for (std::size_t k = 0; k < group.members.size(); ++k)
    if (group.pose.used[k]) used.push_back(group.members[k]);
  Pose pose = describe(alignment ? alignment->camera_T_marker : group.pose.camera_T_marker, parent,
                       used, detections, camera);
  pose.covariance = alignment ? alignment->covariance : group.pose.covariance;
  pose.aligned = alignment.has_value();
  if (alignment) pose.share_used = alignment->share;
  if (group.pose.ambiguous) pose.alternative = group.pose.second;
  return pose;
}

Pose paper_pose(const Group& group, int parent, const std::vector<Detection>& detections,
                const Camera& camera) {
  return describe(average_of_homography_poses(group.members), parent, group.members, detections,
                  camera);
}

double evidence(const Pose& pose, const std::vector<Detection>& detections) {
  double area = 0.0;
  for (const int index : pose.detections)
    area += quad_area(detections[static_cast<std::size_t>(index)].corners);
  return area;
}

}  // namespace

std::vector<Pose> estimate_poses(const ImageView& image, const std::vector<Detection>& detections,
                                 const MarkerSet& markers, const Camera& camera,
                                 const PoseOptions& options) {
  validate(camera);
  if (!image.empty() && (image.width() != camera.width || image.height() != camera.height))
    throw std::invalid_argument("estimate_poses: the image's size is not the camera's");
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
    const int id = parent.marker.id;
    const bool aligns = options.align && options.fusion == Fusion::joint && !image.empty();
    std::optional<InkOutline> outline;
    if (aligns) outline.emplace(ink_plan(markers, static_cast<int>(i)));
    const double cell_m = parent.side_m / (parent.marker.code.cells + 2);
    for (const Group& group : group_by_sheet(by_parent[i], detections, parent.side_m)) {
      if (options.fusion == Fusion::paper) {
        poses.push_back(paper_pose(group, id, detections, camera));
        continue;
      }
      std::optional<Alignment> alignment;
      if (aligns)
        alignment = aligner.align(image, *outline, cell_m, camera, group.pose.camera_T_marker,
                                  group.pose.covariance);
      poses.push_back(joint_pose(group, alignment, id, detections, camera));
    }
  }
  std::stable_sort(poses.begin(), poses.end(), [&](const Pose& a, const Pose& b) {
    return evidence(a, detections) > evidence(b, detections);
  });
  return poses;
}

}  // namespace harco
