#include "results.hpp"

#include <array>
#include <cmath>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "harco/error.hpp"

namespace harco::cli {
namespace {

using Json = nlohmann::ordered_json;

Json number(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

template <typename Vector>
Json vector_json(const Vector& vector) {
  Json list = Json::array();
  for (Eigen::Index i = 0; i < vector.size(); ++i) list.push_back(number(vector(i)));
  return list;
}

template <typename Matrix>
Json matrix_json(const Matrix& matrix) {
  Json rows = Json::array();
  for (Eigen::Index i = 0; i < matrix.rows(); ++i) rows.push_back(vector_json(matrix.row(i)));
  return rows;
}

bool is_known(const std::optional<Matrix6d>& covariance) {
  return covariance && covariance->allFinite();
}

Json marker_json(const Detection& detection) {
  Json corners = Json::array();
  for (const Eigen::Vector2d& corner : detection.corners) corners.push_back(vector_json(corner));
  Json json{{"parent", detection.parent},
            {"layer", detection.layer},
            {"id", detection.id},
            {"corners", corners},
            {"bit_errors", detection.bit_errors},
            {"quality", number(detection.quality)}};
  if (detection.inferred) json["inferred"] = true;
  if (detection.visible < 1.0) json["visible"] = number(detection.visible);
  return json;
}

/// One row of CSV by the names of its columns.
class Row {
 public:
  static const std::vector<std::string>& columns();

  explicit Row(const FrameResult& result) : cells_(columns().size()) {
    set("frame", std::to_string(result.frame));
    set("source", quoted(result.source));
    set("timestamp_s", result.timestamp_s);
    if (result.width > 0) {
      set("width", std::to_string(result.width));
      set("height", std::to_string(result.height));
    }
  }

  void set(const std::string& column, const std::string& text) {
    for (std::size_t i = 0; i < cells_.size(); ++i)
      if (columns()[i] == column) cells_[i] = text;
  }
  void set(const std::string& column, const char* text) { set(column, std::string(text)); }
  void set(const std::string& column, int value) { set(column, std::to_string(value)); }
  void set(const std::string& column, double value) {
    if (std::isfinite(value)) set(column, fmt::format("{}", value));
  }

  std::string line() const { return fmt::format("{}\n", fmt::join(cells_, ",")); }

  /// RFC 4180: in quotes if it needs to be, quotes doubled.
  static std::string quoted(const std::string& text) {
    if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
    std::string result = "\"";
    for (const char c : text) {
      if (c == '"') result += '"';
      result += c;
    }
    return result + '"';
  }

 private:
  std::vector<std::string> cells_;
};

std::string indexed(const char* name, Eigen::Index i) { return fmt::format("{}{}", name, i + 1); }
std::string indexed(const char* name, Eigen::Index i, Eigen::Index j) {
  return fmt::format("{}{}{}", name, i + 1, j + 1);
}

const std::vector<std::string>& Row::columns() {
  static const std::vector<std::string> all = [] {
    std::vector<std::string> names{"frame",  "source", "timestamp_s", "width", "height",
                                   "record", "parent", "layer",       "id"};
    for (int i = 0; i < 4; ++i) {
      names.push_back(indexed("x", i));
      names.push_back(indexed("y", i));
    }
    names.insert(names.end(), {"bit_errors", "quality", "tx", "ty", "tz"});
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) names.push_back(indexed("r", i, j));
    names.insert(names.end(), {"rms_px", "markers", "aligned", "share_used"});
    for (int i = 0; i < 6; ++i)
      for (int j = i; j < 6; ++j) names.push_back(indexed("c", i, j));
    names.emplace_back("error");
    return names;
  }();
  return all;
}

std::string marker_row(const FrameResult& result, const Detection& detection) {
  Row row(result);
  row.set("record", "marker");
  row.set("parent", detection.parent);
  row.set("layer", detection.layer);
  row.set("id", detection.id);
  for (std::size_t i = 0; i < 4; ++i) {
    row.set(indexed("x", static_cast<int>(i)), detection.corners[i].x());
    row.set(indexed("y", static_cast<int>(i)), detection.corners[i].y());
  }
  row.set("bit_errors", detection.bit_errors);
  row.set("quality", detection.quality);
  return row.line();
}

std::string pose_row(const FrameResult& result, const Pose& pose) {
  Row row(result);
  row.set("record", "pose");
  row.set("parent", pose.parent);
  const Eigen::Vector3d t = pose.camera_T_marker.translation();
  row.set("tx", t.x());
  row.set("ty", t.y());
  row.set("tz", t.z());
  const Eigen::Matrix3d r = pose.camera_T_marker.rotation();
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) row.set(indexed("r", i, j), r(i, j));
  row.set("rms_px", pose.rms_px);
  row.set("markers", pose.markers);
  row.set("aligned", pose.aligned ? 1 : 0);
  row.set("share_used", pose.share_used);
  if (is_known(pose.covariance))
    for (int i = 0; i < 6; ++i)
      for (int j = i; j < 6; ++j) row.set(indexed("c", i, j), (*pose.covariance)(i, j));
  return row.line();
}

}  // namespace

Json pose_json(const Pose& pose) {
  Json json = {
      {"parent", pose.parent},
      {"rotation", matrix_json(pose.camera_T_marker.rotation())},
      {"translation", vector_json(pose.camera_T_marker.translation())},
      {"covariance", is_known(pose.covariance) ? matrix_json(*pose.covariance) : Json(nullptr)},
      {"rms_px", number(pose.rms_px)},
      {"markers", pose.markers},
      {"aligned", pose.aligned},
      {"share_used", number(pose.share_used)}};
  if (pose.alternative)
    json["alternative"] = {{"rotation", matrix_json(pose.alternative->rotation())},
                           {"translation", vector_json(pose.alternative->translation())},
                           {"log_likelihood_ratio", number(*pose.log_likelihood_ratio)}};
  return json;
}

Pose pose_from_json(const Json& json) {
  const auto matrix = [](const Json& rows, auto& into) {
    if (!rows.is_array() || rows.size() != static_cast<std::size_t>(into.rows()))
      throw Error("a matrix has the wrong number of rows");
    for (Eigen::Index i = 0; i < into.rows(); ++i) {
      const Json& row = rows[static_cast<std::size_t>(i)];
      if (!row.is_array() || row.size() != static_cast<std::size_t>(into.cols()))
        throw Error("a matrix has the wrong number of columns");
      for (Eigen::Index j = 0; j < into.cols(); ++j)
        into(i, j) = row[static_cast<std::size_t>(j)].get<double>();
    }
  };
  const auto isometry = [&](const Json& from) {
    Eigen::Matrix3d rotation;
    matrix(from.at("rotation"), rotation);
    const auto translation = from.at("translation").get<std::array<double, 3>>();
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.linear() = rotation;
    pose.translation() = Eigen::Map<const Eigen::Vector3d>(translation.data());
    return pose;
  };
  try {
    Pose pose;
    pose.parent = json.at("parent").get<int>();
    pose.camera_T_marker = isometry(json);
    if (!json.at("covariance").is_null()) matrix(json.at("covariance"), pose.covariance.emplace());
    pose.rms_px = json.at("rms_px").get<double>();
    pose.markers = json.at("markers").get<int>();
    pose.aligned = json.at("aligned").get<bool>();
    pose.share_used = json.at("share_used").get<double>();
    if (const auto other = json.find("alternative"); other != json.end()) {
      pose.alternative = isometry(*other);
      pose.log_likelihood_ratio = other->at("log_likelihood_ratio").get<double>();
    }
    return pose;
  } catch (const Json::exception& error) {
    throw Error(std::string("a pose is not as it should be (") + error.what() + ")");
  }
}

Json track_json(const Track& track) {
  const TrackState& state = track.state;
  return {{"parent", track.parent},
          {"status", to_string(state.status)},
          {"measured_s", state.measured_s},
          {"rotation", matrix_json(state.camera_T_marker.linear())},
          {"translation", vector_json(state.camera_T_marker.translation())},
          {"velocity", vector_json(state.velocity)},
          {"turn_rate", vector_json(state.turn_rate)},
          {"covariance", matrix_json(state.covariance)}};
}

Json frame_json(const FrameResult& result) {
  Json line{{"frame", result.frame},
            {"source", result.source},
            {"timestamp_s", number(result.timestamp_s)},
            {"size", nullptr},
            {"markers", Json::array()},
            {"poses", Json::array()}};
  if (result.width > 0) line["size"] = {result.width, result.height};
  for (const Detection& detection : result.detections)
    line["markers"].push_back(marker_json(detection));
  for (const Pose& pose : result.poses) line["poses"].push_back(pose_json(pose));
  if (result.tracks) {
    line["tracks"] = Json::array();
    for (const Track& track : *result.tracks) line["tracks"].push_back(track_json(track));
  }
  if (result.dropped > 0) line["dropped"] = result.dropped;
  if (!result.error.empty()) line["error"] = result.error;
  return line;
}

std::string line_of(const Json& json) {
  // A file's name need not be UTF-8; what isn't is replaced.
  return json.dump(-1, ' ', false, Json::error_handler_t::replace) + '\n';
}

std::string json_line(const FrameResult& result) { return line_of(frame_json(result)); }

std::string csv_header() { return fmt::format("{}\n", fmt::join(Row::columns(), ",")); }

std::string csv_rows(const FrameResult& result) {
  std::string rows;
  for (const Detection& detection : result.detections) rows += marker_row(result, detection);
  for (const Pose& pose : result.poses) rows += pose_row(result, pose);
  if (!rows.empty()) return rows;
  Row row(result);
  row.set("record", result.error.empty() ? "none" : "error");
  row.set("error", Row::quoted(result.error));
  return row.line();
}

}  // namespace harco::cli
