#include "pose/response.hpp"

#include <algorithm>
#include <cmath>

namespace harco {

void Response::set(double log_gamma, double black) {
  constexpr double kDifference = 1e-3;
  Table less{}, more{};
  tabulate(log_gamma, black, seen_);
  tabulate(log_gamma - kDifference, black, less);
  tabulate(log_gamma + kDifference, black, more);
  for (std::size_t i = 0; i <= kCells; ++i) {
    by_log_gamma_[i] = (more[i] - less[i]) / static_cast<float>(2.0 * kDifference);
    const std::size_t before = i > 0 ? i - 1 : 0, after = i < kCells ? i + 1 : kCells;
    slope_[i] = (seen_[after] - seen_[before]) * static_cast<float>(kCells) /
                static_cast<float>(after - before);
  }
}

float Response::seen(float white_share) const {
  const float place = std::clamp(white_share, 0.0F, 1.0F) * static_cast<float>(kCells);
  const auto cell = std::min(static_cast<std::size_t>(place), kCells - 1);
  const float part = place - static_cast<float>(cell);
  return seen_[cell] + part * (seen_[cell + 1] - seen_[cell]);
}

void Response::tell(kernels::LightTerms& terms) const {
  terms.seen = seen_.data();
  terms.slope = slope_.data();
  terms.by_log_gamma = by_log_gamma_.data();
  terms.cells = static_cast<int>(kCells);
}

void Response::tabulate(double log_gamma, double black, Table& table) {
  const double gamma = std::exp(log_gamma);
  const double dark = std::pow(black, gamma);
  for (std::size_t i = 0; i <= kCells; ++i) {
    const double light = dark + (1.0 - dark) * static_cast<double>(i) / static_cast<double>(kCells);
    table[i] = static_cast<float>((std::pow(light, 1.0 / gamma) - black) / (1.0 - black));
  }
}

}  // namespace harco
