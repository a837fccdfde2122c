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
#include "pose/ink_outline.hpp"
#include "pose/patch_painter.hpp"
#include "pose/response.hpp"

namespace harco {
namespace {

using Eigen::Isometry3d;
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
  /// What lens, motion and sensor make of the exact picture, before its noise.
  std::function<void(lab::FloatImage&)> change_exact;
  /// Before detection: what hides or dims the marker. Told where its middle is seen.
  std::function<void(Image&, const Vector2d&)> change_image = [](Image&, const Vector2d&) {};
};

/// lab::render with a change before the noise.
Image changed(const lab::Scene& scene, const Setting& setting, std::uint64_t seed) {
  lab::FloatImage exact = lab::render_exact(scene, markers());
  setting.change_exact(exact);
  Image image(exact.width, exact.height);
  std::mt19937_64 random(seed);
  std::normal_distribution<double> noise(0.0, scene.noise_sigma);
  for (std::size_t i = 0; i < image.pixels.size(); ++i)
    image.pixels[i] = static_cast<std::uint8_t>(
        std::lround(std::clamp(static_cast<double>(exact.pixels[i]) + noise(random), 0.0, 255.0)));
  return image;
}

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
    // One draw a statement: compilers differ in the order of arguments.
    const double roll = turn * unit(random);
    const double around = turn * unit(random);
    const double tilt = unit(random) * setting.most_tilt_deg * turn / 360.0;
    const double down = 0.4 + 0.2 * unit(random);
    const double right = 0.4 + 0.2 * unit(random);
    const Isometry3d truth =
        lab::look_at_marker(kSide * Vector2d(right, down),
                            setting.camera.fx * kSide / setting.side_px, tilt, around, roll);
    scene.parents = {{0, truth}};
    setting.change_scene(scene);
    Image image = setting.change_exact ? changed(scene, setting, random())
                                       : lab::render(scene, markers(), random());
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

/// Nearer to the truth than the corners, and as sure as it says.
void expect_good(const Series& series, int frames) {
  ASSERT_GE(series.frames, frames - 1);
  EXPECT_GE(series.aligned, series.frames - 1);
  EXPECT_LT(median(series.angle), 0.85 * median(series.corner_angle));
  EXPECT_LT(median(series.middle), 1.1 * median(series.corner_middle));
  EXPECT_GT(series.mean_normalised(), 4.0);
  EXPECT_LT(series.mean_normalised(), 8.0);
}

// --- outlines and their picture -----------------------------------------------------------------

/// A square of 7 m with white in its left two thirds, and in that a black bar along its left end.
InkPlan bar_plan() { return {{0, 0, 7, 7}, {{1, 1, 3, 6}, {3, 1, 5, 6}}, {{1, 1, 2, 6}}}; }

TEST(InkOutline, HasEachBorderOnceWithTheInkOnItsRight) {
  const InkOutline outline(bar_plan());
  // Ink is the square without the white from 2 to 5: what two rectangles share is no border.
  double length = 0.0, area = 0.0;
  for (const InkEdge& edge : outline.edges()) {
    length += (edge.to - edge.from).norm();
    area += 0.5 * (edge.from.x() * edge.to.y() - edge.from.y() * edge.to.x());
  }
  EXPECT_NEAR(length, 4 * 7 + 2 * (3 + 5), 1e-6);
  EXPECT_NEAR(area, 49 - 15, 1e-6);
  EXPECT_TRUE(outline.is_black({1.5, 3.0}));
  EXPECT_FALSE(outline.is_black({2.5, 3.0}));
  EXPECT_FALSE(outline.is_black({4.5, 3.0}));
  EXPECT_TRUE(outline.is_black({6.5, 3.0}));
  EXPECT_FALSE(outline.is_black({7.5, 3.0}));
}

TEST(InkOutline, HoldsAsMuchInkAsThePlan) {
  const InkOutline outline(ink_plan(markers(), 0));
  const InkMap map(markers(), 0);
  double area = 0.0;
  for (const InkEdge& edge : outline.edges())
    area += 0.5 * (edge.from.x() * edge.to.y() - edge.from.y() * edge.to.x());
  EXPECT_NEAR(area, kSide * kSide * (1.0 - map.white_share({0, 0, kSide, kSide})), 1e-8);
}

/// The picture of some outlines, in pixels, of one patch.
PatchPicture paint(const std::vector<InkEdge>& edges, int x, int y, const Blur& blur,
                   bool black_on_the_left = false) {
  PatchPainter painter;
  painter.set_blur(blur);
  painter.begin(x, y);
  for (const InkEdge& edge : edges) painter.add(edge.from, edge.to);
  PatchPicture picture;
  painter.finish([&](const Vector2d&) { return black_on_the_left; }, picture);
  return picture;
}

double normal_below(double z) { return 0.5 * std::erfc(-z / std::numbers::sqrt2); }

/// Of a half-plane of ink beyond an edge `d` pixels away, as a pixel's square and a Gaussian see
/// it, the square's sides along the edge: the mean of the normal distribution over the square.
double edge_share(double d, double sigma) {
  const auto integral = [&](double z) {
    return z * normal_below(z) + std::exp(-0.5 * z * z) / std::sqrt(2.0 * std::numbers::pi);
  };
  return sigma * (integral((d + 0.5) / sigma) - integral((d - 0.5) / sigma));
}

TEST(PatchPainter, SeesAnUprightEdgeThroughPixelAndBlur) {
  for (const double sigma : {0.6, 1.2})
    for (int x = 0; x < kPatch; ++x) {
      // A grid of half pixels is a little off, one way or the other, but right on average.
      constexpr int kPhases = 10;
      double sum = 0.0;
      for (int phase = 0; phase < kPhases; ++phase) {
        const double at = 7.0 + (phase + 0.5) / kPhases;
        // Ink on the right of x = at: upwards.
        const PatchPicture seen =
            paint({{{at, 100.0}, {at, -100.0}}}, 0, 0, {sigma * sigma, Vector2d::Zero()});
        const auto i = static_cast<std::size_t>(5 * kPatch + x);
        const double error = static_cast<double>(seen.ink[i]) - edge_share(x - at, sigma);
        EXPECT_LT(std::abs(error), 0.012) << "sigma " << sigma << " edge " << at << " pixel " << x;
        EXPECT_NEAR(seen.by_y[i], 0.0F, 1e-5F);
        sum += error / kPhases;
      }
      EXPECT_LT(std::abs(sum), 0.002) << "sigma " << sigma << " pixel " << x;
    }
}

TEST(PatchPainter, DerivativesAgreeWithDifferences) {
  const auto shifted = [&](double dx, double dy, double variance = 0.5) {
    const Vector2d d(dx, dy);
    // A square of 5.3 pixels, turned, clockwise.
    const std::array<Vector2d, 4> corners{Vector2d(5.1, 4.2) + d, Vector2d(10.2, 5.6) + d,
                                          Vector2d(8.8, 10.7) + d, Vector2d(3.7, 9.3) + d};
    std::vector<InkEdge> edges;
    for (std::size_t i = 0; i < 4; ++i) edges.push_back({corners[i], corners[(i + 1) % 4]});
    return paint(edges, 0, 0, {variance, Vector2d::Zero()});
  };
  const PatchPicture here = shifted(0, 0);
  const PatchPicture left = shifted(0.05, 0), right = shifted(-0.05, 0);
  const PatchPicture up = shifted(0, 0.05), down = shifted(0, -0.05);
  const PatchPicture sharp = shifted(0, 0, 0.48), soft = shifted(0, 0, 0.52);
  for (std::size_t i = 0; i < here.ink.size(); ++i) {
    EXPECT_NEAR(here.by_x[i], (right.ink[i] - left.ink[i]) / 0.1F, 0.02F);
    EXPECT_NEAR(here.by_y[i], (down.ink[i] - up.ink[i]) / 0.1F, 0.02F);
    EXPECT_NEAR(here.by_xx[i], (right.by_x[i] - left.by_x[i]) / 0.1F, 0.05F);
    EXPECT_NEAR(here.by_xy[i], (down.by_x[i] - up.by_x[i]) / 0.1F, 0.05F);
    // The heat equation.
    EXPECT_NEAR(0.5F * (here.by_xx[i] + here.by_yy[i]), (soft.ink[i] - sharp.ink[i]) / 0.04F,
                0.03F);
  }
}

TEST(PatchPainter, KnowsWhatLiesOnTheLeft) {
  // An edge from the left into the patch, ink below it; the patch has no other outline.
  const std::vector<InkEdge> edge{{{-50.0, 6.0}, {50.0, 9.0}}};
  // Asked about the middle of the widest gap, which is below the edge.
  const PatchPicture seen = paint(edge, 0, 0, {0.3, Vector2d::Zero()}, true);
  EXPECT_NEAR(seen.ink[0], 0.0F, 1e-5F);
  EXPECT_NEAR(seen.ink[15 * kPatch + 3], 1.0F, 1e-5F);
}

TEST(PatchPainter, SmearsAlongAWay) {
  const double at = 7.3;
  const std::vector<InkEdge> edge{{{at, 100.0}, {at, -100.0}}};
  const Blur across{0.3, {6.0, 0.0}}, along{0.3, {0.0, 6.0}};
  const PatchPicture still = paint(edge, 0, 0, {0.3, Vector2d::Zero()});
  const PatchPicture smeared = paint(edge, 0, 0, across), same = paint(edge, 0, 0, along);
  const auto row = static_cast<std::size_t>(8 * kPatch);
  for (std::size_t x = 0; x < kPatch; ++x) {
    EXPECT_NEAR(same.ink[row + x], still.ink[row + x], 1e-4F);
    if (x < 6 || x > 8) continue;  // far from the smear's ends: a ramp of six pixels
    EXPECT_NEAR(static_cast<double>(smeared.ink[row + x]),
                0.5 + (static_cast<double>(x) - at) / 6.0, 0.01);
  }
  // More ink ends in the margin: smeared, it doesn't reach the patch's fifth pixel.
  const std::vector<InkEdge> two{{{at, 100.0}, {at, -100.0}}, {{-5.6, -100.0}, {-5.6, 100.0}}};
  const PatchPicture beside = paint(two, 0, 0, across, true);
  for (std::size_t x = 4; x < kPatch; ++x)
    EXPECT_NEAR(beside.ink[row + x], smeared.ink[row + x], 1e-3F) << x;
  const Blur again = Blur::with_moments(across.moments());
  EXPECT_NEAR(again.variance, 0.3, 1e-9);
  EXPECT_NEAR(std::abs(again.smear.x()), 6.0, 1e-9);
}

// --- the camera's response
// ------------------------------------------------------------------------

TEST(Response, ByHand) {
  Response response;
  response.set(0.0, 0.1);  // gamma 1: nothing bends
  for (const float share : {0.0F, 0.3F, 1.0F}) EXPECT_NEAR(response.seen(share), share, 1e-5F);
  // Grey goes with the root of light; black is a fifth of white: 0.04 of its light. Half of both
  // is 0.52, of which the root is 0.7211.
  response.set(std::log(2.0), 0.2);
  EXPECT_NEAR(response.seen(0.5F), (0.7211 - 0.2) / 0.8, 1e-3);
  EXPECT_EQ(response.seen(-0.5F), response.seen(0.0F));
  EXPECT_EQ(response.seen(1.5F), response.seen(1.0F));
}

TEST(Response, DerivativesAgreeWithDifferences) {
  Response response, more, less;
  response.set(0.5, 0.2);
  more.set(0.51, 0.2);
  less.set(0.49, 0.2);
  kernels::LightTerms terms{};
  response.tell(terms);
  for (int i = 1; i < terms.cells; ++i) {
    const auto share = static_cast<float>(i) / static_cast<float>(terms.cells);
    const float step = 0.5F / static_cast<float>(terms.cells);
    EXPECT_EQ(terms.seen[i], response.seen(share));
    EXPECT_NEAR(terms.slope[i],
                (response.seen(share + step) - response.seen(share - step)) / (2.0F * step), 1e-3F);
    EXPECT_NEAR(terms.by_log_gamma[i], (more.seen(share) - less.seen(share)) / 0.02F, 1e-3F);
  }
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

/// Multiplies the light where `inside` says so, before the noise.
std::function<void(lab::FloatImage&)> shade(float gain,
                                            const std::function<bool(double, double)>& inside) {
  return [gain, inside](lab::FloatImage& image) {
    for (int y = 0; y < image.height; ++y)
      for (int x = 0; x < image.width; ++x)
        if (inside(x, y)) image.row(y)[x] *= gain;
  };
}

/// As good as in even light, but for the light that is missing.
void expect_good_in_shade(const std::function<void(lab::FloatImage&)>& shadow) {
  const Series lit = run({});
  Setting setting;
  setting.change_exact = shadow;
  const Series series = run(setting);
  expect_good(series, setting.frames);
  EXPECT_GT(median(series.share), 0.97 * median(lit.share));
  EXPECT_LT(median(series.angle), 1.8 * median(lit.angle));
}

TEST(Align, KnowsAShadowsEdge) {
  expect_good_in_shade(shade(0.6F, [](double x, double y) { return x + 0.5 * y < 410.0; }));
}

TEST(Align, KnowsAShadowWithTwoSides) {
  expect_good_in_shade(
      shade(0.5F, [](double x, double y) { return std::abs(x - 0.4 * y - 220.0) < 18.0; }));
}

TEST(Align, BearsSpottyShade) {
  Setting setting;
  setting.change_exact = shade(0.6F, [](double x, double y) {
    return std::hypot(x - 280.0, y - 220.0) < 22.0 || std::hypot(x - 350.0, y - 270.0) < 18.0 ||
           std::hypot(x - 300.0, y - 300.0) < 14.0 || std::hypot(x - 370.0, y - 200.0) < 16.0;
  });
  const Series series = run(setting);
  ASSERT_GE(series.frames, setting.frames - 1);
  EXPECT_GE(series.aligned, series.frames - 1);
  EXPECT_LT(median(series.angle), 0.85 * median(series.corner_angle));
  EXPECT_GT(series.mean_normalised(), 4.0);
  EXPECT_LT(series.mean_normalised(), 8.0);
}

/// White is whiter than the image can tell.
TEST(Align, KnowsThatWhiteIsClipped) {
  Setting setting;
  setting.change_exact = [](lab::FloatImage& image) {
    for (float& value : image.pixels) value *= 1.3F;
  };
  const Series series = run(setting);
  ASSERT_GE(series.frames, setting.frames - 1);
  EXPECT_GE(series.aligned, series.frames - 1);
  EXPECT_LT(series.mean_normalised(), 10.0);
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
  // It hides 7 % of the square. The same scenes in pairs: shares differ from scene to scene by
  // more.
  ASSERT_EQ(series.share.size(), clear.share.size());
  std::vector<double> less;
  for (std::size_t i = 0; i < series.share.size(); ++i)
    less.push_back(clear.share[i] - series.share[i]);
  EXPECT_GT(median(less), 0.03);
  EXPECT_LT(median(series.angle), 2.0 * median(clear.angle));
}

TEST(Align, FollowsAMotion) {
  Setting setting;
  setting.frames = 12;
  setting.change_exact = [](lab::FloatImage& image) {
    // Six pixels along a diagonal: (-1.8, -2.4) to (1.8, 2.4) in steps of a tenth.
    lab::FloatImage smeared(image.width, image.height, 0.0F);
    constexpr int kSteps = 60;
    for (int k = 0; k < kSteps; ++k) {
      const double at = (k + 0.5) / kSteps - 0.5;
      const double dx = 3.6 * at, dy = 4.8 * at;
      const int ix = static_cast<int>(std::floor(dx)), iy = static_cast<int>(std::floor(dy));
      const auto fx = static_cast<float>(dx - ix), fy = static_cast<float>(dy - iy);
      for (int y = 4; y < image.height - 4; ++y) {
        const float *a = image.row(y + iy) + ix, *b = image.row(y + iy + 1) + ix;
        for (int x = 4; x < image.width - 4; ++x)
          smeared.row(y)[x] += ((1 - fy) * ((1 - fx) * a[x] + fx * a[x + 1]) +
                                fy * ((1 - fx) * b[x] + fx * b[x + 1])) /
                               kSteps;
      }
    }
    image = smeared;
  };
  const Series series = run(setting);
  ASSERT_GE(series.frames, setting.frames - 2);
  EXPECT_GE(series.aligned, series.frames - 1);
  EXPECT_LT(median(series.angle), 0.5 * median(series.corner_angle));
  EXPECT_LT(series.mean_normalised(), 12.0);
}

TEST(Align, FollowsTheCamerasResponse) {
  Setting setting;
  setting.change_exact = [](lab::FloatImage& image) {
    for (float& value : image.pixels) value = 255.0F * std::pow(value / 255.0F, 1.0F / 2.2F);
  };
  expect_good(run(setting), setting.frames);
}

/// Where only a single child was found, the rest of the sheet is seen all the same.
TEST(Align, GrowsFromAChild) {
  const Camera camera = Camera::pinhole(640, 480, 700.0);
  DetectorOptions options;
  options.camera = camera;
  Detector detector(markers(), options);
  int children = 0, as_good = 0;
  for (int k = 0; k < 12; ++k) {
    lab::Scene scene;
    scene.camera = camera;
    const Isometry3d truth = lab::look_at_marker({0.33, 0.36}, 3.0, 0.05 * k, 0.5 * k, 0.3 * k);
    scene.parents = {{0, truth}};
    const Image image = lab::render(scene, markers(), static_cast<std::uint64_t>(k));
    std::vector<Detection> all = detector.detect(image.view()), child;
    for (const Detection& seen : all)
      if (seen.layer == 2 && child.empty()) child.push_back(seen);
    if (child.empty()) continue;
    ++children;
    const Pose whole = estimate_poses(image.view(), all, markers(), camera).at(0);
    const Pose grown = estimate_poses(image.view(), child, markers(), camera).at(0);
    const Vector6d apart = error_of(grown.camera_T_marker, whole.camera_T_marker);
    if (grown.aligned && apart.dot(whole.covariance->ldlt().solve(apart)) < 1.0) ++as_good;
  }
  EXPECT_GE(children, 10);
  EXPECT_GE(as_good, children - 1);
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

TEST_F(Unaligned, AnEstimatorHasNoMemoryOfOtherFrames) {
  const Pose alone = pose(image_);
  PoseEstimator estimator(markers());
  EXPECT_EQ(estimator.markers().parents.size(), 1U);
  for (const int seed : {1, 2, 3}) {
    Image other = image_;
    std::mt19937 random(static_cast<std::uint32_t>(seed));
    for (auto& pixel : other.pixels)
      if (random() % 8 < static_cast<unsigned>(seed)) pixel = 90;
    estimator.estimate(other.view(), detections_, camera_);
    const Pose again = estimator.estimate(image_.view(), detections_, camera_).at(0);
    EXPECT_EQ(again.camera_T_marker.matrix(), alone.camera_T_marker.matrix());
    EXPECT_EQ(*again.covariance, *alone.covariance);
  }
  EXPECT_TRUE(estimator.estimate(image_.view(), {}, camera_).empty());
}

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
