// Detections -> poses: where the parents stand before the camera (paper, section 3.4 d).
#pragma once

#include <array>
#include <optional>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "harco/camera.hpp"
#include "harco/detect.hpp"
#include "harco/image.hpp"
#include "harco/marker.hpp"

namespace harco {

using Matrix6d = Eigen::Matrix<double, 6, 6>;

/// From this log-likelihood ratio on, odds of 400 to 1, the likelier of two solutions counts as
/// decided.
constexpr double kDecidedLogRatio = 6.0;

/// How several markers of one parent become one pose.
enum class Fusion {
  joint,  ///< the best that we have: one solution over everything seen of a parent
  paper   ///< the paper's: every marker's homography pose, averaged by its area in the image
};

/// Pose of one parent.
struct Pose {
  int parent = 0;  ///< id
  Eigen::Isometry3d camera_T_marker = Eigen::Isometry3d::Identity();

  /// Covariance of (dt, w) with t_true = t + dt in the camera frame (metres) and
  /// R_true = R Exp(w) (radians, marker side). Empty where unknown.
  std::optional<Matrix6d> covariance;

  double rms_px = 0.0;          ///< root mean square of the residuals' coordinates
  int markers = 0;              ///< how many markers it was made from
  std::vector<int> detections;  ///< their indices in the list given

  /// A plane seen from afar has a second solution, about its mirrored tilt. It stands here where
  /// the evidence leaves it possible; the covariance then covers both. A pose without alternative
  /// is decided.
  std::optional<Eigen::Isometry3d> alternative;
  /// Natural logarithm of the likelihood of this pose over that of the alternative, 0 …
  /// kDecidedLogRatio: the alternative is right with probability 1 / (1 + exp(ratio)). There if and
  /// only if the alternative is.
  std::optional<double> log_likelihood_ratio;

  /// Whether pose and covariance come from the grey values; otherwise they are the corners'.
  bool aligned = false;
  /// Of the pixels compared: the share that fits, 0 … 1. What is covered, in another light or
  /// dirty doesn't. Zero where not aligned.
  double share_used = 0.0;
};

/// Which way is down, as an accelerometer or a gimbal tells, and how the marker stands to it.
struct GravityPrior {
  Eigen::Vector3d in_camera = Eigen::Vector3d::UnitZ();  ///< direction of gravity, camera frame

  /// The same direction in the marker's frame. A marker that lies on the ground: z, into the
  /// ground. One that hangs upright on a wall: y.
  Eigen::Vector3d in_marker = Eigen::Vector3d::UnitZ();

  double sigma_rad = 0.09;  ///< how far both may disagree, standard deviation
};

struct PoseOptions {
  Fusion fusion = Fusion::joint;

  /// After Fusion::joint: align the marker's own picture to the image's grey values, down to the
  /// noise. Where that doesn't converge or doesn't fit, the corners' pose stands.
  bool align = true;

  /// Of Fusion::joint: helps to tell the two solutions of a small marker's pose. It does not change
  /// a pose otherwise.
  std::optional<GravityPrior> gravity = std::nullopt;
};

/// Poses of all parents that are seen, best evidence (greatest area in the image) first; a parent
/// seen twice has two. Empty without detections. Tentative detections, those beyond the lens's
/// range and those that contradict better evidence take no part. Corners are enough: an empty view
/// stands for an image that isn't at hand. Throws std::invalid_argument if a detection is not of
/// this set, its corners are not finite and convex or their covariance is not positive definite,
/// if the image's size is not the camera's, or for a gravity without direction or sigma.
std::vector<Pose> estimate_poses(const ImageView& image, const std::vector<Detection>& detections,
                                 const MarkerSet& markers, const Camera& camera,
                                 const PoseOptions& options = {});

/// Both poses of a square seen in a plane, better one first, with their reprojection errors
/// (root mean square, in units of the normalised image). Method: infinitesimal plane-based pose
/// (Collins and Bartoli 2014).
struct PlanarPoses {
  std::array<Eigen::Isometry3d, 2> camera_T_plane;
  std::array<double, 2> rms{};
};

/// `plane_points` lie in z = 0; `normalised_points` are undistorted image points (X/Z, Y/Z). At
/// least four, not all on a line; otherwise std::invalid_argument.
PlanarPoses solve_planar_pose(const std::vector<Eigen::Vector2d>& plane_points,
                              const std::vector<Eigen::Vector2d>& normalised_points);

/// Homography H with image ~ H * plane for at least four correspondences (normalised DLT). Throws
/// std::invalid_argument for degenerate input.
Eigen::Matrix3d fit_homography(const std::vector<Eigen::Vector2d>& plane_points,
                               const std::vector<Eigen::Vector2d>& image_points);

}  // namespace harco
