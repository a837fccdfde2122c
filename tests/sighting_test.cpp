#include "harco/sighting.hpp"

#include <cmath>
#include <limits>
#include <stdexcept>

#include <gtest/gtest.h>

namespace harco {
namespace {

using Eigen::Matrix3d;
using Eigen::Quaterniond;
using Eigen::Vector3d;
using mavlink::LandingTarget;

const double kPi = std::acos(-1.0);

/// A marker of 0.4 m flat on the ground, its top to the nose, its middle at a point of the camera
/// frame.
Pose pose_with_middle_at(const Vector3d& camera_p_middle) {
  Pose pose;
  pose.parent = 3;
  pose.camera_T_marker.translation() = camera_p_middle - Vector3d(0.2, 0.2, 0.0);
  return pose;
}
const Vector3d kMiddle(0.2, 0.2, 0.0);

Vector3d position(const LandingTarget& m) { return Eigen::Vector3f(m.x, m.y, m.z).cast<double>(); }

TEST(Sighting, CameraOffsetAndRotationLeadToTheBodyFrame) {
  Mount mount;
  mount.body_T_camera.translation() = Vector3d(0.1, 0.0, 0.05);
  const Sighting sighting = sight(pose_with_middle_at({0.3, -0.5, 2.0}), mount, kMiddle, 0.4, 12.5);
  // 0.3 right in the image is 0.3 to the right, 0.5 up in the image is 0.5 ahead.
  EXPECT_TRUE(sighting.body_T_target.translation().isApprox(Vector3d(0.6, 0.3, 2.05)));
  EXPECT_FALSE(sighting.position_covariance);

  const LandingTarget message = landing_target_body(sighting);
  EXPECT_EQ(message.position_valid, 1);
  EXPECT_EQ(message.frame, 12);
  EXPECT_EQ(message.type, 2);
  EXPECT_EQ(message.target_num, 3);
  EXPECT_EQ(message.time_usec, 12500000U);
  EXPECT_LT((position(message) - Vector3d(0.6, 0.3, 2.05)).norm(), 1e-6);
  EXPECT_NEAR(message.distance, std::sqrt(0.36 + 0.09 + 4.2025), 1e-6);
  // The marker's x axis is the image's right, thus the vehicle's: a quarter turn about down.
  EXPECT_NEAR(message.q[0], std::sqrt(0.5), 1e-6);
  EXPECT_NEAR(message.q[3], std::sqrt(0.5), 1e-6);
  EXPECT_NEAR(message.size_x, 2.0 * std::atan(0.2 / static_cast<double>(message.distance)), 1e-6);
}

TEST(Sighting, AnglesAreWhatArduPilotMakesADirectionOf) {
  const Sighting sighting =
      sight(pose_with_middle_at({0.3, -0.5, 2.0}), Mount(), kMiddle, 0.4, 0.0);
  const LandingTarget message = *landing_target_angles(sighting);
  EXPECT_EQ(message.position_valid, 0);
  // It takes (-tan(angle_y), tan(angle_x), 1) for the direction in the body frame.
  const Vector3d direction =
      Eigen::Vector3f(-std::tan(message.angle_y), std::tan(message.angle_x), 1.0F).cast<double>();
  EXPECT_LT(
      (direction.normalized() * static_cast<double>(message.distance) - Vector3d(0.5, 0.3, 2.0))
          .norm(),
      1e-6);
}

TEST(Sighting, ATargetThatIsntBelowHasNoAngles) {
  EXPECT_FALSE(
      landing_target_angles(sight(pose_with_middle_at({0, 0, -1}), Mount(), kMiddle, 0.4, 0)));
}

TEST(Sighting, NedNeedsTheVehiclesPlaceAndAttitude) {
  // Nose to the east, level: ahead is east, right is south.
  VehiclePose vehicle;
  vehicle.ned_R_body = Eigen::AngleAxisd(kPi / 2.0, Vector3d::UnitZ());
  const Sighting sighting =
      sight(pose_with_middle_at({0.25, -1.0, 3.0}), Mount(), kMiddle, 0.4, 0.0);
  EXPECT_FALSE(landing_target_ned(sighting, vehicle));
  vehicle.ned_p_body = Vector3d(10.0, 20.0, -5.0);
  const LandingTarget message = *landing_target_ned(sighting, vehicle);
  EXPECT_EQ(message.frame, 1);
  EXPECT_EQ(message.position_valid, 1);
  EXPECT_LT((position(message) - Vector3d(9.75, 21.0, -2.0)).norm(), 1e-5);
  // Marker x is right is south: half a turn about down from north.
  EXPECT_NEAR(std::abs(message.q[3]), 1.0, 1e-6);
}

TEST(Sighting, CovarianceOfTheTargetPointFollowsFromThePose) {
  Pose pose = pose_with_middle_at({0.3, -0.5, 2.0});
  pose.camera_T_marker.linear() =
      (Eigen::AngleAxisd(0.7, Vector3d(0.2, -0.4, 0.5).normalized())).toRotationMatrix();
  Eigen::Matrix<double, 6, 6> root;
  for (int i = 0; i < 36; ++i) root.data()[i] = 1e-3 * std::sin(1.7 * i);
  pose.covariance = root * root.transpose();
  const Mount mount = [] {
    Mount m;
    m.body_T_camera.linear() = Eigen::AngleAxisd(0.4, Vector3d::UnitX()).toRotationMatrix();
    m.body_T_camera.translation() = Vector3d(0.3, 0.2, 0.1);
    return m;
  }();
  const Sighting sighting = sight(pose, mount, kMiddle, 0.4, 0.0);

  // The same by differences: each column of the root is one deviation.
  Matrix3d expected = Matrix3d::Zero();
  const double h = 1e-4;
  for (int i = 0; i < 6; ++i) {
    const Eigen::Matrix<double, 6, 1> d = h * root.col(i);
    Pose moved = pose;
    moved.camera_T_marker.translation() += d.head<3>();
    const Vector3d w = d.tail<3>();
    moved.camera_T_marker.linear() *=
        Eigen::AngleAxisd(w.norm(), w.normalized()).toRotationMatrix();
    const Vector3d change = (sight(moved, mount, kMiddle, 0.4, 0.0).body_T_target.translation() -
                             sighting.body_T_target.translation()) /
                            h;
    expected += change * change.transpose();
  }
  EXPECT_LT((*sighting.position_covariance - expected).norm(), 1e-5 * expected.norm());

  const auto message = target_relative(sighting, VehiclePose());
  ASSERT_TRUE(message);
  EXPECT_NEAR(message->pos_std[1], std::sqrt(expected(1, 1)), 1e-8);
  EXPECT_NEAR(message->yaw_std, std::sqrt((*pose.covariance)(5, 5)), 1e-8);
  EXPECT_EQ(message->frame, 1);
  EXPECT_EQ(message->q_sensor[0], 1.0F);
  EXPECT_FALSE(
      target_relative(sight(pose_with_middle_at({0, 0, 1}), Mount(), kMiddle, 0.4, 0), {}));
}

TEST(Sighting, NothingThatIsntFinitePasses) {
  Pose pose;
  pose.camera_T_marker.translation().x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(sight(pose, Mount(), kMiddle, 0.4, 0.0), std::invalid_argument);
}

}  // namespace
}  // namespace harco
