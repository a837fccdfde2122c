#include <cmath>
#include <stdexcept>

#include "harco/deck.hpp"

namespace harco {
namespace {

Eigen::Matrix3d cross(const Eigen::Vector3d& v) {
  Eigen::Matrix3d m;
  m << 0.0, -v.z(), v.y(), v.z(), 0.0, -v.x(), -v.y(), v.x(), 0.0;
  return m;
}

}  // namespace

DeckSample deck_sample(const Pose& pose, const CameraState& camera, double time_s,
                       const Eigen::Vector3d& touchdown_point) {
  if (!pose.covariance) throw std::invalid_argument("deck sample: the pose has no covariance");
  const Eigen::Matrix3d camera_R_marker = pose.camera_T_marker.linear();
  const Eigen::Matrix3d level_R_marker = camera.level_R_camera * camera_R_marker;
  const Eigen::Vector3d point = pose.camera_T_marker * touchdown_point;  // camera frame
  const Eigen::RowVector3d down = camera.level_R_camera.row(2);          // camera frame

  DeckSample sample;
  sample.time_s = time_s;
  const double roll = std::atan2(level_R_marker(2, 1), level_R_marker(2, 2));
  const double pitch =
      std::atan2(-level_R_marker(2, 0), std::hypot(level_R_marker(2, 1), level_R_marker(2, 2)));
  sample.motion = {roll, pitch, camera.height_m - down.dot(point)};

  // d(roll, pitch) by a small rotation on the marker's side.
  Eigen::Matrix<double, 2, 3> angles_by_turn;
  angles_by_turn << 1.0, std::sin(roll) * std::tan(pitch), std::cos(roll) * std::tan(pitch),  //
      0.0, std::cos(roll), -std::sin(roll);
  // d(motion) by (dt, w) of the pose, w of the attitude, the height.
  Eigen::Matrix<double, 3, 6> by_pose = Eigen::Matrix<double, 3, 6>::Zero();
  by_pose.block<2, 3>(0, 3) = angles_by_turn;
  by_pose.block<1, 3>(2, 0) = -down;
  by_pose.block<1, 3>(2, 3) = down * camera_R_marker * cross(touchdown_point);
  Eigen::Matrix3d by_attitude;
  by_attitude.topRows<2>() = angles_by_turn * camera_R_marker.transpose();
  by_attitude.row(2) = down * cross(point);
  sample.covariance = by_pose * *pose.covariance * by_pose.transpose() +
                      by_attitude * camera.attitude_covariance * by_attitude.transpose();
  sample.covariance(kHeave, kHeave) += camera.height_sd_m * camera.height_sd_m;

  if (!std::isfinite(time_s) || !sample.motion.allFinite() || !sample.covariance.allFinite())
    throw std::invalid_argument("deck sample: pose, camera state and time must be finite");
  return sample;
}

}  // namespace harco
