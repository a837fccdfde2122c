#include "lab/bound.hpp"

#include <cmath>
#include <functional>
#include <numbers>
#include <stdexcept>

#include <gtest/gtest.h>
#include <Eigen/Dense>

namespace harco::lab {
namespace {

/// A black square of 1 m without anything in it, on paper with 0.3 m around it.
std::vector<Sheet> square_sheet() {
  return {Sheet{{{0, 0, 1, 1}, {}, {}}, {-0.3, -0.3, 1.3, 1.3}}};
}

Scene frontal(double distance) {
  Scene scene;
  scene.camera = Camera::pinhole(101, 101, 200.0);  // principal point (50, 50)
  scene.oversampling = 16;
  scene.parents.push_back({0, look_at_marker({0.45, 0.53}, distance)});
  return scene;
}

/// The share of a pixel at distance u on the dark side of a blurred edge that is dark, and its
/// derivative: the pixel's mean of the normal distribution function.
double dark_share(double u, double sigma) {
  const auto integral = [&](double x) {
    return x * 0.5 * std::erfc(-x / sigma / std::numbers::sqrt2) +
           sigma * std::exp(-0.5 * x * x / (sigma * sigma)) / std::sqrt(2.0 * std::numbers::pi);
  };
  return integral(u + 0.5) - integral(u - 0.5);
}
double dark_slope(double u, double sigma) {
  const auto phi = [&](double x) { return 0.5 * std::erfc(-x / sigma / std::numbers::sqrt2); };
  return phi(u + 0.5) - phi(u - 0.5);
}

/// Sum over the pixels of a row or column of f(distance from the first edge, ... from the second).
double sum_squared(double first, double last, const std::function<double(double, double)>& f) {
  double sum = 0.0;
  for (int x = 0; x <= 100; ++x) sum += std::pow(f(x - first, last - x), 2);
  return sum;
}

TEST(Bound, OfShiftsOfASquareInClosedForm) {
  // Seen straight on, the square's picture is the product of its profiles along x and y, so the
  // sums over the pixels part into those of rows and columns.
  const double distance = 4.0, scale = 200.0 / distance;  // pixels per metre
  const Scene scene = frontal(distance);
  const double s = scene.psf_sigma_px;
  const double left = 50.0 - 0.45 * scale, right = left + scale;
  const double top = 50.0 - 0.53 * scale, bottom = top + scale;
  const auto profile = [&](double a, double b) {
    return dark_share(a, s) + dark_share(b, s) - 1.0;
  };
  const auto shift = [&](double a, double b) { return dark_slope(b, s) - dark_slope(a, s); };
  const double contrast = scene.white - scene.black;
  const double per_pixel = contrast * contrast / (4.0 + 1.0 / 12.0);

  const Matrix6d information = pose_information(scene, square_sheet());
  const auto in_metres = [&](double a, double b) { return per_pixel * scale * scale * a * b; };
  EXPECT_NEAR(information(0, 0) /
                  in_metres(sum_squared(left, right, shift), sum_squared(top, bottom, profile)),
              1.0, 5e-3);
  EXPECT_NEAR(information(1, 1) /
                  in_metres(sum_squared(left, right, profile), sum_squared(top, bottom, shift)),
              1.0, 5e-3);
}

TEST(Bound, OfAStraightEdgeIsThatOfItsProfile) {
  // The upper side only, far beyond the picture's left, right and lower border: a shift along y is
  // known from a hundred and one columns of the same edge; a shift along x not at all.
  const double distance = 2.0;
  Scene scene = frontal(distance);
  scene.parents[0].camera_T_marker.translation() = Eigen::Vector3d(-0.5, 0.0013, distance);
  const std::vector<Sheet> sheet{{{{-1, 0, 2, 2}, {}, {}}, {-2, -1, 3, 3}}};
  const double scale = 200.0 / distance, top = 50.0 + 0.0013 * scale;
  const double contrast = scene.white - scene.black;
  double sum = 0.0;
  for (int y = 0; y <= 100; ++y) sum += std::pow(dark_slope(y - top, scene.psf_sigma_px), 2);
  const double expected = 101.0 * sum * std::pow(contrast * scale, 2) / (4.0 + 1.0 / 12.0);
  const Matrix6d information = pose_information(scene, sheet);
  EXPECT_NEAR(information(1, 1) / expected, 1.0, 5e-3);
  EXPECT_NEAR(information(0, 0) / expected, 0.0, 1e-6);
  EXPECT_THROW(pose_bound(scene, sheet), std::invalid_argument);
}

TEST(Bound, IsTheInverseOfTheInformation) {
  Scene scene = frontal(3.0);
  scene.parents[0].camera_T_marker = look_at_marker({0.45, 0.53}, 3.0, 0.6, 0.3, 0.2);
  const Matrix6d product =
      pose_bound(scene, square_sheet()) * pose_information(scene, square_sheet());
  EXPECT_TRUE(product.isIdentity(1e-6)) << product;
}

TEST(Bound, TurnsWithThePicture) {
  // A quarter turn about the optical axis of a picture that is its own quarter turn: the
  // information about the translation turns with it, the rotations (marker side) keep theirs.
  Scene scene = frontal(3.0);
  scene.parents[0].camera_T_marker = look_at_marker({0.45, 0.53}, 3.0, 0.6, 0.3, 0.2);
  Scene turned = scene;
  turned.parents[0].camera_T_marker =
      look_at_marker({0.45, 0.53}, 3.0, 0.6, 0.3, 0.2 + std::numbers::pi / 2);
  const Matrix6d a = pose_information(scene, square_sheet());
  const Matrix6d b = pose_information(turned, square_sheet());
  EXPECT_NEAR(b(1, 1) / a(0, 0), 1.0, 2e-3);
  EXPECT_NEAR(b(0, 0) / a(1, 1), 1.0, 2e-3);
  for (int i = 2; i < 6; ++i) EXPECT_NEAR(b(i, i) / a(i, i), 1.0, 2e-3) << i;
}

TEST(Bound, FallsWithTheNoiseAndIgnoresWhatLiesAroundThePaper) {
  Scene scene = frontal(4.0);
  scene.parents[0].camera_T_marker = look_at_marker({0.45, 0.53}, 4.0, 0.6, 0.3, 0.2);
  const Matrix6d quiet = pose_bound(scene, square_sheet());
  scene.noise_sigma = 4.0;
  const Matrix6d loud = pose_bound(scene, square_sheet());
  EXPECT_TRUE(loud.isApprox(quiet * (16.0 + 1.0 / 12.0) / (4.0 + 1.0 / 12.0), 1e-9));
  scene.grey = 10.0;
  EXPECT_TRUE(loud.isApprox(pose_bound(scene, square_sheet()), 1e-9));
  scene.background = Image(101, 101, 77);
  EXPECT_TRUE(loud.isApprox(pose_bound(scene, square_sheet()), 1e-9));
}

TEST(Bound, RefusesNonsense) {
  Scene scene = frontal(4.0);
  EXPECT_THROW(pose_bound(scene, square_sheet(), 1), std::invalid_argument);
  EXPECT_THROW(pose_bound(scene, square_sheet(), -1), std::invalid_argument);
  EXPECT_THROW(pose_bound(scene, {}), std::invalid_argument);
  scene.gain_left = 0.7;
  EXPECT_THROW(pose_bound(scene, square_sheet()), std::invalid_argument);
  scene.gain_left = 1.0;
  scene.parents[0].camera_T_marker.translation().x() = 50.0;  // out of the picture
  EXPECT_THROW(pose_bound(scene, square_sheet()), std::invalid_argument);
}

}  // namespace
}  // namespace harco::lab
