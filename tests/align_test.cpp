#include "pose/align.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <random>

#include <gtest/gtest.h>
#include <Eigen/Cholesky>

#include "harco/harco.hpp"
#include "lab/render.hpp"
#include "pose/blurred_ink.hpp"
#include "pose/footprint.hpp"
#include "pose/refine.hpp"

namespace harco {
namespace {

using Eigen::Isometry3d;
using Eigen::Matrix2d;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Vector6d = Eigen::Matrix<double, 6, 1>;

constexpr double kSide = 0.7;

Marker marker(int id, int cell, const std::string& code) {
  return {id, cell, parse_code(code), {}};
}

/// One parent of 0.7 m with two layers of children: a quincunx, and one in the first of these.
const MarkerSet& markers() {
  static const MarkerSet set = [] {
    MarkerSet all;
    all.parents.push_back({kSide, marker(3, -1, "1001100110001001101010011")});
    int id = 0;
    for (const int cell : {0, 4, 12, 20, 24})
      all.parents[0].marker.children.push_back(marker(id++, cell, "1110111111011111101111101"));
    const std::vector<std::string> codes{"1110111111011111101111101", "1011111010111110111111011",
                                         "1111101110101111110110111", "1101111111111001101111101",
                                         "1111011011111011011111011"};
    for (std::size_t i = 0; i < codes.size(); ++i)
      all.parents[0].marker.children[i].code = parse_code(codes[i]);
    all.parents[0].marker.children[0].children.push_back(
        marker(id, 12, "1111111101110111110111111"));
    return all;
  }();
  return set;
}

/// (dt, w) with t_true = t + dt and R_true = R Exp(w).
Vector6d error_of(const Isometry3d& estimate, const Isometry3d& truth) {
  const Eigen::AngleAxisd turn(estimate.linear().transpose() * truth.linear());
  Vector6d error;
  error << truth.translation() - estimate.translation(), turn.angle() * turn.axis();
  return error;
}

/// Position error of the marker's middle.
double middle_error(const Isometry3d& estimate, const Isometry3d& truth) {
  const Vector3d middle(0.5 * kSide, 0.5 * kSide, 0.0);
  return (estimate * middle - truth * middle).norm();
}

double angle_error(const Isometry3d& estimate, const Isometry3d& truth) {
  return error_of(estimate, truth).tail<3>().norm();
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

/// What a series of random views gave.
struct Series {
  int frames = 0;
  int aligned = 0;
  std::vector<double> angle, middle, corner_angle, corner_middle, normalised, share;

  double mean_normalised() const {
    double sum = 0.0;
    for (const double value : normalised) sum += value;
    return sum / static_cast<double>(normalised.size());
  }
};

struct Setting {
  double side_px = 150.0;
  Camera camera = Camera::pinhole(640, 480, 700.0);
  double most_tilt_deg = 50.0;
  int frames = 24;
  std::function<void(lab::Scene&)> change_scene = [](lab::Scene&) {};
  /// Before detection: what hides or dims the marker. Told where its middle is seen.
  std::function<void(Image&, const Vector2d&)> change_image = [](Image&, const Vector2d&) {};
};

Series run(const Setting& setting) {
  Series series;
  DetectorOptions options;
  options.camera = setting.camera;
  Detector detector(markers(), options);
  for (int k = 0; k < setting.frames; ++k) {
    std::mt19937_64 random(static_cast<std::uint64_t>(k * 1009) +
                           static_cast<std::uint64_t>(setting.side_px));
    std::uniform_real_distribution<double> unit(0.0, 1.0);
    const double turn = 2.0 * std::numbers::pi;
    lab::Scene scene;
    scene.camera = setting.camera;
    const Vector2d aim(0.4 + 0.2 * unit(random), 0.4 + 0.2 * unit(random));
    const Isometry3d truth =
        lab::look_at_marker(kSide * aim, setting.camera.fx * kSide / setting.side_px,
                            unit(random) * setting.most_tilt_deg * turn / 360.0,
                            turn * unit(random), turn * unit(random));
    scene.parents = {{0, truth}};
    setting.change_scene(scene);
    Image image = lab::render(scene, markers(), random());
    const Vector3d middle(0.5 * kSide, 0.5 * kSide, 0.0);
    setting.change_image(image, *setting.camera.project(truth * middle));
    const std::vector<Detection> detections = detector.detect(image.view());
    PoseOptions corners_only;
    corners_only.align = false;
    const auto corners =
        estimate_poses(image.view(), detections, markers(), setting.camera, corners_only);
    const auto poses = estimate_poses(image.view(), detections, markers(), setting.camera);
    if (poses.empty()) continue;
    ++series.frames;
    const Isometry3d& corner_pose = corners.front().camera_T_marker;
    series.corner_angle.push_back(angle_error(corner_pose, truth));
    series.corner_middle.push_back(middle_error(corner_pose, truth));
    const Pose& pose = poses.front();
    series.angle.push_back(angle_error(pose.camera_T_marker, truth));
    series.middle.push_back(middle_error(pose.camera_T_marker, truth));
    const Vector6d error = error_of(pose.camera_T_marker, truth);
    series.normalised.push_back(error.dot(pose.covariance->ldlt().solve(error)));
    series.share.push_back(pose.share_used);
    series.aligned += pose.aligned ? 1 : 0;
  }
  return series;
}

/// Not much farther from the truth than the corners, which see all pixels of the largest squares,
/// and as sure as it says.
void expect_good(const Series& series, int frames) {
  ASSERT_GE(series.frames, frames - 1);
  EXPECT_GE(series.aligned, series.frames - 1);
  EXPECT_LT(median(series.angle), 1.2 * median(series.corner_angle));
  EXPECT_LT(median(series.middle), 1.7 * median(series.corner_middle));
  EXPECT_GT(series.mean_normalised(), 4.0);
  EXPECT_LT(series.mean_normalised(), 8.0);
}

// --- blurred ink --------------------------------------------------------------------------------

/// The same by brute force: the ink's exact share in the small cells of a fine grid, weighted.
double brute_force(const InkMap& ink, const Vector2d& point, const Matrix2d& covariance) {
  const double cell = 0.06 * std::sqrt(covariance.diagonal().minCoeff());
  const double reach = 5.0 * std::sqrt(covariance.diagonal().maxCoeff());
  const Matrix2d information = covariance.inverse();
  double sum = 0.0, weights = 0.0;
  for (double y = -reach; y < reach; y += cell)
    for (double x = -reach; x < reach; x += cell) {
      const Vector2d d(x + 0.5 * cell, y + 0.5 * cell);
      const double weight = std::exp(-0.5 * d.dot(information * d));
      if (weight < 1e-7) continue;
      sum += weight * ink.white_share({point.x() + x, point.y() + y, point.x() + x + cell,
                                       point.y() + y + cell});
      weights += weight;
    }
  return sum / weights;
}

Matrix2d covariance(double sx, double sy, double rho) {
  Matrix2d c;
  c << sx * sx, rho * sx * sy, rho * sx * sy, sy * sy;
  return c;
}

TEST(BlurredInk, IsThePaperAndTheInkFarFromEdges) {
  const BlurredInk ink(ink_plan(markers(), 0), 0.001);
  const Matrix2d tiny = covariance(1e-4, 1e-4, 0.0);
  EXPECT_EQ(ink.at({-0.05, 0.3}, tiny).share, 1.0);
  EXPECT_EQ(ink.at({0.05, 0.05}, tiny).share, 0.0);  // the border
  // On the outer edge, half of what is seen is ink, and the step has the Gaussian's density.
  const Whiteness edge = ink.at({0.0, 0.35}, covariance(0.01, 0.01, 0.0));
  EXPECT_NEAR(edge.share, 0.5, 1e-9);
  EXPECT_NEAR(edge.gradient.x(), -1.0 / (0.01 * std::sqrt(2.0 * std::numbers::pi)), 1e-6);
  EXPECT_NEAR(edge.gradient.y(), 0.0, 1e-9);
}

TEST(BlurredInk, AgreesWithBruteForceResolvedOrNot) {
  const InkMap map(markers(), 0);
  std::mt19937 random(5);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  for (const double size : {0.0015, 0.006, 0.03}) {
    const BlurredInk ink(map.plan(), size);
    for (int i = 0; i < 8; ++i) {
      const Vector2d point(0.3 * unit(random), 0.3 * unit(random));
      const Matrix2d blur =
          covariance(size, size * (0.6 + 0.6 * unit(random)), 1.2 * (unit(random) - 0.5));
      EXPECT_NEAR(ink.at(point, blur).share, brute_force(map, point, blur), 1e-3)
          << "at " << point.transpose() << " size " << size;
    }
  }
}

TEST(BlurredInk, DerivativesAgreeWithDifferences) {
  const InkPlan plan = ink_plan(markers(), 0);
  std::mt19937 random(6);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  for (const double size : {0.0015, 0.006, 0.03}) {
    const BlurredInk ink(plan, size);
    for (int i = 0; i < 50; ++i) {
      const Vector2d point(-0.02 + 0.4 * unit(random), 0.4 * unit(random));
      const Matrix2d blur =
          covariance(size, size * (0.6 + 0.6 * unit(random)), 1.2 * (unit(random) - 0.5));
      const double h = 1e-4 * size;
      const auto share = [&](const Vector2d& p, double grow) {
        return ink.at(p, std::exp(2.0 * grow) * blur).share;
      };
      const Whiteness at = ink.at(point, blur);
      for (Eigen::Index axis = 0; axis < 2; ++axis) {
        const Vector2d step = h * Vector2d::Unit(axis);
        EXPECT_NEAR(size * at.gradient(axis),
                    size * (share(point + step, 0) - share(point - step, 0)) / (2.0 * h), 2e-3);
      }
      EXPECT_NEAR(at.by_log_sigma, (share(point, 1e-4) - share(point, -1e-4)) / 2e-4, 2e-3);
    }
  }
}

// --- footprint ----------------------------------------------------------------------------------

TEST(Footprint, DerivativesAgreeWithDifferences) {
  const Isometry3d pose = lab::look_at_marker({0.2, 0.1}, 2.0, 0.7, 1.1, 0.4);
  const Matrix2d ray_by_pixel = (Matrix2d() << 0.0014, 1e-5, -2e-5, 0.0015).finished();
  const Vector2d ray(0.1, -0.05);
  const auto at = [&](const Vector2d& pixel, const Vector6d& step) {
    return footprint(ray + ray_by_pixel * pixel, ray_by_pixel,
                     pose.linear() * rotation_exp(step.tail<3>()),
                     pose.translation() + step.head<3>())
        ->point;
  };
  const auto here = footprint(ray, ray_by_pixel, pose.linear(), pose.translation());
  ASSERT_TRUE(here);
  EXPECT_TRUE(
      (pose * Vector3d(here->point.x(), here->point.y(), 0.0)).hnormalized().isApprox(ray, 1e-12));
  const Vector6d still = Vector6d::Zero();
  Vector2d bend = Vector2d::Zero();
  for (Eigen::Index i = 0; i < 2; ++i) {
    const Vector2d step = Vector2d::Unit(i);
    const Vector2d slope = (at(1e-4 * step, still) - at(-1e-4 * step, still)) / 2e-4;
    EXPECT_TRUE(here->by_pixel.col(i).isApprox(slope, 1e-6));
    bend += at(step, still) - 2.0 * here->point + at(-step, still);
  }
  EXPECT_LT((here->bend - bend).norm(), 1e-4 * bend.norm());
  for (Eigen::Index i = 0; i < 6; ++i) {
    const Vector6d step = 1e-6 * Vector6d::Unit(i);
    const Vector2d slope = (at({0, 0}, step) - at({0, 0}, -step)) / 2e-6;
    EXPECT_LT((here->by_pose.col(i) - slope).norm(), 1e-6) << i;
  }
}

TEST(Footprint, IsEmptyBehindTheCamera) {
  const Isometry3d pose = lab::look_at_marker({0, 0}, 2.0, 0.7);
  EXPECT_TRUE(footprint({0, 0}, Matrix2d::Identity(), pose.linear(), pose.translation()));
  EXPECT_FALSE(footprint({0, 0}, Matrix2d::Identity(), pose.linear(), -pose.translation()));
}

// --- alignment ----------------------------------------------------------------------------------

TEST(Align, IsNearerThanTheCornersAndKnowsHowNear) {
  for (const double side_px : {30.0, 60.0, 150.0, 400.0}) {
    SCOPED_TRACE(side_px);
    Setting setting;
    setting.side_px = side_px;
    expect_good(run(setting), setting.frames);
  }
}

TEST(Align, FollowsTheLens) {
  for (const LensModel lens : {LensModel::brown_conrady, LensModel::equidistant}) {
    Setting setting;
    setting.camera.lens = lens;
    setting.camera.coefficients = lens == LensModel::brown_conrady
                                      ? std::array<double, 8>{-0.25, 0.08, 0.001, -0.0005}
                                      : std::array<double, 8>{-0.02, 0.005};
    expect_good(run(setting), setting.frames);
  }
}

TEST(Align, FollowsTheBlur) {
  for (const double sigma : {0.35, 1.5}) {
    SCOPED_TRACE(sigma);
    Setting setting;
    setting.change_scene = [&](lab::Scene& scene) { scene.psf_sigma_px = sigma; };
    expect_good(run(setting), setting.frames);
  }
}

TEST(Align, FollowsLightThatVaries) {
  Setting setting;
  setting.change_scene = [](lab::Scene& scene) {
    scene.gain_left = 0.5;
    scene.gain_right = 1.1;
  };
  expect_good(run(setting), setting.frames);
}

TEST(Align, HoldsUnderAShadowsEdge) {
  const Series lit = run({});
  Setting setting;
  setting.change_image = [](Image& image, const Vector2d& middle) {
    for (int y = 0; y < image.height; ++y)
      for (int x = 0; x < image.width; ++x)
        if (x + 0.5 * y < middle.x() + 0.5 * middle.y() - 30.0)
          image.row(y)[x] = static_cast<std::uint8_t>(image.row(y)[x] * 0.6 + 0.5);
  };
  const Series series = run(setting);
  expect_good(series, setting.frames);
  EXPECT_LT(median(series.share), 0.98 * median(lit.share));  // the shadow's edge itself
  EXPECT_LT(median(series.angle), 2.0 * median(lit.angle));
}

TEST(Align, LeavesOutAnOccluder) {
  const Series clear = run({});
  Setting setting;
  setting.change_image = [](Image& image, const Vector2d& middle) {
    for (int y = 0; y < image.height; ++y)
      for (int x = 0; x < image.width; ++x)
        if ((Vector2d(x, y) - middle - Vector2d(12.0, 9.0)).norm() < 22.0) image.row(y)[x] = 130;
  };
  const Series series = run(setting);
  expect_good(series, setting.frames);
  EXPECT_LT(median(series.share), 0.95 * median(clear.share));
  EXPECT_LT(median(series.angle), 2.0 * median(clear.angle));
}

// --- when not to --------------------------------------------------------------------------------

class Unaligned : public ::testing::Test {
 protected:
  Unaligned() {
    scene_.camera = camera_;
    scene_.parents = {{0, lab::look_at_marker({0.35, 0.35}, 3.0, 0.5, 1.0, 0.3)}};
    image_ = lab::render(scene_, markers(), 7);
    DetectorOptions options;
    options.camera = camera_;
    detections_ = Detector(markers(), options).detect(image_.view());
  }

  Pose pose(const Image& image, const PoseOptions& options = {}) const {
    return estimate_poses(image.view(), detections_, markers(), camera_, options).at(0);
  }

  void expect_corners(const Pose& pose) const {
    const Pose corners = estimate_poses({}, detections_, markers(), camera_).at(0);
    EXPECT_FALSE(pose.aligned);
    EXPECT_EQ(pose.share_used, 0.0);
    EXPECT_EQ(pose.camera_T_marker.matrix(), corners.camera_T_marker.matrix());
    EXPECT_EQ(*pose.covariance, *corners.covariance);
  }

  Camera camera_ = Camera::pinhole(640, 480, 700.0);
  lab::Scene scene_;
  Image image_;
  std::vector<Detection> detections_;
};

TEST_F(Unaligned, TheCornersStandWithoutAMarkerInTheImage) {
  EXPECT_TRUE(pose(image_).aligned);
  expect_corners(pose(Image(640, 480, 128)));
  Image noise(640, 480);
  std::mt19937 random(3);
  for (auto& pixel : noise.pixels) pixel = static_cast<std::uint8_t>(random() & 255u);
  expect_corners(pose(noise));
}

TEST_F(Unaligned, TheCornersStandWhereTheMarkerIsElsewhere) {
  lab::Scene moved = scene_;
  moved.parents[0].camera_T_marker.translation().x() += 0.03;  // seven pixels
  expect_corners(pose(lab::render(moved, markers(), 8)));
}

TEST_F(Unaligned, OnRequest) {
  PoseOptions options;
  options.align = false;
  expect_corners(pose(image_, options));
  options.align = true;
  options.fusion = Fusion::paper;
  const Pose paper = pose(image_, options);
  EXPECT_FALSE(paper.aligned);
  EXPECT_FALSE(paper.covariance);
}

}  // namespace
}  // namespace harco
