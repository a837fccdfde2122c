#include "deck_motion.hpp"

#include <cmath>
#include <complex>
#include <numbers>
#include <random>
#include <stdexcept>

namespace harco::lab {
namespace {

constexpr double kTwoPi = 2.0 * std::numbers::pi;
constexpr double kGravity = 9.80665;

/// Uniform in 0 … 1; the same on every standard library.
double uniform(std::mt19937_64& random) { return static_cast<double>(random() >> 11) * 0x1p-53; }

double normal(std::mt19937_64& random) {
  return std::sqrt(-2.0 * std::log(1.0 - uniform(random))) * std::cos(kTwoPi * uniform(random));
}

/// JONSWAP spectrum up to its scale.
double spectrum(double rate, double peak, double peakedness) {
  const double width = rate <= peak ? 0.07 : 0.09;
  const double off = (rate / peak - 1.0) / width;
  return std::pow(rate, -5.0) * std::exp(-1.25 * std::pow(peak / rate, 4.0)) *
         std::pow(peakedness, std::exp(-0.5 * off * off));
}

/// Amplitude and phase of what a wave of one metre does to the ship.
struct Response {
  std::complex<double> heave, pitch, roll;
};

Response response(const Seaway& ship, double rate, double heading) {
  const double k = rate * rate / kGravity;
  const double along = std::max(1e-3, k * std::abs(std::cos(heading)));  // effective wave number
  const double half = 0.5 * along * ship.length_m;
  const double breadth = ship.beam_m * ship.block;
  const double damping = 2.0 * std::sin(0.5 * k * breadth) * std::exp(-k * ship.draught_m);
  const double stiffness = 1.0 - 2.0 * k * ship.draught_m;
  const double radiated = damping * damping / (k * breadth);
  const double gain = 1.0 / std::sqrt(stiffness * stiffness + radiated * radiated);
  const double force = std::hypot(1.0 - k * ship.draught_m, radiated);
  const double depth = std::exp(-along * ship.draught_m);
  const double heave = gain * depth * force * std::sin(half) / half;
  const double pitch =
      gain * depth * force * 3.0 * along / (half * half) * (std::sin(half) / half - std::cos(half));

  const double own = kTwoPi / ship.roll_period_s;
  const double ratio = rate / own;
  const std::complex<double> swing(1.0 - ratio * ratio, 2.0 * ship.roll_damping * ratio);
  const double slope = k * std::sin(heading) * std::exp(-k * ship.draught_m / 2.0);
  const std::complex<double> quarter(0.0, 1.0);
  // Pitch and roll follow the slope, a quarter of a period off the height.
  const double side = std::cos(heading) < 0.0 ? -1.0 : 1.0;
  return {heave, quarter * (side * pitch), quarter * slope / swing};
}

}  // namespace

Eigen::Isometry3d DeckMotion::world_T_deck(double time_s) const {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() = (Eigen::AngleAxisd(value(kPitch, time_s), Eigen::Vector3d::UnitY()) *
                   Eigen::AngleAxisd(value(kRoll, time_s), Eigen::Vector3d::UnitX()))
                      .toRotationMatrix();
  pose.translation().z() = -value(kHeave, time_s);
  return pose;
}

DeckMotion platform_motion(std::uint64_t seed) {
  std::mt19937_64 random(seed);
  const auto part = [&](double amplitude, double period_s, double spread_s) -> Sinusoid {
    return {amplitude * (0.8 + 0.4 * uniform(random)),
            kTwoPi / (period_s + spread_s * uniform(random)), kTwoPi * (uniform(random) - 0.5)};
  };
  DeckMotion motion;
  motion.axes[kRoll].mean = 0.01 * (uniform(random) - 0.5);
  motion.axes[kRoll].parts = {part(0.09, 5.0, 1.0), part(0.03, 2.8, 0.5)};
  motion.axes[kPitch].mean = 0.01 * (uniform(random) - 0.5);
  motion.axes[kPitch].parts = {part(0.07, 6.5, 1.0)};
  motion.axes[kHeave].parts = {part(0.1, 7.0, 1.0)};
  return motion;
}

Seaway sea_state(int state) {
  constexpr std::array<double, 7> kHeight_m{0.0, 0.1, 0.3, 0.88, 1.88, 3.25, 5.0};
  constexpr std::array<double, 7> kPeriod_s{5.0, 5.5, 6.3, 7.5, 8.8, 9.7, 12.4};
  if (state < 0 || state > 6) throw std::invalid_argument("sea state: must be 0 … 6");
  Seaway sea;
  sea.wave_height_m = kHeight_m[static_cast<std::size_t>(state)];
  sea.peak_period_s = kPeriod_s[static_cast<std::size_t>(state)];
  return sea;
}

DeckMotion ship_motion(const Seaway& sea, std::uint64_t seed) {
  constexpr int kParts = 80;
  constexpr double kSlowest = 0.5, kFastest = 2.6;  // over the peak's rate
  if (!(sea.wave_height_m >= 0.0 && sea.peak_period_s > 0.0 && sea.peakedness > 0.0 &&
        sea.length_m > 0.0 && sea.beam_m > 0.0 && sea.draught_m > 0.0 && sea.block > 0.0 &&
        sea.roll_period_s > 0.0 && sea.roll_damping > 0.0))
    throw std::invalid_argument("seaway: lengths, periods and damping must be positive");
  std::mt19937_64 random(seed);
  const double peak = kTwoPi / sea.peak_period_s;
  const double step = (kFastest - kSlowest) * peak / kParts;
  std::array<double, kParts> rates{};
  std::array<double, kParts> amplitudes{};
  double power = 0.0;
  for (std::size_t i = 0; i < kParts; ++i) {
    // Somewhere in its band, so that the sea doesn't repeat.
    rates[i] = kSlowest * peak + step * (static_cast<double>(i) + uniform(random));
    amplitudes[i] = std::sqrt(2.0 * spectrum(rates[i], peak, sea.peakedness) * step);
    power += 0.5 * amplitudes[i] * amplitudes[i];
  }
  // Four standard deviations of the surface are the significant height.
  const double scale = 0.25 * sea.wave_height_m / std::sqrt(power);
  DeckMotion motion;
  for (std::size_t i = 0; i < kParts; ++i) {
    const double heading = sea.heading_rad + sea.spreading_rad * normal(random);
    const Response ship = response(sea, rates[i], heading);
    const double phase = kTwoPi * uniform(random);
    const auto add = [&](DeckAxis axis, const std::complex<double>& by_metre) {
      const double amplitude = scale * amplitudes[i] * std::abs(by_metre);
      if (amplitude == 0.0) return;
      motion.axes[axis].parts.push_back({amplitude, rates[i], phase + std::arg(by_metre)});
    };
    add(kRoll, ship.roll);
    add(kPitch, ship.pitch);
    // A bow that rises lowers the deck aft.
    add(kHeave, ship.heave - sea.deck_aft_m * ship.pitch);
  }
  return motion;
}

}  // namespace harco::lab
