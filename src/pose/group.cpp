#include "pose/group.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <map>
#include <utility>

#include <Eigen/LU>

namespace harco {
namespace {

using Eigen::Isometry3d;
using Eigen::Matrix2d;
using Eigen::Vector2d;
using Eigen::Vector3d;

// Squared distance of a corner from its prediction, in units of the covariance, that still agrees:
// five sigma.
constexpr double kAgree = 25.0;

// Whatever the covariance allows, a corner must lie within this share of its marker's side:
// farther away, the next cell could as well be meant.
constexpr double kAgreeSides = 0.5;

// What corners may be wrong by beyond their covariance, as a share of the marker's side: blur moves
// the edges of small markers.
constexpr double kBias = 0.02;

// A single marker's misfit (root mean square in units of the noise) that still is a square.
constexpr double kSquare = 6.0;

double mean_side(const Observation& seen) {
  double sum = 0.0;
  for (Eigen::Index i = 0; i < 4; ++i)
    sum += (seen.image.col((i + 1) % 4) - seen.image.col(i)).norm();
  return 0.25 * sum;
}

/// How far `seen` is from where the pose predicts it: the greatest squared distance of a corner in
/// units of the covariance. Infinite if it is elsewhere altogether.
double disagreement(const Isometry3d& pose, const Matrix6d& covariance, const Observation& seen) {
  constexpr double kElsewhere = std::numeric_limits<double>::infinity();
  const double side = mean_side(seen);
  double worst = 0.0;
  for (std::size_t i = 0; i < 4; ++i) {
    const auto column = static_cast<Eigen::Index>(i);
    const std::optional<Prediction> predicted = predict(pose, covariance, seen.plane.col(column));
    if (!predicted) return kElsewhere;
    const Vector2d error = predicted->image - seen.image.col(column);
    if (error.norm() > kAgreeSides * side) return kElsewhere;
    const Matrix2d allowed = predicted->covariance +
                             seen.covariance.block<2, 2>(2 * column, 2 * column) +
                             (kBias * kBias * side * side) * Matrix2d::Identity();
    worst = std::max(worst, error.dot(allowed.inverse() * error));
  }
  return worst;
}

/// A seed's own pose, and the observations that agree with it: ascending indices, the seed's
/// among them, each marker once.
struct Support {
  JointPose pose;
  std::vector<std::size_t> members;
};

Support support(const std::vector<Observation>& observations, std::size_t seed) {
  std::optional<JointPose> pose = solve_joint({&observations[seed], 1});
  if (!pose) return {};
  std::map<int, std::pair<double, std::size_t>> best;  // by marker: the nearest observation
  best[observations[seed].placed] = {0.0, seed};
  for (std::size_t i = 0; i < observations.size(); ++i) {
    if (observations[i].placed == observations[seed].placed) continue;
    double distance = disagreement(pose->camera_T_marker, pose->covariance, observations[i]);
    // Seen from afar, a small marker may look alike in both of its poses.
    if (pose->second)
      distance =
          std::min(distance, disagreement(*pose->second, pose->second_covariance, observations[i]));
    if (distance > kAgree) continue;
    const auto [found, is_new] = best.try_emplace(observations[i].placed, distance, i);
    if (!is_new && distance < found->second.first) found->second = {distance, i};
  }
  Support result{std::move(*pose), {}};
  for (const auto& [placed, nearest] : best) result.members.push_back(nearest.second);
  std::sort(result.members.begin(), result.members.end());
  return result;
}

/// The best supported sheet; of equals, that of the larger seed.
Support best_supported(const std::vector<Observation>& observations) {
  Support best;
  for (std::size_t seed = 0; seed < observations.size(); ++seed) {
    Support candidate = support(observations, seed);
    if (candidate.members.size() > best.members.size()) best = std::move(candidate);
    if (best.members.size() == observations.size()) break;
  }
  return best;
}

/// Takes the members out of `observations`.
std::vector<Observation> take(std::vector<Observation>& observations,
                              const std::vector<std::size_t>& members) {
  std::vector<Observation> taken;
  std::vector<Observation> rest;
  for (std::size_t i = 0; i < observations.size(); ++i)
    (std::binary_search(members.begin(), members.end(), i) ? taken : rest)
        .push_back(observations[i]);
  observations = std::move(rest);
  return taken;
}

/// The seed's supporters, solved together, and those besides that the sharper pose can now place.
std::optional<Group> next_sheet(std::vector<Observation>& observations) {
  Support seed = best_supported(observations);
  Group group;
  group.members = take(observations, seed.members);
  if (group.members.size() <= 1) {
    if (group.members.empty()) return std::nullopt;
    group.pose = std::move(seed.pose);
    return group;
  }
  std::optional<JointPose> pose = solve_joint(group.members);
  if (!pose) return std::nullopt;
  std::vector<std::size_t> late;
  for (std::size_t i = 0; i < observations.size(); ++i) {
    const bool held = std::any_of(
        group.members.begin(), group.members.end(),
        [&](const Observation& member) { return member.placed == observations[i].placed; });
    if (!held && disagreement(pose->camera_T_marker, pose->covariance, observations[i]) <= kAgree)
      late.push_back(i);
  }
  if (!late.empty()) {
    for (const Observation& seen : take(observations, late)) group.members.push_back(seen);
    pose = solve_joint(group.members);
    if (!pose) return std::nullopt;
  }
  group.pose = std::move(*pose);
  return group;
}

/// Whether the line of sight to a marker's middle meets a sheet of this pose.
bool lies_on_sheet(const Observation& seen, const Isometry3d& pose, double side_m) {
  constexpr double kMargin = 0.1;  // shares of the side
  const Vector2d middle = seen.image.rowwise().mean();
  const Isometry3d marker_T_camera = pose.inverse();
  const Vector3d eye = marker_T_camera.translation();
  const Vector3d direction = marker_T_camera.linear() * Vector3d(middle.x(), middle.y(), 1.0);
  const Vector3d point = eye - direction * (eye.z() / direction.z());
  const double margin = kMargin * side_m;
  return point.x() > -margin && point.y() > -margin && point.x() < side_m + margin &&
         point.y() < side_m + margin;
}

/// No two sheets are in the same place: a group that lies on a known sheet only contradicts it.
bool contradicts(const Group& group, const std::vector<Group>& sheets, double side_m) {
  return std::any_of(sheets.begin(), sheets.end(), [&](const Group& sheet) {
    return std::all_of(group.members.begin(), group.members.end(), [&](const Observation& seen) {
      return lies_on_sheet(seen, sheet.pose.camera_T_marker, side_m);
    });
  });
}

bool stands_for_itself(const Group& group, const std::vector<Detection>& detections) {
  if (group.members.size() > 1) return true;
  const auto index = static_cast<std::size_t>(group.members.front().detection);
  return detections[index].bit_errors == 0 && group.pose.misfit < kSquare;
}

}  // namespace

std::vector<Group> group_by_sheet(std::vector<Observation> observations,
                                  const std::vector<Detection>& detections, double parent_side_m) {
  std::stable_sort(
      observations.begin(), observations.end(),
      [](const Observation& a, const Observation& b) { return a.area_px > b.area_px; });
  std::vector<Group> sheets;
  while (!observations.empty()) {
    std::optional<Group> group = next_sheet(observations);
    if (!group) break;  // what is left can't be explained by any pose
    if (sheets.empty() ||
        (stands_for_itself(*group, detections) && !contradicts(*group, sheets, parent_side_m)))
      sheets.push_back(std::move(*group));
  }
  return sheets;
}

}  // namespace harco
