#include "pose/light_fit.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Cholesky>

#include "pose/kernels/patch_loops.hpp"

namespace harco {
namespace {

constexpr float kBrightest = 255.0F;

}  // namespace

double Light::black_part() const {
  return std::clamp(levels(0) / std::max(1.0, levels(kWhite)), 0.01, 0.9);
}

void LightFit::add(float grey, float white, float u, float v) {
  if (count_ == grey_.size()) {
    const std::size_t size = std::max<std::size_t>(1024, 2 * count_);
    for (auto* values : {&grey_, &white_, &u_, &v_, &residuals_, &weights_, &sizes_})
      values->resize(size);
    for (auto& column : columns_) column.resize(size);
  }
  grey_[count_] = grey;
  white_[count_] = white;
  u_[count_] = u;
  v_[count_++] = v;
}

/// Residuals, and how the greys change with the light.
void LightFit::linearise(const Light& light) {
  const Eigen::Matrix<float, Light::kLevels, 1> l = light.levels.cast<float>();
  const Eigen::Matrix<float, ShadowShape::kTerms, 1> shape = light.shape.cast<float>();
  const auto dark_part = static_cast<float>(light.black_part());
  const float less_white = 1.0F - static_cast<float>(light.shaded_white);
  const float less_black = 1.0F - static_cast<float>(light.shaded_black);
  for (std::size_t i = 0; i < count_; ++i) {
    const float u = u_[i], v = v_[i], seen = white_[i];
    const float bow = u * (l(6) * u + l(7) * v) + v * v * l(8);
    const float black = (1.0F - seen) * (l(0) + l(1) * u + l(2) * v + dark_part * bow);
    const float white = seen * (l(3) + l(4) * u + l(5) * v + bow);
    const ShadowShape::Terms terms = ShadowShape::terms(u, v);
    const auto [share, slope] = ShadowShape::depth(shape.dot(terms));
    const float on_black = 1.0F - share * less_black, on_white = 1.0F - share * less_white;
    const float value = on_black * black + on_white * white;
    // Nothing that is burnt out tells by how much.
    const float tells = value > kBrightest ? 0.0F : 1.0F;
    const float black_share = tells * on_black * (1.0F - seen), share_of = tells * on_white * seen;
    const float both = share_of + dark_part * black_share;
    const float by_value = -tells * slope * (less_white * white + less_black * black);
    const std::array<float, kShape> row{
        black_share,  black_share * u,       black_share * v,      share_of,
        share_of * u, share_of * v,          both * u * u,         both * u * v,
        both * v * v, tells * white * share, tells * black * share};
    for (std::size_t k = 0; k < row.size(); ++k) columns_[k][i] = row[k];
    for (std::size_t k = 0; k < ShadowShape::kTerms; ++k)
      columns_[kShape + k][i] = by_value * terms(static_cast<Eigen::Index>(k));
    residuals_[i] = grey_[i] - std::min(kBrightest, value);
  }
}

/// Mean size of the residuals.
double LightFit::misfit() const {
  double sum = 0.0;
  for (std::size_t i = 0; i < count_; ++i) sum += static_cast<double>(std::abs(residuals_[i]));
  return sum / static_cast<double>(count_);
}

/// The normal equations at what has been linearised, with what is known beforehand.
void LightFit::solve(const Light& light) {
  constexpr double kRounding = 0.29;  // grey levels
  const std::size_t stride = count_ / 600 + 1;
  std::size_t n = 0;
  for (std::size_t i = 0; i < count_; i += stride) sizes_[n++] = std::abs(residuals_[i]);
  const auto middle = sizes_.begin() + static_cast<std::ptrdiff_t>(n / 2);
  std::nth_element(sizes_.begin(), middle, sizes_.begin() + static_cast<std::ptrdiff_t>(n));
  const double noise = std::max(kRounding, 1.4826 * static_cast<double>(*middle));
  noise2_ = noise * noise;
  const auto inverse = static_cast<float>(1.0 / noise2_);
  kernels::huber_weights(residuals_.data(), inverse, count_, weights_.data());

  constexpr std::size_t kColumns = kUnknowns + 1;
  std::array<const float*, kColumns> columns{residuals_.data()};
  for (std::size_t a = 1; a < kColumns; ++a) columns[a] = columns_[a - 1].data();
  std::array<float, kColumns * kColumns> sums{};
  kernels::normal_products(weights_.data(), columns.data(), kColumns, count_, sums.data());
  for (std::size_t a = 1; a < kColumns; ++a) {
    const auto row = static_cast<Eigen::Index>(a) - 1;
    pull_(row) = static_cast<double>(sums[a * kColumns]);
    for (std::size_t b = 1; b <= a; ++b) {
      const auto other = static_cast<Eigen::Index>(b) - 1;
      normal_(row, other) = normal_(other, row) = static_cast<double>(sums[a * kColumns + b]);
    }
  }

  const double usual = LightPrior::kUsualBow * std::max(1.0, light.levels(Light::kWhite));
  for (Eigen::Index k = Light::kBow; k < Light::kLevels; ++k) {
    normal_(k, k) += noise2_ / (usual * usual);
    pull_(k) -= noise2_ / (usual * usual) * light.levels(k);
  }
  const double alike = noise2_ / (LightPrior::kUsualTint * LightPrior::kUsualTint);
  const double apart = light.shaded_white - light.shaded_black;
  normal_.block<2, 2>(kShade, kShade) +=
      alike * (Eigen::Matrix2d() << 1.0, -1.0, -1.0, 1.0).finished();
  pull_(kShade) -= alike * apart;
  pull_(kShade + 1) += alike * apart;
  const double steady = noise2_ / (LightPrior::kMostShape * LightPrior::kMostShape);
  for (Eigen::Index k = kShape; k < kUnknowns; ++k) normal_(k, k) += steady;
}

std::size_t LightFit::fit(Light& light, double steepest) {
  constexpr std::size_t kSteps = 20;
  constexpr double kSettled = 1e-3;  // of the misfit
  constexpr double kMostDamping = 1e4;
  if (count_ == 0) return 0;
  blunt(light, steepest);
  linearise(light);
  double cost = misfit(), damping = 0.01;
  solve(light);
  std::size_t step = 0;
  while (step < kSteps && damping < kMostDamping) {
    ++step;
    Normal damped = normal_;
    damped.diagonal() *= 1.0 + damping;
    const Row move = damped.ldlt().solve(pull_);
    if (!move.allFinite()) break;
    Light next = light;
    next.levels += move.head<Light::kLevels>();
    next.shaded_white = std::clamp(next.shaded_white + move(kShade), 0.02, 5.0);
    next.shaded_black = std::clamp(next.shaded_black + move(kShade + 1), 0.02, 5.0);
    next.shape += move.tail<ShadowShape::kTerms>();
    blunt(next, steepest);
    linearise(next);
    const double next_cost = misfit();
    if (next_cost < cost) {
      const bool settled = cost - next_cost < kSettled * cost;
      light = next;
      cost = next_cost;
      damping *= 0.2;
      if (settled) break;
      solve(light);
    } else {
      damping *= 10.0;
    }
  }
  return step;
}

double LightFit::best_steepness(const Light& light) {
  double best = 1.0, least = std::numeric_limits<double>::infinity();
  for (const double times : {2.0, 1.0, 0.5, 0.25, 0.12}) {
    Light other = light;
    other.shape *= times;
    linearise(other);
    if (const double cost = misfit(); cost < least) {
      least = cost;
      best = times;
    }
  }
  return best;
}

/// No shadow's edge is steeper than pixels can show.
void LightFit::blunt(Light& light, double steepest) const {
  constexpr double kFar = 4.0;  // from the border, where all is in or out of the shadow
  double steep = 0.0, count = 0.0;
  for (std::size_t i = 0; i < count_; i += 3) {
    const auto u = static_cast<double>(u_[i]), v = static_cast<double>(v_[i]);
    const auto& c = light.shape;
    const double value = c(0) + u * (c(1) + u * c(3) + v * c(4)) + v * (c(2) + v * c(5));
    if (std::abs(value) > kFar) continue;
    steep += Eigen::Vector2d(c(1) + 2.0 * u * c(3) + v * c(4), c(2) + u * c(4) + 2.0 * v * c(5))
                 .squaredNorm();
    count += 1.0;
  }
  if (count == 0.0) return;
  const double steepness = std::sqrt(steep / count);
  if (steepness > steepest) light.shape *= steepest / steepness;
}

}  // namespace harco
