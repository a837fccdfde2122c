#include "lab/render.hpp"

#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <stdexcept>

#include <gtest/gtest.h>

#include "harco/geometry.hpp"

namespace harco::lab {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

using Polygon = std::vector<Eigen::Vector2d>;

double sum(const FloatImage& image) {
  double total = 0.0;
  for (const float value : image.pixels) total += static_cast<double>(value);
  return total;
}

double at(const FloatImage& image, int x, int y) { return static_cast<double>(image.row(y)[x]); }

/// Two layers, 1.4 m: cells of 0.2 m.
MarkerSet two_layers() {
  MarkerSet set;
  Parent parent;
  parent.side_m = 1.4;
  parent.marker.code = parse_code("1101011101101110110111001");
  Marker child;
  child.id = 3;
  child.cell = 0;
  child.code = parse_code("1110110111111011011111110");
  parent.marker.children.push_back(child);
  child.id = 4;
  child.cell = 24;
  child.code = rotated(child.code, 1);
  parent.marker.children.push_back(child);
  set.parents.push_back(parent);
  return set;
}

Scene scene_of(const Camera& camera, const Eigen::Isometry3d& camera_T_marker) {
  Scene scene;
  scene.camera = camera;
  scene.parents.push_back({0, camera_T_marker});
  return scene;
}

TEST(Coverage, OfPixelsByHand) {
  Coverage coverage({10, 20, 3, 2}, {0.0, 1});
  // Pixel (11, 20) reaches from 10.5 to 11.5 and from 19.5 to 20.5. The rectangle covers its right
  // 0.75 x lower 0.5, all the right neighbour's lower half, and the lower row to 20.75.
  coverage.add({{10.75, 20.0}, {13.0, 20.0}, {13.0, 20.75}, {10.75, 20.75}});
  const FloatImage image = coverage.blurred();
  EXPECT_NEAR(at(image, 0, 0), 0.0, 1e-7);
  EXPECT_NEAR(at(image, 1, 0), 0.75 * 0.5, 1e-7);
  EXPECT_NEAR(at(image, 2, 0), 0.5, 1e-7);
  EXPECT_NEAR(at(image, 1, 1), 0.75 * 0.25, 1e-7);
  EXPECT_NEAR(at(image, 2, 1), 0.25, 1e-7);
}

TEST(Coverage, OfATriangleByHand) {
  // Below the diagonal of a 2 x 2 block: half of the pixels on it, one whole pixel.
  Coverage coverage({0, 0, 2, 2}, {0.0, 3});
  coverage.add({{-0.5, -0.5}, {1.5, 1.5}, {-0.5, 1.5}}, 2.0);
  const FloatImage image = coverage.blurred();
  EXPECT_NEAR(at(image, 0, 0), 1.0, 1e-6);
  EXPECT_NEAR(at(image, 1, 0), 0.0, 1e-6);
  EXPECT_NEAR(at(image, 0, 1), 2.0, 1e-6);
  EXPECT_NEAR(at(image, 1, 1), 1.0, 1e-6);
}

TEST(Coverage, SumsToThePolygonsAreaWithAnyBlur) {
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> place(12.0, 47.0);
  for (int trial = 0; trial < 60; ++trial) {
    Polygon polygon;
    double area = 0.0;
    for (int i = 0; i < 3 + trial % 4; ++i) polygon.emplace_back(place(random), place(random));
    for (std::size_t i = 0; i < polygon.size(); ++i) {
      const Eigen::Vector2d& a = polygon[i];
      const Eigen::Vector2d& b = polygon[(i + 1) % polygon.size()];
      area += 0.5 * (a.x() * b.y() - b.x() * a.y());
    }
    Coverage coverage({0, 0, 60, 60}, {0.3 * (trial % 5), 1 + trial % 4});
    coverage.add(polygon);
    EXPECT_NEAR(sum(coverage.blurred()), area, 1e-3) << trial;
  }
}

TEST(Coverage, ClipsAtItsWindow) {
  // Whatever the window, a pixel's value is the same.
  const Polygon polygon{{-30.0, 3.2}, {25.0, -40.0}, {70.0, 22.5}, {11.0, 55.0}};
  const Psf psf{0.8, 4};
  Coverage whole({-60, -60, 160, 160}, psf);
  whole.add(polygon);
  Coverage part({4, 7, 13, 11}, psf);
  part.add(polygon);
  const FloatImage all = whole.blurred();
  const FloatImage some = part.blurred();
  for (int y = 0; y < 11; ++y)
    for (int x = 0; x < 13; ++x) EXPECT_NEAR(at(some, x, y), at(all, x + 64, y + 67), 1e-5);
}

TEST(Coverage, BlursAnEdgeAsTheGaussianDoes) {
  // A vertical edge at x = 10.3, covered on its right: the pixel at x takes the mean of the normal
  // distribution over [x - 0.5, x + 0.5].
  // What the sub-pixels leave out falls with the square of their size.
  struct Case {
    double sigma;
    int oversampling;
    double tolerance;
  };
  for (const Case& test : {Case{0.5, 4, 4e-3}, Case{0.6, 4, 2e-3}, Case{1.0, 4, 1e-3},
                           Case{2.5, 4, 2e-4}, Case{0.6, 8, 5e-4}, Case{0.6, 16, 1.25e-4}}) {
    Coverage coverage({0, 0, 21, 1}, {test.sigma, test.oversampling});
    coverage.add({{10.3, -50.0}, {80.0, -50.0}, {80.0, 50.0}, {10.3, 50.0}});
    const FloatImage image = coverage.blurred();
    const auto integral = [&](double x) {  // of Phi(x / sigma)
      const double u = x / test.sigma;
      return x * 0.5 * std::erfc(-u / std::numbers::sqrt2) +
             test.sigma * std::exp(-0.5 * u * u) / std::sqrt(2.0 * std::numbers::pi);
    };
    for (int x = 0; x < 21; ++x)
      EXPECT_NEAR(at(image, x, 0), integral(x + 0.5 - 10.3) - integral(x - 0.5 - 10.3),
                  test.tolerance)
          << test.sigma << ", " << test.oversampling << " at " << x;
  }
}

TEST(Coverage, RefusesNonsense) {
  EXPECT_THROW(Coverage({0, 0, 0, 4}, {}), std::invalid_argument);
  EXPECT_THROW(Coverage({0, 0, 4, 4}, {-1.0, 4}), std::invalid_argument);
  EXPECT_THROW(Coverage({0, 0, 4, 4}, {kNan, 4}), std::invalid_argument);
  EXPECT_THROW(Coverage({0, 0, 4, 4}, {0.6, 0}), std::invalid_argument);
}

TEST(LookAtMarker, PutsThePointOnTheAxis) {
  const Eigen::Isometry3d frontal = look_at_marker({0.3, 0.4}, 2.0);
  EXPECT_TRUE(frontal.linear().isIdentity());
  EXPECT_TRUE(frontal.translation().isApprox(Eigen::Vector3d(-0.3, -0.4, 2.0)));
  const Eigen::Isometry3d any = look_at_marker({0.3, 0.4}, 2.0, 0.7, 1.1, -2.0);
  EXPECT_TRUE((any * Eigen::Vector3d(0.3, 0.4, 0.0)).isApprox(Eigen::Vector3d(0.0, 0.0, 2.0)));
  // Between the marker's normal and the optical axis lies the tilt.
  EXPECT_NEAR(any.linear()(2, 2), std::cos(0.7), 1e-12);
}

/// Where a row's step from left to right lies: beyond it all is `after`, before it `before`.
double step_position(const FloatImage& image, int y, int x0, int x1, double before, double after) {
  double share = 0.0;
  for (int x = x0; x <= x1; ++x) share += (at(image, x, y) - before) / (after - before);
  return x1 + 0.5 - share;
}

TEST(Render, PutsEdgesWhereTheCameraProjectsThem) {
  const Camera camera = Camera::pinhole(640, 480, 700.0);
  const Scene scene = scene_of(camera, look_at_marker({0.7, 0.7}, 3.0, 0.5, 0.4, 0.05));
  const FloatImage image = render_exact(scene, two_layers());
  // The left side of the black square, crossed in each pixel row; the mean over a row of a slanted
  // edge is the edge at the row's middle.
  const auto top = *camera.project(scene.parents[0].camera_T_marker * Eigen::Vector3d::Zero());
  const auto bottom =
      *camera.project(scene.parents[0].camera_T_marker * Eigen::Vector3d(0.0, 1.4, 0.0));
  int rows = 0;
  for (int y = static_cast<int>(top.y()) + 8; y < bottom.y() - 8; ++y, ++rows) {
    const double x = top.x() + (y - top.y()) * (bottom.x() - top.x()) / (bottom.y() - top.y());
    const int middle = static_cast<int>(std::lround(x));
    EXPECT_NEAR(step_position(image, y, middle - 8, middle + 8, scene.white, scene.black), x, 2e-3);
  }
  EXPECT_GT(rows, 200);
}

TEST(Render, BendsEdgesAsTheLensDoes) {
  Camera camera = Camera::pinhole(640, 480, 500.0);
  for (const double k1 : {-0.25, 0.2}) {
    camera.coefficients = {k1, 0.05, 0.001, -0.002};
    const Scene scene = scene_of(camera, look_at_marker({0.7, 0.7}, 1.7, 0.3, 1.4));
    const Eigen::Isometry3d& pose = scene.parents[0].camera_T_marker;
    const FloatImage image = render_exact(scene, two_layers());
    double bend = 0.0;
    const auto on_edge = [&](double y_m) {
      return *camera.project(pose * Eigen::Vector3d(0.0, y_m, 0.0));
    };
    for (double y_m = 0.05; y_m < 1.36; y_m += 0.01) {
      // Move along the edge to where it crosses the middle of a pixel row.
      double s = y_m;
      const double row = std::round(on_edge(s).y());
      for (int i = 0; i < 20; ++i)
        s += (row - on_edge(s).y()) * 1e-5 / (on_edge(s + 1e-5).y() - on_edge(s).y());
      const double x = on_edge(s).x();
      const int y = static_cast<int>(row), middle = static_cast<int>(std::lround(x));
      EXPECT_NEAR(step_position(image, y, middle - 7, middle + 7, scene.white, scene.black), x,
                  0.01);
      const double chord = on_edge(0.0).x() + (on_edge(1.4).x() - on_edge(0.0).x()) * s / 1.4;
      bend = std::max(bend, std::abs(x - chord));
    }
    EXPECT_GT(bend, 2.0) << "the edge must be curved for this test to mean anything";
  }
}

/// Grey level by many rays through one pixel: slow, and independent of polygons and clipping.
double by_rays(const Scene& scene, const InkPlan& plan, int x, int y, double zone) {
  constexpr int kRays = 24;
  const Eigen::Isometry3d marker_T_camera = scene.parents[0].camera_T_marker.inverse();
  const auto hit = [](const std::vector<Rect>& coat, double u, double v) {
    for (const Rect& r : coat)
      if (u >= r.x0 && u < r.x1 && v >= r.y0 && v < r.y1) return true;
    return false;
  };
  double total = 0.0;
  for (int i = 0; i < kRays * kRays; ++i) {
    const Eigen::Vector2d pixel(x - 0.5 + (i % kRays + 0.5) / kRays,
                                y - 0.5 + (i / kRays + 0.5) / kRays);
    const Eigen::Vector3d ray = scene.camera.unproject(pixel)->homogeneous();
    const Eigen::Vector3d origin = marker_T_camera.translation();
    const Eigen::Vector3d direction = marker_T_camera.linear() * ray;
    const double s = -origin.z() / direction.z();
    const double u = origin.x() + s * direction.x(), v = origin.y() + s * direction.y();
    const double low = -zone, high = plan.square.x1 + zone;
    if (s <= 0.0 || u < low || v < low || u > high || v > high) {
      total += scene.grey;
      continue;
    }
    const bool black =
        hit({plan.square}, u, v) && (!hit(plan.white, u, v) || hit(plan.black, u, v));
    total += black ? scene.black : scene.white;
  }
  return total / (kRays * kRays);
}

TEST(Render, AgreesWithRaysFromAnywhereEvenPartlyBehindTheCamera) {
  const MarkerSet set = two_layers();
  const InkPlan plan = ink_plan(set, 0);
  std::mt19937_64 random(11);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  int behind = 0, mixed = 0;
  for (int trial = 0; trial < 40; ++trial) {
    Camera camera = Camera::pinhole(160, 120, 150.0);
    if (trial % 2 == 1) camera.coefficients = {-0.2, 0.04};
    const double distance = std::exp(std::log(0.03) + unit(random) * std::log(5.0 / 0.03));
    Scene scene = scene_of(
        camera, look_at_marker({1.4 * unit(random), 1.4 * unit(random)}, distance,
                               1.3 * unit(random), 7.0 * unit(random), 7.0 * unit(random)));
    scene.psf_sigma_px = 0.0;
    for (const double u : {-0.2, 1.6})
      for (const double v : {-0.2, 1.6})
        if ((scene.parents[0].camera_T_marker * Eigen::Vector3d(u, v, 0.0)).z() < 0.0) ++behind;
    const FloatImage image = render_exact(scene, set);
    for (int i = 0; i < 60; ++i) {
      const int x = static_cast<int>(160 * unit(random)), y = static_cast<int>(120 * unit(random));
      const double expected = by_rays(scene, plan, x, y, 0.2);
      EXPECT_NEAR(at(image, x, y), expected, 9.0) << "trial " << trial << " at " << x << ", " << y;
      if (expected != scene.black && expected != scene.white && expected != scene.grey) ++mixed;
    }
  }
  EXPECT_GT(behind, 5);
  EXPECT_GT(mixed, 60);
}

TEST(Render, ShowsNothingFromBehind) {
  Scene scene = scene_of(Camera::pinhole(64, 48, 60.0),
                         look_at_marker({0.7, 0.7}, 3.0, std::numbers::pi, 0.0));
  for (const float value : render_exact(scene, two_layers()).pixels) EXPECT_EQ(value, 128.0F);
}

TEST(Render, LightsTheSheetAlongItsXAxis) {
  Scene scene = scene_of(Camera::pinhole(200, 200, 200.0), look_at_marker({0.7, 0.7}, 2.0));
  scene.gain_left = 0.5;
  scene.gain_right = 1.0;
  const FloatImage image = render_exact(scene, two_layers());
  // 100 px per metre; the optical axis at (99.5, 99.5) meets (0.7, 0.7). The border ring is black.
  EXPECT_NEAR(at(image, 99, 35), 25.0 * (0.5 + 0.5 * 0.695 / 1.4), 1e-4);
  EXPECT_NEAR(at(image, 160, 35), 25.0 * (0.5 + 0.5 * 1.305 / 1.4), 1e-4);
}

TEST(Render, KeepsTheBackgroundAroundTheSheet) {
  Scene scene = scene_of(Camera::pinhole(100, 80, 100.0), look_at_marker({0.7, 0.7}, 5.0));
  scene.background = Image(100, 80);
  for (int y = 0; y < 80; ++y)
    for (int x = 0; x < 100; ++x) scene.background->row(y)[x] = static_cast<std::uint8_t>(x + y);
  const FloatImage image = render_exact(scene, two_layers());
  EXPECT_EQ(at(image, 3, 5), 8.0);
  EXPECT_EQ(at(image, 97, 70), 167.0);
  scene.background = Image(99, 80);
  EXPECT_THROW(render_exact(scene, two_layers()), std::invalid_argument);
}

TEST(Render, AddsTheNoiseAskedFor) {
  Scene scene;
  scene.camera = Camera::pinhole(200, 200, 200.0);
  scene.noise_sigma = 3.0;
  const Image image = render(scene, two_layers(), 42);
  double mean = 0.0, square = 0.0;
  for (const std::uint8_t value : image.pixels) mean += value / 40000.0;
  for (const std::uint8_t value : image.pixels) square += (value - mean) * (value - mean) / 40000.0;
  EXPECT_NEAR(mean, 128.0, 0.1);
  EXPECT_NEAR(std::sqrt(square), std::hypot(3.0, std::sqrt(1.0 / 12.0)), 0.1);
  EXPECT_EQ(image.pixels, render(scene, two_layers(), 42).pixels);
  EXPECT_NE(image.pixels, render(scene, two_layers(), 43).pixels);
}

TEST(Render, RefusesNonsense) {
  Scene scene = scene_of(Camera::pinhole(64, 48, 60.0), look_at_marker({0.7, 0.7}, 3.0));
  scene.noise_sigma = kNan;
  EXPECT_THROW(render_exact(scene, two_layers()), std::invalid_argument);
  scene.noise_sigma = 0.0;
  scene.psf_sigma_px = -1.0;
  EXPECT_THROW(render_exact(scene, two_layers()), std::invalid_argument);
  scene.psf_sigma_px = 0.6;
  scene.parents[0].parent_index = 1;
  EXPECT_THROW(render_exact(scene, two_layers()), std::invalid_argument);
}

}  // namespace
}  // namespace harco::lab
