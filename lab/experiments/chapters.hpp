// The experiments, one file each.
#pragma once

#include "lab/experiments/experiment.hpp"

namespace harco::lab {

const Experiment& transition();    ///< section 4.1
const Experiment& stage_times();   ///< section 4.2
const Experiment& hand_held();     ///< section 4.3
const Experiment& landing();       ///< section 4.4
const Experiment& large_scale();   ///< section 4.5
const Experiment& deck_landing();  ///< section 4.6

}  // namespace harco::lab
