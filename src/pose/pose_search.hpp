// Where corners leave a pose open: poses under which the picture is bright and dark where the
// marker is.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Geometry>

#include "harco/camera.hpp"
#include "harco/image.hpp"
#include "pose/ink_outline.hpp"
#include "pose/observation.hpp"

namespace harco {

/// A pose that is roughly right, and how roughly.
struct RoughPose {
  Eigen::Isometry3d camera_T_marker = Eigen::Isometry3d::Identity();
  Matrix6d covariance = Matrix6d::Zero();  ///< of (dt, w) as in Pose
  double agreement = 0.0;                  ///< of the image with it, see PoseSearch
};

/// Compares what is seen of a marker's square, and of the paper around it, with the image at places
/// that are of one colour all around.
class PoseSearch {
 public:
  /// `quiet_m` is the width of the paper, that of a cell. All that is given is used later.
  PoseSearch(const ImageView& image, const InkOutline& outline, double quiet_m,
             const Camera& camera, std::span<const Observation> seen);

  /// Correlation of the image's grey values with the marker's colours; 0 if too little is in view.
  double agreement(const Eigen::Isometry3d& camera_T_marker) const;

  /// The other pose under which the corners of what is seen are nearly where this one has them;
  /// empty if they tell the two apart by more than `most_px`, root mean square.
  std::optional<RoughPose> mirrored(const Eigen::Isometry3d& camera_T_marker, double most_px) const;

  /// Poses that agree well, best first, a few at most, each in a neighbourhood of its own. They are
  /// looked for at all tilts, from `start`, near where the corners of `seen` put the marker; those
  /// may be wrong by a share of their marker's side.
  std::vector<RoughPose> find(const Eigen::Isometry3d& start) const;

 private:
  /// A place of the marker that is of one colour all around.
  struct Probe {
    float x, y;  ///< in the plane, metres
    float white;
  };
  struct Candidate {
    Eigen::Isometry3d pose;
    double agreement;
  };
  struct Corners;

  static std::vector<Probe> probes_of(const InkOutline& outline, double cell_m);
  static std::vector<Candidate> best_apart(std::vector<Candidate> all, std::size_t most,
                                           double apart);
  Eigen::Isometry3d moved_by(const Eigen::Isometry3d& pose,
                             const Eigen::Matrix<double, 6, 1>& by) const;
  double agreement(const Eigen::Isometry3d& pose, std::size_t stride) const;
  std::optional<Corners> corners(const Eigen::Isometry3d& pose) const;
  std::optional<Eigen::Isometry3d> settled(Eigen::Isometry3d pose) const;
  std::vector<Candidate> tilts(const Eigen::Isometry3d& start) const;
  void climb(Candidate& candidate) const;
  Matrix6d covariance(const Eigen::Isometry3d& pose) const;

  const ImageView& image_;
  const Camera& camera_;
  std::span<const Observation> seen_;
  bool bends_;  ///< whether the lens bends lines
  std::vector<Probe> probes_;
  Eigen::Vector3d centre_ = Eigen::Vector3d::Zero();  ///< of the corners, on the marker
  std::vector<double> corner_sigma_;                  ///< of each observation, normalised
};

}  // namespace harco
