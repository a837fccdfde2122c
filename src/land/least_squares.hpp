// Eq. 19 by non-linear least squares: the only place that knows Ceres.
#pragma once

#include <vector>

#include "harco/deck.hpp"

namespace harco {

/// Moves all parameters from `start` so that the squares of the residuals, over their standard
/// deviations, become least; rates stay between the options' periods. A residual beyond three times
/// `scale` counts by its size instead of its square (Huber).
Oscillation least_squares(const std::vector<SeriesSample>& samples, const Oscillation& start,
                          double scale, const OscillationOptions& options);

}  // namespace harco
