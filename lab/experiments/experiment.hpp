// An experiment of the paper's section 4: work cut into items that need nothing of one another, so
// that any number of threads and machines can share it, and what all results together show.
//
// To add one: derive from Experiment in a file of its own, and list it in registry.cpp.
#pragma once

#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "lab/report/chapter.hpp"

namespace harco::lab {

using Json = nlohmann::json;

/// How much of it is done.
enum class Extent {
  tiny,   ///< some frames, for tests: a second for an experiment
  quick,  ///< all of it in small: all experiments in two minutes on two cores
  full    ///< with the paper's numbers: all experiments in half an hour on two cores
};
inline const char* to_string(Extent extent) {
  return extent == Extent::tiny ? "tiny" : extent == Extent::quick ? "quick" : "full";
}

class Experiment {
 public:
  Experiment() = default;
  virtual ~Experiment() = default;
  Experiment(const Experiment&) = delete;
  Experiment& operator=(const Experiment&) = delete;

  virtual std::string name() const = 0;   ///< the paper's section, such as "4.1"
  virtual std::string title() const = 0;  ///< a few words

  /// All that decides what the results are: results of other settings are never mixed with these.
  /// Change something here whenever the experiment changes.
  virtual Json settings(Extent extent) const = 0;

  /// How many items there are. Each should take some seconds.
  virtual int items(Extent extent) const = 0;

  /// Does one item, 0 … items - 1, with random numbers seeded by `item` alone. Anything that makes
  /// one line of JSON; pictures are part of it (picture.hpp). Same arguments, same result, but for
  /// fields whose names end in `_ms`, which are times. Called by several threads at once.
  virtual Json run(Extent extent, int item) const = 0;

  /// What the results show. They come in the order of the items; some may be missing, never all.
  virtual Chapter summarise(Extent extent, const std::vector<Json>& results) const = 0;
};

/// All experiments, in the paper's order.
const std::vector<const Experiment*>& experiments();

}  // namespace harco::lab
