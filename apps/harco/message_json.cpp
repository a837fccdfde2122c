#include "message_json.hpp"

#include <variant>

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace harco::cli {
namespace {

/// The fields of a message as members of a JSON object.
std::string fields(const mavlink::LandingTarget& m) {
  return fmt::format(
      R"("time_usec": {}, "target_num": {}, "frame": {}, "position_valid": {}, "x": {}, "y": {}, )"
      R"("z": {}, "distance": {}, "angle_x": {}, "angle_y": {}, "size_x": {}, "size_y": {}, )"
      R"("q": [{}], "type": {})",
      m.time_usec, m.target_num, m.frame, m.position_valid, m.x, m.y, m.z, m.distance, m.angle_x,
      m.angle_y, m.size_x, m.size_y, fmt::join(m.q, ", "), m.type);
}

std::string fields(const mavlink::TargetRelative& m) {
  return fmt::format(
      R"("timestamp": {}, "id": {}, "frame": {}, "x": {}, "y": {}, "z": {}, "pos_std": [{}], )"
      R"("yaw_std": {}, "q_target": [{}], "q_sensor": [{}], "type": {})",
      m.timestamp, m.id, m.frame, m.x, m.y, m.z, fmt::join(m.pos_std, ", "), m.yaw_std,
      fmt::join(m.q_target, ", "), fmt::join(m.q_sensor, ", "), m.type);
}

std::string fields(const mavlink::StatusText& m) {
  return fmt::format(R"("severity": {}, "text": "{}")", m.severity, m.text);  // our own words
}

std::string fields(const mavlink::CommandLong& m) {
  return fmt::format(
      R"("command": {}, "target_system": {}, "target_component": {}, "confirmation": {}, )"
      R"("param": [{}])",
      m.command, m.target_system, m.target_component, m.confirmation, fmt::join(m.param, ", "));
}

template <typename M>
std::string fields(const M& /*other*/) {
  return {};
}

}  // namespace

std::string fields_json(const mavlink::Message& message) {
  return fmt::format("{{{}}}", std::visit([](const auto& m) { return fields(m); }, message));
}

std::string json_line(const mavlink::Message& message, double sent_s,
                      std::optional<double> captured_s) {
  std::string line =
      fmt::format(R"({{"message": "{}", "sent_s": {})", mavlink::name_of(message), sent_s);
  if (captured_s) line += fmt::format(R"(, "captured_s": {})", *captured_s);
  return line + R"(, "fields": )" + fields_json(message) + "}\n";
}

}  // namespace harco::cli
