#include "land_deck.hpp"

#include <cmath>
#include <utility>

#include <fmt/format.h>

namespace harco::cli {
namespace {

/// Between two texts about windows, seconds, unless the window has moved.
constexpr double kTextPeriod = 5.0;
constexpr double kShortestTextPeriod = 1.0;
constexpr double kMoved = 1.0;

std::unique_ptr<DeckWatch> watch_of(const LandingOrderOptions& options) {
  std::unique_ptr<DeckWatch> watch;
  deck_function<MakeDeckWatch>("harco_deck_watch")(options, watch);
  return watch;
}

}  // namespace

LandDeck::LandDeck(const LandingOrderOptions& options, bool command, LandLink& link,
                   std::function<void(const DeckView&)> news)
    : watch_(watch_of(options)),
      command_(command),
      link_(link),
      news_(std::move(news)),
      thread_([this] { run(); }) {}

LandDeck::~LandDeck() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  changed_.notify_one();
  thread_.join();
}

void LandDeck::add(const DeckSample& sample, double height_m) {
  {
    const std::lock_guard lock(mutex_);
    looks_.push_back({sample, height_m});
  }
  changed_.notify_one();
}

std::optional<DeckView> LandDeck::view() const {
  const std::lock_guard lock(mutex_);
  return view_;
}

void LandDeck::run() {
  for (;;) {
    std::vector<Look> looks;
    {
      std::unique_lock lock(mutex_);
      changed_.wait(lock, [this] { return stopping_ || !looks_.empty(); });
      if (stopping_) return;
      looks = std::exchange(looks_, {});
    }
    for (const Look& look : looks) {
      const std::optional<DeckView> view = watch_->add(look.sample, look.height_m);
      if (!view) continue;
      announce(*view);
      if (command_) command(*view);
      news_(*view);
      const std::lock_guard lock(mutex_);
      view_ = view;
    }
  }
}

/// Tells the crew of the next window: when there is another one, and now and then.
void LandDeck::announce(const DeckView& view) {
  if (view.windows.empty()) return;
  const LevelWindow& next = view.windows.front();
  const double since = view.time_s - announced_s_;
  const bool moved =
      std::abs(next.begin_s - announced_begin_s_) > kMoved && next.begin_s > view.time_s;
  if (since < kTextPeriod && !(moved && since >= kShortestTextPeriod)) return;
  announced_s_ = view.time_s;
  announced_begin_s_ = next.begin_s;
  link_.say(mavlink::value::kSeverityInfo,
            fmt::format("HArCo: deck level in {:.1f} s for {:.1f} s, {:.0f} %",
                        next.begin_s - view.time_s, next.duration_s(), 100.0 * next.probability));
}

void LandDeck::command(const DeckView& view) {
  if (view.advice == ordered_) return;
  if (view.advice == LandingAdvice::land) {
    link_.say(mavlink::value::kSeverityInfo, "HArCo: landing");
    link_.order(FlightMode::land);
  } else if (view.advice == LandingAdvice::call_off) {
    link_.say(mavlink::value::kSeverityWarning, "HArCo: landing called off");
    link_.order(FlightMode::wait);
  }
  ordered_ = view.advice;
}

}  // namespace harco::cli
