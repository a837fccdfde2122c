#include "harco/pose.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <utility>

#include "harco/pose_estimator.hpp"
#include "pose/align.hpp"
#include "pose/ambiguity.hpp"
#include "pose/group.hpp"
#include "pose/paper.hpp"
#include "pose/pose_search.hpp"
#include "pose/refine.hpp"

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

// An alignment that explains so much of the pixels leaves nothing to look for; one that explains
// less than this is no evidence where corners don't lead to it; noise alone leaves 0.91.
constexpr double kConvincingShare = 0.86, kLeastShare = 0.65;
// ... where light of one's own choice may have explained what a wrong pose can't.
constexpr double kConvincingInAnyLight = 0.885;
// ... and nor does one that takes all for noise, grey levels.
constexpr double kMostNoise = 9.0;
// A marker of such a side has corners that tell its tilt.
constexpr double kPlainPx = 100.0;
// Corners that are told apart by more than this, root mean square, tell two poses apart.
constexpr double kMirroredPx = 1.0;
// ... where the picture doesn't tell corners better: to so many times their deviation.
constexpr double kSurelyApart = 8.0;
// Aligning what the search finds may cost this share of aligning what the corners lead to.
constexpr double kSearchShare = 0.3;
// What agrees with the picture by so much less isn't worth aligning.
constexpr double kHardlyLess = 0.03;

// Corners that no pose explains to so many times their noise, root mean square, and that the
// picture doesn't bear out either, are no marker's.
constexpr double kHopelessMisfit = 100.0;

// Solutions closer than this, in radians, are one.
constexpr double kSameSolution = 0.005;
// ... and closer than this, alignment comes from one to the other.
constexpr double kSameNeighbourhood = 0.14;

/// A possible pose: from corners, or aligned.
struct Solution {
  Eigen::Isometry3d camera_T_marker;
  Matrix6d covariance;
  std::optional<Alignment> alignment;
};

/// The likeliest solution and, where there is one, that which comes next.
struct Verdict {
  Solution first;
  std::optional<Solution> second;
  double ratio = 0.0;  ///< log-likelihood of the first over the second
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
  const InkOutline* outline = nullptr;  ///< there if poses shall be aligned

  Solution solution(const Eigen::Isometry3d& start, const Matrix6d& covariance,
                    const std::optional<Alignment>& rival = std::nullopt,
                    std::optional<LightModel> light = std::nullopt) const {
    Solution found{start, covariance, std::nullopt};
    if (outline)
      found.alignment =
          aligner.align(image, *outline, cell_m, camera, start, covariance, rival, light);
    if (found.alignment) {
      found.camera_T_marker = found.alignment->camera_T_marker;
      found.covariance = found.alignment->covariance;
    }
    return found;
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

  /// One more solution, judged by the image and gravity.
  void weigh(Verdict& verdict, Solution next) const {
    if (angle_between(verdict.first.camera_T_marker, next.camera_T_marker) < kSameSolution) {
      if (!verdict.first.alignment) verdict.first = std::move(next);
      return;
    }
    const double lead =
        picture(next, verdict.first) + gravity(next.camera_T_marker, verdict.first.camera_T_marker);
    if (lead > 0.0) {
      verdict.second = std::exchange(verdict.first, std::move(next));
      verdict.ratio = lead;
    } else if (!verdict.second || -lead < verdict.ratio) {
      verdict.second = std::move(next);
      verdict.ratio = -lead;
    }
  }

  bool convinces(const Solution& solution) const {
    if (!solution.alignment) return false;
    const Alignment& found = *solution.alignment;
    const bool even = found.light == LightModel::even && !found.shaded;
    return found.share > (even ? kConvincingShare : kConvincingInAnyLight) &&
           found.noise < kMostNoise;
  }

  /// Where alignment from the corners' solutions doesn't convince: others that agree with the
  /// picture as well. Corners of large markers, once aligned, don't mislead.
  void search(Verdict& verdict, const std::vector<Observation>& used) const {
    const std::optional<Alignment>& aligned = verdict.first.alignment;
    if (aligned && (aligned->plain || largest_px2(used) > kPlainPx * kPlainPx)) return;
    const PoseSearch search(image, *outline, cell_m, camera, used);
    if (aligned && !verdict.second)
      if (const auto other =
              search.mirrored(verdict.first.camera_T_marker, alike_px(*aligned, used)))
        weigh_aligned(verdict, *other);
    if (convinces(verdict.first)) return;
    aligner.refill(kSearchShare);
    const Eigen::Isometry3d known = verdict.first.camera_T_marker;
    const double agreement = search.agreement(known);
    for (const RoughPose& rough : search.find(known)) {
      if (rough.agreement < agreement - kHardlyLess || aligner.spent()) return;
      if (is_aligned_near(verdict, rough)) continue;
      weigh_aligned(verdict, rough);
      if (convinces(verdict.first)) return;
    }
  }

  /// Even light that doesn't fit is the last resort.
  static bool knows_light(const Alignment& found) {
    return found.fits || found.light != LightModel::even;
  }

  /// Whether alignment has come to a pose that close already: it would do so again.
  static bool is_aligned_near(const Verdict& verdict, const RoughPose& rough) {
    const auto near = [&](const Solution& known) {
      return known.alignment && knows_light(*known.alignment) &&
             angle_between(known.camera_T_marker, rough.camera_T_marker) < kSameNeighbourhood;
    };
    return near(verdict.first) || (verdict.second && near(*verdict.second));
  }

  /// By how much corners of another pose may differ for the picture to take it for this one,
  /// root mean square.
  double alike_px(const Alignment& aligned, const std::vector<Observation>& used) const {
    if (!aligned.fits) return kMirroredPx;
    double sum = 0.0, count = 0.0;
    for (const Observation& seen : used)
      for (Eigen::Index i = 0; i < 4; ++i)
        if (const auto at =
                predict(aligned.camera_T_marker, aligned.covariance, seen.plane.col(i))) {
          sum += 0.5 * at->covariance.trace();
          count += 1.0;
        }
    return std::min(kMirroredPx, kSurelyApart * camera.fx * std::sqrt(sum / std::max(1.0, count)));
  }

  void weigh_aligned(Verdict& verdict, const RoughPose& rough) const {
    const std::optional<Alignment>& known = verdict.first.alignment;
    const bool convinced = convinces(verdict.first);
    std::optional<LightModel> light;
    if (known && !convinced && knows_light(*known)) light = known->light;
    Solution found =
        solution(rough.camera_T_marker, rough.covariance, convinced ? known : std::nullopt, light);
    if (!found.alignment) return;
    if (!found.alignment->plain && !aligner.spent()) found = again(found);
    if (found.alignment->share > kLeastShare) weigh(verdict, found);
  }

  static double largest_px2(const std::vector<Observation>& used) {
    double largest = 0.0;
    for (const Observation& seen : used) largest = std::max(largest, seen.area_px);
    return largest;
  }

  /// Aligned once more, from where it came to.
  Solution again(const Solution& aligned) const {
    const Solution next = solution(aligned.camera_T_marker, aligned.covariance, std::nullopt,
                                   aligned.alignment->light);
    return next.alignment && next.alignment->share > aligned.alignment->share ? next : aligned;
  }
};

/// What the corners leave possible, each solution aligned where it can be.
Verdict from_corners(const Group& group, const Evidence& evidence) {
  const JointPose& corners = group.pose;
  double ratio = corners.log_likelihood_ratio;
  const bool two =
      corners.second &&
      ratio + evidence.gravity(corners.camera_T_marker, *corners.second) < kExcludedLogRatio;
  if (!two) return {evidence.solution(corners.camera_T_marker, corners.covariance), std::nullopt};
  Verdict verdict{evidence.solution(corners.camera_T_marker, corners.covariance), std::nullopt};
  verdict.second =
      evidence.solution(*corners.second, corners.second_covariance,
                        evidence.convinces(verdict.first) ? verdict.first.alignment : std::nullopt);
  Solution &first = verdict.first, &second = *verdict.second;
  if (angle_between(first.camera_T_marker, second.camera_T_marker) < kSameSolution) {
    if (!first.alignment) std::swap(first, second);
    verdict.second.reset();
    return verdict;
  }
  if (first.alignment || second.alignment) ratio = evidence.picture(first, second);
  ratio += evidence.gravity(first.camera_T_marker, second.camera_T_marker);
  if (ratio < 0.0) std::swap(first, second);
  verdict.ratio = std::abs(ratio);
  return verdict;
}

/// Alignment replaces the corners' solution where there is one; where several are possible, the
/// image and gravity are asked. Empty if neither corners nor image bear a pose out.
std::optional<Pose> joint_pose(const Group& group, const Evidence& evidence) {
  std::vector<Observation> used;
  for (std::size_t k = 0; k < group.members.size(); ++k)
    if (group.pose.used[k]) used.push_back(group.members[k]);

  evidence.aligner.refill();
  Verdict verdict = from_corners(group, evidence);
  if (evidence.outline) evidence.search(verdict, used);

  const Solution& first = verdict.first;
  if (evidence.outline && !first.alignment && group.pose.misfit > kHopelessMisfit)
    return std::nullopt;
  Pose pose =
      describe(first.camera_T_marker, evidence.parent, used, evidence.detections, evidence.camera);
  pose.covariance = first.covariance;
  pose.aligned = first.alignment.has_value();
  if (first.alignment) pose.share_used = first.alignment->share;
  if (verdict.second) add_alternative(pose, verdict.second->camera_T_marker, verdict.ratio);
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

class PoseEstimator::Impl {
 public:
  explicit Impl(MarkerSet markers)
      : markers_(std::move(markers)),
        placed_(place(markers_)),
        outlines_(markers_.parents.size()),
        by_parent_(markers_.parents.size()) {}

  const MarkerSet& markers() const { return markers_; }

  std::vector<Pose> estimate(const ImageView& image, const std::vector<Detection>& detections,
                             const Camera& camera, const PoseOptions& options) {
    validate(camera);
    if (!image.empty() && (image.width() != camera.width || image.height() != camera.height))
      throw std::invalid_argument("estimate_poses: the image's size is not the camera's");
    if (options.gravity) check(*options.gravity);
    if (detections.empty()) return {};

    for (auto& seen : by_parent_) seen.clear();
    for (const Observation& seen : observe(detections, markers_, placed_, camera)) {
      const int parent = placed_[static_cast<std::size_t>(seen.placed)].parent_index;
      by_parent_[static_cast<std::size_t>(parent)].push_back(seen);
    }

    const bool align = options.align && options.fusion == Fusion::joint && !image.empty();
    std::vector<Pose> poses;
    for (std::size_t i = 0; i < by_parent_.size(); ++i) {
      if (by_parent_[i].empty()) continue;
      const Parent& parent = markers_.parents[i];
      const Evidence evidence{image,
                              camera,
                              options,
                              detections,
                              parent.marker.id,
                              parent.side_m / (parent.marker.code.cells + 2),
                              aligner_,
                              align ? &outline(i) : nullptr};
      for (const Group& group : group_by_sheet(by_parent_[i], detections, parent.side_m))
        if (options.fusion == Fusion::paper)
          poses.push_back(paper_pose(group, parent.marker.id, detections, camera));
        else if (auto pose = joint_pose(group, evidence))
          poses.push_back(*std::move(pose));
    }
    std::stable_sort(poses.begin(), poses.end(), [&](const Pose& a, const Pose& b) {
      return seen_area(a, detections) > seen_area(b, detections);
    });
    return poses;
  }

 private:
  const InkOutline& outline(std::size_t parent) {
    std::optional<InkOutline>& known = outlines_[parent];
    if (!known) known.emplace(ink_plan(markers_, static_cast<int>(parent)));
    return *known;
  }

  MarkerSet markers_;
  std::vector<PlacedMarker> placed_;
  std::vector<std::optional<InkOutline>> outlines_;  ///< of the parents seen so far
  std::vector<std::vector<Observation>> by_parent_;
  Aligner aligner_;
};

PoseEstimator::PoseEstimator(MarkerSet markers)
    : impl_(std::make_unique<Impl>(std::move(markers))) {}
PoseEstimator::~PoseEstimator() = default;
PoseEstimator::PoseEstimator(PoseEstimator&&) noexcept = default;
PoseEstimator& PoseEstimator::operator=(PoseEstimator&&) noexcept = default;

const MarkerSet& PoseEstimator::markers() const { return impl_->markers(); }

std::vector<Pose> PoseEstimator::estimate(const ImageView& image,
                                          const std::vector<Detection>& detections,
                                          const Camera& camera, const PoseOptions& options) {
  return impl_->estimate(image, detections, camera, options);
}

std::vector<Pose> estimate_poses(const ImageView& image, const std::vector<Detection>& detections,
                                 const MarkerSet& markers, const Camera& camera,
                                 const PoseOptions& options) {
  return PoseEstimator(markers).estimate(image, detections, camera, options);
}

}  // namespace harco
