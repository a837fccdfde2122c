// What the fits ask of their input, and small things that several of them need.
#pragma once

#include <vector>

#include "harco/deck.hpp"

namespace harco {

inline constexpr double kTwoPi = 6.28318530717958647692;
inline constexpr double kMadToSd = 1.4826;  ///< median absolute value -> sd, for normal errors

/// Throws std::invalid_argument, naming the field, for options out of range.
void check(const OscillationOptions& options);

/// Ascending in time, otherwise in the order given. Throws std::invalid_argument as fit_orders
/// says.
std::vector<SeriesSample> sorted(std::vector<SeriesSample> samples);

/// At most `most` of them, evenly chosen; first and last stay.
std::vector<SeriesSample> thinned(const std::vector<SeriesSample>& samples, int most);

/// The middle one (the upper of two). `values` must not be empty.
double median(std::vector<double> values);

}  // namespace harco
