// Where to start: the strongest frequency in samples at irregular times.
#pragma once

#include <vector>

#include "harco/deck.hpp"

namespace harco {

/// Angular frequency (rad/s) at which a mean and one sinusoid, fitted by weighted least squares,
/// explain most of the values (the generalised Lomb-Scargle periodogram), sought between the
/// options' periods on a grid finer than the samples can resolve. `weights` has one for each
/// sample. Zero if nothing is explained. Samples ascend in time.
double strongest_rate(const std::vector<SeriesSample>& samples, const std::vector<double>& weights,
                      const OscillationOptions& options);

}  // namespace harco
