#include "pose/blurred_ink.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace harco {
namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;

// Beyond so many sigmas, there is nothing left of a Gaussian.
constexpr double kReach = 4.5;
// Rectangles smaller than this in both directions, in sigmas, are as good as a small Gaussian.
constexpr double kSmall = 0.8;

double density(double z) { return std::exp(-0.5 * z * z) / std::sqrt(2.0 * std::numbers::pi); }

double distribution(double z) { return 0.5 * std::erfc(-z * std::numbers::sqrt2 / 2.0); }

/// One coordinate of an edge, in sigmas from the Gaussian's middle.
struct Cut {
  explicit Cut(double at) : z(std::clamp(at, -kReach, kReach)), inside(z == at) {
    below = inside ? distribution(z) : (z > 0.0 ? 1.0 : 0.0);
    here = inside ? density(z) : 0.0;
  }
  double z;
  bool inside;   ///< whether the Gaussian reaches so far
  double below;  ///< share of the Gaussian below the cut
  double here;   ///< its density there
};

/// Shape of a Gaussian with unit variances.
struct Correlation {
  explicit Correlation(double r)
      : rho(r), angle(std::asin(r)), narrowing(1.0 / std::sqrt(1.0 - r * r)) {
    // Gauss-Legendre over the angle from 0 to asin(rho).
    constexpr std::array<double, 5> kAt{0.0469100770306680, 0.2307653449471585, 0.5,
                                        0.7692346550528415, 0.9530899229693320};
    for (std::size_t i = 0; i < kAt.size(); ++i) {
      sine[i] = std::sin(angle * kAt[i]);
      half_secant2[i] = 0.5 / (1.0 - sine[i] * sine[i]);
    }
  }
  double rho, angle, narrowing;
  std::array<double, 5> sine{}, half_secant2{};
};

/// A value with its derivatives by the two cuts.
struct Quadrant {
  double value = 0.0, by_x = 0.0, by_y = 0.0;
};

/// Share of the Gaussian that lies below both cuts (Drezner and Wesolowsky 1990).
Quadrant quadrant(const Cut& x, const Cut& y, const Correlation& shape) {
  if (!x.inside || !y.inside) return {x.below * y.below, x.here * y.below, y.here * x.below};
  constexpr std::array<double, 5> kWeight{0.1184634425280945, 0.2393143352496832,
                                          0.2844444444444444, 0.2393143352496832,
                                          0.1184634425280945};
  double sum = 0.0;
  if (shape.rho != 0.0) {
    const double square = x.z * x.z + y.z * y.z;
    const double product = 2.0 * x.z * y.z;
    for (std::size_t i = 0; i < kWeight.size(); ++i)
      sum += kWeight[i] * std::exp((product * shape.sine[i] - square) * shape.half_secant2[i]);
  }
  return {x.below * y.below + sum * shape.angle / (2.0 * std::numbers::pi),
          x.here * distribution((y.z - shape.rho * x.z) * shape.narrowing),
          y.here * distribution((x.z - shape.rho * y.z) * shape.narrowing)};
}

/// Share of the Gaussian in a rectangle, in sigmas from its middle, with its derivatives by a shift
/// of the rectangle and by the logarithm of its size.
struct Share {
  double value = 0.0, by_x = 0.0, by_y = 0.0, by_log_size = 0.0;
};

Share large_share(const Rect& r, const Correlation& shape) {
  Share share;
  const std::array<Cut, 2> x{Cut(r.x0), Cut(r.x1)};
  const std::array<Cut, 2> y{Cut(r.y0), Cut(r.y1)};
  for (std::size_t i = 0; i < 2; ++i)
    for (std::size_t j = 0; j < 2; ++j) {
      const double sign = i == j ? 1.0 : -1.0;
      const Quadrant q = quadrant(x[i], y[j], shape);
      share.value += sign * q.value;
      share.by_x += sign * q.by_x;
      share.by_y += sign * q.by_y;
      share.by_log_size += sign * (x[i].z * q.by_x + y[j].z * q.by_y);
    }
  return share;
}

/// The rectangle as a Gaussian of its own with the same second moments.
Share small_share(const Rect& r, const Correlation& shape) {
  const Vector2d at(0.5 * (r.x0 + r.x1), 0.5 * (r.y0 + r.y1));
  const Vector2d spread(r.width() * r.width() / 12.0, r.height() * r.height() / 12.0);
  const double xx = 1.0 + spread.x(), yy = 1.0 + spread.y(), xy = shape.rho;
  const double determinant = xx * yy - xy * xy;
  const Vector2d z((yy * at.x() - xy * at.y()) / determinant,
                   (xx * at.y() - xy * at.x()) / determinant);
  Share share;
  share.value =
      r.area() * std::exp(-0.5 * at.dot(z)) / (2.0 * std::numbers::pi * std::sqrt(determinant));
  share.by_x = -z.x() * share.value;
  share.by_y = -z.y() * share.value;
  const double bend_x = (z.x() * z.x() - yy / determinant) * share.value;
  const double bend_y = (z.y() * z.y() - xx / determinant) * share.value;
  share.by_log_size = 2.0 * share.value + at.x() * share.by_x + at.y() * share.by_y +
                      spread.x() * bend_x + spread.y() * bend_y;
  return share;
}

}  // namespace

BlurredInk::BlurredInk(const InkPlan& plan, double detail) : square_(plan.square) {
  constexpr double kMostBins = 64.0;
  bins_ = static_cast<int>(std::clamp(square_.width() / (2.0 * kReach * detail), 1.0, kMostBins));
  patches_.push_back({plan.square, -1.0});
  for (const Rect& white : plan.white) patches_.push_back({white, 1.0});
  for (const Rect& black : plan.black) patches_.push_back({black, -1.0});
  by_bin_.resize(static_cast<std::size_t>(bins_ * bins_));
  for (std::size_t i = 0; i < patches_.size(); ++i) {
    const Rect& r = patches_[i].rect;
    for (int y = bin(r.y0); y <= bin(r.y1); ++y)
      for (int x = bin(r.x0); x <= bin(r.x1); ++x)
        by_bin_[static_cast<std::size_t>(y * bins_ + x)].push_back(static_cast<int>(i));
  }
}

int BlurredInk::bin(double coordinate) const {
  return static_cast<int>(
      std::clamp(coordinate / square_.width() * bins_, 0.0, static_cast<double>(bins_ - 1)));
}

Whiteness BlurredInk::at(const Vector2d& point, const Matrix2d& covariance) const {
  const double sx = std::sqrt(covariance(0, 0));
  const double sy = std::sqrt(covariance(1, 1));
  const Correlation shape(covariance(0, 1) / (sx * sy));
  const Rect window{point.x() - kReach * sx, point.y() - kReach * sy, point.x() + kReach * sx,
                    point.y() + kReach * sy};
  Whiteness seen;
  const auto add = [&](const Patch& patch) {
    const Rect r{(patch.rect.x0 - point.x()) / sx, (patch.rect.y0 - point.y()) / sy,
                 (patch.rect.x1 - point.x()) / sx, (patch.rect.y1 - point.y()) / sy};
    const bool small = r.width() < kSmall && r.height() < kSmall;
    const Share share = small ? small_share(r, shape) : large_share(r, shape);
    seen.share += patch.sign * share.value;
    seen.gradient.x() -= patch.sign * share.by_x / sx;
    seen.gradient.y() -= patch.sign * share.by_y / sy;
    seen.by_log_sigma -= patch.sign * share.by_log_size;
  };
  const int x0 = bin(window.x0), y0 = bin(window.y0);
  const int x1 = bin(window.x1), y1 = bin(window.y1);
  for (int y = y0; y <= y1; ++y)
    for (int x = x0; x <= x1; ++x)
      for (const int index : by_bin_[static_cast<std::size_t>(y * bins_ + x)]) {
        const Patch& patch = patches_[static_cast<std::size_t>(index)];
        const Rect& r = patch.rect;
        if (r.x1 < window.x0 || r.x0 > window.x1 || r.y1 < window.y0 || r.y0 > window.y1) continue;
        // A rectangle in several bins counts in the first of them that the window has.
        if (x == std::max(x0, bin(r.x0)) && y == std::max(y0, bin(r.y0))) add(patch);
      }
  return seen;
}

}  // namespace harco
