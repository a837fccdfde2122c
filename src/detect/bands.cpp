#include "detect/bands.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace harco::detect {
namespace {

// Unknowns: the offset, the logarithm of the blur, what the first border moves besides, the light's
// change a pixel outwards, and the levels from the inside out. With fewer borders than three the
// last levels change nothing, and stay where they are. What is sampled is as exact as floats are;
// what is solved for is not.
constexpr int kOffset = 0, kBlur = 1, kFirst = 2, kLight = 3, kLevels = 4, kUnknowns = 8;
using Unknowns = Eigen::Matrix<double, kUnknowns, 1>;
using Normal = Eigen::Matrix<double, kUnknowns, kUnknowns>;
using Jacobian = Eigen::Matrix<float, Eigen::Dynamic, kUnknowns, Eigen::ColMajor, kMaxAcross>;
using Samples = Eigen::Array<float, Eigen::Dynamic, 1, Eigen::ColMajor, kMaxAcross, 1>;

// What is expected beforehand, for what a profile can't tell: blur, and greys to about the
// contrast; both weak against a profile known to about a grey level.
constexpr double kUsualBlur = 0.85;
constexpr double kBlurSpread = 0.5;  // of the logarithm
constexpr double kLeastBlur = 0.3, kMostBlur = 4.0;
constexpr double kMostOffset = 1.0;  // pixels

/// The standard normal law at many places: its density, and its integral to 2e-7 (Abramowitz and
/// Stegun, 7.1.26).
struct Gaussian {
  Samples density;
  Samples integral;

  explicit Gaussian(const Samples& z) {
    constexpr float kRootTwo = std::numbers::sqrt2_v<float>;
    constexpr float kPerRootPi = std::numbers::inv_sqrtpi_v<float>;
    constexpr float kNothing = -60.0F;  // processors are slow with numbers below the normal ones
    const Samples bell = (-0.5F * z * z).max(kNothing).exp();
    const Samples t = (1.0F + 0.3275911F / kRootTwo * z.abs()).inverse();
    const Samples tail =
        bell * t *
        (0.127414796F +
         t * (-0.142248368F + t * (0.7107068705F + t * (-0.7265760135F + t * 0.5307027145F))));
    density = kPerRootPi / kRootTwo * bell;
    integral.resize(z.size());
    for (Eigen::Index k = 0; k < z.size(); ++k)
      integral(k) = z(k) < 0.0F ? tail(k) : 1.0F - tail(k);
  }
};

/// The profile that the unknowns predict, with its derivatives by them and by the last border.
void predict(const Unknowns& exact, const Samples& outwards, const Bands& bands, Samples& profile,
             Jacobian& jacobian, Samples& by_last) {
  const Eigen::Matrix<float, kUnknowns, 1> unknowns = exact.cast<float>();
  const float sigma = std::exp(unknowns(kBlur));
  profile.setConstant(unknowns(kLevels));
  jacobian.setZero();
  jacobian.col(kLevels).setOnes();
  for (int b = 0; b < bands.count; ++b) {
    const float border = static_cast<float>(bands.borders[static_cast<std::size_t>(b)]) +
                         unknowns(kOffset) + (b == 0 ? unknowns(kFirst) : 0.0F);
    const float rise = unknowns(kLevels + b + 1) - unknowns(kLevels + b);
    const Samples z = (outwards - border) / sigma;
    const Gaussian gaussian(z);
    const Samples by_border = -rise / sigma * gaussian.density;
    profile += rise * gaussian.integral;
    jacobian.col(kOffset).array() += by_border;
    if (b == 0) jacobian.col(kFirst) = by_border;
    if (b == bands.count - 1) by_last = by_border;
    jacobian.col(kBlur).array() += sigma * by_border * z;
    jacobian.col(kLevels + b).array() -= gaussian.integral;
    jacobian.col(kLevels + b + 1) = gaussian.integral;
  }
  const Samples light = 1.0F + unknowns(kLight) * outwards;
  for (int unknown = 0; unknown < kUnknowns; ++unknown) jacobian.col(unknown).array() *= light;
  jacobian.col(kLight) = profile * outwards;
  by_last *= light;
  profile *= light;
}

/// Cholesky's factors L D L^T of a positive definite matrix, in place: L below the diagonal, D on
/// it.
void factor(Normal& a) {
  for (int j = 0; j < kUnknowns; ++j) {
    for (int i = j + 1; i < kUnknowns; ++i) {
      const double l = a(i, j) / a(j, j);
      for (int k = j + 1; k <= i; ++k) a(i, k) -= l * a(k, j);
    }
    for (int i = j + 1; i < kUnknowns; ++i) a(i, j) /= a(j, j);
  }
}

/// Of the equations with such factors.
Unknowns solve(const Normal& factors, Unknowns right) {
  for (int i = 0; i < kUnknowns; ++i)
    for (int k = 0; k < i; ++k) right(i) -= factors(i, k) * right(k);
  for (int i = 0; i < kUnknowns; ++i) right(i) /= factors(i, i);
  for (int i = kUnknowns - 1; i >= 0; --i)
    for (int k = i + 1; k < kUnknowns; ++k) right(i) -= factors(k, i) * right(k);
  return right;
}

/// Each band's grey in the middle of its part of the profile.
Unknowns first_guess(const Profile& mean, double first, double step, const Bands& bands) {
  Unknowns guess = Unknowns::Zero();
  guess(kBlur) = std::log(kUsualBlur);
  const double last = first + static_cast<double>(mean.size() - 1) * step;
  for (int band = 0; band <= bands.count; ++band) {
    const double from = band == 0 ? first : bands.borders[static_cast<std::size_t>(band - 1)];
    const double to = band == bands.count ? last : bands.borders[static_cast<std::size_t>(band)];
    // The outermost are evenest at their outer ends.
    const double at = band == 0 ? first : band == bands.count ? last : 0.5 * (from + to);
    const auto k = static_cast<Eigen::Index>(std::lround((at - first) / step));
    guess(kLevels + band) = mean(std::clamp(k, Eigen::Index{0}, mean.size() - 1));
  }
  return guess;
}

}  // namespace

std::optional<EdgeFilter> fit_bands(const Profile& mean, double first, double step,
                                    const Bands& bands, const EdgeFilter* start) {
  constexpr int kIterations = 8;
  constexpr double kSettled = 1e-3;  // pixels
  const Unknowns expected = first_guess(mean, first, step, bands);
  const double contrast = std::max(1.0, mean.maxCoeff() - mean.minCoeff());
  Unknowns trust = Unknowns::Constant(1.0 / (contrast * contrast));
  trust(kOffset) = 1.0;
  trust(kBlur) = 1.0 / (kBlurSpread * kBlurSpread);
  trust(kLight) = 1.0 / (bands.light_spread * bands.light_spread + 1e-12);
  trust(kFirst) = 1.0 / (bands.first_spread * bands.first_spread + 1e-6);

  Unknowns unknowns = start ? start->fitted : expected;
  Samples outwards(mean.size());
  for (Eigen::Index k = 0; k < mean.size(); ++k)
    outwards(k) = static_cast<float>(first + static_cast<double>(k) * step);
  Samples profile(mean.size()), by_last(mean.size());
  Jacobian jacobian(mean.size(), kUnknowns);
  for (int i = 0; i < kIterations; ++i) {
    predict(unknowns, outwards, bands, profile, jacobian, by_last);
    const auto sum_of_products = [](const auto& a, const auto& b) {
      return static_cast<double>((a.array() * b.array()).sum());
    };
    Normal normal;
    Unknowns right = trust.cwiseProduct(expected - unknowns);
    const Samples left = mean.cast<float>().array() - profile;
    for (int a = 0; a < kUnknowns; ++a) {
      for (int b = 0; b <= a; ++b) normal(a, b) = sum_of_products(jacobian.col(a), jacobian.col(b));
      normal(a, a) += trust(a);
      right(a) += sum_of_products(jacobian.col(a), left);
    }
    factor(normal);
    Unknowns move = solve(normal, right);
    if (!move.allFinite()) return std::nullopt;
    const bool settled = std::abs(move(kOffset)) < kSettled && std::abs(move(kBlur)) < 0.02;
    move(kOffset) = std::clamp(move(kOffset), -0.5, 0.5);
    move(kBlur) = std::clamp(move(kBlur), -0.4, 0.4);
    unknowns += move;
    if (std::abs(unknowns(kOffset)) > kMostOffset || unknowns(kBlur) < std::log(kLeastBlur) ||
        unknowns(kBlur) > std::log(kMostBlur))
      return std::nullopt;
    if (settled) {
      EdgeFilter filter;
      filter.offset = unknowns(kOffset);
      filter.sigma = std::exp(unknowns(kBlur));
      const auto along = [&](const Unknowns& direction) -> Profile {
        return jacobian.lazyProduct(direction.cast<float>().eval()).cast<double>();
      };
      filter.expected = profile.matrix().cast<double>() + along(move);
      filter.fitted = unknowns;
      filter.weights = along(solve(normal, Unknowns::Unit(kOffset)));
      filter.by_last = filter.weights.dot(by_last.matrix().cast<double>());
      return filter;
    }
  }
  return std::nullopt;
}

}  // namespace harco::detect
