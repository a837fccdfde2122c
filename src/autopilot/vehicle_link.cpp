#include <algorithm>
#include <cmath>
#include <type_traits>
#include <variant>

#include "harco/vehicle.hpp"

namespace harco {
namespace {

using namespace mavlink;  // NOLINT(google-build-using-namespace): messages are all that this is
                          // about

constexpr double kHeartbeatPeriod = 1.0;
constexpr double kQuestionPeriod = 0.2;
constexpr double kWishPeriod = 2.0;  // while the vehicle's pose doesn't come
constexpr double kPoseMissing = 1.0;
constexpr double kOrderPeriod = 0.5, kOrderTime = 3.0;
constexpr std::size_t kMostQuestions = 8, kMostAnswers = 8;

/// What a mode is called by the autopilots: DO_SET_MODE's second and third parameter.
struct ModeNumber {
  std::uint8_t main, sub;
};

ModeNumber number_of(FlightMode mode, Autopilot autopilot) {
  const bool land = mode == FlightMode::land;
  if (autopilot == Autopilot::ardupilot)  // copter: LAND, LOITER
    return {land ? std::uint8_t{9} : std::uint8_t{5}, 0};
  return {4, land ? std::uint8_t{9} : std::uint8_t{3}};  // AUTO: PRECLAND, LOITER
}

/// HEARTBEAT's custom_mode of it.
std::uint32_t custom_mode(FlightMode mode, Autopilot autopilot) {
  const ModeNumber number = number_of(mode, autopilot);
  if (autopilot == Autopilot::ardupilot) return number.main;
  return (std::uint32_t{number.sub} << 24) | (std::uint32_t{number.main} << 16);
}

std::int64_t nanoseconds(double seconds) {
  return static_cast<std::int64_t>(std::llround(seconds * 1e9));
}

}  // namespace

VehicleLink::VehicleLink(const VehicleLinkOptions& options) : options_(options) {}

bool VehicleLink::from_vehicle(const Received& received) {
  if (vehicle_) return received.from == *vehicle_;
  // The first autopilot that introduces itself; ground stations and cameras do so too.
  const auto* const heartbeat = std::get_if<Heartbeat>(&received.message);
  if (heartbeat == nullptr || heartbeat->autopilot == value::kAutopilotInvalid ||
      heartbeat->type == value::kTypeGroundStation)
    return false;
  if (options_.system != 0 && received.from.system != options_.system) return false;
  vehicle_ = received.from;
  return true;
}

void VehicleLink::receive(const Received& received, double now_s) {
  if (!from_vehicle(received)) return;
  heard_s_ = now_s;
  std::visit(
      [&](const auto& message) {
        using M = std::decay_t<decltype(message)>;
        if constexpr (std::is_same_v<M, Heartbeat> || std::is_same_v<M, CommandAck>) {
          hear(message);
        } else if constexpr (std::is_same_v<M, Timesync>) {
          hear(message, now_s);
        } else if constexpr (std::is_same_v<M, Attitude> || std::is_same_v<M, AttitudeQuaternion> ||
                             std::is_same_v<M, LocalPositionNed>) {
          hear_pose(message, now_s);
        }
      },
      received.message);
}

void VehicleLink::hear(const Heartbeat& message) {
  heartbeat_ = message;
  if (order_ && message.custom_mode == custom_mode(order_->mode, options_.autopilot)) {
    order_.reset();
    order_result_ = OrderResult::obeyed;
  }
}

void VehicleLink::hear(const Timesync& message, double now_s) {
  if (message.tc1 == 0) {  // its question
    if (answers_.size() == kMostAnswers) return;
    Timesync answer;
    answer.tc1 = nanoseconds(now_s);
    answer.ts1 = message.ts1;
    answers_.emplace_back(answer);
    return;
  }
  const auto asked = std::find_if(questions_.begin(), questions_.end(),
                                  [&](const Question& q) { return q.stamp_ns == message.ts1; });
  if (asked == questions_.end()) return;  // somebody else's
  clock_.answered(asked->asked_s, 1e-9 * static_cast<double>(message.tc1), now_s);
  questions_.erase(questions_.begin(), std::next(asked));
}

template <typename Stamped>
void VehicleLink::hear_pose(const Stamped& message, double now_s) {
  if (!history_.add(message)) return;
  clock_.stamped(1e-3 * message.time_boot_ms, now_s);
  (std::is_same_v<Stamped, LocalPositionNed> ? position_heard_s_ : attitude_heard_s_) = now_s;
}

void VehicleLink::hear(const CommandAck& message) {
  if (!order_ || message.command != value::kCommandDoSetMode || message.result == 5) return;
  // Accepted: its HEARTBEAT will show it, but need not be waited for.
  order_result_ = message.result == 0 ? OrderResult::obeyed : OrderResult::refused;
  order_.reset();
}

CommandLong VehicleLink::command(std::uint16_t number, float param1, float param2,
                                 float param3) const {
  CommandLong message;
  message.param = {param1, param2, param3, 0.0F, 0.0F, 0.0F, 0.0F};
  message.command = number;
  message.target_system = vehicle_->system;
  message.target_component = vehicle_->component;
  return message;
}

std::vector<Message> VehicleLink::due(double now_s) {
  std::vector<Message> messages = std::move(answers_);
  answers_.clear();
  if (now_s >= heartbeat_due_s_) {
    heartbeat_due_s_ = now_s + kHeartbeatPeriod;
    Heartbeat heartbeat;
    heartbeat.type = value::kTypeOnboardController;
    heartbeat.autopilot = value::kAutopilotInvalid;
    heartbeat.system_status = value::kStateActive;
    messages.emplace_back(heartbeat);
  }
  if (!vehicle_) return messages;

  if (now_s >= question_due_s_) {
    question_due_s_ = now_s + kQuestionPeriod;
    questions_.push_back({nanoseconds(now_s), now_s});
    if (questions_.size() > kMostQuestions) questions_.pop_front();
    Timesync question;
    question.ts1 = questions_.back().stamp_ns;
    messages.emplace_back(question);
  }
  if (options_.want_pose && now_s >= wish_due_s_) {
    wish_due_s_ = now_s + kWishPeriod;
    const auto wish = [&](std::uint32_t id, double heard_s) {
      if (first_wishes_ == 0 && now_s - heard_s < kPoseMissing) return;
      messages.emplace_back(command(value::kCommandSetMessageInterval, static_cast<float>(id),
                                    static_cast<float>(1e6 / options_.pose_rate_hz)));
    };
    wish(value::kIdAttitudeQuaternion, attitude_heard_s_);
    wish(value::kIdLocalPositionNed, position_heard_s_);
    first_wishes_ = std::max(0, first_wishes_ - 1);
  }
  if (order_ && now_s - order_->since_s >= kOrderTime) {
    order_.reset();
    order_result_ = OrderResult::unanswered;
  }
  if (order_ && now_s >= order_->due_s) {
    order_->due_s = now_s + kOrderPeriod;
    const ModeNumber number = number_of(order_->mode, options_.autopilot);
    CommandLong message =
        command(value::kCommandDoSetMode, value::kCustomModeEnabled, number.main, number.sub);
    message.confirmation = order_->sent++;
    messages.emplace_back(message);
  }
  return messages;
}

double VehicleLink::next_due_s() const {
  double next = heartbeat_due_s_;
  if (vehicle_) {
    next = std::min(next, question_due_s_);
    if (options_.want_pose) next = std::min(next, wish_due_s_);
    if (order_) next = std::min(next, order_->due_s);
  }
  return answers_.empty() ? next : -1e9;
}

void VehicleLink::order(FlightMode mode, double now_s) {
  order_ = Order{mode, now_s, now_s, 0};
  order_result_.reset();
}

Presence VehicleLink::presence(double now_s) const {
  if (!heard_s_) return Presence::unheard;
  return now_s - *heard_s_ > options_.silent_s ? Presence::silent : Presence::heard;
}

std::optional<VehiclePose> VehicleLink::pose(double ours_s) const {
  const auto remote_s = clock_.remote(ours_s);
  return remote_s ? pose_by_its_clock(*remote_s) : std::nullopt;
}

std::optional<VehiclePose> VehicleLink::pose_by_its_clock(double remote_s) const {
  const auto ned_R_body = history_.ned_R_body(remote_s);
  if (!ned_R_body) return std::nullopt;
  return VehiclePose{*ned_R_body, history_.ned_p_body(remote_s)};
}

bool VehicleLink::landing() const {
  return heartbeat_.custom_mode == custom_mode(FlightMode::land, options_.autopilot);
}

}  // namespace harco
