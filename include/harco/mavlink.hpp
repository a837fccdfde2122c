// MAVLink 2: the few messages that a landing needs, packed, signed, and parsed from bytes that
// anybody may have sent. Library harco::autopilot.
//
// Nothing here has a clock or a connection; link.hpp has the connections. Messages are plain
// structs with the fields, units and order of MAVLink's common dialect.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

namespace harco::mavlink {

// ---------------------------------------------------------------------------------------- messages

/// Who there is, and in which state. Sent once a second by every component.
struct Heartbeat {
  std::uint32_t custom_mode = 0;   ///< flight mode; what it means depends on `autopilot`
  std::uint8_t type = 0;           ///< MAV_TYPE
  std::uint8_t autopilot = 0;      ///< MAV_AUTOPILOT
  std::uint8_t base_mode = 0;      ///< MAV_MODE_FLAG
  std::uint8_t system_status = 0;  ///< MAV_STATE
  std::uint8_t mavlink_version = 3;
};

struct Attitude {
  std::uint32_t time_boot_ms = 0;
  float roll = 0, pitch = 0, yaw = 0;                 ///< rad: NED to body, z-y-x
  float rollspeed = 0, pitchspeed = 0, yawspeed = 0;  ///< rad/s, body
};

struct AttitudeQuaternion {
  std::uint32_t time_boot_ms = 0;
  float q1 = 1, q2 = 0, q3 = 0, q4 = 0;               ///< w, x, y, z of ned_R_body
  float rollspeed = 0, pitchspeed = 0, yawspeed = 0;  ///< rad/s, body
  std::array<float, 4> repr_offset_q{};
};

struct LocalPositionNed {
  std::uint32_t time_boot_ms = 0;
  float x = 0, y = 0, z = 0;     ///< m: north, east, down from the autopilot's origin
  float vx = 0, vy = 0, vz = 0;  ///< m/s
};

struct CommandLong {
  std::array<float, 7> param{};
  std::uint16_t command = 0;  ///< MAV_CMD
  std::uint8_t target_system = 0;
  std::uint8_t target_component = 0;
  std::uint8_t confirmation = 0;  ///< counts how often it was sent before
};

struct CommandAck {
  std::uint16_t command = 0;
  std::uint8_t result = 0;  ///< MAV_RESULT; 0 is accepted
  std::uint8_t progress = 0;
  std::int32_t result_param2 = 0;
  std::uint8_t target_system = 0;
  std::uint8_t target_component = 0;
};

/// A question (tc1 0, ts1 the asker's time) or its answer (tc1 the answerer's time, ts1 as asked).
struct Timesync {
  std::int64_t tc1 = 0;  ///< ns
  std::int64_t ts1 = 0;  ///< ns
  std::uint8_t target_system = 0;
  std::uint8_t target_component = 0;
};

struct LandingTarget {
  std::uint64_t time_usec = 0;  ///< when the image was taken, sender's clock
  float angle_x = 0;            ///< rad, from the optical axis to the right
  float angle_y = 0;            ///< rad, downwards in the image
  float distance = 0;           ///< m, along the line of sight
  float size_x = 0;             ///< rad, as seen
  float size_y = 0;
  std::uint8_t target_num = 0;
  std::uint8_t frame = 0;              ///< MAV_FRAME of what follows
  float x = 0, y = 0, z = 0;           ///< m
  std::array<float, 4> q{1, 0, 0, 0};  ///< w, x, y, z: frame_R_target
  std::uint8_t type = 0;               ///< LANDING_TARGET_TYPE
  std::uint8_t position_valid = 0;     ///< 1: x, y, z count
};

struct ExtendedSysState {
  std::uint8_t vtol_state = 0;
  std::uint8_t landed_state = 0;  ///< MAV_LANDED_STATE: 1 on the ground, 2 in the air, 4 landing
};

struct StatusText {
  std::uint8_t severity = 6;  ///< MAV_SEVERITY: 6 is information, 4 a warning
  std::string text;           ///< at most 50 bytes; packing cuts what is longer
  std::uint16_t id = 0;
  std::uint8_t chunk_seq = 0;
};

/// A target relative to the vehicle, with how well it is known.
struct TargetRelative {
  std::uint64_t timestamp = 0;      ///< us, when it was measured, sender's clock
  float x = 0, y = 0, z = 0;        ///< m
  std::array<float, 3> pos_std{};   ///< m, standard deviations of x, y, z
  float yaw_std = 0;                ///< rad
  std::array<float, 4> q_target{};  ///< w, x, y, z: frame_R_target
  std::array<float, 4> q_sensor{};  ///< w, x, y, z: frame_R_sensor
  std::uint8_t id = 0;
  std::uint8_t frame = 0;  ///< TARGET_OBS_FRAME
  std::uint8_t type = 0;   ///< LANDING_TARGET_TYPE
};

using Message =
    std::variant<Heartbeat, Attitude, AttitudeQuaternion, LocalPositionNed, CommandLong, CommandAck,
                 Timesync, LandingTarget, ExtendedSysState, StatusText, TargetRelative>;

/// Its name as MAVLink spells it: "LANDING_TARGET".
const char* name_of(const Message& message);

/// The values of MAVLink's enumerations that are used here.
namespace value {
inline constexpr std::uint8_t kTypeOnboardController = 18, kTypeGroundStation = 6;
inline constexpr std::uint8_t kAutopilotArduPilot = 3, kAutopilotPx4 = 12, kAutopilotInvalid = 8;
inline constexpr std::uint8_t kStateActive = 4;
inline constexpr std::uint8_t kComponentAutopilot = 1, kComponentOnboardComputer = 191;
inline constexpr std::uint8_t kFrameLocalNed = 1, kFrameBodyFrd = 12;
inline constexpr std::uint8_t kLandingTargetVisionFiducial = 2;
inline constexpr std::uint8_t kTargetFrameBodyFrd = 1, kTargetFrameLocalNed = 0;
inline constexpr std::uint8_t kSeverityWarning = 4, kSeverityInfo = 6;
inline constexpr std::uint8_t kArmed = 128, kCustomModeEnabled = 1;
inline constexpr std::uint16_t kCommandDoSetMode = 176, kCommandSetMessageInterval = 511;
inline constexpr std::uint32_t kIdAttitude = 30, kIdAttitudeQuaternion = 31,
                               kIdLocalPositionNed = 32;
}  // namespace value

// ----------------------------------------------------------------------------------------- packing

/// Who sends.
struct Address {
  std::uint8_t system = 1;
  std::uint8_t component = value::kComponentOnboardComputer;
  bool operator==(const Address& other) const {
    return system == other.system && component == other.component;
  }
};

/// A whole frame, ready for the wire.
struct Packet {
  std::array<std::uint8_t, 280> bytes{};
  std::size_t size = 0;
};

/// What signs messages: 32 bytes that both ends share.
struct SigningKey {
  std::array<std::uint8_t, 32> bytes{};

  /// SHA-256 of a pass phrase, as ground stations make it.
  static SigningKey from_pass_phrase(const std::string& phrase);
};

/// Turns messages into frames and numbers them.
class Packer {
 public:
  explicit Packer(Address from = {}) : from_(from) {}

  const Address& from() const { return from_; }
  void set_from(Address from) { from_ = from; }

  /// From now on every frame is signed, on this link.
  void sign_with(const SigningKey& key, std::uint8_t link_id = 0);

  /// `unix_time_us` counts only for the signature; it rises by at least 10 us from frame to frame,
  /// whatever is given.
  Packet pack(const Message& message, std::uint64_t unix_time_us = 0);

 private:
  Address from_;
  std::uint8_t sequence_ = 0;
  std::optional<SigningKey> key_;
  std::uint8_t link_id_ = 0;
  std::uint64_t signed_at_ = 0;  ///< last timestamp of a signature
};

// ----------------------------------------------------------------------------------------- parsing

struct Received {
  Address from;
  Message message;
};

/// What came, and what was wrong with it.
struct ParserCounts {
  std::uint64_t messages = 0;       ///< good ones of the kinds above
  std::uint64_t unknown = 0;        ///< frames of other kinds, or that need what isn't known here
  std::uint64_t bad_crc = 0;        ///< frames whose checksum was wrong
  std::uint64_t bad_signature = 0;  ///< not signed, wrongly signed or played again
  std::uint64_t truncated = 0;      ///< frames that ended too early
  std::uint64_t junk_bytes = 0;     ///< bytes outside of frames
};

/// Finds messages in bytes. Any bytes may come, in pieces of any size: what is no message changes
/// nothing but a counter.
class Parser {
 public:
  /// From now on only frames that are rightly signed, and newer than those before them, count.
  void require_signature(const SigningKey& key);

  /// Takes bytes of a stream and appends the messages that they complete to `out`.
  void feed(const std::uint8_t* bytes, std::size_t size, std::vector<Received>& out);

  /// The end of a datagram or a connection: what is incomplete will never be whole. Messages that
  /// hid behind a false beginning are appended to `out`.
  void finish(std::vector<Received>& out);

  const ParserCounts& counts() const { return counts_; }

 private:
  /// The newest signature of one sender on one of its links.
  struct Stream {
    Address from;
    std::uint8_t link_id;
    std::uint64_t timestamp;
  };
  enum class Step { need_more, skip_byte, skip_frame };

  void scan(bool more_may_come, std::vector<Received>& out);
  Step examine(const std::uint8_t* at, std::size_t left, std::size_t& frame,
               std::vector<Received>& out);
  bool signature_holds(const std::uint8_t* frame, std::size_t without_signature);

  std::vector<std::uint8_t> pending_;
  bool in_step_ = true;  ///< the byte looked at follows a whole frame, or begins a connection
  std::optional<SigningKey> key_;
  std::vector<Stream> streams_;
  std::uint64_t newest_ = 0;  ///< greatest timestamp of all streams
  ParserCounts counts_;
};

}  // namespace harco::mavlink
