// Watches the deck under a vehicle: when will it be level, when to order the landing? The work is
// in a module of its own, harco_deck.so, because the library that fits decks takes long to start.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "harco/deck.hpp"
#include "harco/forecast.hpp"
#include "harco/landing_order.hpp"
#include "harco/level.hpp"
#include "module.hpp"

namespace harco::cli {

/// What is known of the deck, by the time of its newest sample.
struct DeckView {
  double time_s = 0.0;
  Eigen::Vector3d motion = Eigen::Vector3d::Zero();  ///< roll, pitch (radians), heave (metres)
  double height_m = 0.0;                             ///< of the vehicle above the touchdown point
  DeckPhase phase = DeckPhase::collecting;
  std::vector<LevelWindow> windows;
  LandingAdvice advice = LandingAdvice::hold;
  std::optional<double> touchdown_s;
};

class DeckWatch {
 public:
  virtual ~DeckWatch() = default;
  /// Takes a sample and, when it is time for it, thinks anew: that takes a good part of a second.
  virtual std::optional<DeckView> add(const DeckSample& sample, double height_m) = 0;
};

/// The module's functions.
using MakeDeckWatch = void(const LandingOrderOptions& options, std::unique_ptr<DeckWatch>& watch);
using MakeDeckSample = void(const Pose& pose, const CameraState& camera, double time_s,
                            const Eigen::Vector3d& touchdown_point, DeckSample& sample);

template <typename Function>
Function* deck_function(const char* name) {
  return reinterpret_cast<Function*>(module_symbol("harco_deck.so", name));
}

}  // namespace harco::cli
