// Mounts in words and in pictures.
#include "mount_check.hpp"

#include <cmath>
#include <string>

#include <gtest/gtest.h>

namespace harco::cli {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

bool contains(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

/// The stroke that begins in the image's middle in the colour of the nose.
Vector2d nose_arrow(const Overlay& overlay, const Camera& camera) {
  const Vector2d middle(0.5 * (camera.width - 1.0), 0.5 * (camera.height - 1.0));
  for (const Stroke& stroke : overlay.strokes)
    if (stroke.points.size() == 2 && stroke.points[0] == middle && stroke.colour.red > 200 &&
        stroke.colour.green < 100)
      return stroke.points[1] - stroke.points[0];
  return Vector2d::Zero();
}

bool has_label(const Overlay& overlay, const std::string& text) {
  for (const Label& label : overlay.labels)
    if (contains(label.text, text)) return true;
  return false;
}

TEST(NameOfDirection, IsTheNearestAndHowFarItIsOff) {
  EXPECT_EQ(name_of_direction(Vector3d::UnitX()), "nose");
  EXPECT_EQ(name_of_direction(-Vector3d::UnitX()), "tail");
  EXPECT_EQ(name_of_direction(Vector3d::UnitY()), "right");
  EXPECT_EQ(name_of_direction(-Vector3d::UnitY()), "left");
  EXPECT_EQ(name_of_direction(Vector3d::UnitZ()), "down");
  EXPECT_EQ(name_of_direction({0.0, 0.001, -1.0}), "up");
  const double angle = 12.0 * M_PI / 180.0;
  EXPECT_EQ(name_of_direction({std::sin(angle), 0.0, std::cos(angle)}),
            "down, 12 degrees towards the nose");
  EXPECT_EQ(name_of_direction({std::cos(angle), 0.0, -std::sin(angle)}),
            "nose, 12 degrees towards up");
}

TEST(MountText, NamesLookImageSidesAndPlace) {
  Mount mount = parse_mount("looks: down\nimage_top: right\noffset_m: [0.1, -0.02, 0]\n");
  const std::string text = mount_text(mount);
  EXPECT_TRUE(contains(text, "the camera looks:              down\n")) << text;
  EXPECT_TRUE(contains(text, "image top is the vehicle's:    right\n")) << text;
  EXPECT_TRUE(contains(text, "image right is the vehicle's:  tail\n")) << text;
  EXPECT_TRUE(contains(text, "0.10 m ahead and 0.02 m to the left\n")) << text;
  EXPECT_TRUE(contains(mount_text(Mount()), "at the vehicle's origin"));
}

TEST(PlaceText, IsSeenFromTheVehicle) {
  MarkerSet markers;
  markers.parents.push_back({1.0, {5, -1, parse_code("1010100010111000011010101"), {}}});
  Pose pose;
  pose.parent = 5;
  // The marker's middle 2 m along the axis of a camera that looks down and sits 0.5 m ahead.
  pose.camera_T_marker.translation() = Vector3d(-0.5, -0.5, 2.0);
  const Mount mount = parse_mount("looks: down\noffset_m: [0.5, 0, 0.1]\n");
  EXPECT_EQ(place_text(pose, markers, mount),
            "parent 5 is 2.10 m below and 0.50 m ahead of the vehicle");
}

TEST(MountOverlay, ArrowPointsToTheNose) {
  const Camera camera = Camera::pinhole(640, 480, 400.0);
  const auto arrow = [&](const std::string& yaml) {
    return nose_arrow(mount_overlay(parse_mount(yaml), camera), camera).normalized();
  };
  EXPECT_LT((arrow("looks: down\nimage_top: nose\n") - Vector2d(0.0, -1.0)).norm(), 1e-9);
  EXPECT_LT((arrow("looks: down\nimage_top: tail\n") - Vector2d(0.0, 1.0)).norm(), 1e-9);
  // Top to the right wing: the nose is at the image's left.
  EXPECT_LT((arrow("looks: down\nimage_top: right\n") - Vector2d(-1.0, 0.0)).norm(), 1e-9);
}

TEST(MountOverlay, ShowsHorizonOrNadirAsTheCameraSeesThem) {
  const Camera camera = Camera::pinhole(640, 480, 400.0);
  const Overlay down = mount_overlay(parse_mount("looks: down\n"), camera);
  EXPECT_TRUE(has_label(down, "straight below"));
  EXPECT_FALSE(has_label(down, "horizon"));
  EXPECT_TRUE(has_label(down, "image top is the vehicle's nose; the camera looks down"));

  const Overlay ahead = mount_overlay(parse_mount("looks: nose\n"), camera);
  EXPECT_TRUE(has_label(ahead, "horizon"));
  EXPECT_FALSE(has_label(ahead, "straight below"));
  // Level: the horizon runs through the image's middle row.
  for (const Stroke& stroke : ahead.strokes) {
    if (stroke.points.size() < 20) continue;
    for (const Vector2d& point : stroke.points) EXPECT_NEAR(point.y(), 239.5, 1e-6);
  }
}

}  // namespace
}  // namespace harco::cli
