// Infinitesimal plane-based pose (Collins and Bartoli 2014): both poses of a plane in closed form
// from the homography's derivative at one point.
#include "pose/planar.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Geometry>
#include <Eigen/LU>

namespace harco {
namespace {

using Eigen::Isometry3d;
using Eigen::Matrix2d;
using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

/// Both rotations, from the homography H (h33 = 1) of a plane whose origin is the point of
/// expansion.
///
/// There the image is v = (h13, h23) and the derivative of the image by the plane's coordinates is
/// J. For a pose R, t it is also J = 1 / t_z [I | -v] (r1 r2), and v = (t_x, t_y) / t_z.
/// Let Rv turn the z axis into the line of sight (v, 1). Then [I | -v] Rv = (B | 0), because the
/// line of sight itself has no image motion; with S = Rv^T R, this leaves J = 1 / t_z B S22,
/// S22 the upper left 2 x 2 of S.
/// So A = B^-1 J is S22 up to the scale 1 / t_z. The columns of S are orthonormal:
/// S22^T S22 + b b^T = I, b^T the third row of the first two columns. Hence one singular value of
/// S22 is 1, the greatest: it gives the scale. And b follows from b b^T but for its sign: the two
/// solutions.
std::array<Matrix3d, 2> rotations(const Matrix3d& h) {
  const Vector2d v = h.topRightCorner<2, 1>();
  const Matrix2d j = h.topLeftCorner<2, 2>() - v * h.bottomLeftCorner<1, 2>();
  const Matrix3d turn =
      Eigen::Quaterniond::FromTwoVectors(Vector3d::UnitZ(), Vector3d(v.x(), v.y(), 1.0))
          .toRotationMatrix();
  const Matrix2d b = turn.topLeftCorner<2, 2>() - v * turn.bottomLeftCorner<1, 2>();
  const Matrix2d a = b.inverse() * j;

  // Greatest eigenvalue of A^T A, whose root is the greatest singular value of A.
  const Matrix2d square = a.transpose() * a;
  const double half_trace = 0.5 * square.trace();
  const double scale =
      std::sqrt(half_trace + std::hypot(0.5 * (square(0, 0) - square(1, 1)), square(0, 1)));
  const Matrix2d s22 = a / scale;

  const Matrix2d outer = Matrix2d::Identity() - s22.transpose() * s22;  // b b^T
  const double b0 = std::sqrt(std::max(0.0, outer(0, 0)));
  const double b1 = std::copysign(std::sqrt(std::max(0.0, outer(1, 1))), outer(0, 1));
  std::array<Matrix3d, 2> result;
  for (std::size_t i = 0; i < 2; ++i) {
    const double sign = i == 0 ? 1.0 : -1.0;
    const Vector3d first = Vector3d(s22(0, 0), s22(1, 0), sign * b0).normalized();
    Vector3d second(s22(0, 1), s22(1, 1), sign * b1);
    second = (second - first * first.dot(second)).normalized();
    Matrix3d s;
    s << first, second, first.cross(second);
    result[i] = turn * s;
  }
  return result;
}

/// The translation that fits best for a given rotation: (X + t)_xy = n (X + t)_z is linear in t.
Vector3d translation(const Matrix3d& rotation, const Points& plane, const Points& image) {
  Matrix3d normal = Matrix3d::Zero();
  Vector3d right = Vector3d::Zero();
  for (Eigen::Index i = 0; i < plane.cols(); ++i) {
    const Vector3d point = rotation.leftCols<2>() * plane.col(i);
    Eigen::Matrix<double, 2, 3> row;
    row << 1.0, 0.0, -image(0, i), 0.0, 1.0, -image(1, i);
    normal += row.transpose() * row;
    right -= row.transpose() * (row * point);
  }
  return normal.inverse() * right;
}

/// Root mean square of the coordinates' reprojection errors; infinite if a point is behind.
double reprojection_rms(const Isometry3d& pose, const Points& plane, const Points& image) {
  double sum = 0.0;
  for (Eigen::Index i = 0; i < plane.cols(); ++i) {
    const Vector3d point = pose * Vector3d(plane(0, i), plane(1, i), 0.0);
    if (!(point.z() > 0.0)) return std::numeric_limits<double>::infinity();
    sum += (point.head<2>() / point.z() - image.col(i)).squaredNorm();
  }
  return std::sqrt(sum / static_cast<double>(2 * plane.cols()));
}

}  // namespace

PlanarPoses planar_poses(const Points& plane, const Points& image) {
  require_correspondences(plane, image);
  const Vector2d centre = plane.rowwise().mean();
  Matrix3d to_centre = Matrix3d::Identity();
  to_centre.topRightCorner<2, 1>() = centre;
  Matrix3d h = homography(plane, image) * to_centre;
  h /= h(2, 2);

  PlanarPoses poses;
  const std::array<Matrix3d, 2> both = rotations(h);
  for (std::size_t i = 0; i < 2; ++i) {
    poses.camera_T_plane[i].linear() = both[i];
    poses.camera_T_plane[i].translation() = translation(both[i], plane, image);
    poses.camera_T_plane[i].makeAffine();
    poses.rms[i] = reprojection_rms(poses.camera_T_plane[i], plane, image);
  }
  if (poses.rms[1] < poses.rms[0]) {
    std::swap(poses.rms[0], poses.rms[1]);
    std::swap(poses.camera_T_plane[0], poses.camera_T_plane[1]);
  }
  return poses;
}

PlanarPoses solve_planar_pose(const std::vector<Vector2d>& plane_points,
                              const std::vector<Vector2d>& normalised_points) {
  return planar_poses(columns(plane_points), columns(normalised_points));
}

}  // namespace harco
