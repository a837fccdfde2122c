// The default way to a dictionary: for one tau after the other, local search over pools of
// admissible codes, each pool closed under another symmetry.
#pragma once

#include <cstdint>

#include "dictionary/demand.hpp"
#include "dictionary/monitor.hpp"
#include "dictionary/random.hpp"

namespace harco {

/// Random codes as demanded, all different. Throws std::invalid_argument if there are fewer.
CodeGroups random_dictionary(const Demand& demand, Random& random, Monitor& monitor);

/// Codes with the greatest tau found, at most about `most_distance`: it stops there. Throws
/// std::invalid_argument if there are fewer codes than asked for. `reached` is kept up to date.
/// However soon the monitor says stop, there is a dictionary.
CodeGroups search_dictionary(const Demand& demand, int most_distance, std::uint64_t seed,
                             Monitor& monitor, int& reached);

}  // namespace harco
