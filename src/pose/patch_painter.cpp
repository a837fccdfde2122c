#include "pose/patch_painter.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Eigenvalues>

namespace harco {
namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;

// Rows along a pixel's side.
constexpr int kFields = 2;
// Beyond so many sigmas nothing is left of a Gaussian.
constexpr double kReach = 3.2;
constexpr double kLeastVariance = 0.02, kMostVariance = 40.0;  // square pixels

/// Step response of a pixel's square and a Gaussian, and its first two derivatives.
std::array<double, 3> step_response(double d, double sigma) {
  constexpr double kDensity = std::numbers::inv_sqrtpi / std::numbers::sqrt2;
  const double a = (d + 0.5) / sigma, b = (d - 0.5) / sigma;
  const auto below = [](double z) { return 0.5 * std::erfc(-z / std::numbers::sqrt2); };
  const auto density = [](double z) { return kDensity * std::exp(-0.5 * z * z); };
  const double below_a = below(a), below_b = below(b);
  const double density_a = density(a), density_b = density(b);
  return {sigma * (a * below_a + density_a - b * below_b - density_b), below_a - below_b,
          (density_a - density_b) / sigma};
}

}  // namespace

Matrix2d Blur::moments() const {
  return variance * Matrix2d::Identity() + smear * smear.transpose() / 12.0;
}

Blur Blur::with_moments(const Matrix2d& moments) {
  const Eigen::SelfAdjointEigenSolver<Matrix2d> eigen(moments);
  Blur blur;
  blur.variance = std::max(kLeastVariance, eigen.eigenvalues()(0));
  blur.smear = std::sqrt(12.0 * std::max(0.0, eigen.eigenvalues()(1) - blur.variance)) *
               eigen.eigenvectors().col(1);
  return blur;
}

void PatchPainter::set_blur(const Blur& blur) {
  const double variance = std::clamp(blur.variance, kLeastVariance, kMostVariance);
  const double sigma = kFields * std::sqrt(variance);
  const int taps = std::max(2, static_cast<int>(std::lround(kReach * sigma + 0.2)));
  smear_ = blur.smear;
  // What is smeared is drawn at some places along its way.
  const double length = smear_.norm();
  places_ = length > 0.0
                ? std::max<std::size_t>(2, static_cast<std::size_t>(std::ceil(kFields * length)))
                : 1;
  margin_ = (taps + 1) / kFields +
            static_cast<int>(std::ceil(0.5 * smear_.norm() + 0.5 * (smear_.norm() > 0.0)));
  size_ = kFields * (kPatch + 2 * margin_);
  far_ = kPatch + margin_ + static_cast<int>(std::ceil(0.5 * smear_.norm()));
  set_steps(variance);
  set_taps(sigma, taps);
  rows_.resize(static_cast<std::size_t>(size_));
  starts_.resize(static_cast<std::size_t>(size_));
}

void PatchPainter::set_steps(double variance) {
  constexpr auto kPhases = static_cast<int>(kernels::Steps::kPhases);
  const double sigma = std::sqrt(variance);
  const int stride = 2 * far_ + 4;
  steps_.resize(static_cast<std::size_t>(3 * kPhases * stride));
  for (int phase = 0; phase < kPhases; ++phase)
    for (int i = 0; i < stride; ++i) {
      const double d = i - far_ + static_cast<double>(phase) / kPhases;
      const bool near = std::abs(d) < 0.5 + 5.0 * sigma;
      const auto response =
          near ? step_response(d, sigma) : std::array<double, 3>{d > 0.0 ? 1.0 : 0.0, 0.0, 0.0};
      for (int k = 0; k < 3; ++k)
        steps_[static_cast<std::size_t>((3 * phase + k) * stride + i)] =
            static_cast<float>(response[static_cast<std::size_t>(k)]);
    }
}

/// A pixel's square is two halves; the Gaussian is sampled on their middles.
void PatchPainter::set_taps(double sigma, int taps) {
  const auto gauss = [&](double d) { return std::exp(-0.5 * d * d / (sigma * sigma)); };
  std::vector<double> value, slope, bend;
  double sum = 0.0, lever = 0.0, curve = 0.0, excess = 0.0;
  for (int j = 0; j < taps; ++j) {
    const double d = j + 0.5, g0 = gauss(j), g1 = gauss(j + 1);
    value.push_back(g0 + g1);
    slope.push_back(j * g0 + (j + 1) * g1);
    const double s2 = sigma * sigma;
    bend.push_back((j * j / s2 - 1.0) * g0 + ((j + 1) * (j + 1) / s2 - 1.0) * g1);
    sum += 2.0 * value.back();
    lever += 2.0 * slope.back() * d / kFields;
    excess += 2.0 * bend.back();
  }
  // Right for all that is even, slopes and parabolas.
  for (std::size_t j = 0; j < value.size(); ++j) {
    const double d = (static_cast<double>(j) + 0.5) / kFields;
    value[j] /= sum;
    slope[j] /= lever;
    bend[j] -= excess * value[j];
    curve += bend[j] * d * d;
  }
  value_.assign(value.begin(), value.end());
  slope_.assign(slope.begin(), slope.end());
  bend_.clear();
  for (const double b : bend) bend_.push_back(static_cast<float>(b / curve));
}

void PatchPainter::begin(int x, int y) {
  x_ = x;
  y_ = y;
  edges_.clear();
  crossings_.clear();
}

void PatchPainter::add(const Vector2d& from, const Vector2d& to) {
  const double left = x_ - margin_ - 0.5, top = y_ - margin_ - 0.5;
  const double wide = kPatch + 2 * margin_, tall = size_;
  double xa = from.x() - left, ya = kFields * (from.y() - top);
  double xb = to.x() - left, yb = kFields * (to.y() - top);
  if (std::max(ya, yb) <= 0.0 || std::min(ya, yb) >= tall || std::min(xa, xb) >= wide ||
      std::max(xa, xb) < 0.0)
    return;
  const double slope = ya == yb ? 0.0 : (xb - xa) / (yb - ya);
  const auto cut_at_row = [&](double row, double& x, double& y) {
    x += slope * (row - y);
    y = row;
  };
  if (ya < 0.0) cut_at_row(0.0, xa, ya);
  if (yb < 0.0) cut_at_row(0.0, xb, yb);
  if (ya > tall) cut_at_row(tall, xa, ya);
  if (yb > tall) cut_at_row(tall, xb, yb);
  if ((xa < 0.0) != (xb < 0.0)) {
    const double row = std::clamp(ya + (yb - ya) * xa / (xa - xb), 0.0, tall);
    const bool goes_in = xa < 0.0;
    crossings_.push_back({row, goes_in ? 1.0F : -1.0F});
    (goes_in ? xa : xb) = 0.0;
    (goes_in ? ya : yb) = row;
  } else if (xa < 0.0) {
    return;
  }
  if (xa > wide && xb > wide) return;
  if ((xa > wide) != (xb > wide)) {
    const double row = ya + (yb - ya) * (wide - xa) / (xb - xa);
    (xa > wide ? ya : yb) = row;
    (xa > wide ? xa : xb) = wide;
  }
  constexpr double kLevel = 1e-4;  // half pixels: nothing to see
  const auto edge = [&](double x, double first, double last, float sign) {
    if (last - first < kLevel) return;
    edges_.push_back({static_cast<float>(x), static_cast<float>(slope), static_cast<float>(first),
                      static_cast<float>(last), sign});
  };
  // Upwards, ink is on the right.
  if (ya < yb) edge(xa, ya, yb, -1.0F);
  if (yb < ya) edge(xb, yb, ya, 1.0F);
}

/// Ink at the left end of the first row.
float PatchPainter::first_ink(const std::function<bool(const Vector2d&)>& is_black) {
  std::sort(crossings_.begin(), crossings_.end(),
            [](const Crossing& a, const Crossing& b) { return a.row < b.row; });
  // Ask in the middle of the widest gap between crossings.
  double asked = 0.5 * size_, widest = -1.0, above = 0.0;
  for (std::size_t i = 0; i <= crossings_.size(); ++i) {
    const double below = i < crossings_.size() ? crossings_[i].row : size_;
    if (below - above > widest) {
      widest = below - above;
      asked = 0.5 * (above + below);
    }
    above = below;
  }
  const Vector2d corner(x_ - margin_ - 0.5, y_ - margin_ - 0.5);
  float ink = is_black(corner + Vector2d(0.0, asked / kFields)) ? 1.0F : 0.0F;
  for (const Crossing& crossing : crossings_)
    if (crossing.row < asked) ink -= crossing.jump;
  return ink;
}

/// Ink at the rows' left ends, if all is `down` by so many rows.
void PatchPainter::find_starts(float ink, double down, float weight) {
  std::size_t next = 0;
  for (int row = 0; row < size_; ++row) {
    float start = ink;
    for (; next < crossings_.size() && crossings_[next].row + down < row + 1.0; ++next) {
      const auto below = static_cast<float>(row + 1.0 - crossings_[next].row - down);
      start += crossings_[next].jump * std::min(below, 1.0F);
      ink += crossings_[next].jump;
    }
    starts_[static_cast<std::size_t>(row)] = weight * start;
  }
}

/// The edges moved by a way of so many pixels, as far as they remain in the rows.
void PatchPainter::move_edges(const Vector2d& way, float weight) {
  const auto right = static_cast<float>(way.x()), down = static_cast<float>(kFields * way.y());
  const auto tall = static_cast<float>(size_);
  moved_.clear();
  for (kernels::PatchEdge edge : edges_) {
    const float top = std::max(0.0F, edge.top + down);
    edge.x += right + edge.slope * (top - edge.top - down);
    edge.top = top;
    edge.bottom = std::min(tall, edge.bottom + down);
    edge.sign *= weight;
    if (edge.top < edge.bottom) moved_.push_back(edge);
  }
}

void PatchPainter::finish(const std::function<bool(const Vector2d&)>& is_black,
                          PatchPicture& picture) {
  static_assert(kPatch == kernels::kSide);
  const kernels::Steps steps{steps_.data(), static_cast<std::size_t>(2 * far_ + 4),
                             static_cast<float>(margin_ + far_) + 0.5F};
  const kernels::Taps taps{value_.data(), slope_.data(), bend_.data(), value_.size()};
  const auto draw = [&](const std::vector<kernels::PatchEdge>& edges, bool first, bool last) {
    kernels::draw_patch(
        edges.data(), edges.size(), starts_.data(), static_cast<std::size_t>(margin_), steps, taps,
        !first, rows_.front().values.data(),
        last ? kernels::Channels{picture.ink.data(), picture.by_x.data(), picture.by_y.data(),
                                 picture.by_xx.data(), picture.by_xy.data(), picture.by_yy.data()}
             : kernels::Channels{});
  };
  const float ink = first_ink(is_black);
  if (places_ == 1) {
    find_starts(ink, 0.0, 1.0F);
    draw(edges_, true, true);
    return;
  }
  const auto places = static_cast<double>(places_);
  for (std::size_t k = 0; k < places_; ++k) {
    const Vector2d way = ((static_cast<double>(k) + 0.5) / places - 0.5) * smear_;
    const float weight = 1.0F / static_cast<float>(places_);
    find_starts(ink, kFields * way.y(), weight);
    move_edges(way, weight);
    draw(moved_, k == 0, k + 1 == places_);
  }
}

}  // namespace harco
