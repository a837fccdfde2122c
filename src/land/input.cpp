#include "land/input.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

namespace harco {
namespace {

void require(bool holds, const char* what) {
  if (!holds) throw std::invalid_argument(std::string("deck model: ") + what);
}

}  // namespace

void check(const OscillationOptions& options) {
  require(options.max_order >= 0 && options.max_order <= 12, "max_order must be 0 … 12");
  require(options.min_period_s > 0.0, "min_period_s must be positive");
  require(options.max_period_s > options.min_period_s && std::isfinite(options.max_period_s),
          "max_period_s must be finite and greater than min_period_s");
  require(options.max_iterations > 0, "max_iterations must be positive");
}

std::vector<SeriesSample> sorted(std::vector<SeriesSample> samples) {
  constexpr std::size_t kLeastSamples = 4;
  for (const SeriesSample& sample : samples) {
    require(std::isfinite(sample.time_s) && std::isfinite(sample.value),
            "samples must have finite times and values");
    require(sample.sd > 0.0 && std::isfinite(sample.sd),
            "samples must have positive standard deviations");
  }
  require(samples.size() >= kLeastSamples, "a fit needs at least four samples");
  std::stable_sort(samples.begin(), samples.end(),
                   [](const auto& a, const auto& b) { return a.time_s < b.time_s; });
  require(samples.front().time_s < samples.back().time_s, "samples must span some time");
  return samples;
}

std::vector<SeriesSample> thinned(const std::vector<SeriesSample>& samples, int most) {
  const std::size_t kept = static_cast<std::size_t>(most);
  if (samples.size() <= kept) return samples;
  std::vector<SeriesSample> chosen;
  chosen.reserve(kept);
  for (std::size_t i = 0; i < kept; ++i)
    chosen.push_back(samples[i * (samples.size() - 1) / (kept - 1)]);
  return chosen;
}

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace harco
