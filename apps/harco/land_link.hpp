// The thread that speaks with the autopilot: it is told of targets and never sends an old one.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "harco/link.hpp"
#include "harco/vehicle.hpp"

namespace harco::cli {

struct LandLinkOptions {
  VehicleLinkOptions vehicle;
  double rate_hz = 50.0;     ///< most targets a second; 0: all
  double max_age_s = 0.5;    ///< of an image whose target is still sent
  double lost_s = 0.5;       ///< without a target for so long the autopilot is told that it is lost
  bool only_listen = false;  ///< targets and orders are reported as if sent, but aren't
};

/// A target on its way to the autopilot.
struct TargetNews {
  std::vector<mavlink::Message> messages;
  double captured_s = 0.0;  ///< time of the image
  double since_s = 0.0;     ///< when the image's age begins to count
};

/// What there is to show.
struct LandLinkState {
  bool connected = false;
  Presence presence = Presence::unheard;
  std::optional<mavlink::Address> vehicle;
  bool armed = false;
  bool landing = false;
  bool target = false;          ///< one was told a moment ago
  std::uint64_t targets = 0;    ///< told so far
  std::uint64_t too_old = 0;    ///< not told, since it would have been late
  std::uint64_t too_many = 0;   ///< not told, since the rate is bounded
  std::uint64_t not_taken = 0;  ///< not told, since the link was down or the vehicle silent
  std::optional<double> round_trip_s;
  mavlink::LinkCounts counts;
};

class LandLink {
 public:
  /// Called from the link's thread for all targets, texts and orders sent, with the time and, of
  /// targets, that of their image.
  using Sent = std::function<void(const mavlink::Message& message, double now_s,
                                  std::optional<double> captured_s)>;

  /// Without a link nothing is heard, and all is reported as if sent. Starts at once.
  LandLink(std::optional<mavlink::Link> link, const LandLinkOptions& options, Sent sent);
  ~LandLink() { stop(); }
  LandLink(const LandLink&) = delete;
  LandLink& operator=(const LandLink&) = delete;

  /// Says what was still to be said, but for targets, and ends.
  void stop();

  // From any thread:

  /// The newest target takes the place of an older one that wasn't sent yet.
  void tell(TargetNews news);
  void say(std::uint8_t severity, const std::string& text);
  void order(FlightMode mode);

  std::optional<VehiclePose> vehicle_pose(double ours_s) const;
  std::optional<VehiclePose> vehicle_pose_by_its_clock(double remote_s) const;
  std::optional<double> ours(double remote_s) const;
  std::optional<VehicleLink::OrderResult> order_result() const;
  LandLinkState state() const;

 private:
  void run();
  void wait();
  void send_targets(double now_s);
  std::uint64_t LandLinkState::*send_target(const TargetNews& news, double now_s,
                                            Presence presence);
  void watch_target(double now_s);
  bool send(const mavlink::Message& message, double now_s, std::optional<double> captured_s);
  void wake() const;

  LandLinkOptions options_;
  Sent sent_;
  std::optional<mavlink::Link> link_;  ///< the thread's own
  int wake_;
  std::atomic<bool> stopping_ = false;

  mutable std::mutex mutex_;
  VehicleLink vehicle_;           ///< under the mutex, as all that follows
  std::vector<TargetNews> news_;  ///< one, or without a link as many as there are
  std::vector<mavlink::Message> texts_;
  LandLinkState state_;

  std::vector<mavlink::Received> received_;  ///< the thread's own, as all that follows
  double next_target_s_ = -1e9;
  double told_s_ = -1e9;
  std::thread thread_;
};

}  // namespace harco::cli
