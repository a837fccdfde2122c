// The deck's thread of `harco land`: fits, foretells, and, where it may, orders.
#pragma once

#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>

#include "deck_watch.hpp"
#include "land_link.hpp"

namespace harco::cli {

class LandDeck {
 public:
  /// `news` is called from the deck's thread. With `command` the landing is ordered through `link`.
  LandDeck(const LandingOrderOptions& options, bool command, LandLink& link,
           std::function<void(const DeckView&)> news);
  ~LandDeck();
  LandDeck(const LandDeck&) = delete;
  LandDeck& operator=(const LandDeck&) = delete;

  /// One look at the deck, from any thread; `height_m` is the vehicle's above the touchdown point.
  void add(const DeckSample& sample, double height_m);

  std::optional<DeckView> view() const;  ///< the newest

 private:
  struct Look {
    DeckSample sample;
    double height_m;
  };

  void run();
  void announce(const DeckView& view);
  void command(const DeckView& view);

  std::unique_ptr<DeckWatch> watch_;
  bool command_;
  LandLink& link_;
  std::function<void(const DeckView&)> news_;

  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<Look> looks_;  ///< under the mutex, as what follows
  std::optional<DeckView> view_;
  bool stopping_ = false;

  double announced_s_ = -1e9;  ///< the thread's own
  double announced_begin_s_ = -1e9;
  LandingAdvice ordered_ = LandingAdvice::hold;
  std::thread thread_;
};

}  // namespace harco::cli
