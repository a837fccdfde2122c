#include "harco/camera.hpp"

#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <random>
#include <stdexcept>

#include <gtest/gtest.h>

#include "harco/error.hpp"

namespace harco {
namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;
using Eigen::Vector3d;

Camera with(LensModel lens, std::array<double, 8> coefficients) {
  Camera camera;
  camera.width = 752;
  camera.height = 480;
  camera.fx = 700.0;
  camera.fy = 690.0;
  camera.cx = 380.0;
  camera.cy = 235.0;
  camera.lens = lens;
  camera.coefficients = coefficients;
  return camera;
}

std::vector<Camera> lenses() {
  return {with(LensModel::brown_conrady, {}),
          with(LensModel::brown_conrady, {-0.28, 0.09, 0.0012, -0.0008, -0.01}),
          with(LensModel::brown_conrady, {0.1, 0.02, -0.002, 0.001, 0.0}),
          with(LensModel::brown_conrady, {0.4, -0.2, 0.001, -0.002, 0.05, 0.3, -0.1, 0.02}),
          with(LensModel::equidistant, {}),
          with(LensModel::equidistant, {-0.02, 0.004, -0.003, 0.001})};
}

TEST(Camera, PinholeHasItsAxisInTheMiddle) {
  const Camera camera = Camera::pinhole(750, 480, 700.0);
  EXPECT_FALSE(camera.has_distortion());
  EXPECT_EQ(camera.project({0.0, 0.0, 2.0}), Vector2d(374.5, 239.5));
  // 0.5 m to the right at 2 m: 700 * 0.25 = 175 pixels.
  EXPECT_EQ(camera.project({0.5, 0.0, 2.0}), Vector2d(374.5 + 175.0, 239.5));
  EXPECT_LT((*camera.to_ideal({12.0, 34.0}) - Vector2d(12.0, 34.0)).norm(), 1e-12);
  EXPECT_EQ(camera.matrix().row(1), Eigen::RowVector3d(0.0, 700.0, 239.5));
}

TEST(Camera, DistortsAsComputedByHand) {
  // x = 0.5, y = 0, s = 0.25: factor 1 + 0.2 * 0.25 + 0.4 * 0.0625 = 1.075, p2 (s + 2 x x) =
  // 0.0075.
  const Camera brown = with(LensModel::brown_conrady, {0.2, 0.4, 0.02, 0.01});
  EXPECT_TRUE(brown.distort({0.5, 0.0}).isApprox(Vector2d(0.5 * 1.075 + 0.0075, 0.02 * 0.25)));
  // x = 0, y = 1: (1 + 0.1) / (1 + 0.25) = 0.88.
  const Camera rational = with(LensModel::brown_conrady, {0.1, 0.0, 0.0, 0.0, 0.0, 0.25, 0.0, 0.0});
  EXPECT_TRUE(rational.distort({0.0, 1.0}).isApprox(Vector2d(0.0, 0.88)));
  // A ray at 45 degrees: theta = pi / 4, radius theta (1 + 0.1 theta^2).
  const Camera fisheye = with(LensModel::equidistant, {0.1});
  const double theta = std::acos(-1.0) / 4.0;
  EXPECT_TRUE(fisheye.distort({0.6, 0.8})
                  .isApprox(theta * (1.0 + 0.1 * theta * theta) * Vector2d(0.6, 0.8)));
}

TEST(Camera, ProjectsAsOpenCvDoes) {
  // cv::projectPoints and cv::fisheye::projectPoints of OpenCV 4.6.
  const Vector3d point(0.3, -0.2, 1.25);
  const std::vector<Camera> cameras = lenses();
  EXPECT_LT((*cameras[1].project(point) - Vector2d(544.014352705782, 127.257411650486)).norm(),
            1e-9);
  EXPECT_LT((*cameras[3].project(point) - Vector2d(548.922404651037, 123.974712372176)).norm(),
            1e-9);
  EXPECT_LT((*cameras[5].project(point) - Vector2d(543.306266885815, 127.684453189321)).norm(),
            1e-9);
}

TEST(Camera, JacobiansAgreeWithDifferences) {
  constexpr double kStep = 1e-6;
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(-0.6, 0.6);
  for (const Camera& camera : lenses())
    for (int trial = 0; trial < 50; ++trial) {
      const Vector3d point(uniform(random), uniform(random), 1.0 + std::abs(uniform(random)));
      Eigen::Matrix<double, 2, 3> projected;
      const std::optional<Vector2d> pixel = camera.project(point, &projected);
      ASSERT_TRUE(pixel);
      for (int axis = 0; axis < 3; ++axis) {
        const Vector3d step = kStep * Vector3d::Unit(axis);
        const Vector2d difference =
            (*camera.project(point + step) - *camera.project(point - step)) / (2.0 * kStep);
        EXPECT_LT((difference - projected.col(axis)).norm(), 1e-4);
      }
      Matrix2d unprojected;
      ASSERT_TRUE(camera.unproject(*pixel, &unprojected));
      for (int axis = 0; axis < 2; ++axis) {
        const Vector2d step = 1e-3 * Vector2d::Unit(axis);
        const Vector2d difference =
            (*camera.unproject(*pixel + step) - *camera.unproject(*pixel - step)) / 2e-3;
        EXPECT_LT((difference - unprojected.col(axis)).norm(), 1e-8);
      }
    }
}

TEST(Camera, UndistortInvertsDistort) {
  for (const Camera& camera : lenses())
    for (double x = -1.0; x <= 1.0; x += 0.125)
      for (double y = -0.75; y <= 0.75; y += 0.125) {
        const Vector2d ray(x, y);
        if (!camera.in_range(ray)) continue;
        const std::optional<Vector2d> back = camera.undistort(camera.distort(ray));
        ASSERT_TRUE(back) << ray.transpose();
        EXPECT_LT((*back - ray).norm(), 1e-11) << ray.transpose();
        const Vector2d pixel = *camera.project({x, y, 1.0});
        EXPECT_LT((*camera.from_ideal(*camera.to_ideal(pixel)) - pixel).norm(), 1e-8);
      }
}

TEST(Camera, KnowsWhereTheLensEnds) {
  // r (1 - 0.3 r^2) turns back at r = sqrt(1 / 0.9), where it reaches 2/3 of that.
  const Camera barrel = with(LensModel::brown_conrady, {-0.3});
  const double end = std::sqrt(1.0 / 0.9);
  EXPECT_TRUE(barrel.in_range({end - 1e-9, 0.0}));
  EXPECT_FALSE(barrel.in_range({end + 1e-9, 0.0}));
  EXPECT_TRUE(barrel.undistort({0.0, end * 2.0 / 3.0 - 1e-6}));
  EXPECT_FALSE(barrel.undistort({0.0, end * 2.0 / 3.0 + 1e-6}));
  EXPECT_FALSE(barrel.project({1.1, 0.0, 1.0}));

  // Beyond a dip, the image grows again: still outside, since two rays meet in one pixel.
  // 1 - 4.5 s + 2.5 s^2 is negative from s = 0.26 to 1.54.
  const Camera dip = with(LensModel::brown_conrady, {-1.5, 0.5});
  EXPECT_TRUE(dip.in_range({0.5, 0.0}));
  EXPECT_FALSE(dip.in_range({0.6, 0.0}));
  EXPECT_FALSE(dip.in_range({2.0, 0.0}));

  // A pole: 1 / (1 - 0.5 s) at s = 2.
  const Camera pole = with(LensModel::brown_conrady, {0.0, 0.0, 0.0, 0.0, 0.0, -0.5});
  EXPECT_TRUE(pole.in_range({1.4, 0.0}));
  EXPECT_FALSE(pole.in_range({1.5, 0.0}));

  // theta (1 - 0.4 theta^2) turns back at theta = sqrt(1 / 1.2).
  const Camera fisheye = with(LensModel::equidistant, {-0.4});
  const double theta = std::sqrt(1.0 / 1.2);
  EXPECT_TRUE(fisheye.in_range({std::tan(theta - 1e-6), 0.0}));
  EXPECT_FALSE(fisheye.in_range({std::tan(theta + 1e-6), 0.0}));
  EXPECT_TRUE(fisheye.undistort({theta * 2.0 / 3.0 - 1e-6, 0.0}));
  EXPECT_FALSE(fisheye.undistort({theta * 2.0 / 3.0 + 1e-6, 0.0}));
  EXPECT_FALSE(with(LensModel::equidistant, {}).undistort({1.6, 0.0}));
}

TEST(Camera, ImagesNothingBehindItOrInfinite) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  for (const Camera& camera : lenses()) {
    EXPECT_FALSE(camera.project({0.0, 0.0, -1.0}));
    EXPECT_FALSE(camera.project({0.0, 0.0, 0.0}));
    EXPECT_FALSE(camera.project({kNan, 0.0, 1.0}));
    EXPECT_FALSE(camera.project({0.0, kInfinity, 1.0}));
    EXPECT_FALSE(camera.unproject({kNan, 0.0}));
    EXPECT_FALSE(camera.unproject({0.0, kInfinity}));
  }
}

TEST(Camera, ValidateNamesTheField) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  const auto message = [](auto&& change) -> std::string {
    Camera camera = Camera::pinhole(640, 480, 500.0);
    change(camera);
    try {
      validate(camera);
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_EQ(message([](Camera&) {}), "");
  EXPECT_NE(message([](Camera& c) { c.width = 0; }).find("width"), std::string::npos);
  EXPECT_NE(message([](Camera& c) { c.height = -1; }).find("height"), std::string::npos);
  EXPECT_NE(message([](Camera& c) { c.fx = 0.0; }).find("fx"), std::string::npos);
  EXPECT_NE(message([](Camera& c) { c.fx = 1e-9; }).find("fx is no focal"), std::string::npos);
  EXPECT_NE(message([](Camera& c) { c.fy = 1e9; }).find("fy is no focal"), std::string::npos);
  EXPECT_EQ(message([](Camera& c) { c.fx = c.fy = 0.02 * 640; }), "");
  EXPECT_EQ(message([](Camera& c) { c.fx = c.fy = 1e6; }), "");
  EXPECT_NE(message([](Camera& c) { c.cy = -1e5; }).find("cy is farther"), std::string::npos);
  EXPECT_NE(message([](Camera& c) { c.fy = kNan; }).find("fy"), std::string::npos);
  EXPECT_NE(message([](Camera& c) { c.cx = kNan; }).find("cx"), std::string::npos);
  EXPECT_NE(message([](Camera& c) { c.coefficients[3] = kNan; }).find("distortion"),
            std::string::npos);
  EXPECT_NE(message([](Camera& c) {
              c.lens = LensModel::equidistant;
              c.coefficients[4] = 0.1;
            }).find("equidistant"),
            std::string::npos);
  EXPECT_THROW(Camera::pinhole(640, 480, 0.0), std::invalid_argument);
}

// As OpenCV's FileStorage writes it.
constexpr const char* kOpenCvFile = R"(%YAML:1.0
---
calibration_time: "Thu 1 Jan 2026 01:02:03"
image_width: 640
image_height: 480
flags: 0
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 700., 0., 380., 0., 690., 235., 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 5
   cols: 1
   dt: d
   data: [ -2.8000000000000003e-01, 8.9999999999999997e-02,
       1.1999999999999999e-03, -8.0000000000000004e-04,
       -1.0000000000000000e-02 ]
avg_reprojection_error: 2.5000000000000000e-01
)";

// As ROS's camera_calibration writes it.
constexpr const char* kRosFile = R"(image_width: 640
image_height: 480
camera_name: narrow_stereo
camera_matrix:
  rows: 3
  cols: 3
  data: [700.0, 0.0, 380.0, 0.0, 690.0, 235.0, 0.0, 0.0, 1.0]
distortion_model: equidistant
distortion_coefficients:
  rows: 1
  cols: 4
  data: [-0.02, 0.004, -0.003, 0.001]
rectification_matrix:
  rows: 3
  cols: 3
  data: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
projection_matrix:
  rows: 3
  cols: 4
  data: [700.0, 0.0, 380.0, 0.0, 0.0, 690.0, 235.0, 0.0, 0.0, 0.0, 1.0, 0.0]
)";

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

std::string complaint(const std::string& yaml) {
  try {
    parse_camera(yaml, "lens.yaml");
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

TEST(CameraFile, ReadsOpenCv) {
  const Camera camera = parse_camera(kOpenCvFile);
  EXPECT_EQ(camera.width, 640);
  EXPECT_EQ(camera.height, 480);
  EXPECT_EQ(camera.fx, 700.0);
  EXPECT_EQ(camera.fy, 690.0);
  EXPECT_EQ(camera.cx, 380.0);
  EXPECT_EQ(camera.cy, 235.0);
  EXPECT_EQ(camera.lens, LensModel::brown_conrady);
  EXPECT_EQ(camera.coefficients,
            (std::array<double, 8>{-0.28, 0.09, 0.0012, -0.0008, -0.01, 0.0, 0.0, 0.0}));
}

TEST(CameraFile, ReadsRos) {
  const Camera camera = parse_camera(kRosFile);
  EXPECT_EQ(camera.lens, LensModel::equidistant);
  EXPECT_EQ(camera.coefficients, (std::array<double, 8>{-0.02, 0.004, -0.003, 0.001}));
  EXPECT_EQ(camera.fy, 690.0);
}

TEST(CameraFile, NoDistortionMeansNone) {
  std::string text = kOpenCvFile;
  text.erase(text.find("distortion_coefficients"));
  EXPECT_FALSE(parse_camera(text).has_distortion());
}

TEST(CameraFile, FisheyeFlagOfOpenCvsCalibrationSelectsTheFisheye) {
  std::string text = replaced(kRosFile, "distortion_model: equidistant", "fisheye_model: 1");
  EXPECT_EQ(parse_camera(text).lens, LensModel::equidistant);
  text = replaced(text, "fisheye_model: 1", "fisheye_model: 0");
  EXPECT_EQ(parse_camera(text).lens, LensModel::brown_conrady);
}

TEST(CameraFile, TakesThinPrismAndTiltOnlyIfTheyAreZero) {
  const std::string text = replaced(kRosFile, "distortion_model: equidistant", "");
  const auto with_values = [&](const std::string& values) {
    return replaced(replaced(text, "cols: 4\n  data: [-0.02", "cols: 12\n  data: [-0.02"), "0.001]",
                    values);
  };
  EXPECT_EQ(parse_camera(with_values("0.001, 0, 0, 0, 0.5, 0, 0, 0, 0]")).coefficients[7], 0.5);
  EXPECT_NE(complaint(with_values("0.001, 0, 0, 0, 0, 0, 0, 0, 0.1]")).find("beyond the 8th"),
            std::string::npos);
}

TEST(CameraFile, WrittenAndReadIsTheSame) {
  const std::filesystem::path file = std::filesystem::path(testing::TempDir()) / "camera.yaml";
  for (Camera camera : lenses()) {
    camera.fx += 1.0 / 3.0;
    save_camera(camera, file);
    const Camera back = load_camera(file);
    EXPECT_EQ(back.width, camera.width);
    EXPECT_EQ(back.height, camera.height);
    EXPECT_EQ(back.matrix(), camera.matrix());
    EXPECT_EQ(back.lens, camera.lens);
    EXPECT_EQ(back.coefficients, camera.coefficients);
  }
  std::filesystem::remove(file);
  EXPECT_THROW(format_camera(Camera{}), std::invalid_argument);
}

TEST(CameraFile, ComplaintsNameFileAndField) {
  const auto expect = [](const std::string& text, const std::string& what) {
    const std::string got = complaint(text);
    EXPECT_EQ(got.rfind("lens.yaml: ", 0), 0U) << got;
    EXPECT_NE(got.find(what), std::string::npos) << got;
    EXPECT_EQ(got.find('\n'), std::string::npos) << got;
  };
  expect("", "not a camera description");
  expect("[1, 2", "not valid YAML");
  expect("%YAML:1.0\n---\na: [1, 2\nb: }", "line");
  expect("just text", "not a camera description");
  expect("image_width: 640\nimage_height: 480\n", "'camera_matrix' is missing");
  expect(replaced(kOpenCvFile, "image_width: 640", ""), "'image_width' is missing");
  expect(replaced(kOpenCvFile, "image_width: 640", "image_width: 0"), "'image_width'");
  expect(replaced(kOpenCvFile, "image_height: 480", "image_height: 480.5"), "'image_height'");
  expect(replaced(kOpenCvFile, "image_height: 480", "image_height: tall"), "'image_height'");
  expect(replaced(kOpenCvFile, "rows: 3", "rows: 2"), "'camera_matrix'");
  expect(replaced(kOpenCvFile, "rows: 3\n   cols: 3", "rows: 9\n   cols: 1"), "3 x 3");
  expect(replaced(kOpenCvFile, "rows: 3", ""), "'camera_matrix': 'rows' is missing");
  expect(replaced(kOpenCvFile, "700.", ".Nan"), "'camera_matrix': element 0");
  expect(replaced(kOpenCvFile, "700.", "-700."), "fx");
  expect(replaced(kOpenCvFile, "700., 0.,", "700., 0.1,"), "skew");
  expect(replaced(kOpenCvFile, "0., 0., 1. ]", "0., 0., 2. ]"), "'camera_matrix'");
  expect(replaced(kOpenCvFile, "rows: 5", "rows: 4"), "'distortion_coefficients'");
  expect(replaced(replaced(kOpenCvFile, "rows: 5", "rows: 3"),
                  "-8.0000000000000004e-04,\n       "
                  "-1.0000000000000000e-02",
                  ""),
         "not 4, 5 or 8");
  expect(replaced(kOpenCvFile, "flags: 0", "distortion_model: equidistant"), "equidistant");
  expect(replaced(kRosFile, "equidistant", "mystery"), "'distortion_model' \"mystery\"");
  expect(replaced(kRosFile, "data: [700.0", "data: [[700.0]"), "element 0");
}

TEST(CameraFile, MissingFileIsNamed) {
  try {
    load_camera("no/such/camera.yaml");
    FAIL();
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("no/such/camera.yaml"), std::string::npos);
  }
}

}  // namespace
}  // namespace harco
