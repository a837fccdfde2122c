#include "harco/mount.hpp"

#include <cmath>
#include <random>
#include <stdexcept>

#include <gtest/gtest.h>

#include "harco/error.hpp"

namespace harco {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

/// Where the image's right, the image's bottom and the optical axis point to on the vehicle.
Matrix3d axes(const Vector3d& right, const Vector3d& bottom, const Vector3d& forward) {
  Matrix3d body_R_camera;
  body_R_camera << right, bottom, forward;
  return body_R_camera;
}

const Vector3d kNose = Vector3d::UnitX(), kRight = Vector3d::UnitY(), kDown = Vector3d::UnitZ();

Matrix3d rotation_of(const std::string& yaml) { return parse_mount(yaml).body_T_camera.linear(); }

void expect_error(const std::string& yaml, const std::string& part) {
  try {
    parse_mount(yaml, "m.yaml");
    ADD_FAILURE() << "no error for: " << yaml;
  } catch (const Error& error) {
    const std::string what = error.what();
    EXPECT_EQ(what.rfind("m.yaml: ", 0), 0U) << what;
    EXPECT_NE(what.find(part), std::string::npos) << what;
  }
}

TEST(Mount, NamedDirectionsAreWhatAPersonSeesOnTheVehicle) {
  // Looking down with the image's top to the nose, the image's right side is the vehicle's.
  const Matrix3d down = axes(kRight, -kNose, kDown);
  EXPECT_EQ(rotation_of("{looks: down, image_top: nose}"), down);
  EXPECT_EQ(rotation_of("{looks: down}"), down);
  EXPECT_EQ(Mount().body_T_camera.linear(), down);
  // Turned by a quarter: the top to the right, so the image's right is the tail.
  EXPECT_EQ(rotation_of("{looks: down, image_top: right}"), axes(-kNose, -kRight, kDown));
  EXPECT_EQ(rotation_of("{looks: nose}"), axes(kRight, kDown, kNose));
  EXPECT_EQ(rotation_of("{looks: tail}"), axes(-kRight, kDown, -kNose));
  EXPECT_EQ(rotation_of("{looks: right, image_top: down}"), axes(kNose, -kDown, kRight));
}

TEST(Mount, EveryNamedMountIsARightHandedRotation) {
  for (const char* looks : {"nose", "tail", "right", "left", "up", "down"})
    for (const char* top : {"nose", "tail", "right", "left", "up", "down"}) {
      try {
        const Matrix3d r =
            rotation_of(std::string("{looks: ") + looks + ", image_top: " + top + "}");
        EXPECT_TRUE(r.isUnitary());
        EXPECT_DOUBLE_EQ(r.determinant(), 1.0) << looks << " " << top;
      } catch (const Error& error) {
        EXPECT_NE(std::string(error.what()).find("square to"), std::string::npos);
      }
    }
}

TEST(Mount, AnglesTurnTheCameraAboutTheBodysAxes) {
  // As with gimbals: pitch -90 looks down, the image's top to the nose.
  EXPECT_TRUE(rotation_of("roll_pitch_yaw_deg: [0, -90, 0]").isApprox(axes(kRight, -kNose, kDown)));
  EXPECT_TRUE(rotation_of("roll_pitch_yaw_deg: [0, 0, 90]").isApprox(axes(-kNose, kDown, kRight)));
  // A camera that looks down, then tilted by pitch 30: its axis swings to the nose.
  const Matrix3d tilted = rotation_of("{looks: down, roll_pitch_yaw_deg: [0, 30, 0]}");
  EXPECT_TRUE(tilted.col(2).isApprox(Vector3d(0.5, 0.0, std::sqrt(0.75))));
}

TEST(Mount, OffsetIsTheCamerasPlaceOnTheVehicle) {
  const Mount mount = parse_mount("%YAML:1.0\n---\nlooks: down\noffset_m: [0.1, -0.02, 0.05]\n");
  // A point 2 m in front of the lens is 2.05 m under the vehicle's origin.
  EXPECT_TRUE((mount.body_T_camera * Vector3d(0.0, 0.0, 2.0)).isApprox(Vector3d(0.1, -0.02, 2.05)));
  EXPECT_EQ(Mount().body_T_camera.translation(), Vector3d::Zero());
}

TEST(Mount, TextReadsBackAsTheSame) {
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  const auto next = [&] { return normal(random); };
  for (int i = 0; i < 100; ++i) {
    Mount mount;
    const Eigen::Quaterniond q(next(), next(), next(), next());
    mount.body_T_camera.linear() = q.normalized().toRotationMatrix();
    mount.body_T_camera.translation() = Vector3d(next(), next(), next());
    const Mount read = parse_mount(format_mount(mount));
    EXPECT_TRUE(read.body_T_camera.isApprox(mount.body_T_camera, 1e-14));
  }
  Mount mirrored;
  mirrored.body_T_camera.linear() = Vector3d(1.0, 1.0, -1.0).asDiagonal();
  EXPECT_THROW(format_mount(mirrored), std::invalid_argument);
}

TEST(Mount, SaysWhatIsWrong) {
  expect_error("[1, 2]", "not a mount's description");
  expect_error("offset_m: [0, 0, 0]", "'looks' is missing");
  expect_error("looks: ahead", "'looks' must be nose");
  expect_error("{looks: down, image_top: up}", "square to");
  expect_error("{looks: down, ofset_m: [0, 0, 0]}", "'ofset_m' is not known");
  expect_error("{looks: down, offset_m: [0, 0]}", "'offset_m' is not a list of 3 numbers");
  expect_error("{looks: down, offset_m: [0, .nan, 0]}", "element 1 is not a finite number");
  expect_error("quaternion_wxyz: [1, 1, 0, 0]", "length is not 1");
  expect_error("{looks: down, quaternion_wxyz: [1, 0, 0, 0]}", "nothing else");
  expect_error("looks: [", "not valid YAML at line 1");
  EXPECT_THROW(load_mount("/nonexistent/mount.yaml"), Error);
}

}  // namespace
}  // namespace harco
