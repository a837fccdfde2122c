// harco simulate, run as a user does.
#include <cmath>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <Eigen/Core>
#include <nlohmann/json.hpp>

#include "command.hpp"
#include "harco/marker.hpp"
#include "sample_markers.hpp"

namespace harco::test {
namespace {

namespace fs = std::filesystem;

constexpr const char* kScene = R"(
markers: markers.json
camera: {size: [320, 240], focal_px: 300}
effects: {exposure_s: 0.005, readout_s: 0.004}
ground: {metres_per_pixel: 0.02}
frames: 3
frame_rate: 10
path:
  - {time_s: 0, distance_m: 3.5, tilt_deg: 12, tilt_axis_deg: 40}
  - {time_s: 1, distance_m: 3.0, roll_deg: 30}
)";

class Simulate : public testing::Test {
 protected:
  Simulate() {
    save_markers(three_layers(), folder_ / "markers.json");
    write_file(folder_ / "scene.yaml", kScene);
  }
  std::string path(const std::string& name) const {
    std::string quoted(1, '\'');
    return quoted.append((folder_ / name).string()).append(1, '\'');
  }
  CommandResult refused(const std::string& scene) {
    write_file(folder_ / "bad.yaml", scene);
    const CommandResult result =
        run_harco("simulate " + path("bad.yaml") + " --out " + path("none"));
    EXPECT_EQ(result.status, 2) << scene;
    EXPECT_NE(result.errors.find("bad.yaml"), std::string::npos) << result.errors;
    EXPECT_EQ(std::count(result.errors.begin(), result.errors.end(), '\n'), 1) << result.errors;
    EXPECT_FALSE(fs::exists(folder_ / "none"));
    return result;
  }
  TemporaryFolder folder_;
};

std::vector<nlohmann::json> lines_of(const std::string& text) {
  std::vector<nlohmann::json> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) lines.push_back(nlohmann::json::parse(line));
  return lines;
}

TEST_F(Simulate, PicturesShowWhatTheTruthSays) {
  const CommandResult made = run_harco("simulate " + path("scene.yaml") + " --out " + path("made"));
  ASSERT_EQ(made.status, 0) << made.errors;
  EXPECT_EQ(made.output, "");
  const auto truth = lines_of(read_file(folder_ / "made/truth.jsonl"));
  ASSERT_EQ(truth.size(), 3U);
  const CommandResult found = run_harco("detect --markers " + path("markers.json") + " --camera " +
                                        path("made/camera.yaml") + " " + path("made"));
  ASSERT_EQ(found.status, 0) << found.errors;
  const auto seen = lines_of(found.output);
  ASSERT_EQ(seen.size(), 3U);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(truth[i]["timestamp_s"].get<double>(), 0.1 * static_cast<double>(i), 1e-12);
    ASSERT_EQ(truth[i]["poses"].size(), 1U);
    ASSERT_EQ(seen[i]["poses"].size(), 1U);
    EXPECT_EQ(seen[i]["source"], truth[i]["source"]);
    Eigen::Vector3d wanted, measured;
    for (std::size_t k = 0; k < 3; ++k) {
      wanted[static_cast<Eigen::Index>(k)] = truth[i]["poses"][0]["translation"][k];
      measured[static_cast<Eigen::Index>(k)] = seen[i]["poses"][0]["translation"][k];
    }
    EXPECT_LT((wanted - measured).norm(), 0.01);
    ASSERT_FALSE(truth[i]["markers"].empty());
    EXPECT_EQ(truth[i]["markers"][0]["layer"], 1);
    for (std::size_t k = 0; k < 4; ++k)
      for (std::size_t axis = 0; axis < 2; ++axis)
        EXPECT_NEAR(truth[i]["markers"][0]["corners"][k][axis].get<double>(),
                    seen[i]["markers"][0]["corners"][k][axis].get<double>(), 0.3);
  }
}

TEST_F(Simulate, StreamsIntoDetect) {
  const std::string command = std::string("'") + HARCO_COMMAND + "' ";
  write_file(folder_ / "pipe.sh", command + "simulate " + path("scene.yaml") +
                                      " --out pgm:- --frames 2 --truth " + path("truth.jsonl") +
                                      " | " + command + "detect --markers " + path("markers.json") +
                                      " pgm:-\n");
  const CommandResult result = run_shell("sh " + path("pipe.sh"));
  ASSERT_EQ(result.status, 0) << result.errors;
  const auto seen = lines_of(result.output);
  ASSERT_EQ(seen.size(), 2U);
  EXPECT_NEAR(seen[1]["timestamp_s"].get<double>(), 0.1, 1e-9);
  EXPECT_FALSE(seen[1]["markers"].empty());
  EXPECT_EQ(lines_of(read_file(folder_ / "truth.jsonl")).size(), 2U);
}

TEST_F(Simulate, FliesToo) {
  write_file(folder_ / "flight.json",
             R"({"markers": "markers.json", "camera": {"size": [320, 240], "focal_px": 200},
                 "frame_rate": 8, "seed": 2,
                 "flight": {"start_height_m": 3, "deck": {"motion": "platform",
                            "surface": {"size_m": [6, 6]}}}})");
  const CommandResult made =
      run_harco("simulate " + path("flight.json") + " --frames 8 --out " + path("flown"));
  ASSERT_EQ(made.status, 0) << made.errors;
  const auto truth = lines_of(read_file(folder_ / "flown/truth.jsonl"));
  ASSERT_EQ(truth.size(), 8U);
  EXPECT_NEAR(truth[0]["poses"][0]["translation"][2].get<double>(), 3.2, 0.3);
}

TEST_F(Simulate, SaysWhatIsWrong) {
  refused("frames: 3");                         // no markers
  refused("markers: markers.json\ncamra: {}");  // misspelt
  refused("markers: markers.json\nframes: -1");
  refused("markers: markers.json\neffects: {exposure_s: -1}");
  refused("markers: markers.json\npath: [{distance_m: 0}]");
  refused("markers: markers.json\nframe_rate: fast");
  refused("markers: [");
  refused("markers: markers.json\nsheets: [{parent: 9}]");
  EXPECT_EQ(run_harco("simulate " + path("missing.yaml") + " --out x").status, 2);
}

}  // namespace
}  // namespace harco::test
