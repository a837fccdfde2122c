#include "pose/patch_painter.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Eigenvalues>

#include "pose/kernels/patch_loops.hpp"

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

/// The change of ink that a piece brings to the fields of one row, of which it covers `cover`, on
/// its way from x to `next`.
void PatchPainter::cover_row(float* change, float x, float next, float cover) {
  const float low = std::min(x, next), high = std::max(x, next);
  const int first = static_cast<int>(low);
  if (high <= static_cast<float>(first + 1)) {
    const float right = 0.5F * (low + high) - static_cast<float>(first);
    change[first] += cover - cover * right;
    change[first + 1] += cover * right;
    return;
  }
  // The fields it crosses from side to side have equal shares of its height; of each share, half is
  // to the field's right.
  int last = static_cast<int>(high);
  if (static_cast<float>(last) == high) --last;
  const float share = 1.0F / (high - low);
  const float enters = static_cast<float>(first + 1) - low;
  const float leaves = high - static_cast<float>(last);
  const float begin = 0.5F * share * enters * enters, end = 0.5F * share * leaves * leaves;
  // What has been passed on so far, up to the field at hand.
  change[first] += cover * begin;
  float given = begin;
  float level = share * (enters + 0.5F);  // of the next field, if it is crossed
  for (int field = first + 1; field < last; ++field, level += share) {
    change[field] += cover * (level - given);
    given = level;
  }
  change[last] += cover * (1.0F - end - given);
  change[last + 1] += cover * end;
}

/// A piece that goes down, within the grid: in every row, the change of ink that it brings to each
/// field and to all fields on the right of it (signed areas, as font rasterisers keep them).
void PatchPainter::accumulate(double x0, double y0, double x1, double y1, float sign) {
  const auto slope = static_cast<float>((x1 - x0) / (y1 - y0));
  const auto size = static_cast<float>(size_);
  const int first = std::max(0, static_cast<int>(y0));
  const int last = std::min(size_ - 1, static_cast<int>(y1));
  float* change = &grid_[static_cast<std::size_t>(first * (size_ + 2))];
  auto x = static_cast<float>(x0);
  const auto down = [&](float height) {
    const float next = std::clamp(x + slope * height, 0.0F, size);
    cover_row(change, x, next, height * sign);
    change += size_ + 2;
    x = next;
  };
  if (first >= last) {
    if (first == last) down(static_cast<float>(y1 - y0));
    return;
  }
  down(static_cast<float>(first + 1.0 - y0));
  for (int row = first + 1; row < last; ++row) down(1.0F);
  if (y1 > last) down(static_cast<float>(y1 - last));
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

  starts_.resize(static_cast<std::size_t>(size_));
  std::size_t next = 0;
  for (int row = 0; row < size_; ++row) {
    float start = ink;
    for (; next < crossings_.size() && crossings_[next].row < row + 1.0; ++next) {
      start += crossings_[next].jump * static_cast<float>(row + 1.0 - crossings_[next].row);
      ink += crossings_[next].jump;
    }
    starts_[static_cast<std::size_t>(row)] = start;
  }
  // From changes to shares; rows side by side, since each sum waits for the one before it.
  constexpr int kAtOnce = 4;
  static_assert(kFields * kPatch % kAtOnce == 0 && kFields * 2 % kAtOnce == 0);
  const int stride = size_ + 2;
  for (int row = 0; row < size_; row += kAtOnce) {
    float* share = &grid_[static_cast<std::size_t>(row * stride)];
    std::array<float, kAtOnce> sum;
    std::copy_n(&starts_[static_cast<std::size_t>(row)], kAtOnce, sum.begin());
    for (int i = 0; i < size_; ++i)
      for (int k = 0; k < kAtOnce; ++k)
        share[k * stride + i] = sum[static_cast<std::size_t>(k)] += share[k * stride + i];
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

void PatchPainter::finish(const std::function<bool(const Vector2d&)>& is_black,
                          PatchPicture& picture) {
  fill_rows(is_black);
  smear();
  static_assert(kPatch == kernels::kSide);
  const auto half = static_cast<std::size_t>(size_ / 2);
  blurred_.resize((2 + 6 * kPatch) * half);
  kernels::blur_patch(grid_.data(), static_cast<std::size_t>(size_ + 2),
                      static_cast<std::size_t>(margin_),
                      {value_.data(), slope_.data(), bend_.data(), value_.size()}, blurred_.data(),
                      {picture.ink.data(), picture.by_x.data(), picture.by_y.data(),
                       picture.by_xx.data(), picture.by_xy.data(), picture.by_yy.data()});
}

}  // namespace harco
