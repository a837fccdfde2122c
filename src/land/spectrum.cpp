#include "land/spectrum.hpp"

#include <cmath>
#include <complex>

#include <Eigen/Cholesky>

#include "land/input.hpp"

namespace harco {
namespace {

/// One sample's phasor at the rate looked at, and its turn from one rate to the next: cheaper than
/// a sine and a cosine for each rate.
struct Phasor {
  std::complex<double> now, turn;
  double weight, value;
};

/// Sum of weighted squares that a mean and one sinusoid explain.
double explained(const std::vector<Phasor>& phasors) {
  double w = 0.0, wc = 0.0, ws = 0.0, wcc = 0.0, wcs = 0.0, wss = 0.0;
  double wy = 0.0, wcy = 0.0, wsy = 0.0;
  for (const Phasor& phasor : phasors) {
    const double c = phasor.weight * phasor.now.real();
    const double s = phasor.weight * phasor.now.imag();
    w += phasor.weight;
    wc += c;
    ws += s;
    wcc += c * phasor.now.real();
    wcs += c * phasor.now.imag();
    wss += s * phasor.now.imag();
    wy += phasor.weight * phasor.value;
    wcy += c * phasor.value;
    wsy += s * phasor.value;
  }
  Eigen::Matrix3d normal;
  normal << w, wc, ws, wc, wcc, wcs, ws, wcs, wss;
  const Eigen::Vector3d right(wy, wcy, wsy);
  const Eigen::LDLT<Eigen::Matrix3d> solver(normal);
  return solver.info() == Eigen::Success ? right.dot(solver.solve(right)) : 0.0;
}

}  // namespace

double strongest_rate(const std::vector<SeriesSample>& samples, const std::vector<double>& weights,
                      const OscillationOptions& options) {
  constexpr double kStepsPerLine = 5.0;  // a spectral line is 2 pi / span wide
  const double epoch_s = samples.back().time_s;
  const double span_s = epoch_s - samples.front().time_s;
  const double lowest = kTwoPi / options.max_period_s;
  const double highest = kTwoPi / options.min_period_s;
  const double step = kTwoPi / (kStepsPerLine * span_s);
  std::vector<Phasor> phasors;
  phasors.reserve(samples.size());
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const double since_s = samples[i].time_s - epoch_s;
    phasors.push_back({std::polar(1.0, lowest * since_s), std::polar(1.0, step * since_s),
                       weights[i], samples[i].value});
  }
  double best_rate = 0.0;
  double most = 0.0;
  for (double rate = lowest; rate <= highest; rate += step) {
    const double power = explained(phasors);
    for (Phasor& phasor : phasors) phasor.now *= phasor.turn;
    if (!(power > most)) continue;
    most = power;
    best_rate = rate;
  }
  return best_rate;
}

}  // namespace harco
