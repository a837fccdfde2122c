// Possible courses of a deck, drawn from its forecast.
#pragma once

#include <vector>

#include "harco/level.hpp"

namespace harco {

/// For every draw (row) and time (column): is the deck level then?
using LevelTable = Eigen::Array<bool, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// Draws courses and compares them with the limits.
LevelTable draw_level(const DeckForecast& forecast, const LevelLimits& limits,
                      const std::vector<double>& times_s, const LevelOptions& options);

}  // namespace harco
