// The program of docs/landing.md in short: samples of a deck go in, level windows come out.
#include <cmath>
#include <iostream>

#include <harco/land.hpp>

int main() {
  harco::DeckModel model;
  for (int i = 0; i < 400; ++i) {
    harco::DeckSample sample;
    sample.time_s = 0.1 * i;
    sample.motion << 0.08 * std::sin(0.6 * sample.time_s), 0.05 * std::sin(0.5 * sample.time_s),
        0.0;
    sample.motion[i % 3] += i % 2 == 0 ? 1e-3 : -1e-3;
    sample.covariance = 1e-6 * Eigen::Matrix3d::Identity();
    model.add(sample);
    model.update();
  }
  if (model.phase() != harco::DeckPhase::ready) return 1;
  const harco::DeckForecast& forecast = *model.forecast();
  const auto windows =
      harco::level_windows(forecast, {}, forecast.as_of_s, forecast.as_of_s + 20.0);
  for (const harco::LevelWindow& window : windows)
    std::cout << window.begin_s << " " << window.end_s << " " << window.probability << "\n";
  return windows.empty() ? 1 : 0;
}
