// Every drawing shows one parent.
#pragma once

#include <stdexcept>
#include <string>

#include "harco/marker.hpp"

namespace harco {

/// The set with this parent alone, checked. Throws std::invalid_argument.
inline MarkerSet only_parent(const MarkerSet& markers, int parent_index) {
  if (parent_index < 0 || parent_index >= static_cast<int>(markers.parents.size()))
    throw std::invalid_argument("there is no parent " + std::to_string(parent_index) +
                                " to be drawn");
  MarkerSet single{
      markers.cells, markers.line, {markers.parents[static_cast<std::size_t>(parent_index)]}};
  validate(single);
  return single;
}

}  // namespace harco
