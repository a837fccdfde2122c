// Local search: as many codes of a pool as are asked for, all at least tau apart.
#pragma once

#include <memory>

#include "dictionary/demand.hpp"
#include "dictionary/monitor.hpp"
#include "dictionary/pool.hpp"
#include "dictionary/random.hpp"

namespace harco {

/// Adds orbits that conflict with none chosen; where there are none, exchanges one for another
/// (plateau moves, with a tabu on what was just taken out); now and then forces a random one in.
class Packing {
 public:
  /// The pool must outlive the packing.
  Packing(const Pool& pool, const Demand& demand, const Turns& turns, int tau);
  ~Packing();

  /// Goes on until the demand is met (true), or `work` units (distances computed) are done or the
  /// monitor says stop (false).
  bool run(double work, Random& random, Monitor& monitor);

  /// Adds without ever taking out, whatever the monitor says; true if the demand is met.
  bool fill(Random& random, Monitor& monitor);

  /// The codes, turned to fit their groups. Only once the demand is met.
  CodeGroups codes() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace harco
