#include "detect/bands.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace harco::detect {
namespace {

// Unknowns: the offset, the logarithm of the blur, what the first border moves besides, the light's
// change a pixel outwards, and the levels from the inside out. With fewer borders than three the
// last levels change nothing, and stay where they are.
constexpr int kOffset = 0, kBlur = 1, kFirst = 2, kLight = 3, kLevels = 4, kUnknowns = 8;
using Unknowns = Eigen::Matrix<double, kUnknowns, 1>;
using Normal = Eigen::Matrix<double, kUnknowns, kUnknowns>;
using Jacobian = Eigen::Matrix<double, Eigen::Dynamic, kUnknowns, Eigen::ColMajor, kMaxAcross>;
using Samples = Eigen::Array<double, Eigen::Dynamic, 1, Eigen::ColMajor, kMaxAcross, 1>;

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
    constexpr double kRootTwo = std::numbers::sqrt2;
    const Samples bell = (-0.5 * z * z).exp();
    const Samples t = (1.0 + 0.3275911 / kRootTwo * z.abs()).inverse();
    const Samples tail =
        bell * t *
        (0.127414796 +
         t * (-0.142248368 + t * (0.7107068705 + t * (-0.7265760135 + t * 0.5307027145))));
    density = bell / (kRootTwo * std::sqrt(std::numbers::pi));
    integral.resize(z.size());
    for (Eigen::Index k = 0; k < z.size(); ++k) integral(k) = z(k) < 0.0 ? tail(k) : 1.0 - tail(k);
  }
};

/// The profile that the unknowns predict, with its derivatives by them and by the last border.
void predict(const Unknowns& unknowns, const Samples& outwards, const Bands& bands,
             Profile& profile, Jacobian& jacobian, Profile& by_last) {
  const double sigma = std::exp(unknowns(kBlur));
  profile.setConstant(unknowns(kLevels));
  jacobian.setZero();
  jacobian.col(kLevels).setOnes();
  for (int b = 0; b < bands.count; ++b) {
    const double border = bands.borders[static_cast<std::size_t>(b)] + unknowns(kOffset) +
                          (b == 0 ? unknowns(kFirst) : 0.0);
    const double rise = unknowns(kLevels + b + 1) - unknowns(kLevels + b);
    const Samples z = (outwards - border) / sigma;
    const Gaussian gaussian(z);
    const Samples by_border = -rise / sigma * gaussian.density;
    profile.array() += rise * gaussian.integral;
    jacobian.col(kOffset).array() += by_border;
    if (b == 0) jacobian.col(kFirst) = by_border;
    if (b == bands.count - 1) by_last = by_border;
    jacobian.col(kBlur).array() += sigma * by_border * z;
    jacobian.col(kLevels + b).array() -= gaussian.integral;
    jacobian.col(kLevels + b + 1) = gaussian.integral;
  }
  const Samples light = 1.0 + unknowns(kLight) * outwards;
  for (int unknown = 0; unknown < kUnknowns; ++unknown) jacobian.col(unknown).array() *= light;
  jacobian.col(kLight) = profile.array() * outwards;
  by_last.array() *= light;
  profile.array() *= light;
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
  const auto outwards =
      Samples::LinSpaced(mean.size(), first, first + static_cast<double>(mean.size() - 1) * step)
          .eval();
  Profile profile(mean.size()), by_last(mean.size());
  Jacobian jacobian(mean.size(), kUnknowns);
  for (int i = 0; i < kIterations; ++i) {
    predict(unknowns, outwards, bands, profile, jacobian, by_last);
    Normal normal;
    Unknowns right = trust.cwiseProduct(expected - unknowns);
    const Profile left = mean - profile;
    for (int a = 0; a < kUnknowns; ++a) {
      for (int b = 0; b <= a; ++b) normal(a, b) = jacobian.col(a).dot(jacobian.col(b));
      normal(a, a) += trust(a);
      right(a) += jacobian.col(a).dot(left);
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
      filter.expected = profile + jacobian * move;
      filter.fitted = unknowns;
      filter.weights = jacobian * solve(normal, Unknowns::Unit(kOffset));
      filter.by_last = filter.weights.dot(by_last);
      return filter;
    }
  }
  return std::nullopt;
}

}  // namespace harco::detect
