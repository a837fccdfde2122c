#include "lab/experiments/chapters.hpp"

namespace harco::lab {

const std::vector<const Experiment*>& experiments() {
  static const std::vector<const Experiment*> all{&transition(), &stage_times(), &hand_held(),
                                                  &landing(),    &large_scale(), &deck_landing()};
  return all;
}

}  // namespace harco::lab
