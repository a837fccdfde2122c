#include "lab/camera_simulator.hpp"

#include <cmath>
#include <limits>
#include <numeric>
#include <stdexcept>

#include <gtest/gtest.h>

#include "harco/detect.hpp"
#include "lab/plane_view.hpp"
#include "sample_markers.hpp"

namespace harco::lab {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

double at(const FloatImage& image, int x, int y) { return static_cast<double>(image.row(y)[x]); }

CameraEffects without_noise(Quality quality = Quality::moderate) {
  CameraEffects effects;
  effects.read_noise = 0.0;
  effects.electrons_per_level = 0.0;
  effects.quality = quality;
  return effects;
}

/// A black square of side 0.2 m, its top-left corner at the origin, on white paper without end.
Stage black_square() {
  Stage stage;
  stage.grey = 200.0;
  StagedSheet sheet;
  sheet.sheet.ink.square = {0.0, 0.0, 0.2, 0.2};
  sheet.sheet.paper = {-50.0, -50.0, 50.0, 50.0};
  sheet.white = 200.0;
  sheet.black = 0.0;
  stage.sheets.push_back(sheet);
  return stage;
}

/// Sum, centre and variance of what is darker than paper.
struct Moments {
  double sum = 0.0;
  Vector2d centre = Vector2d::Zero();
  Vector2d variance = Vector2d::Zero();
};
Moments moments(const FloatImage& image, double paper) {
  Moments found;
  Vector2d squares = Vector2d::Zero();
  for (int y = 0; y < image.height; ++y)
    for (int x = 0; x < image.width; ++x) {
      const double dark = (paper - at(image, x, y)) / paper;
      found.sum += dark;
      found.centre += dark * Vector2d(x, y);
      squares += dark * Vector2d(x * x, y * y);
    }
  found.centre /= found.sum;
  found.variance = squares / found.sum - found.centre.cwiseAbs2();
  return found;
}

/// Camera 1 m before the square's middle, moving as told (metres and radians a second).
Motion moving(const Vector3d& speed, const Vector3d& turn = Vector3d::Zero()) {
  return [=](double time_s) {
    Isometry3d pose = Isometry3d::Identity();
    pose.translation() = Vector3d(0.1, 0.1, -1.0) + speed * time_s;
    if (!turn.isZero())
      pose.linear() = Eigen::AngleAxisd(turn.norm() * time_s, turn.normalized()).toRotationMatrix();
    return pose;
  };
}

/// Column of the left edge of the square in a row of the image: where its dark share begins.
double left_edge(const FloatImage& image, int row, double paper, int until) {
  double covered = 0.0;
  for (int x = 0; x < until; ++x) covered += (paper - at(image, x, row)) / paper;
  return until - 0.5 - covered;
}

TEST(CameraSimulator, ASquareIsWhereTheCameraProjectsIt) {
  const Camera camera = Camera::pinhole(200, 160, 300.0);
  const CameraSimulator simulator(camera, without_noise());
  const FloatImage image = simulator.light(black_square(), moving(Vector3d::Zero()), 0.0);
  const Moments found = moments(image, 200.0);
  EXPECT_NEAR(found.sum, 60.0 * 60.0, 0.02);  // 0.2 m at 1 m
  EXPECT_NEAR(found.centre.x(), camera.cx, 1e-4);
  EXPECT_NEAR(found.centre.y(), camera.cy, 1e-4);
  EXPECT_NEAR(left_edge(image, 80, 200.0, 100), camera.cx - 30.0, 1e-3);
}

TEST(CameraSimulator, AgreesWithTheExactRenderer) {
  const MarkerSet markers = test::three_layers();
  Camera camera = Camera::pinhole(240, 180, 260.0);
  camera.coefficients = {-0.2, 0.05, 0.001, -0.001};
  const Isometry3d camera_T_marker = look_at_marker({0.7, 0.7}, 2.2, 0.5, 0.4, 0.3);
  Scene scene;
  scene.camera = camera;
  scene.parents.push_back({0, camera_T_marker});
  Stage stage;
  stage.sheets.push_back({sheet_of(markers, 0)});
  const FloatImage wanted = render_exact(scene, markers);
  const CameraSimulator simulator(camera, without_noise(Quality::exact));
  const FloatImage image = simulator.light(stage, still(camera_T_marker.inverse()), 0.0);
  for (std::size_t i = 0; i < image.pixels.size(); ++i)
    ASSERT_NEAR(image.pixels[i], wanted.pixels[i], 0.05F) << i;
}

TEST(CameraSimulator, ModerateQualityMovesNoCorner) {
  const MarkerSet markers = test::three_layers();
  const Camera camera = Camera::pinhole(400, 320, 420.0);
  Stage stage;
  stage.sheets.push_back({sheet_of(markers, 0)});
  CameraEffects effects = without_noise();
  const CameraSimulator moderate(camera, effects);
  effects.quality = Quality::exact;
  const CameraSimulator exact(camera, effects);
  Detector detector(markers);
  for (double tilt : {0.0, 0.2, 0.7}) {
    const double side = markers.parents.front().side_m;
    const Isometry3d pose = look_at_marker({0.5 * side, 0.5 * side}, 2.0 * side, tilt, 0.3, 0.2);
    const Motion camera_motion = still(pose.inverse());
    const Image rough = moderate.shoot(stage, camera_motion, 0.0, 1).image;
    const Image fine = exact.shoot(stage, camera_motion, 0.0, 1).image;
    const auto a = detector.detect(rough.view());
    const auto b = detector.detect(fine.view());
    ASSERT_EQ(a.size(), b.size());
    ASSERT_FALSE(a.empty());
    for (std::size_t i = 0; i < a.size(); ++i) {
      if (a[i].inferred) continue;
      for (std::size_t k = 0; k < 4; ++k)
        EXPECT_LT((a[i].corners[k] - b[i].corners[k]).norm(), 0.01) << tilt;
    }
  }
}

TEST(CameraSimulator, BlursAlongTheMotionAboutTheMiddleOfTheExposure) {
  const Camera camera = Camera::pinhole(240, 160, 300.0);
  CameraEffects effects = without_noise(Quality::exact);
  const Moments still_one = moments(
      CameraSimulator(camera, effects).light(black_square(), moving(Vector3d::Zero()), 0.0), 200.0);
  effects.exposure_s = 0.02;
  const CameraSimulator simulator(camera, effects);
  for (double speed : {0.05, 0.5, 2.0}) {  // 0.3, 3, 12 pixels
    const Vector3d velocity(speed, 0.4 * speed, 0.0);
    const Moments found = moments(simulator.light(black_square(), moving(velocity), 0.0), 200.0);
    EXPECT_NEAR(found.sum, still_one.sum, 0.02);
    EXPECT_NEAR((found.centre - still_one.centre).norm(), 0.0, 1e-3) << speed;
    const double smear_px = 300.0 * speed * effects.exposure_s;
    // Sub-pixels leave the variance open by about a third of their own size squared.
    EXPECT_NEAR(found.variance.x() - still_one.variance.x(), smear_px * smear_px / 12.0, 0.02);
    EXPECT_NEAR(found.variance.y() - still_one.variance.y(), 0.16 * smear_px * smear_px / 12.0,
                0.02);
    // Where the camera is at another time, so is the square.
    const Moments later = moments(simulator.light(black_square(), moving(velocity), 0.01), 200.0);
    EXPECT_NEAR((later.centre - found.centre + 3.0 * velocity.head<2>()).norm(), 0.0, 2e-3);
  }
}

TEST(CameraSimulator, RollingShutterTakesEveryRowAtItsTime) {
  const Camera camera = Camera::pinhole(240, 160, 300.0);
  CameraEffects effects = without_noise();
  effects.readout_s = 0.04;
  const CameraSimulator simulator(camera, effects);
  constexpr double kSpeed = 1.5;
  const FloatImage image = simulator.light(black_square(), moving({kSpeed, 0.0, 0.0}), 0.0);
  for (int row = 60; row <= 100; row += 5) {
    const double time_s = effects.readout_s * (row - 79.5) / 159.0;
    const double edge = camera.cx - 30.0 - 300.0 * kSpeed * time_s;
    EXPECT_NEAR(left_edge(image, row, 200.0, 120), edge, 5e-3) << row;
  }
  // A camera that sinks with the rows sees things longer: row r has gone on by then.
  const Moments longer =
      moments(simulator.light(black_square(), moving({0.0, 0.5, 0.0}), 0.0), 200.0);
  const double rate = 300.0 * 0.5 * effects.readout_s / 159.0;  // rows a row
  EXPECT_NEAR(longer.sum, 3600.0 / (1.0 + rate), 0.5);
}

TEST(PlaneView, RowsAndPointsAreInverse) {
  Camera camera = Camera::pinhole(320, 240, 300.0);
  camera.coefficients = {-0.15, 0.02, 0.0, 0.0};
  const FieldOfView field(camera, 40);
  std::vector<Isometry3d> poses;
  for (int i = 0; i <= 16; ++i) {
    Isometry3d pose = look_at_marker({0.2, 0.1}, 1.0, 0.4, 0.3, 0.1);
    pose.linear() = (Eigen::AngleAxisd(0.006 * i, Vector3d(0.6, 0.8, 0.0)) * pose.linear()).eval();
    pose.translation().x() += 0.003 * i;
    poses.push_back(pose);
  }
  const PlaneView view(field, poses);
  EXPECT_TRUE(view.shows_face());
  for (double x : {-0.2, 0.1, 0.5})
    for (double y : {-0.2, 0.15, 0.4}) {
      const auto pixel = view.pixel({x, y});
      ASSERT_TRUE(pixel);
      const auto back = view.point(*pixel);
      ASSERT_TRUE(back);
      EXPECT_NEAR((*back - Vector2d(x, y)).norm(), 0.0, 1e-6);
    }
}

TEST(CameraSimulator, DefocusIsADisc) {
  const Camera camera = Camera::pinhole(200, 160, 300.0);
  CameraEffects effects = without_noise(Quality::exact);
  const Moments sharp = moments(
      CameraSimulator(camera, effects).light(black_square(), moving(Vector3d::Zero()), 0.0), 200.0);
  for (double radius : {1.5, 3.0, 4.5}) {
    effects.defocus_px = radius;
    const Moments soft = moments(
        CameraSimulator(camera, effects).light(black_square(), moving(Vector3d::Zero()), 0.0),
        200.0);
    EXPECT_NEAR((soft.centre - sharp.centre).norm(), 0.0, 1e-3);
    EXPECT_NEAR(soft.variance.x() - sharp.variance.x(), radius * radius / 4.0, 0.03);
  }
}

TEST(CameraSimulator, LightFallsOffAndShadowsFall) {
  const Camera camera = Camera::pinhole(200, 160, 300.0);
  Stage stage = black_square();
  stage.sheets.front().sheet.ink.square = {10.0, 10.0, 10.1, 10.1};  // out of view
  stage.light_slope_per_m = {0.5, 0.0, 0.0};
  Shadow shadow;
  shadow.towards = {0.0, 1.0, 0.0};
  shadow.offset_m = 0.1;
  shadow.light = 0.5;
  stage.shadows.push_back(shadow);
  CameraEffects effects = without_noise();
  const FloatImage image =
      CameraSimulator(camera, effects).light(stage, moving(Vector3d::Zero()), 0.0);
  const auto wanted = [&](int x, double left) {
    return 200.0 * (1.0 + 0.5 * (0.1 + (x - camera.cx) / 300.0)) * left;
  };
  for (int x : {20, 100, 170}) {
    EXPECT_NEAR(at(image, x, 40), wanted(x, 1.0), 0.05);
    EXPECT_NEAR(at(image, x, 120), wanted(x, 0.5), 0.05);
  }
  // Halfway down in the middle of its penumbra, which is the image's middle.
  EXPECT_NEAR(0.5 * (at(image, 100, 79) + at(image, 100, 80)), wanted(100, 0.75), 0.1);
  effects.vignetting = 0.4;
  const FloatImage dim =
      CameraSimulator(camera, effects).light(stage, moving(Vector3d::Zero()), 0.0);
  EXPECT_NEAR(at(dim, 0, 0) / at(image, 0, 0), 0.6, 0.01);
  EXPECT_NEAR(at(dim, 100, 80) / at(image, 100, 80), 1.0, 0.001);
}

TEST(CameraSimulator, BlobsHideWhatTheyLieOn) {
  const Camera camera = Camera::pinhole(200, 160, 300.0);
  Stage stage = black_square();
  stage.sheets.front().blobs.push_back({{0.1, 0.1}, 0.05, 90.0});
  const FloatImage image =
      CameraSimulator(camera, without_noise()).light(stage, moving(Vector3d::Zero()), 0.0);
  EXPECT_NEAR(at(image, 99, 79), 90.0, 0.01);
  EXPECT_NEAR(at(image, 75, 79), 0.0, 0.01);
  double covered = 0.0;
  for (int y = 55; y < 105; ++y)
    for (int x = 75; x < 125; ++x) covered += at(image, x, y) / 90.0;
  EXPECT_NEAR(covered, 3.14159 * 15.0 * 15.0, 0.01 * 707.0 + 2.0);
}

TEST(CameraSimulator, NearGroundMovesAndTheFarDoesnt) {
  const Camera camera = Camera::pinhole(160, 120, 200.0);
  const auto photo = std::make_shared<const Photo>(made_up_ground(256, 120.0, 40.0, 1));
  Stage near;
  Surface ground;
  ground.photo = photo;
  ground.metres_per_pixel = 0.005;  // one pixel of the camera at 1 m
  near.surfaces.push_back(ground);
  Stage far;
  far.far = photo;
  far.far_pixels_per_radian = 200.0;
  const CameraSimulator simulator(camera, without_noise());
  const auto difference = [](const FloatImage& a, const FloatImage& b, int shift) {
    double sum = 0.0;
    for (int y = 10; y < 110; ++y)
      for (int x = 40; x < 120; ++x) sum += std::abs(at(a, x, y) - at(b, x - shift, y));
    return sum / 8000.0;
  };
  const auto moved = [](double x) {
    Isometry3d pose = Isometry3d::Identity();
    pose.translation() = Vector3d(x, 0.0, -1.0);
    return still(pose);
  };
  const FloatImage a = simulator.light(near, moved(0.0), 0.0);
  const FloatImage b = simulator.light(near, moved(0.1), 0.0);  // 20 pixels
  EXPECT_LT(difference(a, b, 20), 0.2);
  EXPECT_GT(difference(a, b, 0), 3.0);
  const FloatImage c = simulator.light(far, moved(0.0), 0.0);
  const FloatImage d = simulator.light(far, moved(0.1), 0.0);
  EXPECT_EQ(difference(c, d, 0), 0.0);
  const auto turned = still(Isometry3d(Eigen::AngleAxisd(0.1, Vector3d::UnitY())));
  EXPECT_GT(difference(c, simulator.light(far, turned, 0.0), 0), 3.0);
  double squares = 0.0;
  for (const float value : c.pixels) squares += std::pow(static_cast<double>(value) - 120.0, 2);
  EXPECT_GT(squares / static_cast<double>(c.pixels.size()), 100.0);
}

TEST(CameraSimulator, NoiseIsThatOfTheSensor) {
  CameraEffects effects;
  effects.read_noise = 1.5;
  effects.electrons_per_level = 20.0;
  effects.gain = 2.0;
  const CameraSimulator simulator(Camera::pinhole(200, 160, 300.0), effects);
  for (double level : {20.0, 60.0}) {
    const FloatImage light(200, 160, static_cast<float>(level));
    const Image image = simulator.expose(light, 7);
    double sum = 0.0, squares = 0.0;
    for (const std::uint8_t value : image.pixels) {
      sum += value;
      squares += 1.0 * value * value;
    }
    const double count = static_cast<double>(image.pixels.size());
    const double mean = sum / count;
    EXPECT_NEAR(mean, 2.0 * level, 0.1);
    const double wanted = 4.0 * 1.5 * 1.5 + 2.0 * (2.0 * level) / 20.0 + 1.0 / 12.0;
    EXPECT_NEAR(squares / count - mean * mean, wanted, 0.05 * wanted);
    EXPECT_EQ(image.pixels, simulator.expose(light, 7).pixels);
    EXPECT_NE(image.pixels, simulator.expose(light, 8).pixels);
  }
  effects.bits = 2;
  for (const std::uint8_t value :
       CameraSimulator(simulator.camera(), effects).expose(FloatImage(200, 160, 50.0F), 1).pixels)
    EXPECT_EQ(value % 85, 0);
  CameraEffects curved = without_noise();
  curved.gamma = 2.2;
  const Image bright =
      CameraSimulator(simulator.camera(), curved).expose(FloatImage(200, 160, 64.0F), 1);
  EXPECT_EQ(bright.pixels.front(), 136);  // 255 (64 / 255)^(1 / 2.2)
}

TEST(CameraSimulator, RefusesNonsense) {
  const Camera camera = Camera::pinhole(200, 160, 300.0);
  const auto refused = [&](auto change) {
    CameraEffects effects;
    change(effects);
    EXPECT_THROW(CameraSimulator(camera, effects), std::invalid_argument);
  };
  refused([](auto& effects) { effects.psf_sigma_px = -1.0; });
  refused([](auto& effects) { effects.exposure_s = -0.1; });
  refused([](auto& effects) { effects.readout_s = std::numeric_limits<double>::quiet_NaN(); });
  refused([](auto& effects) { effects.gain = 0.0; });
  refused([](auto& effects) { effects.bits = 9; });
  refused([](auto& effects) { effects.defocus_px = 1e3; });
  EXPECT_THROW(CameraSimulator(Camera{}, CameraEffects{}), std::invalid_argument);
  EXPECT_THROW(Photo(Image{}), std::invalid_argument);
}

}  // namespace
}  // namespace harco::lab
