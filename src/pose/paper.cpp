#include "pose/paper.hpp"

#include <Eigen/Geometry>
#include <Eigen/SVD>

#include "pose/planar.hpp"

namespace harco {
namespace {

using Eigen::Isometry3d;
using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

/// The rotation nearest to a matrix in the sense of Frobenius. Of a weighted sum of rotations it is
/// their chordal mean.
Matrix3d nearest_rotation(const Matrix3d& matrix) {
  const Eigen::JacobiSVD<Matrix3d> svd(matrix, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Vector3d signs = Vector3d::Ones();
  signs.z() = (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0.0 ? -1.0 : 1.0;
  return svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose();
}

}  // namespace

Isometry3d homography_pose(const Observation& seen) {
  const Vector2d origin = seen.plane.col(0);
  const Matrix3d h = homography(seen.plane.colwise() - origin, seen.image);
  // The first two columns are a rotation's but for a common scale and for noise. The marker is
  // before the camera: h33 > 0, as homography() gives it for a corner of the quad, fixes the sign.
  const double scale = 2.0 / (h.col(0).norm() + h.col(1).norm());
  Matrix3d rotation;
  rotation << scale * h.col(0), scale * h.col(1), scale * scale * h.col(0).cross(h.col(1));
  Isometry3d pose = Isometry3d::Identity();
  pose.linear() = nearest_rotation(rotation);
  pose.translation() = scale * h.col(2);
  return pose;
}

Isometry3d average_of_homography_poses(std::span<const Observation> observations) {
  Matrix3d rotation = Matrix3d::Zero();
  Vector3d translation = Vector3d::Zero();
  double weight = 0.0;
  for (const Observation& seen : observations) {
    const Isometry3d own = homography_pose(seen);
    const Isometry3d pose = own * Eigen::Translation3d(-seen.plane(0, 0), -seen.plane(1, 0), 0.0);
    rotation += seen.area_px * pose.linear();
    translation += seen.area_px * pose.translation();
    weight += seen.area_px;
  }
  Isometry3d mean = Isometry3d::Identity();
  mean.linear() = nearest_rotation(rotation);
  mean.translation() = translation / weight;
  return mean;
}

}  // namespace harco
