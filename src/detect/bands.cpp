#include "detect/bands.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Cholesky>

namespace harco::detect {
namespace {

// Unknowns: the offset, the logarithm of the blur, what the first border moves besides, the light's
// change a pixel outwards, and the levels from the inside out.
constexpr int kOffset = 0, kBlur = 1, kFirst = 2, kLight = 3, kLevels = 4, kMostUnknowns = 8;
using Unknowns = Eigen::Matrix<double, Eigen::Dynamic, 1, Eigen::ColMajor, kMostUnknowns, 1>;
using Normal = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, kMostUnknowns,
                             kMostUnknowns>;
using Jacobian = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, kMaxAcross,
                               kMostUnknowns>;

// What is expected beforehand, for what a profile can't tell: blur, and greys to about the
// contrast; both weak against a profile known to about a grey level.
constexpr double kUsualBlur = 0.85;
constexpr double kBlurSpread = 0.5;  // of the logarithm
constexpr double kLeastBlur = 0.3, kMostBlur = 4.0;
constexpr double kMostOffset = 1.0;  // pixels

double gaussian(double z) { return std::exp(-0.5 * z * z) / std::sqrt(2.0 * std::numbers::pi); }
double gaussian_integral(double z) { return 0.5 * std::erfc(-z / std::numbers::sqrt2); }

/// The profile that the unknowns predict, with its derivatives by them and by the last border.
void predict(const Unknowns& unknowns, double first, double step, const Bands& bands,
             Profile& profile, Jacobian& jacobian, Profile& by_last) {
  const double sigma = std::exp(unknowns(kBlur));
  profile.setConstant(unknowns(kLevels));
  jacobian.setZero();
  jacobian.col(kLevels).setOnes();
  by_last.setZero();
  for (int b = 0; b < bands.count; ++b) {
    const double border = bands.borders[static_cast<std::size_t>(b)] + unknowns(kOffset) +
                          (b == 0 ? unknowns(kFirst) : 0.0);
    const double rise = unknowns(kLevels + b + 1) - unknowns(kLevels + b);
    for (Eigen::Index k = 0; k < profile.size(); ++k) {
      const double z = (first + static_cast<double>(k) * step - border) / sigma;
      const double beyond = gaussian_integral(z);
      const double density = gaussian(z);
      profile(k) += rise * beyond;
      jacobian(k, kOffset) -= rise * density / sigma;
      if (b == 0) jacobian(k, kFirst) = -rise * density / sigma;
      jacobian(k, kBlur) -= rise * density * z;
      jacobian(k, kLevels + b) -= beyond;
      jacobian(k, kLevels + b + 1) += beyond;
      if (b == bands.count - 1) by_last(k) = -rise * density / sigma;
    }
  }
  for (Eigen::Index k = 0; k < profile.size(); ++k) {
    const double outwards = first + static_cast<double>(k) * step;
    const double light = 1.0 + unknowns(kLight) * outwards;
    jacobian.row(k) *= light;
    by_last(k) *= light;
    jacobian(k, kLight) = profile(k) * outwards;
    profile(k) *= light;
  }
}

/// Each band's grey in the middle of its part of the profile.
Unknowns first_guess(const Profile& mean, double first, double step, const Bands& bands) {
  Unknowns guess(kLevels + bands.count + 1);
  guess(kOffset) = 0.0;
  guess(kBlur) = std::log(kUsualBlur);
  guess(kFirst) = 0.0;
  guess(kLight) = 0.0;
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
  Unknowns trust = Unknowns::Constant(expected.size(), 1.0 / (contrast * contrast));
  trust(kOffset) = 1.0;
  trust(kBlur) = 1.0 / (kBlurSpread * kBlurSpread);
  trust(kLight) = 1.0 / (bands.light_spread * bands.light_spread + 1e-12);
  trust(kFirst) = 1.0 / (bands.first_spread * bands.first_spread + 1e-6);

  Unknowns unknowns = start ? start->fitted : expected;
  Profile profile(mean.size()), by_last(mean.size());
  Jacobian jacobian(mean.size(), expected.size());
  Eigen::LDLT<Normal> factored;
  for (int i = 0; i < kIterations; ++i) {
    predict(unknowns, first, step, bands, profile, jacobian, by_last);
    Normal normal = jacobian.transpose() * jacobian;
    normal.diagonal() += trust;
    factored.compute(normal);
    Unknowns move = factored.solve(Unknowns(jacobian.transpose() * (mean - profile) +
                                            trust.cwiseProduct(expected - unknowns)));
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
      filter.expected = profile;
      filter.fitted = unknowns;
      Unknowns offset = Unknowns::Zero(expected.size());
      offset(kOffset) = 1.0;
      filter.weights = jacobian * factored.solve(offset);
      filter.by_last = filter.weights.dot(by_last);
      return filter;
    }
  }
  return std::nullopt;
}

}  // namespace harco::detect
