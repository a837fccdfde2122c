#include "pose/patch_painter.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Eigenvalues>

namespace harco {
namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;

// The grid's fields along a pixel's side.
constexpr int kFields = 2;
// Beyond so many sigmas nothing is left of a Gaussian.
constexpr double kReach = 3.2;
constexpr double kLeastVariance = 0.02, kMostVariance = 40.0;  // square pixels

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
  const double sigma =
      kFields * std::sqrt(std::clamp(blur.variance, kLeastVariance, kMostVariance));
  const int taps = std::max(2, static_cast<int>(std::lround(kReach * sigma + 0.2)));
  smear_ = blur.smear;
  margin_ = (taps + 1) / kFields +
            static_cast<int>(std::ceil(0.5 * smear_.norm() + 0.5 * (smear_.norm() > 0.0)));
  size_ = kFields * (kPatch + 2 * margin_);

  // A pixel's square is two fields; the Gaussian is sampled on the fields' middles.
  const auto gauss = [&](double d) { return std::exp(-0.5 * d * d / (sigma * sigma)); };
  std::vector<double> value, slope, bend;
  double sum = 0.0, lever = 0.0, curve = 0.0, spread = 0.0, excess = 0.0;
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
    spread += 2.0 * value[j] * d * d;
  }
  value_.assign(value.begin(), value.end());
  slope_.assign(slope.begin(), slope.end());
  bend_.clear();
  for (const double b : bend) bend_.push_back(static_cast<float>(b / curve));
}

void PatchPainter::begin(int x, int y) {
  x_ = x;
  y_ = y;
  grid_.assign(static_cast<std::size_t>(size_) * static_cast<std::size_t>(size_ + 2), 0.0F);
  crossings_.clear();
}

void PatchPainter::add(const Vector2d& from, const Vector2d& to) {
  const double left = x_ - margin_ - 0.5, top = y_ - margin_ - 0.5, size = size_;
  double x0 = kFields * (from.x() - left), y0 = kFields * (from.y() - top);
  double x1 = kFields * (to.x() - left), y1 = kFields * (to.y() - top);
  if (std::max(y0, y1) <= 0.0 || std::min(y0, y1) >= size || std::min(x0, x1) >= size ||
      std::max(x0, x1) < 0.0)
    return;
  const float sign = y0 > y1 ? 1.0F : -1.0F;
  const auto cut_at_row = [&](double row, double& x, double& y) {
    x = x0 + (x1 - x0) * (row - y0) / (y1 - y0);
    y = row;
  };
  double xa = x0, ya = y0, xb = x1, yb = y1;
  if (ya < 0.0) cut_at_row(0.0, xa, ya);
  if (yb < 0.0) cut_at_row(0.0, xb, yb);
  if (ya > size) cut_at_row(size, xa, ya);
  if (yb > size) cut_at_row(size, xb, yb);
  if ((xa < 0.0) != (xb < 0.0)) {
    const double row = ya + (yb - ya) * xa / (xa - xb);
    crossings_.push_back({std::clamp(row, 0.0, size), xa < 0.0 ? 1.0F : -1.0F});
    (xa < 0.0 ? xa : xb) = 0.0;
    (x0 < x1 ? ya : yb) = row;
  } else if (xa < 0.0) {
    return;
  }
  if (xa > size && xb > size) return;
  if ((xa > size) != (xb > size)) {
    const double row = ya + (yb - ya) * (size - xa) / (xb - xa);
    (xa > size ? ya : yb) = row;
    (xa > size ? xa : xb) = size;
  }
  if (ya == yb) return;
  if (ya < yb)
    accumulate(xa, ya, xb, yb, sign);
  else
    accumulate(xb, yb, xa, ya, sign);
}

/// A piece that goes down, within the grid: in every row, the change of ink that it brings to each
/// field and to all fields on the right of it (signed areas, as font rasterisers keep them).
void PatchPainter::accumulate(double x0, double y0, double x1, double y1, float sign) {
  const double slope = (x1 - x0) / (y1 - y0);
  const double size = size_;
  double x = x0;
  const int last = std::min(size_ - 1, static_cast<int>(y1));
  for (int row = std::max(0, static_cast<int>(y0)); row <= last; ++row) {
    float* change = &grid_[static_cast<std::size_t>(row) * static_cast<std::size_t>(size_ + 2)];
    const double height = std::min(row + 1.0, y1) - std::max(static_cast<double>(row), y0);
    if (height <= 0.0) continue;
    const double next = std::clamp(x + slope * height, 0.0, size);
    const auto cover = static_cast<float>(height) * sign;
    const double low = std::min(x, next), high = std::max(x, next);
    const int first = static_cast<int>(low);
    if (high <= first + 1.0) {
      const auto right = static_cast<float>(0.5 * (low + high) - first);
      change[first] += cover - cover * right;
      change[first + 1] += cover * right;
    } else {
      // Of the height per field, so much goes to each; within a field, half of it to the next.
      const double share = 1.0 / (high - low);
      double rest = 0.0;  // what the field before left over
      for (int field = first; field < high; ++field) {
        const double from = std::max(low, static_cast<double>(field));
        const double to = std::min(high, field + 1.0);
        const double own = share * (to - from);
        const double right = 0.5 * (from + to) - field;
        change[field] += cover * static_cast<float>(own * (1.0 - right) + rest);
        rest = own * right;
      }
      change[static_cast<int>(std::ceil(high))] += cover * static_cast<float>(rest);
    }
    x = next;
  }
}

void PatchPainter::fill_rows(const std::function<bool(const Vector2d&)>& is_black) {
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

  const int half = size_ / 2;
  even_.resize(static_cast<std::size_t>(size_) * static_cast<std::size_t>(half));
  odd_.resize(even_.size());
  std::size_t next = 0;
  for (int row = 0; row < size_; ++row) {
    float start = ink;
    for (; next < crossings_.size() && crossings_[next].row < row + 1.0; ++next) {
      start += crossings_[next].jump * static_cast<float>(row + 1.0 - crossings_[next].row);
      ink += crossings_[next].jump;
    }
    float* share = &grid_[static_cast<std::size_t>(row) * static_cast<std::size_t>(size_ + 2)];
    for (int i = 0; i < size_; ++i) share[i] = start += share[i];
  }
}

void PatchPainter::smear() {
  const double length = smear_.norm();
  if (length <= 0.0) return;
  const int steps = std::max(2, static_cast<int>(std::ceil(kFields * length)));
  const int stride = size_ + 2;
  scratch_.assign(grid_.size(), 0.0F);
  for (int k = 0; k < steps; ++k) {
    const Vector2d shift = kFields * ((k + 0.5) / steps - 0.5) * smear_;
    const int dx = static_cast<int>(std::floor(shift.x())),
              dy = static_cast<int>(std::floor(shift.y()));
    const auto fx = static_cast<float>(shift.x() - dx), fy = static_cast<float>(shift.y() - dy);
    const float weight = 1.0F / static_cast<float>(steps);
    const float w00 = weight * (1 - fx) * (1 - fy), w01 = weight * fx * (1 - fy);
    const float w10 = weight * (1 - fx) * fy, w11 = weight * fx * fy;
    const int x_begin = std::max(0, -dx), x_end = std::min(size_, size_ - 1 - dx);
    for (int y = std::max(0, -dy); y < std::min(size_, size_ - 1 - dy); ++y) {
      const float* a = &grid_[static_cast<std::size_t>((y + dy) * stride)];
      const float* b = a + stride;
      float* to = &scratch_[static_cast<std::size_t>(y * stride)];
      for (int x = x_begin; x < x_end; ++x)
        to[x] += w00 * a[x + dx] + w01 * a[x + dx + 1] + w10 * b[x + dx] + w11 * b[x + dx + 1];
    }
  }
  grid_.swap(scratch_);
}

void PatchPainter::blur_rows() {
  const int half = size_ / 2;
  const auto taps = static_cast<int>(value_.size());
  for (auto& rows : rows_) rows.resize(static_cast<std::size_t>(size_ * kPatch));
  for (int row = 0; row < size_; ++row) {
    const float* share =
        &grid_[static_cast<std::size_t>(row) * static_cast<std::size_t>(size_ + 2)];
    float* even = &even_[static_cast<std::size_t>(row * half)];
    float* odd = &odd_[static_cast<std::size_t>(row * half)];
    for (int i = 0; i < half; ++i) {
      even[i] = share[2 * i];
      odd[i] = share[2 * i + 1];
    }
    std::array<float, kPatch> value{}, slope{}, bend{};
    for (int j = 0; j < taps; ++j) {
      // The fields at distance j + 1/2 on both sides of a pixel's middle.
      const float* left = j % 2 == 0 ? even + margin_ - j / 2 : odd + margin_ - (j + 1) / 2;
      const float* right = j % 2 == 0 ? odd + margin_ + j / 2 : even + margin_ + (j + 1) / 2;
      const auto at = static_cast<std::size_t>(j);
      for (std::size_t x = 0; x < kPatch; ++x) {
        const float sum = left[x] + right[x];
        value[x] += value_[at] * sum;
        slope[x] += slope_[at] * (right[x] - left[x]);
        bend[x] += bend_[at] * sum;
      }
    }
    const auto to = static_cast<std::ptrdiff_t>(row * kPatch);
    std::copy(value.begin(), value.end(), rows_[0].begin() + to);
    std::copy(slope.begin(), slope.end(), rows_[1].begin() + to);
    std::copy(bend.begin(), bend.end(), rows_[2].begin() + to);
  }
}

void PatchPainter::blur_columns(PatchPicture& picture) const {
  const auto taps = static_cast<int>(value_.size());
  for (int y = 0; y < kPatch; ++y) {
    std::array<float, kPatch> ink{}, by_x{}, by_y{}, by_xx{}, by_xy{}, by_yy{};
    for (int j = 0; j < taps; ++j) {
      const auto above = static_cast<std::size_t>((2 * (y + margin_) - j) * kPatch);
      const auto below = static_cast<std::size_t>((2 * (y + margin_) + 1 + j) * kPatch);
      const auto at = static_cast<std::size_t>(j);
      const float value = value_[at], slope = slope_[at], bend = bend_[at];
      const float *v0 = &rows_[0][above], *v1 = &rows_[0][below];
      const float *s0 = &rows_[1][above], *s1 = &rows_[1][below];
      const float *b0 = &rows_[2][above], *b1 = &rows_[2][below];
      for (std::size_t x = 0; x < kPatch; ++x) {
        const float v = v0[x] + v1[x];
        ink[x] += value * v;
        by_yy[x] += bend * v;
        by_y[x] += slope * (v1[x] - v0[x]);
        by_x[x] += value * (s0[x] + s1[x]);
        by_xy[x] += slope * (s1[x] - s0[x]);
        by_xx[x] += value * (b0[x] + b1[x]);
      }
    }
    const auto to = static_cast<std::ptrdiff_t>(y * kPatch);
    std::copy(ink.begin(), ink.end(), picture.ink.begin() + to);
    std::copy(by_x.begin(), by_x.end(), picture.by_x.begin() + to);
    std::copy(by_y.begin(), by_y.end(), picture.by_y.begin() + to);
    std::copy(by_xx.begin(), by_xx.end(), picture.by_xx.begin() + to);
    std::copy(by_xy.begin(), by_xy.end(), picture.by_xy.begin() + to);
    std::copy(by_yy.begin(), by_yy.end(), picture.by_yy.begin() + to);
  }
}

void PatchPainter::finish(const std::function<bool(const Vector2d&)>& is_black,
                          PatchPicture& picture) {
  fill_rows(is_black);
  smear();
  blur_rows();
  blur_columns(picture);
}

}  // namespace harco
