#include "pose/joint.hpp"

#include <algorithm>
#include <cmath>

#include "pose/ambiguity.hpp"
#include "pose/planar.hpp"

namespace harco {
namespace {

using Eigen::Isometry3d;

// In units of the noise, root mean square over a marker's eight coordinates.
constexpr double kHuber = 2.0;         // from here on a marker counts less
constexpr double kInconsistent = 6.0;  // from here on not at all

// Corners' errors have longer tails than the Gaussian law: a log-likelihood ratio is worth this
// share.
constexpr double kTrust = 0.35;

// Minima closer than this are one (radians).
constexpr double kSameSolution = 0.005;

double misfit(double chi2) { return std::sqrt(chi2 / 8.0); }

/// How much worse than the given noise the markers typically fit: 1 or more.
double common_scale(const std::vector<double>& chi2, const std::vector<bool>& used) {
  std::vector<double> misfits;
  for (std::size_t k = 0; k < chi2.size(); ++k)
    if (used[k]) misfits.push_back(misfit(chi2[k]));
  const auto middle = misfits.begin() + static_cast<std::ptrdiff_t>((misfits.size() - 1) / 2);
  std::nth_element(misfits.begin(), middle, misfits.end());
  return std::max(1.0, *middle);
}

struct RobustFit {
  Refined refined;
  std::vector<double> weights;
  std::vector<bool> used;
  double scale = 1.0;

  /// Huber's loss at a given scale, over all markers: comparable between fits.
  double loss(double at_scale) const {
    double sum = 0.0;
    for (const double chi2 : refined.chi2) {
      const double r = misfit(chi2) / at_scale;
      sum += 8.0 * (r <= kHuber ? r * r : kHuber * (2.0 * r - kHuber));
    }
    return sum;
  }

  /// Weighted chi-square per degree of freedom.
  double reduced_chi2() const {
    double sum = 0.0;
    double count = 0.0;
    for (std::size_t k = 0; k < used.size(); ++k)
      if (used[k]) {
        sum += weights[k] * refined.chi2[k];
        count += 8.0;
      }
    return sum / (count - 6.0);
  }
};

/// Iteratively reweighted least squares; a marker's weight is Huber's.
std::optional<RobustFit> fit(std::span<const Observation> observations, const Isometry3d& start) {
  constexpr int kRounds = 10;
  constexpr double kSettled = 0.01;
  RobustFit result;
  result.weights.assign(observations.size(), 1.0);
  result.used.assign(observations.size(), true);
  Isometry3d pose = start;
  for (int round = 0; round < kRounds; ++round) {
    std::optional<Refined> refined = refine(observations, result.weights, pose);
    if (!refined) return std::nullopt;
    result.refined = std::move(*refined);
    pose = result.refined.camera_T_marker;
    if (observations.size() == 1) break;
    result.scale = common_scale(result.refined.chi2, result.used);
    double change = 0.0;
    for (std::size_t k = 0; k < observations.size(); ++k) {
      const double r = misfit(result.refined.chi2[k]) / result.scale;
      // The first rounds, still under the spell of what is wrong, only weigh down.
      result.used[k] = round < 2 || r < kInconsistent;
      const double weight = !result.used[k] ? 0.0 : r <= kHuber ? 1.0 : kHuber / r;
      change = std::max(change, std::abs(weight - result.weights[k]));
      result.weights[k] = weight;
    }
    if (change < kSettled && round >= 2) break;
    if (change == 0.0) break;  // nobody is in doubt
  }
  return result;
}

PlanarPoses starts(std::span<const Observation> observations) {
  if (observations.size() == 1)
    return planar_poses(observations.front().plane, observations.front().image);
  const auto count = static_cast<Eigen::Index>(observations.size());
  Eigen::Matrix2Xd plane(2, 4 * count);
  Eigen::Matrix2Xd image(2, 4 * count);
  for (Eigen::Index k = 0; k < count; ++k) {
    plane.middleCols<4>(4 * k) = observations[static_cast<std::size_t>(k)].plane;
    image.middleCols<4>(4 * k) = observations[static_cast<std::size_t>(k)].image;
  }
  return planar_poses(plane, image);
}

}  // namespace

std::optional<JointPose> solve_joint(std::span<const Observation> observations) {
  const PlanarPoses both = starts(observations);
  std::optional<RobustFit> best = fit(observations, both.camera_T_plane[0]);
  std::optional<RobustFit> other = fit(observations, both.camera_T_plane[1]);
  if (!best) best.swap(other);
  if (!best) return std::nullopt;
  double lead = 0.0;
  if (other) {
    const double scale = std::min(best->scale, other->scale);
    lead = scale * scale * (other->loss(scale) - best->loss(scale));
    if (lead < 0.0) std::swap(*best, *other);
  }

  JointPose pose;
  const double widening = std::max(1.0, best->reduced_chi2());
  pose.camera_T_marker = best->refined.camera_T_marker;
  pose.covariance = best->refined.covariance * widening;
  pose.used = best->used;
  pose.misfit = std::sqrt(best->reduced_chi2());
  if (other &&
      angle_between(pose.camera_T_marker, other->refined.camera_T_marker) > kSameSolution) {
    pose.second = other->refined.camera_T_marker;
    pose.second_covariance = other->refined.covariance * widening;
    pose.log_likelihood_ratio = kTrust * 0.5 * std::abs(lead) / widening;
  }
  return pose;
}

}  // namespace harco
