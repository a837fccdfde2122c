#pragma once

#include "harco/touchdown.hpp"

namespace harco {

/// Throws std::invalid_argument, naming the field, for limits out of range.
void check(const MotionLimits& limits);

}  // namespace harco
