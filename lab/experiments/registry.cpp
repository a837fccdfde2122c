#include "lab/experiments/experiment.hpp"

namespace harco::lab {

const char* to_string(Extent extent) {
  switch (extent) {
    case Extent::tiny:
      return "tiny";
    case Extent::quick:
      return "quick";
    case Extent::full:
      return "full";
  }
  return "unknown";
}

const std::vector<const Experiment*>& experiments() {
  static const std::vector<const Experiment*> all;
  return all;
}

}  // namespace harco::lab
