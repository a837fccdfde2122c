// How each message lies on the wire: its number, the seed of its checksum, and its fields in wire
// order (by size, the largest first; then what version 2 added, as it was added).
#pragma once

#include <cstddef>
#include <cstdint>

#include "harco/mavlink.hpp"

namespace harco::mavlink {

inline constexpr std::size_t kStatusTextLength = 50;

/// `fields` visits every field in order. `base_length` is the payload's length without what version
/// 2 added: that of version 1.
template <typename M>
struct Wire;

template <>
struct Wire<Heartbeat> {
  static constexpr const char* name = "HEARTBEAT";
  static constexpr std::uint32_t id = 0;
  static constexpr std::uint8_t crc_extra = 50;
  static constexpr std::size_t base_length = 9;
  template <typename M, typename Visit>
  static void fields(M& m, const Visit& visit) {
    visit(m.custom_mode, m.type, m.autopilot, m.base_mode, m.system_status, m.mavlink_version);
  }
};

template <>
struct Wire<Attitude> {
  static constexpr const char* name = "ATTITUDE";
  static constexpr std::uint32_t id = 30;
  static constexpr std::uint8_t crc_extra = 39;
  static constexpr std::size_t base_length = 28;
  template <typename M, typename Visit>
  static void fields(M& m, const Visit& visit) {
    visit(m.time_boot_ms, m.roll, m.pitch, m.yaw, m.rollspeed, m.pitchspeed, m.yawspeed);
  }
};

template <>
struct Wire<AttitudeQuaternion> {
  static constexpr const char* name = "ATTITUDE_QUATERNION";
  static constexpr std::uint32_t id = 31;
  static constexpr std::uint8_t crc_extra = 246;
  static constexpr std::size_t base_length = 32;
  template <typename M, typename Visit>
  static void fields(M& m, const Visit& visit) {
    visit(m.time_boot_ms, m.q1, m.q2, m.q3, m.q4, m.rollspeed, m.pitchspeed, m.yawspeed,
          m.repr_offset_q);
  }
};

template <>
struct Wire<LocalPositionNed> {
  static constexpr const char* name = "LOCAL_POSITION_NED";
  static constexpr std::uint32_t id = 32;
  static constexpr std::uint8_t crc_extra = 185;
  static constexpr std::size_t base_length = 28;
  template <typename M, typename Visit>
  static void fields(M& m, const Visit& visit) {
    visit(m.time_boot_ms, m.x, m.y, m.z, m.vx, m.vy, m.vz);
  }
};

template <>
struct Wire<CommandLong> {
  static constexpr const char* name = "COMMAND_LONG";
  static constexpr std::uint32_t id = 76;
  static constexpr std::uint8_t crc_extra = 152;
  static constexpr std::size_t base_length = 33;
  template <typename M, typename Visit>
  static void fields(M& m, const Visit& visit) {
    visit(m.param, m.command, m.target_system, m.target_component, m.confirmation);
  }
};

template <>
struct Wire<CommandAck> {
  static constexpr const char* name = "COMMAND_ACK";
  static constexpr std::uint32_t id = 77;
  static constexpr std::uint8_t crc_extra = 143;
  static constexpr std::size_t base_length = 3;
  template <typename M, typename Visit>
  static void fields(M& m, const Visit& visit) {
    visit(m.command, m.result, m.progress, m.result_param2, m.target_system, m.target_component);
  }
};

template <>
struct Wire<Timesync> {
  static constexpr const char* name = "TIMESYNC";
  static constexpr std::uint32_t id = 111;
  static constexpr std::uint8_t crc_extra = 34;
  static constexpr std::size_t base_length = 16;
  template <typename M, typename Visit>
  static void fields(M& m, const Visit& visit) {
    visit(m.tc1, m.ts1, m.target_system, m.target_component);
  }
};

template <>
struct Wire<LandingTarget> {
  static constexpr const char* name = "LANDING_TARGET";
  static constexpr std::uint32_t id = 149;
  static constexpr std::uint8_t crc_extra = 200;
  static constexpr std::size_t base_length = 30;
  template <typename M, typename Visit>
  static void fields(M& m, const Visit& visit) {
    visit(m.time_usec, m.angle_x, m.angle_y, m.distance, m.size_x, m.size_y, m.target_num, m.frame,
          m.x, m.y, m.z, m.q, m.type, m.position_valid);
  }
};

template <>
struct Wire<ExtendedSysState> {
  static constexpr const char* name = "EXTENDED_SYS_STATE";
  static constexpr std::uint32_t id = 245;
  static constexpr std::uint8_t crc_extra = 130;
  static constexpr std::size_t base_length = 2;
  template <typename M, typename Visit>
  static void fields(M& m, const Visit& visit) {
    visit(m.vtol_state, m.landed_state);
  }
};

template <>
struct Wire<StatusText> {
  static constexpr const char* name = "STATUSTEXT";
  static constexpr std::uint32_t id = 253;
  static constexpr std::uint8_t crc_extra = 83;
  static constexpr std::size_t base_length = 51;
  template <typename M, typename Visit>
  static void fields(M& m, const Visit& visit) {
    visit(m.severity, m.text, m.id, m.chunk_seq);
  }
};

template <>
struct Wire<TargetRelative> {
  static constexpr const char* name = "TARGET_RELATIVE";
  static constexpr std::uint32_t id = 511;
  static constexpr std::uint8_t crc_extra = 28;
  static constexpr std::size_t base_length = 71;
  template <typename M, typename Visit>
  static void fields(M& m, const Visit& visit) {
    visit(m.timestamp, m.x, m.y, m.z, m.pos_std, m.yaw_std, m.q_target, m.q_sensor, m.id, m.frame,
          m.type);
  }
};

}  // namespace harco::mavlink
