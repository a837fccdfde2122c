#include "harco/camera.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <Eigen/LU>

namespace harco {
namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;

constexpr double kHalfPi = 1.57079632679489661923;

/// Coefficients of a polynomial, constant first.
template <std::size_t Size>
using Polynomial = std::array<double, Size>;

template <std::size_t Size>
double evaluate(const Polynomial<Size>& polynomial, double at) {
  double value = 0.0;
  for (std::size_t i = Size; i-- > 0;) value = value * at + polynomial[i];
  return value;
}

template <std::size_t Size>
Polynomial<Size - 1> derivative(const Polynomial<Size>& polynomial) {
  Polynomial<Size - 1> result{};
  for (std::size_t i = 1; i < Size; ++i) result[i - 1] = static_cast<double>(i) * polynomial[i];
  return result;
}

/// Whether a polynomial, given by its Bernstein coefficients, is positive on the whole interval:
/// they bound it from below, the first and the last are its values at the ends, and halving the
/// interval (de Casteljau) tightens the bound.
template <std::size_t Size>
bool positive(Polynomial<Size> bernstein, int halvings_left) {
  if (!(bernstein.front() > 0.0 && bernstein.back() > 0.0)) return false;
  if (*std::min_element(bernstein.begin(), bernstein.end()) > 0.0) return true;
  if (halvings_left == 0) return false;
  Polynomial<Size> left{};
  for (std::size_t i = 0; i < Size; ++i) {
    left[i] = bernstein.front();
    for (std::size_t j = 0; j + 1 < Size - i; ++j)
      bernstein[j] = 0.5 * (bernstein[j] + bernstein[j + 1]);
  }
  return positive(left, halvings_left - 1) && positive(bernstein, halvings_left - 1);
}

/// Whether a polynomial is positive everywhere on [0, end]. Exact but for near-double roots, and
/// without a search for roots: cheap enough to ask at every point.
template <std::size_t Size>
bool positive_up_to(const Polynomial<Size>& polynomial, double end) {
  constexpr int kHalvings = 24;
  if (!std::isfinite(end)) return false;
  // Power basis on [0, end] to Bernstein basis: b_j = sum over i of C(j, i) / C(n, i) c_i end^i.
  Polynomial<Size> bernstein{};
  double scale = 1.0;
  for (std::size_t i = 0; i < Size; ++i) {
    bernstein[i] = polynomial[i] * scale;
    scale *= end * static_cast<double>(i + 1) / static_cast<double>(Size - 1 - i);
  }
  for (std::size_t round = 1; round < Size; ++round)
    for (std::size_t j = Size - 1; j >= round; --j) bernstein[j] += bernstein[j - 1];
  return positive(bernstein, kHalvings);
}

/// Brown-Conrady: a radial factor, a quotient of two polynomials in the squared radius s, and two
/// terms for a tilted lens.
struct BrownConrady {
  explicit BrownConrady(const std::array<double, 8>& k)
      : numerator{1.0, k[0], k[1], k[4]},
        denominator{1.0, k[5], k[6], k[7]},
        p1(k[2]),
        p2(k[3]),
        rational(k[5] != 0.0 || k[6] != 0.0 || k[7] != 0.0) {}

  Vector2d distort(const Vector2d& point, Matrix2d* jacobian) const {
    const double x = point.x();
    const double y = point.y();
    const double s = point.squaredNorm();
    const double above = evaluate(numerator, s);
    const double below = rational ? evaluate(denominator, s) : 1.0;
    const double factor = above / below;
    if (jacobian != nullptr) {
      double slope = evaluate(derivative(numerator), s);  // d(factor)/ds
      if (rational) slope = (slope - factor * evaluate(derivative(denominator), s)) / below;
      const double mixed = 2.0 * (x * y * slope + p1 * x + p2 * y);
      *jacobian << factor + 2.0 * (x * x * slope + p1 * y + 3.0 * p2 * x), mixed, mixed,
          factor + 2.0 * (y * y * slope + 3.0 * p1 * y + p2 * x);
    }
    return {x * factor + 2.0 * p1 * x * y + p2 * (s + 2.0 * x * x),
            y * factor + p1 * (s + 2.0 * y * y) + 2.0 * p2 * x * y};
  }

  /// The radius grows with r as long as d(r N(s) / D(s))/dr > 0, that is, with s = r^2, as long as
  /// (N + 2 s N') D - 2 s N D' > 0, and the quotient has no pole.
  bool monotonic_up_to(double s) const {
    Polynomial<4> grown{};  // N + 2 s N'
    for (std::size_t i = 0; i < 4; ++i) grown[i] = static_cast<double>(2 * i + 1) * numerator[i];
    if (!rational) return positive_up_to(grown, s);
    Polynomial<7> slope{};
    for (std::size_t i = 0; i < 4; ++i)
      for (std::size_t j = 0; j < 4; ++j)
        slope[i + j] += (grown[i] - static_cast<double>(2 * j) * numerator[i]) * denominator[j];
    return positive_up_to(denominator, s) && positive_up_to(slope, s);
  }

  bool in_range(const Vector2d& point) const {
    if (!monotonic_up_to(point.squaredNorm())) return false;
    if (p1 == 0.0 && p2 == 0.0) return true;
    Matrix2d jacobian;
    distort(point, &jacobian);
    return jacobian.determinant() > 0.0;
  }

  /// Newton's method from the centre, where the Jacobian is the identity. Steps that leave the
  /// range or don't bring the image nearer are halved.
  std::optional<Vector2d> undistort(const Vector2d& target) const {
    constexpr int kIterations = 50;
    constexpr int kHalvings = 12;
    const double done = 1e-15 * (1.0 + target.norm());
    Vector2d point = Vector2d::Zero();
    Matrix2d jacobian = Matrix2d::Identity();
    Vector2d error = target;
    for (int i = 0; i < kIterations && error.norm() > done; ++i) {
      Vector2d step = jacobian.inverse() * error;
      bool nearer = false;
      for (int halving = 0; halving < kHalvings && !nearer; ++halving, step *= 0.5) {
        const Vector2d next = point + step;
        if (!in_range(next)) continue;
        Matrix2d next_jacobian;
        const Vector2d next_error = target - distort(next, &next_jacobian);
        if (next_error.squaredNorm() >= error.squaredNorm()) continue;
        nearer = true;
        point = next;
        jacobian = next_jacobian;
        error = next_error;
      }
      if (!nearer) break;
    }
    if (!(error.norm() < 1e-9 * (1.0 + target.norm()))) return std::nullopt;
    return point;
  }

  Polynomial<4> numerator;
  Polynomial<4> denominator;
  double p1;
  double p2;
  bool rational;
};

/// Kannala-Brandt: a ray at the angle theta to the axis is seen at the radius
/// theta (1 + k1 theta^2 + k2 theta^4 + k3 theta^6 + k4 theta^8).
struct Equidistant {
  explicit Equidistant(const std::array<double, 8>& k) : factor{1.0, k[0], k[1], k[2], k[3]} {
    for (std::size_t i = 0; i < factor.size(); ++i)
      slope[i] = static_cast<double>(2 * i + 1) * factor[i];
  }

  Vector2d distort(const Vector2d& point, Matrix2d* jacobian) const {
    const double r = point.norm();
    const double theta = std::atan(r);
    const double s = theta * theta;
    const double scale = r > 0.0 ? theta / r * evaluate(factor, s) : 1.0;
    if (jacobian != nullptr) {
      *jacobian = scale * Matrix2d::Identity();
      if (r > 0.0) {
        const Vector2d outward = point / r;
        const double radial = evaluate(slope, s) / (1.0 + r * r);
        *jacobian += (radial - scale) * outward * outward.transpose();
      }
    }
    return scale * point;
  }

  bool in_range(const Vector2d& point) const {
    const double theta = std::atan(point.norm());
    return point.allFinite() && positive_up_to(slope, theta * theta);
  }

  /// Newton's method on the angle, held inside an interval that surely contains it.
  std::optional<Vector2d> undistort(const Vector2d& target) const {
    constexpr int kIterations = 100;
    const double radius = target.norm();
    if (!std::isfinite(radius)) return std::nullopt;
    if (radius == 0.0) return target;
    double low = 0.0;
    double high = kHalfPi;
    double theta = std::min(radius, 0.5 * kHalfPi);
    for (int i = 0; i < kIterations; ++i) {
      const double s = theta * theta;
      const double error = radius - theta * evaluate(factor, s);
      const bool usable = positive_up_to(slope, s);
      (usable && error >= 0.0 ? low : high) = theta;
      double next = theta + error / evaluate(slope, s);
      if (!usable || !(next > low && next < high)) next = 0.5 * (low + high);
      const bool settled = std::abs(next - theta) < 1e-15;
      theta = next;
      if (settled) break;
    }
    const double s = theta * theta;
    if (!(theta < kHalfPi && std::abs(theta * evaluate(factor, s) - radius) < 1e-9) ||
        !positive_up_to(slope, s))
      return std::nullopt;
    const Vector2d point = target * (std::tan(theta) / radius);
    if (!(point.squaredNorm() < 1e12)) return std::nullopt;  // a ray along the image plane
    return point;
  }

  Polynomial<5> factor;   // of theta^2
  Polynomial<5> slope{};  // d(radius)/d(theta), of theta^2
};

/// Calls `use` with the camera's lens.
template <typename Use>
auto with_lens(const Camera& camera, const Use& use) {
  if (camera.lens == LensModel::equidistant) return use(Equidistant(camera.coefficients));
  return use(BrownConrady(camera.coefficients));
}

void require(bool condition, const std::string& what) {
  if (!condition) throw std::invalid_argument("camera: " + what);
}

}  // namespace

Camera Camera::pinhole(int width, int height, double focal_px) {
  Camera camera;
  camera.width = width;
  camera.height = height;
  camera.fx = camera.fy = focal_px;
  camera.cx = 0.5 * (width - 1);
  camera.cy = 0.5 * (height - 1);
  validate(camera);
  return camera;
}

bool Camera::has_distortion() const {
  return lens == LensModel::equidistant ||
         std::any_of(coefficients.begin(), coefficients.end(), [](double k) { return k != 0.0; });
}

Eigen::Matrix3d Camera::matrix() const {
  Eigen::Matrix3d k;
  k << fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0;
  return k;
}

Vector2d Camera::distort(const Vector2d& normalised, Matrix2d* jacobian) const {
  return with_lens(*this, [&](const auto& l) { return l.distort(normalised, jacobian); });
}

bool Camera::in_range(const Vector2d& normalised) const {
  if (!has_distortion()) return std::isfinite(normalised.squaredNorm());
  return with_lens(*this, [&](const auto& l) { return l.in_range(normalised); });
}

std::optional<Vector2d> Camera::undistort(const Vector2d& distorted, Matrix2d* jacobian) const {
  if (!has_distortion()) {
    if (!in_range(distorted)) return std::nullopt;
    if (jacobian != nullptr) jacobian->setIdentity();
    return distorted;
  }
  std::optional<Vector2d> point =
      with_lens(*this, [&](const auto& l) { return l.undistort(distorted); });
  if (point && jacobian != nullptr) {
    Matrix2d forward;
    distort(*point, &forward);
    *jacobian = forward.inverse();
  }
  return point;
}

std::optional<Vector2d> Camera::project(const Eigen::Vector3d& point,
                                        Eigen::Matrix<double, 2, 3>* jacobian) const {
  if (!(point.z() > 0.0)) return std::nullopt;
  const Vector2d normalised = point.head<2>() / point.z();
  if (!in_range(normalised)) return std::nullopt;
  if (jacobian == nullptr) {
    const Vector2d distorted = distort(normalised);
    return Vector2d(fx * distorted.x() + cx, fy * distorted.y() + cy);
  }
  Matrix2d lens_jacobian;
  const Vector2d distorted = distort(normalised, &lens_jacobian);
  jacobian->leftCols<2>() = lens_jacobian / point.z();
  jacobian->col(2) = -jacobian->leftCols<2>() * normalised;
  jacobian->row(0) *= fx;
  jacobian->row(1) *= fy;
  return Vector2d(fx * distorted.x() + cx, fy * distorted.y() + cy);
}

std::optional<Vector2d> Camera::unproject(const Vector2d& pixel, Matrix2d* jacobian) const {
  const Vector2d distorted((pixel.x() - cx) / fx, (pixel.y() - cy) / fy);
  std::optional<Vector2d> normalised = undistort(distorted, jacobian);
  if (normalised && jacobian != nullptr) {
    jacobian->col(0) /= fx;
    jacobian->col(1) /= fy;
  }
  return normalised;
}

std::optional<Vector2d> Camera::to_ideal(const Vector2d& pixel) const {
  const std::optional<Vector2d> normalised = unproject(pixel);
  if (!normalised) return std::nullopt;
  return Vector2d(fx * normalised->x() + cx, fy * normalised->y() + cy);
}

std::optional<Vector2d> Camera::from_ideal(const Vector2d& ideal_pixel) const {
  const Vector2d normalised((ideal_pixel.x() - cx) / fx, (ideal_pixel.y() - cy) / fy);
  return project({normalised.x(), normalised.y(), 1.0});
}

void validate(const Camera& camera) {
  require(camera.width > 0, "width must be positive");
  require(camera.height > 0, "height must be positive");
  // Between a fisheye that sees more than everything and a telescope.
  constexpr double kLeastFocal = 0.01, kMostFocal = 1e4;
  // Shift lenses and images cut out of larger ones have it outside; small cuttings
  // far outside, by their measure.
  constexpr double kFarthestCentre = 100.0;
  const double size = std::max(camera.width, camera.height);
  const auto check_focal = [&](double focal, const std::string& name) {
    require(focal > 0.0 && std::isfinite(focal), name + " must be positive and finite");
    require(focal >= kLeastFocal * size && focal <= kMostFocal * size,
            name +
                " is no focal length in pixels: it must be a hundredth to ten thousand times "
                "the image's longer side");
  };
  const auto check_centre = [&](double centre, const std::string& name) {
    require(std::isfinite(centre), name + " must be finite");
    require(std::abs(centre) <= kFarthestCentre * size,
            name + " is farther away than a hundred times the image's longer side");
  };
  check_focal(camera.fx, "fx");
  check_focal(camera.fy, "fy");
  check_centre(camera.cx, "cx");
  check_centre(camera.cy, "cy");
  for (std::size_t i = 0; i < camera.coefficients.size(); ++i) {
    const double k = camera.coefficients[i];
    require(std::isfinite(k), "distortion coefficients must be finite");
    require(camera.lens == LensModel::brown_conrady || i < 4 || k == 0.0,
            "the equidistant lens has four distortion coefficients");
  }
}

}  // namespace harco
