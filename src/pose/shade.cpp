#include "pose/shade.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include <Eigen/Cholesky>

namespace harco {
namespace {

constexpr int kTerms = ShadowShape::kTerms;
using Vector = Eigen::Matrix<double, kTerms, 1>;
using Square = Eigen::Matrix<double, kTerms, kTerms>;

struct Classes {
  double dark = 0.0, bright = 0.0;  ///< their medians
  double share = 0.0;               ///< of the dark one
};

/// Splits values where the variance between both parts is greatest (Otsu 1979).
Classes split(std::span<const float> values) {
  std::vector<float> sorted(values.begin(), values.end());
  std::sort(sorted.begin(), sorted.end());
  double total = 0.0, below = 0.0, best = -1.0;
  for (const float value : sorted) total += static_cast<double>(value);
  const auto count = static_cast<double>(sorted.size());
  std::size_t at = 0;
  for (std::size_t i = 0; i + 1 < sorted.size(); ++i) {
    below += static_cast<double>(sorted[i]);
    const double n = static_cast<double>(i) + 1.0;
    const double apart = below / n - (total - below) / (count - n);
    const double between = n * (count - n) * apart * apart;
    if (between > best) {
      best = between;
      at = i + 1;
    }
  }
  return {static_cast<double>(sorted[at / 2]),
          static_cast<double>(sorted[(at + sorted.size()) / 2]), static_cast<double>(at) / count};
}

}  // namespace

ShadowShape::Depth ShadowShape::depth(float value) {
  // A disc of light behind an edge fades much like the normal distribution.
  constexpr float kFar = 4.0F;
  constexpr std::size_t kPerUnit = 64, kCells = 2 * 4 * kPerUnit;
  static const std::array<Depth, kCells + 2> kTable = [] {
    std::array<Depth, kCells + 2> table{};
    constexpr auto kRoot = static_cast<float>(std::numbers::inv_sqrtpi / std::numbers::sqrt2);
    for (std::size_t i = 0; i < table.size(); ++i) {
      const float at = static_cast<float>(i) / static_cast<float>(kPerUnit) - kFar;
      table[i] = {0.5F * std::erfc(-at / std::numbers::sqrt2_v<float>),
                  kRoot * std::exp(-0.5F * at * at)};
    }
    return table;
  }();
  if (value > kFar) return {1.0F, 0.0F};
  if (!(value > -kFar)) return {0.0F, 0.0F};
  const float place = (value + kFar) * static_cast<float>(kPerUnit);
  const auto cell = static_cast<std::size_t>(place);
  const float part = place - static_cast<float>(cell);
  const Depth &low = kTable[cell], &high = kTable[cell + 1];
  return {low.share + part * (high.share - low.share), low.slope + part * (high.slope - low.slope)};
}

std::optional<Shadow> find_shadow(std::span<const float> grey, std::span<const float> u,
                                  std::span<const float> v) {
  constexpr std::size_t kLeast = 30;
  constexpr double kLeastShare = 0.02;  // of the pixels, on either side
  constexpr double kLeastDepth = 0.04;  // of the light
  constexpr double kMostMisfit = 0.08;  // mean, of the light's step
  constexpr double kClear = 0.2;        // what is as dark, or as bright, is wholly so
  constexpr double kLogisticToNormal = (1.0 - 2.0 * kClear) / 1.7;
  constexpr int kSteps = 16;
  if (grey.size() < kLeast) return std::nullopt;
  const Classes classes = split(grey);
  const double step = classes.bright - classes.dark;
  if (classes.share < kLeastShare || classes.share > 1.0 - kLeastShare ||
      step < kLeastDepth * classes.bright)
    return std::nullopt;

  // A logistic regression of how dark pixels are.
  Vector shape = Vector::Zero();
  const auto share_at = [&](const Vector& terms) {
    return 1.0 / (1.0 + std::exp(-shape.dot(terms)));
  };
  const auto terms_at = [&](std::size_t i) -> Vector {
    return ShadowShape::terms(u[i], v[i]).cast<double>();
  };
  const auto darkness = [&](std::size_t i) {
    const double share = (classes.bright - static_cast<double>(grey[i])) / step;
    return std::clamp((share - kClear) / (1.0 - 2.0 * kClear), 0.0, 1.0);
  };
  for (int k = 0; k < kSteps; ++k) {
    // Pixels that are told apart without fail leave the steepness open.
    const double ridge = 1e-6 * static_cast<double>(grey.size());
    Square normal = Square::Zero();
    Vector pull = -ridge * shape;
    normal.diagonal().setConstant(ridge);
    for (std::size_t i = 0; i < grey.size(); ++i) {
      const Vector terms = terms_at(i);
      const double share = share_at(terms);
      normal += std::max(1e-6, share * (1.0 - share)) * terms * terms.transpose();
      pull += (darkness(i) - share) * terms;
    }
    const Vector move = normal.ldlt().solve(pull);
    if (!move.allFinite()) return std::nullopt;
    shape += move;
    if (move.norm() < 0.05 * shape.norm()) break;
  }
  double misfit = 0.0;
  for (std::size_t i = 0; i < grey.size(); ++i)
    misfit += std::abs(darkness(i) - share_at(terms_at(i)));
  if (!(misfit < kMostMisfit * static_cast<double>(grey.size()))) return std::nullopt;
  return Shadow{classes.bright, classes.dark, kLogisticToNormal * shape};
}

}  // namespace harco
