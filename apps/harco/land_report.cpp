#include "land_report.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <utility>

#include <unistd.h>

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace harco::cli {
namespace {

constexpr std::size_t kLatenciesKept = 4096;
constexpr double kStatusPeriod = 0.2;

const char* to_string(DeckPhase phase) {
  constexpr std::array names{"collecting", "validating", "ready"};
  return names.at(static_cast<std::size_t>(phase));
}

const char* to_string(LandingAdvice advice) {
  constexpr std::array names{"hold", "wait", "land", "call off"};
  return names.at(static_cast<std::size_t>(advice));
}

std::string link_text(const LandLinkState& link) {
  const std::string who = link.vehicle ? fmt::format("vehicle {}", link.vehicle->system)
                                       : std::string("no vehicle yet");
  const char* how = !link.connected                      ? "no link"
                    : link.presence == Presence::silent  ? "silent"
                    : link.presence == Presence::unheard ? "unheard"
                    : link.landing                       ? "landing"
                    : link.armed                         ? "armed"
                                                         : "disarmed";
  return fmt::format("{}, {}, {} sent", who, how, link.targets);
}

}  // namespace

LandLog::LandLog(bool print, const std::string& record, const TargetOptions& options) {
  if (!record.empty()) record_.emplace(record, options);
  if (print && record != "-") printed_.emplace("-", /*at_once=*/true);
}

void LandLog::add(const FrameRecord& frame) {
  const std::lock_guard lock(mutex_);
  if (record_) record_->add(frame);
}

void LandLog::add_line(const std::string& line) {
  const std::lock_guard lock(mutex_);
  if (printed_) printed_->write(line);
  if (record_) record_->add_line(line);
}

void LandLog::commit() {
  const std::lock_guard lock(mutex_);
  if (printed_) printed_->commit();
  if (record_) record_->commit();
}

std::string json_line(const DeckView& deck) {
  std::string windows;
  for (const LevelWindow& window : deck.windows)
    windows +=
        fmt::format(R"({}{{"begin_s": {}, "end_s": {}, "probability": {}}})",
                    windows.empty() ? "" : ", ", window.begin_s, window.end_s, window.probability);
  std::string line = fmt::format(
      R"({{"deck": {{"time_s": {}, "roll_rad": {}, "pitch_rad": {}, "heave_m": {}, "height_m": {}, )"
      R"("phase": "{}", "advice": "{}", "windows": [{}])",
      deck.time_s, deck.motion[kRoll], deck.motion[kPitch], deck.motion[kHeave], deck.height_m,
      to_string(deck.phase), to_string(deck.advice), windows);
  if (deck.touchdown_s) line += fmt::format(R"(, "touchdown_s": {})", *deck.touchdown_s);
  return line + "}}\n";
}

void Latencies::add(double seconds) {
  if (all_.size() < kLatenciesKept) {
    all_.push_back(seconds);
    return;
  }
  all_[next_] = seconds;
  next_ = (next_ + 1) % kLatenciesKept;
}

double Latencies::quantile(double share) const {
  std::vector<double> sorted = all_;
  const auto place = static_cast<std::ptrdiff_t>(share * static_cast<double>(sorted.size() - 1));
  std::nth_element(sorted.begin(), sorted.begin() + place, sorted.end());
  return sorted[static_cast<std::size_t>(place)];
}

StatusLine::StatusLine() : terminal_(isatty(STDERR_FILENO) == 1) {}

StatusLine::~StatusLine() {
  if (shown_) fmt::print(stderr, "\r\x1b[K");
}

void StatusLine::show(const std::string& text, double now_s) {
  const std::lock_guard lock(mutex_);
  fmt::print(stderr, "\r{}\x1b[K", text);
  std::fflush(stderr);
  shown_ = true;
  next_s_ = now_s + kStatusPeriod;
}

void StatusLine::tell(const std::string& line) {
  const std::lock_guard lock(mutex_);
  fmt::print(stderr, "{}harco: {}\n", std::exchange(shown_, false) ? "\r\x1b[K" : "", line);
}

std::string status_text(const TargetView& view, double frames_per_second, const Latencies& latency,
                        bool absolute, const LandLinkState& link,
                        const std::optional<DeckView>& deck) {
  std::string text = fmt::format("{:4.1f} fps", frames_per_second);
  if (latency.count() > 0)
    text += fmt::format("  latency {}{:.0f} ms", absolute ? "" : "> ", 1e3 * latency.quantile(0.5));
  if (view.posed) {
    text += fmt::format("  layers {}  range {:.2f} m", fmt::join(view.layers, ","), view.range_m);
    if (view.sd_m) text += fmt::format(" ± {:.2g} cm", 100.0 * *view.sd_m);
    if (!view.believed) text += " (doubtful)";
  } else if (view.foretold) {
    text += fmt::format("  hidden  range {:.2f} m", view.range_m);
  } else {
    text += "  no target";
  }
  if (deck) {
    text += fmt::format("  deck {}", to_string(deck->phase));
    if (!deck->windows.empty())
      text += fmt::format(", level in {:.1f} s", deck->windows[0].begin_s - deck->time_s);
  }
  return text + "  " + link_text(link);
}

}  // namespace harco::cli
