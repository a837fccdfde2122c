// A vehicle as its messages tell: where it was when, by whose clock, in which mode; and what a
// companion computer owes it. Library harco::autopilot.
//
// Nothing here has a clock or a connection: times are given, in seconds of the caller's own
// monotonic clock ("our clock"). Messages may be wrong, late, doubled or somebody else's: they
// change nothing.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "harco/mavlink.hpp"
#include "harco/sighting.hpp"

namespace harco {

/// Tells the time on another clock from answers to TIMESYNC, or, while there are none, from
/// messages that carry a time. Clocks may run at different speeds: a simulator's does.
class RemoteClock {
 public:
  /// An answer: asked at, answered at (remote clock), received at. Ones that took longer than a
  /// second, or no time at all, are ignored.
  void answered(double asked_s, double remote_s, double received_s);

  /// A message that says when it was sent, less some unknown delay.
  void stamped(double remote_s, double received_s);

  /// Time on the remote clock at a time of ours, and back; empty until something is known.
  std::optional<double> remote(double ours_s) const;
  std::optional<double> ours(double remote_s) const;

  /// Shortest way to and fro among the last answers, seconds; empty without any.
  std::optional<double> round_trip_s() const;

 private:
  struct Pair {
    double ours_s, remote_s, round_trip_s;
  };
  /// remote = at.remote_s + speed (ours - at.ours_s)
  struct Line {
    Pair at;
    double speed;
  };
  void add(std::deque<Pair>& pairs, const Pair& pair);
  std::optional<Line> line() const;

  std::deque<Pair> answers_, stamps_;
};

/// Where the vehicle was during the last seconds, by its own clock.
class VehicleHistory {
 public:
  /// False, and nothing changes, for what isn't finite, no rotation, or older than what is known. A
  /// time far back means that the autopilot has started anew, and so does this.
  bool add(const mavlink::Attitude& message);
  bool add(const mavlink::AttitudeQuaternion& message);
  bool add(const mavlink::LocalPositionNed& message);

  /// Between two messages interpolated; up to 0.3 s after the last one foretold by its rates. Empty
  /// outside.
  std::optional<Eigen::Quaterniond> ned_R_body(double remote_s) const;
  std::optional<Eigen::Vector3d> ned_p_body(double remote_s) const;
  std::optional<Eigen::Vector3d> ned_v_body(double remote_s) const;  ///< m/s

 private:
  struct Turned {
    double time_s;
    Eigen::Quaterniond ned_R_body;
    Eigen::Vector3d body_rates;
  };
  struct Moved {
    double time_s;
    Eigen::Vector3d ned_p_body, velocity;
  };
  bool add(const Turned& turned);

  std::deque<Turned> turned_;
  std::deque<Moved> moved_;
};

enum class Autopilot { ardupilot, px4 };

/// Whether the vehicle is heard.
enum class Presence {
  unheard,  ///< nothing so far; it may be one that only listens
  heard,
  silent  ///< it was heard, but not for a while: what is sent would be late if it arrived
};

/// The modes that a landing orders.
enum class FlightMode { land, wait };

struct VehicleLinkOptions {
  Autopilot autopilot = Autopilot::ardupilot;
  std::uint8_t system = 0;     ///< the vehicle's; 0: the first one heard
  bool want_pose = true;       ///< ask it for its attitude and position ...
  double pose_rate_hz = 50.0;  ///< ... so often
  double silent_s = 3.0;       ///< without a message for longer it counts as silent
};

/// Speaks with one vehicle: hears its messages, and says what is to be sent when.
class VehicleLink {
 public:
  explicit VehicleLink(const VehicleLinkOptions& options = {});

  /// A message that came, at a time of ours.
  void receive(const mavlink::Received& received, double now_s);

  /// What is to be sent now: HEARTBEAT once a second, TIMESYNC questions and answers, wishes for
  /// messages, orders until they are obeyed or three seconds are over.
  std::vector<mavlink::Message> due(double now_s);
  double next_due_s() const;  ///< when to call `due` at the latest

  /// Orders a mode: LAND or the mode to wait in (ArduPilot: LOITER; PX4: PRECLAND, HOLD).
  void order(FlightMode mode, double now_s);
  /// What became of the last order; empty while that is open, or if there was none.
  enum class OrderResult { obeyed, refused, unanswered };
  std::optional<OrderResult> order_result() const { return order_result_; }

  Presence presence(double now_s) const;
  const RemoteClock& clock() const { return clock_; }
  const VehicleHistory& history() const { return history_; }
  /// Where it was at a time of ours; empty unless its attitude is known.
  std::optional<VehiclePose> pose(double ours_s) const;
  std::optional<VehiclePose> pose_by_its_clock(double remote_s) const;

  std::optional<mavlink::Address> vehicle() const { return vehicle_; }
  bool armed() const { return (heartbeat_.base_mode & mavlink::value::kArmed) != 0; }
  bool landing() const;  ///< it is in the mode that `order(FlightMode::land)` orders

 private:
  bool from_vehicle(const mavlink::Received& received);
  void hear(const mavlink::Heartbeat& message);
  void hear(const mavlink::Timesync& message, double now_s);
  void hear(const mavlink::CommandAck& message);
  template <typename Stamped>
  void hear_pose(const Stamped& message, double now_s);
  mavlink::CommandLong command(std::uint16_t number, float param1, float param2,
                               float param3 = 0.0F) const;

  VehicleLinkOptions options_;
  std::optional<mavlink::Address> vehicle_;
  mavlink::Heartbeat heartbeat_;
  RemoteClock clock_;
  VehicleHistory history_;
  std::optional<double> heard_s_;
  double attitude_heard_s_ = -1e9, position_heard_s_ = -1e9;
  int first_wishes_ = 3;  ///< said even if it sends already, perhaps seldom; any may get lost

  double heartbeat_due_s_ = -1e9, question_due_s_ = -1e9, wish_due_s_ = -1e9;
  struct Question {
    std::int64_t stamp_ns;
    double asked_s;
  };
  std::deque<Question> questions_;         ///< not answered yet
  std::vector<mavlink::Message> answers_;  ///< to be sent at once

  struct Order {
    FlightMode mode;
    double since_s;
    double due_s;
    std::uint8_t sent;
  };
  std::optional<Order> order_;
  std::optional<OrderResult> order_result_;
};

}  // namespace harco
