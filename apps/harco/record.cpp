#include "record.hpp"

#include <array>
#include <fstream>
#include <iostream>
#include <stdexcept>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "harco/error.hpp"

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

/// Plays lines one by one.
class Player {
 public:
  explicit Player(const Json& header) {
    if (header.value("format", "") != kFormat) throw Error("is no record");
    if (header.at("version").get<int>() != kVersion)
      throw Error("is of version " + header.at("version").dump() + ", not 1");
    if (const Json& tracking = header.at("tracking"); !tracking.is_null())
      options_ = tracking_from_json(tracking);
  }

  std::string play(Json line) {
    if (line.contains("message")) return line_of(line);
    const Json record = line.at("record");
    line.erase("record");
    if (!options_ || line.contains("error")) return line_of(line);
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
    return line_of(line);
  }

 private:
  std::optional<TrackingOptions> options_;
  std::optional<Tracking> tracking_;
  std::size_t sequence_ = 0;
};

}  // namespace

RecordWriter::RecordWriter(const std::string& file, const std::string& verb,
                           const std::optional<TrackingOptions>& tracking, bool at_once)
    : header_(line_of({{"format", kFormat},
                       {"version", kVersion},
                       {"verb", verb},
                       {"tracking", tracking ? tracking_json(*tracking) : Json(nullptr)}})),
      output_(file, at_once) {}

void RecordWriter::write(const std::string& line) {
  output_.write(header_ + line);
  header_.clear();
}

void RecordWriter::add(const FrameRecord& frame) {
  Json measured = Json::array();
  for (const Pose& pose : frame.measured) measured.push_back(pose_json(pose));
  const FrameTiming& t = frame.timing;
  Json line = frame_json(frame.result);
  line["record"] = {{"sequence", frame.sequence},
                    {"measured", measured},
                    {"reference_T_camera", camera_json(frame.reference_T_camera)},
                    {"captured_s", t.captured_s ? Json(*t.captured_s) : Json(nullptr)},
                    {"received_s", t.received_s},
                    {"done_s", t.done_s},
                    {"detect_ms", t.detect_ms},
                    {"pose_ms", t.pose_ms}};
  write(line_of(line));
}

void RecordWriter::add_message(const std::string& kind, double time_s, const Json& fields) {
  Json line{{"message", kind}, {"time_s", time_s}};
  line.update(fields);
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
      const Json line = Json::parse(text);
      if (player)
        give(player->play(line));
      else
        player.emplace(line);
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
