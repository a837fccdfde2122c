// Several marker sets as one.
#pragma once

#include <vector>

#include "harco/marker.hpp"

namespace harco {

/// A set with all parents of `sets`, in their order, so that one detector finds them in one pass.
/// Ids stay what they are. Throws std::invalid_argument if there is no set, if the result breaks a
/// rule of validate (an id or a code that two of them have), or if two of those that have children
/// have different lines around them.
MarkerSet merge(const std::vector<MarkerSet>& sets);

}  // namespace harco
