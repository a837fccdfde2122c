// Section 3.2 of the paper, equation by equation.
#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "harco/plan.hpp"

namespace harco {
namespace {

// Logarithms of exact powers come out a rounding error beside a whole number.
constexpr double kRounding = 1e-9;
// Counts stop here: ratios next to 1 would ask for more than an int holds.
constexpr double kMostCounted = 1e9;

int rounded_up(double value) {
  return static_cast<int>(std::min(std::ceil(value - kRounding), kMostCounted));
}

int rounded_down(double value) {
  return static_cast<int>(std::min(std::floor(value + kRounding), kMostCounted));
}

double square(double value) { return value * value; }

void require_positive(double value, const char* name) {
  if (!(value > 0.0) || !std::isfinite(value))
    throw std::invalid_argument(std::string(name) + " must be positive and finite");
}

void require_share(double value, const char* name) {
  if (!(value > 0.0 && value < 1.0))
    throw std::invalid_argument(std::string(name) + " must lie between 0 and 1");
}

void require_less(double low, double high, const char* names) {
  if (!(low < high)) throw std::invalid_argument(std::string(names) + ": the first must be less");
}

void require_width(double value, const char* name) {
  if (!(value >= 0.0 && value <= 0.25))
    throw std::invalid_argument(std::string(name) + " must be 0 … 0.25 of the side");
}

void require_layers(int child_layers) {
  if (child_layers < 1) throw std::invalid_argument("child_layers must be at least 1");
}

void require_range(double h_min, double h_max, double theta) {
  require_positive(h_min, "h_min");
  require_positive(h_max, "h_max");
  require_less(h_min, h_max, "h_min, h_max");
  require_share(theta, "theta");
}

/// h_j times theta_k for k = first … i.
double scaled(double distance_j, const std::vector<double>& theta, int first, int i) {
  double distance = distance_j;
  for (int k = first; k <= i; ++k) {
    const double theta_k = theta[static_cast<std::size_t>(k - 1)];
    require_share(theta_k, "theta");
    distance *= theta_k;
  }
  return distance;
}

void require_layer_pair(double distance_j, const std::vector<double>& theta, int j, int i) {
  require_positive(distance_j, "distance_j");
  if (j < 1 || j > i || i > static_cast<int>(theta.size()))
    throw std::invalid_argument("layers: 1 <= j <= i <= number of theta is needed");
}

/// w_{k+1} = w_1 - beta (1 + ink outside - w_k), as the two numbers of a linear recursion.
struct WhiteRecursion {
  double first;  ///< w_1
  double beta;
  double outside;  ///< area of the ink outside a child, in areas of the child

  WhiteRecursion(double alpha, double beta_, const LineWidth& line)
      : first(child_white_share(alpha, line.inside)), beta(beta_) {
    require_share(beta, "beta");
    require_width(line.outside, "line outside");
    outside = square(1.0 + 2.0 * line.outside) - 1.0;
  }

  double next(double white) const { return first - beta * (1.0 + outside - white); }
  double limit() const { return (first - beta * (1.0 + outside)) / (1.0 - beta); }
};

}  // namespace

double side_in_image(double focal_px, double side_m, double distance_m) {
  require_positive(focal_px, "focal length");
  require_positive(side_m, "side");
  require_positive(distance_m, "distance");
  return focal_px * side_m / distance_m;
}

double distance_in_layer(double distance_j, const std::vector<double>& theta, int j, int i) {
  require_layer_pair(distance_j, theta, j, i);
  return scaled(distance_j, theta, j + 1, i);
}

int layers_needed(double h_min, double h_max, double theta, double s_min, double s_max) {
  require_range(h_min, h_max, theta);
  require_positive(s_min, "s_min");
  require_positive(s_max, "s_max");
  require_less(s_min, s_max, "s_min, s_max");
  const double uncovered = (h_max / h_min) / (s_max / s_min);
  return 1 + std::max(0, rounded_up(std::log(uncovered) / std::log(1.0 / theta)));
}

double child_white_share(double alpha, double gamma) {
  require_share(alpha, "alpha");
  require_width(gamma, "line inside");
  return std::max(0.0, square(1.0 - 2.0 * gamma) - alpha);
}

double carried_white_share(int child_layers, double alpha, double beta, const LineWidth& line) {
  require_layers(child_layers);
  const WhiteRecursion recursion(alpha, beta, line);
  double white = recursion.first;
  for (int k = 1; k < child_layers; ++k) white = recursion.next(white);
  return std::max(0.0, white);
}

double carried_white_limit(double alpha, double beta, const LineWidth& line) {
  return std::max(0.0, WhiteRecursion(alpha, beta, line).limit());
}

std::optional<int> most_child_layers(double alpha, double beta, const LineWidth& line,
                                     double least_white) {
  require_share(least_white, "least_white");
  const WhiteRecursion recursion(alpha, beta, line);
  int layers = 0;
  for (double white = recursion.first; white > least_white;) {
    ++layers;
    // Shares fall towards the limit; where they no longer do, they have arrived there.
    const double next = recursion.next(white);
    if (next >= white) return std::nullopt;
    white = next;
  }
  return layers;
}

namespace printed {

double distance_in_layer(double distance_j, const std::vector<double>& theta, int j, int i) {
  require_layer_pair(distance_j, theta, j, i);
  return scaled(distance_j, theta, j, i);
}

int layers_needed(double h_min, double h_max, double theta) {
  require_range(h_min, h_max, theta);
  return rounded_up(std::log(h_min / h_max) / std::log(theta));
}

double child_white_share(double alpha, double gamma) {
  require_share(alpha, "alpha");
  require_width(gamma, "gamma");
  return (1.0 - alpha) * square(1.0 - 2.0 * gamma);
}

double carried_white_step(double a_before, double beta, double b) {
  require_share(a_before, "a");
  require_share(beta, "beta");
  require_share(b, "b");
  return (1.0 - beta * (1.0 - b)) * a_before;
}

double carried_white_share(int child_layers, double alpha, double beta, double gamma) {
  require_layers(child_layers);
  require_share(beta, "beta");
  const double b = child_white_share(alpha, gamma);
  return std::pow(1.0 - beta + beta * b, child_layers - 1) * b;
}

int most_child_layers(double base, double first, double least_white) {
  require_share(base, "base");
  require_share(first, "first");
  require_share(least_white, "least_white");
  if (first <= least_white) return 0;
  return 1 + rounded_down(std::log(least_white / first) / std::log(base));
}

int most_child_layers(double alpha, double beta, double gamma, double least_white) {
  require_share(beta, "beta");
  const double b = child_white_share(alpha, gamma);
  return most_child_layers(1.0 - beta + beta * b, b, least_white);
}

}  // namespace printed
}  // namespace harco
