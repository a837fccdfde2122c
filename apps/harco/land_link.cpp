#include "land_link.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <system_error>
#include <utility>

#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include "harco/error.hpp"
#include "stop_signal.hpp"

namespace harco::cli {
namespace {

constexpr double kLongestWait = 0.1;
constexpr std::size_t kMostTexts = 16;

mavlink::Message status_text(std::uint8_t severity, const std::string& text) {
  mavlink::StatusText message;
  message.severity = severity;
  message.text = text;
  return message;
}

}  // namespace

LandLink::LandLink(std::optional<mavlink::Link> link, const LandLinkOptions& options, Sent sent)
    : options_(options),
      sent_(std::move(sent)),
      link_(std::move(link)),
      wake_(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)),
      vehicle_(options.vehicle) {
  if (wake_ < 0) throw Error("no event file: " + std::generic_category().message(errno));
  thread_ = std::thread([this] { run(); });
}

void LandLink::stop() {
  if (!thread_.joinable()) return;
  stopping_ = true;
  wake();
  thread_.join();
  close(wake_);
}

void LandLink::wake() const {
  const std::uint64_t one = 1;
  [[maybe_unused]] const auto written = write(wake_, &one, sizeof one);
}

void LandLink::tell(TargetNews news) {
  {
    const std::lock_guard lock(mutex_);
    if (link_) news_.clear();
    news_.push_back(std::move(news));
  }
  wake();
}

void LandLink::say(std::uint8_t severity, const std::string& text) {
  {
    const std::lock_guard lock(mutex_);
    if (texts_.size() < kMostTexts) texts_.push_back(status_text(severity, text));
  }
  wake();
}

void LandLink::order(FlightMode mode) {
  {
    const std::lock_guard lock(mutex_);
    vehicle_.order(mode, monotonic_s());
  }
  wake();
}

std::optional<VehiclePose> LandLink::vehicle_pose(double ours_s) const {
  const std::lock_guard lock(mutex_);
  return vehicle_.pose(ours_s);
}

std::optional<VehiclePose> LandLink::vehicle_pose_by_its_clock(double remote_s) const {
  const std::lock_guard lock(mutex_);
  return vehicle_.pose_by_its_clock(remote_s);
}

std::optional<double> LandLink::ours(double remote_s) const {
  const std::lock_guard lock(mutex_);
  return vehicle_.clock().ours(remote_s);
}

std::optional<VehicleLink::OrderResult> LandLink::order_result() const {
  const std::lock_guard lock(mutex_);
  return vehicle_.order_result();
}

LandLinkState LandLink::state() const {
  const std::lock_guard lock(mutex_);
  LandLinkState state = state_;
  state.presence = vehicle_.presence(monotonic_s());
  state.vehicle = vehicle_.vehicle();
  state.armed = vehicle_.armed();
  state.landing = vehicle_.landing();
  state.round_trip_s = vehicle_.clock().round_trip_s();
  return state;
}

/// Until something comes, somebody wakes us, or something is due.
void LandLink::wait() {
  double due_s = 0.0;
  {
    const std::lock_guard lock(mutex_);
    due_s = vehicle_.next_due_s();
  }
  const double seconds = std::clamp(due_s - monotonic_s(), 0.0, kLongestWait);
  const auto most = std::chrono::milliseconds(static_cast<int>(std::ceil(1e3 * seconds)));
  if (link_) {
    link_->wait(most, wake_, received_);
  } else {
    pollfd woken{wake_, POLLIN, 0};
    poll(&woken, 1, static_cast<int>(most.count()));
  }
  std::uint64_t count = 0;
  [[maybe_unused]] const auto got = read(wake_, &count, sizeof count);
}

void LandLink::run() {
  for (bool last = false; !last;) {
    last = stopping_;
    if (!last) wait();
    const double now_s = monotonic_s();
    std::vector<mavlink::Message> due, texts;
    mavlink::Address from;
    {
      const std::lock_guard lock(mutex_);
      for (const mavlink::Received& received : received_) vehicle_.receive(received, now_s);
      received_.clear();
      due = vehicle_.due(now_s);
      if (vehicle_.vehicle()) from.system = vehicle_.vehicle()->system;
    }
    if (link_) link_->set_from(from);
    send_targets(now_s);
    watch_target(now_s);
    {
      const std::lock_guard lock(mutex_);
      texts = std::exchange(texts_, {});
    }
    for (const mavlink::Message& message : due) {
      const auto* const command = std::get_if<mavlink::CommandLong>(&message);
      const bool is_order =
          command != nullptr && command->command == mavlink::value::kCommandDoSetMode;
      if (is_order) {
        send(message, now_s, std::nullopt);
      } else if (link_) {
        link_->send(message);
      }
    }
    for (const mavlink::Message& text : texts) send(text, now_s, std::nullopt);
    const std::lock_guard lock(mutex_);
    if (link_) {
      state_.connected = link_->connected();
      state_.counts = link_->counts();
    }
  }
}

/// Sends what the user wants to know of. Where there is only to listen, reports it as sent.
bool LandLink::send(const mavlink::Message& message, double now_s,
                    std::optional<double> captured_s) {
  const bool gone = !link_ || options_.only_listen || link_->send(message);
  if (gone) sent_(message, now_s, captured_s);
  return gone;
}

void LandLink::send_targets(double now_s) {
  std::vector<TargetNews> all;
  Presence presence = Presence::unheard;
  {
    const std::lock_guard lock(mutex_);
    all = std::exchange(news_, {});
    presence = vehicle_.presence(now_s);
  }
  if (link_ && stopping_) return;
  for (const TargetNews& news : all) {
    std::uint64_t LandLinkState::*const became = send_target(news, now_s, presence);
    const std::lock_guard lock(mutex_);
    ++(state_.*became);
    if (became != &LandLinkState::targets) continue;
    told_s_ = now_s;
    if (!std::exchange(state_.target, true))
      texts_.push_back(status_text(mavlink::value::kSeverityInfo, "HArCo: target found"));
  }
}

/// Sends it, if it may be sent. Returns what it counts as.
std::uint64_t LandLinkState::*LandLink::send_target(const TargetNews& news, double now_s,
                                                    Presence presence) {
  if (now_s - news.since_s > options_.max_age_s) return &LandLinkState::too_old;
  if (now_s < next_target_s_) return &LandLinkState::too_many;
  if (presence == Presence::silent) return &LandLinkState::not_taken;
  bool all = true;
  for (const mavlink::Message& message : news.messages)
    all = send(message, now_s, news.captured_s) && all;
  const double period = options_.rate_hz > 0.0 ? 1.0 / options_.rate_hz : 0.0;
  next_target_s_ = std::max(next_target_s_ + period, now_s - period);
  return all ? &LandLinkState::targets : &LandLinkState::not_taken;
}

void LandLink::watch_target(double now_s) {
  if (now_s - told_s_ < options_.lost_s && !stopping_) return;
  const std::lock_guard lock(mutex_);
  if (std::exchange(state_.target, false))
    texts_.push_back(status_text(mavlink::value::kSeverityWarning, "HArCo: target lost"));
}

}  // namespace harco::cli
