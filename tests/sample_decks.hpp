// Decks whose motion is known, and samples of it.
#pragma once

#include <cmath>
#include <random>
#include <vector>

#include "harco/deck.hpp"
#include "harco/forecast.hpp"

namespace harco {

inline constexpr double kPi = 3.14159265358979323846;

/// Two sinusoids about 0.01, as the paper's oscillating platform has them.
inline Oscillation two_sinusoids(double epoch_s = 0.0) {
  Oscillation o;
  o.epoch_s = epoch_s;
  o.mean = 0.01;
  o.parts = {{0.10, 2.0 * kPi / 6.0, 0.4}, {0.04, 2.0 * kPi / 3.7, -1.1}};
  return o;
}

/// A seaway: many sinusoids, whose power lies about one period.
inline Oscillation seaway(double period_s, double rms, std::mt19937_64& random) {
  constexpr int kParts = 60;
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  Oscillation o;
  double power = 0.0;
  for (int i = 0; i < kParts; ++i) {
    const double rate = 2.0 * kPi / period_s * (0.6 + 0.9 * (i + uniform(random)) / kParts);
    const double off = (rate * period_s / (2.0 * kPi) - 1.0) / 0.12;
    const double amplitude = std::exp(-0.25 * off * off);
    power += 0.5 * amplitude * amplitude;
    o.parts.push_back({amplitude, rate, kPi * (2.0 * uniform(random) - 1.0)});
  }
  for (Sinusoid& part : o.parts) part.amplitude *= rms / std::sqrt(power);
  return o;
}

/// Samples at irregular times: the interval varies by a third.
inline std::vector<SeriesSample> samples_of(const Oscillation& truth, double from_s, double to_s,
                                            double per_s, double sd, std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> interval(0.67 / per_s, 1.33 / per_s);
  std::vector<SeriesSample> samples;
  for (double time_s = from_s; time_s <= to_s; time_s += interval(random))
    samples.push_back({time_s, truth.value(time_s) + sd * normal(random), sd});
  return samples;
}

/// A deck that rolls by one sinusoid of 0.1 rad and 8 s, level (0.05 rad) about every zero
/// crossing; learnt from 20 s that end at time 0. `ahead_s`: it runs so much earlier.
inline DeckForecast rolling(double ahead_s = 0.0, double amplitude = 0.1) {
  std::mt19937_64 random(4);
  Oscillation truth;
  truth.parts = {{amplitude, 2.0 * kPi / 8.0, 2.0 * kPi / 8.0 * ahead_s}};
  OscillationOptions options;
  options.max_order = 1;
  std::vector<SeriesSample> samples = samples_of(truth, -20.0, -0.2, 10.0, 0.002, random);
  samples.push_back({0.0, truth.value(0.0), 0.002});
  const AxisForecast roll = AxisForecast::learn(samples, options);
  DeckForecast forecast;
  forecast.as_of_s = 0.0;
  forecast.axes = {roll, roll, roll};
  return forecast;
}

}  // namespace harco
