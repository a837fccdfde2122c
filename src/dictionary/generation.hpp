// What all ways to a marker set's codes share: checks before, and the search for one dictionary.
#pragma once

#include <optional>
#include <stdexcept>
#include <string>

#include "dictionary/demand.hpp"
#include "dictionary/monitor.hpp"
#include "harco/dictionary.hpp"

namespace harco {

/// In one dictionary.
inline constexpr int kMostCodes = 20000;

/// What the dictionaries of parents and of children may cost, in distances computed; half a second
/// and two seconds or so.
inline constexpr double kParentWork = 1.5e9;
inline constexpr double kChildWork = 5e9;
/// Of the progress.
inline constexpr double kParentShare = 0.2;

[[noreturn]] inline void refuse(const std::string& what) {
  throw std::invalid_argument("dictionary: " + what);
}

/// Refuses lists with cells that are not there or stand twice.
void check_list(const std::vector<int>& list, int cells, const std::string& what);

/// Refuses an effort or a time that is no positive number.
void check_search(const CodeSearch& search);

/// Refuses what can't be, before any search; `whose` names the dictionary.
DistanceBound check_demand(const Demand& demand, const std::optional<int>& wanted,
                           const std::string& whose);

/// Searches by the method asked for, up to `most_distance`. `reached` is kept up to date.
CodeGroups search_codes(const Demand& demand, bool children, int most_distance,
                        const CodeSearch& search, Monitor& monitor, int& reached);

}  // namespace harco
