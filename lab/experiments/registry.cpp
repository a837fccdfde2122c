#include "lab/experiments/experiment.hpp"

namespace harco::lab {

const std::vector<const Experiment*>& experiments() {
  static const std::vector<const Experiment*> all;
  return all;
}

}  // namespace harco::lab
