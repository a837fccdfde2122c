// What is said about a frame: one JSON object a line, or rows of CSV.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "harco/detect.hpp"
#include "harco/filter.hpp"
#include "harco/pose.hpp"

namespace harco::cli {

struct FrameResult {
  std::size_t frame = 0;
  std::string source;
  double timestamp_s = 0.0;
  std::size_t dropped = 0;    ///< frames just before it for which there was no time
  int width = 0, height = 0;  ///< 0 if the frame couldn't be read
  std::vector<Detection> detections;
  std::vector<Pose> poses;
  std::optional<std::vector<Track>> tracks;  ///< empty where nothing is tracked
  std::string error;
};

/// A pose as it stands in a line, and back. Numbers read back to the same double.
nlohmann::ordered_json pose_json(const Pose& pose);
/// Throws Error, without naming a file, if it is none.
Pose pose_from_json(const nlohmann::ordered_json& json);
nlohmann::ordered_json track_json(const Track& track);
nlohmann::ordered_json frame_json(const FrameResult& result);
std::string line_of(const nlohmann::ordered_json& json);  ///< with its end

/// One line with its end, all numbers so that they read back to the same double.
std::string json_line(const FrameResult& result);

/// A table with a row for every marker (record `marker`) and every pose (record `pose`); a frame
/// without either has one row (record `none` or `error`). What a record doesn't have is left empty.
std::string csv_header();
std::string csv_rows(const FrameResult& result);

}  // namespace harco::cli
