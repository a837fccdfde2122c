#include "pose/pose_search.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>

#include <Eigen/Cholesky>

#include "pose/ambiguity.hpp"
#include "pose/planar.hpp"
#include "pose/refine.hpp"

namespace harco {
namespace {

using Eigen::Isometry3d;
using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Vector6d = Eigen::Matrix<double, 6, 1>;

constexpr double kDegree = std::numbers::pi / 180.0;

// Corners may be wrong by so many pixels and by such a share of their marker's side.
constexpr double kCornerPx = 0.3, kCornerShare = 0.04;
// Tilts that are tried.
constexpr double kMostTilt = 66.0 * kDegree, kTiltStep = 4.0 * kDegree;
// So many of the best are made better; those that remain apart by less are one.
constexpr std::size_t kPromising = 8, kMostFound = 3;
constexpr double kSamePose = 6.0 * kDegree, kSameFinding = 10.0 * kDegree;
// Agreement that is worth aligning.
constexpr double kLeastAgreement = 0.5;

// So many probes are enough for the first look at a tilt, and so many to climb.
constexpr std::size_t kFirstProbes = 160, kClimbProbes = 250;

/// Columns: uncorrelated steps of one sigma of the corners, tilts at most of half the grid's.
Matrix6d steps(Matrix6d information) {
  for (const Eigen::Index k : {3, 4}) information(k, k) += 4.0 / (kTiltStep * kTiltStep);
  return information.llt().matrixU().solve(Matrix6d::Identity());
}

}  // namespace

/// Squared errors of the corners, in units of what they may be wrong by.
struct PoseSearch::Corners {
  double chi2 = 0.0;
  Matrix6d information = Matrix6d::Zero();
  Vector6d pull = Vector6d::Zero();
};

PoseSearch::PoseSearch(const ImageView& image, const InkOutline& outline, double quiet_m,
                       const Camera& camera, std::span<const Observation> seen)
    : image_(image),
      camera_(camera),
      seen_(seen),
      bends_(camera.has_distortion()),
      probes_(probes_of(outline, quiet_m)) {
  for (const Observation& one : seen) {
    centre_.head<2>() += one.plane.rowwise().mean() / static_cast<double>(seen.size());
    double side = 0.0;
    for (Eigen::Index i = 0; i < 4; ++i)
      side += 0.25 * (one.image.col((i + 1) % 4) - one.image.col(i)).norm();
    corner_sigma_.push_back(kCornerPx / camera.fx + kCornerShare * side);
  }
}

std::vector<PoseSearch::Probe> PoseSearch::probes_of(const InkOutline& outline, double cell_m) {
  constexpr int kPerCell = 3;
  constexpr double kAround = 0.08;  // of a cell
  constexpr int kPaper = 2;         // probes wide
  const Rect& square = outline.square();
  const double step = cell_m / kPerCell, reach = kAround * cell_m;
  const auto black = [&](const Vector2d& p) {
    return p.x() > square.x0 && p.x() < square.x1 && p.y() > square.y0 && p.y() < square.y1 &&
           outline.is_black(p);
  };
  std::vector<Probe> probes;
  const int count = static_cast<int>(std::lround(square.width() / step));
  for (int j = -kPaper; j < count + kPaper; ++j)
    for (int i = -kPaper; i < count + kPaper; ++i) {
      const Vector2d p(square.x0 + (i + 0.5) * step, square.y0 + (j + 0.5) * step);
      const bool ink = black(p);
      bool plain = true;
      for (const double dx : {-reach, reach})
        for (const double dy : {-reach, reach}) plain &= black(p + Vector2d(dx, dy)) == ink;
      if (plain)
        probes.push_back({static_cast<float>(p.x()), static_cast<float>(p.y()), ink ? 0.0F : 1.0F});
    }
  return probes;
}

double PoseSearch::agreement(const Isometry3d& camera_T_marker) const {
  return agreement(camera_T_marker, 1);
}

double PoseSearch::agreement(const Isometry3d& pose, std::size_t stride) const {
  constexpr float kFewest = 24.0F;
  const Eigen::Vector3f right = pose.linear().col(0).cast<float>();
  const Eigen::Vector3f down = pose.linear().col(1).cast<float>();
  const Eigen::Vector3f origin = pose.translation().cast<float>();
  const auto fx = static_cast<float>(camera_.fx), fy = static_cast<float>(camera_.fy);
  const auto cx = static_cast<float>(camera_.cx), cy = static_cast<float>(camera_.cy);
  const auto wide = static_cast<float>(image_.width()), tall = static_cast<float>(image_.height());
  float n = 0.0F, w = 0.0F, ww = 0.0F, g = 0.0F, gg = 0.0F, gw = 0.0F;
  for (std::size_t i = 0; i < probes_.size(); i += stride) {
    const Eigen::Vector3f p = origin + right * probes_[i].x + down * probes_[i].y;
    if (!(p.z() > 0.0F)) continue;
    // From the first pixel's corner.
    const float per_z = 1.0F / p.z();
    float x = fx * p.x() * per_z + cx + 0.5F, y = fy * p.y() * per_z + cy + 0.5F;
    if (bends_) {
      const auto bent = camera_.project(p.cast<double>());
      if (!bent) continue;
      x = static_cast<float>(bent->x()) + 0.5F;
      y = static_cast<float>(bent->y()) + 0.5F;
    }
    if (!(x > 0.0F && y > 0.0F && x < wide && y < tall)) continue;
    const auto grey = static_cast<float>(image_(static_cast<int>(x), static_cast<int>(y)));
    const float white = probes_[i].white;
    n += 1.0F, w += white, ww += white * white;
    g += grey, gg += grey * grey, gw += grey * white;
  }
  if (n * static_cast<float>(stride) < kFewest) return 0.0;
  const float of_white = n * ww - w * w, of_grey = n * gg - g * g;
  if (!(of_white > 0.0F && of_grey > 0.0F)) return 0.0;
  return static_cast<double>((n * gw - w * g) / std::sqrt(of_white * of_grey));
}

std::optional<RoughPose> PoseSearch::mirrored(const Isometry3d& camera_T_marker,
                                              double most_px) const {
  const auto count = 4 * static_cast<Eigen::Index>(seen_.size());
  Eigen::Matrix2Xd plane(2, count), image(2, count);
  const auto seen_by = [&](const Isometry3d& pose, Eigen::Index i) -> Vector2d {
    return (pose * Vector3d(plane(0, i), plane(1, i), 0.0)).hnormalized();
  };
  for (Eigen::Index i = 0; i < count; ++i) {
    plane.col(i) = seen_[static_cast<std::size_t>(i / 4)].plane.col(i % 4);
    image.col(i) = seen_by(camera_T_marker, i);
  }
  const PlanarPoses both = planar_poses(plane, image);
  const auto away = [&](std::size_t k) {
    return angle_between(both.camera_T_plane[k], camera_T_marker);
  };
  const Isometry3d& other = both.camera_T_plane[away(0) > away(1) ? 0 : 1];
  double apart = 0.0;
  for (Eigen::Index i = 0; i < count; ++i)
    apart += (seen_by(other, i) - image.col(i)).squaredNorm() / static_cast<double>(2 * count);
  if (camera_.fx * std::sqrt(apart) > most_px) return std::nullopt;
  return RoughPose{other, covariance(other), agreement(other)};
}

std::vector<RoughPose> PoseSearch::find(const Isometry3d& start) const {
  std::vector<Candidate> promising = best_apart(tilts(start), kPromising, kSamePose);
  for (Candidate& candidate : promising) climb(candidate);
  std::vector<RoughPose> found;
  for (const Candidate& one : best_apart(std::move(promising), kMostFound, kSameFinding))
    if (one.agreement > kLeastAgreement)
      found.push_back({one.pose, covariance(one.pose), one.agreement});
  return found;
}

/// The best of them, each in a neighbourhood of its own.
std::vector<PoseSearch::Candidate> PoseSearch::best_apart(std::vector<Candidate> all,
                                                          std::size_t most, double apart) {
  std::stable_sort(all.begin(), all.end(), [](const Candidate& a, const Candidate& b) {
    return a.agreement > b.agreement;
  });
  std::vector<Candidate> best;
  for (const Candidate& one : all) {
    if (best.size() == most) break;
    const bool known = std::any_of(best.begin(), best.end(), [&](const Candidate& other) {
      return angle_between(other.pose, one.pose) < apart;
    });
    if (!known) best.push_back(one);
  }
  return best;
}

/// The pose with its frame moved by (dt, w) at the middle of the corners.
Isometry3d PoseSearch::moved_by(const Isometry3d& pose, const Vector6d& by) const {
  Isometry3d result = Isometry3d::Identity();
  result.linear() = pose.linear() * rotation_exp(by.tail<3>());
  result.translation() = pose * centre_ + by.head<3>() - result.linear() * centre_;
  return result;
}

/// Empty if a corner is behind the camera.
std::optional<PoseSearch::Corners> PoseSearch::corners(const Isometry3d& pose) const {
  Corners sum;
  const Vector3d t = pose * centre_;
  for (std::size_t k = 0; k < seen_.size(); ++k)
    for (Eigen::Index i = 0; i < 4; ++i) {
      const Vector3d p = Vector3d(seen_[k].plane(0, i), seen_[k].plane(1, i), 0.0) - centre_;
      const Vector3d point = pose.linear() * p + t;
      if (!(point.z() > 0.0)) return std::nullopt;
      Eigen::Matrix<double, 2, 6> jacobian;
      const Vector2d error =
          (seen_[k].image.col(i) - project(pose.linear(), p, point, jacobian)) / corner_sigma_[k];
      jacobian /= corner_sigma_[k];
      sum.chi2 += error.squaredNorm();
      sum.information += jacobian.transpose() * jacobian;
      sum.pull += jacobian.transpose() * error;
    }
  return sum;
}

/// The pose of the same tilt that the corners like best, if they like it at all.
std::optional<Isometry3d> PoseSearch::settled(Isometry3d pose) const {
  constexpr int kSteps = 2;
  constexpr double kMostChi2 = 4.0;  // of a coordinate
  const std::array<Eigen::Index, 4> free{0, 1, 2, 5};
  for (int step = 0; step < kSteps; ++step) {
    const auto at = corners(pose);
    if (!at) return std::nullopt;
    Vector6d by = Vector6d::Zero();
    by(free) = Eigen::Matrix4d(at->information(free, free)).ldlt().solve(at->pull(free));
    if (!by.allFinite()) return std::nullopt;
    pose = moved_by(pose, by);
  }
  const auto at = corners(pose);
  const double count = 8.0 * static_cast<double>(seen_.size());
  if (!at || at->chi2 > kMostChi2 * count) return std::nullopt;
  return pose;
}

/// All tilts that the corners allow, with the corners' best of the rest.
std::vector<PoseSearch::Candidate> PoseSearch::tilts(const Isometry3d& start) const {
  const Vector3d middle = start * centre_;
  const Vector3d sight = middle.normalized();
  const Vector3d across = sight.unitOrthogonal(), beside = sight.cross(across);
  const std::size_t stride = std::max<std::size_t>(1, probes_.size() / kFirstProbes);
  constexpr int kRings = static_cast<int>(kMostTilt / kTiltStep);
  std::vector<Candidate> found;
  for (int ring = 0; ring <= kRings; ++ring) {
    const double tilt = ring * kTiltStep;
    const int ways =
        std::max(1, static_cast<int>(2.0 * std::numbers::pi * std::sin(tilt) / kTiltStep));
    for (int way = 0; way < ways; ++way) {
      const double angle = 2.0 * std::numbers::pi * way / ways;
      const Vector3d normal = std::cos(tilt) * sight + std::sin(tilt) * (std::cos(angle) * across +
                                                                         std::sin(angle) * beside);
      Isometry3d pose = Isometry3d::Identity();
      pose.linear() =
          Eigen::Quaterniond::FromTwoVectors(start.linear().col(2), normal) * start.linear();
      pose.translation() = middle - pose.linear() * centre_;
      if (const auto best = settled(pose)) found.push_back({*best, agreement(*best, stride)});
    }
  }
  return found;
}

/// Steps of the pose, each kept if the picture agrees better.
void PoseSearch::climb(Candidate& candidate) const {
  constexpr int kRounds = 5;
  const std::size_t stride = std::max<std::size_t>(1, probes_.size() / kClimbProbes);
  candidate.agreement = agreement(candidate.pose, stride);
  double size = 1.0;
  for (int round = 0; round < kRounds; ++round) {
    const auto at = corners(candidate.pose);
    if (!at) return;
    const Matrix6d axes = steps(at->information);
    bool moved = false;
    for (Eigen::Index k = 0; k < 6; ++k)
      for (const double sign : {-size, size}) {
        const Isometry3d next = moved_by(candidate.pose, sign * axes.col(k));
        const double agrees = agreement(next, stride);
        if (agrees <= candidate.agreement) continue;
        candidate = {next, agrees};
        moved = true;
      }
    if (!moved) size *= 0.5;
  }
  candidate.agreement = agreement(candidate.pose);
}

/// What the corners leave open; of tilts, what lies between those of the grid.
Matrix6d PoseSearch::covariance(const Isometry3d& pose) const {
  const auto at = corners(pose);
  if (!at) return Matrix6d::Zero();
  Matrix6d information = at->information;
  for (const Eigen::Index k : {3, 4}) information(k, k) += 4.0 / (kTiltStep * kTiltStep);
  const Matrix6d own = information.ldlt().solve(Matrix6d::Identity());
  const Matrix6d of_frame = moved(own, pose.linear(), centre_);
  return 0.5 * (of_frame + of_frame.transpose());
}

}  // namespace harco
