#include "harco/sighting.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace harco {
namespace {

using Eigen::Matrix3d;
using Eigen::Quaterniond;
using Eigen::Vector3d;
using mavlink::LandingTarget;
using mavlink::TargetRelative;

Matrix3d cross_matrix(const Vector3d& v) {
  Matrix3d m;
  m << 0.0, -v.z(), v.y(), v.z(), 0.0, -v.x(), -v.y(), v.x(), 0.0;
  return m;
}

std::uint64_t microseconds(double time_s) {
  return static_cast<std::uint64_t>(std::max(0.0, std::round(time_s * 1e6)));
}

std::array<float, 4> wxyz(const Quaterniond& q) {
  return {static_cast<float>(q.w()), static_cast<float>(q.x()), static_cast<float>(q.y()),
          static_cast<float>(q.z())};
}

void set_position(LandingTarget& message, const Vector3d& position) {
  message.x = static_cast<float>(position.x());
  message.y = static_cast<float>(position.y());
  message.z = static_cast<float>(position.z());
  message.position_valid = 1;
}

/// What all variants have in common.
LandingTarget common_fields(const Sighting& sighting) {
  const Vector3d p = sighting.body_T_target.translation();
  LandingTarget message;
  message.time_usec = microseconds(sighting.time_s);
  // A target at the horizon or above it has angles up to a right one: those of its direction.
  message.angle_x = static_cast<float>(std::atan2(p.y(), std::max(p.z(), 0.0)));
  message.angle_y = static_cast<float>(std::atan2(-p.x(), std::max(p.z(), 0.0)));
  message.distance = static_cast<float>(sighting.distance());
  const double size = 2.0 * std::atan2(0.5 * sighting.side_m, sighting.distance());
  message.size_x = message.size_y = static_cast<float>(size);
  message.target_num = static_cast<std::uint8_t>(sighting.target);
  message.frame = mavlink::value::kFrameBodyFrd;
  message.q = wxyz(Quaterniond(sighting.body_T_target.linear()));
  message.type = mavlink::value::kLandingTargetVisionFiducial;
  return message;
}

}  // namespace

Sighting sight(const Pose& pose, const Mount& mount, const Vector3d& target_point, double side_m,
               double time_s) {
  const Eigen::Isometry3d body_T_marker = mount.body_T_camera * pose.camera_T_marker;
  if (!body_T_marker.matrix().allFinite() || !target_point.allFinite() || !std::isfinite(time_s))
    throw std::invalid_argument("sight: pose, mount, target point and time must be finite");
  Sighting sighting;
  sighting.time_s = time_s;
  sighting.target = pose.parent;
  sighting.side_m = side_m;
  sighting.body_T_target = body_T_marker * Eigen::Translation3d(target_point);
  if (!pose.covariance) return sighting;

  // camera_p = t + R Exp(w) m: its error is dt - R [m]x w.
  Eigen::Matrix<double, 3, 6> body_J;
  body_J.leftCols<3>() = mount.body_T_camera.linear();
  body_J.rightCols<3>() = -body_T_marker.linear() * cross_matrix(target_point);
  sighting.position_covariance = body_J * *pose.covariance * body_J.transpose();
  sighting.yaw_sd_rad = std::sqrt(std::max(0.0, (*pose.covariance)(5, 5)));
  return sighting;
}

LandingTarget landing_target_body(const Sighting& sighting) {
  LandingTarget message = common_fields(sighting);
  set_position(message, sighting.body_T_target.translation());
  return message;
}

std::optional<LandingTarget> landing_target_ned(const Sighting& sighting,
                                                const VehiclePose& vehicle) {
  if (!vehicle.ned_p_body) return std::nullopt;
  LandingTarget message = common_fields(sighting);
  message.frame = mavlink::value::kFrameLocalNed;
  set_position(message,
               *vehicle.ned_p_body + vehicle.ned_R_body * sighting.body_T_target.translation());
  message.q = wxyz(vehicle.ned_R_body * Quaterniond(sighting.body_T_target.linear()));
  return message;
}

std::optional<LandingTarget> landing_target_angles(const Sighting& sighting) {
  if (!(sighting.body_T_target.translation().z() > 0.0)) return std::nullopt;
  return common_fields(sighting);
}

std::optional<TargetRelative> target_relative(const Sighting& sighting,
                                              const VehiclePose& vehicle) {
  if (!sighting.position_covariance) return std::nullopt;
  const Vector3d p = sighting.body_T_target.translation();
  const Vector3d sd = sighting.position_covariance->diagonal().cwiseMax(0.0).cwiseSqrt();
  TargetRelative message;
  message.timestamp = microseconds(sighting.time_s);
  message.x = static_cast<float>(p.x());
  message.y = static_cast<float>(p.y());
  message.z = static_cast<float>(p.z());
  for (std::size_t i = 0; i < 3; ++i)
    message.pos_std[i] = static_cast<float>(sd[static_cast<Eigen::Index>(i)]);
  message.yaw_std = static_cast<float>(sighting.yaw_sd_rad);
  message.q_target = wxyz(vehicle.ned_R_body * Quaterniond(sighting.body_T_target.linear()));
  message.q_sensor = wxyz(vehicle.ned_R_body);
  message.id = static_cast<std::uint8_t>(sighting.target);
  message.frame = mavlink::value::kTargetFrameBodyFrd;
  message.type = mavlink::value::kLandingTargetVisionFiducial;
  return message;
}

}  // namespace harco
