#include "record.hpp"

#include <array>
#include <fstream>
#include <iostream>
#include <stdexcept>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "harco/error.hpp"
#include "message_json.hpp"

namespace harco::cli {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kFormat = "harco-record";
constexpr int kVersion = 1;

Json camera_json(const CameraPose& camera) {
  if (!camera) return nullptr;
  Json rows = Json::array();
  for (int i = 0; i < 3; ++i)
    rows.push_back({(*camera)(i, 0), (*camera)(i, 1), (*camera)(i, 2), (*camera)(i, 3)});
  return rows;
}

CameraPose camera_from_json(const Json& json) {
  if (json.is_null()) return std::nullopt;
  const auto rows = json.get<std::array<std::array<double, 4>, 3>>();
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 4; ++j)
      pose(i, j) = rows[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)];
  return pose;
}

Json vehicle_json(const VehiclePose& vehicle) {
  const Eigen::Quaterniond& q = vehicle.ned_R_body;
  Json json{{"ned_R_body", {q.w(), q.x(), q.y(), q.z()}}, {"ned_p_body", nullptr}};
  if (const auto& p = vehicle.ned_p_body) json["ned_p_body"] = {p->x(), p->y(), p->z()};
  return json;
}

std::optional<VehiclePose> vehicle_from_json(const Json& json) {
  if (json.is_null()) return std::nullopt;
  const auto q = json.at("ned_R_body").get<std::array<double, 4>>();
  VehiclePose vehicle{Eigen::Quaterniond(q[0], q[1], q[2], q[3]), std::nullopt};
  if (const Json& p = json.at("ned_p_body"); !p.is_null()) {
    const auto xyz = p.get<std::array<double, 3>>();
    vehicle.ned_p_body = Eigen::Vector3d(xyz[0], xyz[1], xyz[2]);
  }
  return vehicle;
}

Json target_json(const Target& target) {
  Json json{{"believed", target.believed}, {"foretold", target.foretold}, {"news", Json::array()}};
  for (const mavlink::Message& message : target.news)
    json["news"].push_back(
        {{"message", mavlink::name_of(message)}, {"fields", Json::parse(fields_json(message))}});
  return json;
}

Json number_or_null(const std::optional<double>& number) {
  return number ? Json(*number) : Json(nullptr);
}

/// Plays lines one by one.
class Player {
 public:
  explicit Player(const Json& header) {
    if (header.value("format", "") != kFormat) throw Error("is no record");
    if (header.at("version").get<int>() != kVersion)
      throw Error("is of version " + header.at("version").dump() + ", not 1");
    if (const auto target = header.find("target"); target != header.end())
      teller_.emplace(target_options_from_json(*target));
    else if (const Json& tracking = header.at("tracking"); !tracking.is_null())
      options_ = tracking_from_json(tracking);
  }

  /// A line without its end.
  std::string play(const std::string& text) {
    Json line = Json::parse(text);
    if (line.contains("message") || line.contains("deck")) return text + "\n";
    const Json record = line.at("record");
    line.erase("record");
    if (!line.contains("error")) {
      if (teller_) tell(line, record);
      if (options_) track(line, record);
    }
    return line_of(line);
  }

 private:
  void tell(Json& line, const Json& record) {
    TargetFrame frame;
    line.at("timestamp_s").get_to(frame.time_s);
    if (const Json& captured_s = record.at("captured_s"); !captured_s.is_null())
      frame.captured_s = captured_s.get<double>();
    frame.vehicle = vehicle_from_json(record.at("vehicle"));
    for (const Json& pose : line.at("poses")) frame.poses.push_back(pose_from_json(pose));
    line["target"] = target_json(teller_->take(frame));
  }

  void track(Json& line, const Json& record) {
    const auto sequence = record.at("sequence").get<std::size_t>();
    if (!tracking_ || sequence != sequence_) tracking_.emplace(*options_);
    sequence_ = sequence;

    std::vector<Pose> poses;
    for (const Json& pose : record.at("measured")) poses.push_back(pose_from_json(pose));
    const CameraPose camera = camera_from_json(record.at("reference_T_camera"));
    const auto time_s = line.at("timestamp_s").get<double>();
    tracking_->take(poses, time_s, camera);
    line["poses"] = Json::array();
    for (const Pose& pose : poses) line["poses"].push_back(pose_json(pose));
    if (const auto tracks = tracking_->tracks(time_s, camera)) {
      line["tracks"] = Json::array();
      for (const Track& track : *tracks) line["tracks"].push_back(track_json(track));
    }
  }

  std::optional<TargetTeller> teller_;  ///< of a landing
  std::optional<TrackingOptions> options_;
  std::optional<Tracking> tracking_;
  std::size_t sequence_ = 0;
};

}  // namespace

RecordWriter::RecordWriter(const std::string& file, const std::optional<TrackingOptions>& tracking,
                           bool at_once)
    : header_(line_of({{"format", kFormat},
                       {"version", kVersion},
                       {"verb", "detect"},
                       {"tracking", tracking ? tracking_json(*tracking) : Json(nullptr)}})),
      output_(file, at_once) {}

RecordWriter::RecordWriter(const std::string& file, const TargetOptions& target)
    : header_(line_of({{"format", kFormat},
                       {"version", kVersion},
                       {"verb", "land"},
                       {"target", options_json(target)}})),
      output_(file, /*at_once=*/true) {}

void RecordWriter::write(const std::string& line) {
  output_.write(header_ + line);
  header_.clear();
}

void RecordWriter::add(const FrameRecord& frame) {
  const FrameTiming& t = frame.timing;
  Json line = frame_json(frame.result);
  Json record{{"sequence", frame.sequence}};
  if (frame.target) {
    line["target"] = target_json(*frame.target);
    record["vehicle"] = frame.vehicle ? vehicle_json(*frame.vehicle) : Json(nullptr);
  } else {
    record["measured"] = Json::array();
    for (const Pose& pose : frame.measured) record["measured"].push_back(pose_json(pose));
    record["reference_T_camera"] = camera_json(frame.reference_T_camera);
  }
  record["captured_s"] = number_or_null(t.captured_s);
  record["received_s"] = t.received_s;
  record["done_s"] = t.done_s;
  record["detect_ms"] = t.detect_ms;
  record["pose_ms"] = t.pose_ms;
  line["record"] = record;
  write(line_of(line));
}

void RecordWriter::commit() {
  write("");
  output_.commit();
}

void replay(const std::string& file, const std::function<void(const std::string& line)>& give) {
  std::ifstream opened;
  if (file != "-") opened.open(file, std::ios::binary);
  std::istream& in = file == "-" ? std::cin : opened;
  const std::string name = file == "-" ? "standard input" : file;
  if (!in) throw Error(name + ": can't be opened");
  std::optional<Player> player;
  std::string text;
  for (std::size_t number = 1; std::getline(in, text); ++number) {
    // A record that was cut off in the middle of a line ends with the line before.
    if (in.eof() && player) break;
    try {
      if (player)
        give(player->play(text));
      else
        player.emplace(Json::parse(text));
    } catch (const Json::exception&) {
      throw Error(fmt::format("{}: line {} is not as a record's lines are", name, number));
    } catch (const std::invalid_argument& error) {
      throw Error(fmt::format("{}: line {}: {}", name, number, error.what()));
    } catch (const Error& error) {
      throw Error(fmt::format("{}: line {}: {}", name, number, error.what()));
    }
  }
  if (!player) throw Error(name + ": is empty");
}

}  // namespace harco::cli
