// The detect verb as a user runs it: on frames of a known scene, and on wrong input of every kind.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <sys/stat.h>

#include "command.hpp"
#include "harco/camera.hpp"
#include "harco/marker.hpp"
#include "lab/render.hpp"

namespace harco::test {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

bool contains(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

std::vector<std::string> lines_of(const std::string& text) {
  std::istringstream in(text);
  std::vector<std::string> lines;
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

std::vector<json> json_lines(const std::string& text) {
  std::vector<json> all;
  for (const std::string& line : lines_of(text)) all.push_back(json::parse(line));
  return all;
}

std::string pgm(const Image& image, const std::string& header_comment = "") {
  std::string text = "P5\n" + header_comment + std::to_string(image.width) + " " +
                     std::to_string(image.height) + "\n255\n";
  text.append(image.pixels.begin(), image.pixels.end());
  return text;
}

/// A set of one parent of 0.5 m with two children, a camera, and frames of them with known poses.
class DetectVerb : public ::testing::Test {
 protected:
  DetectVerb() {
    Parent parent;
    parent.side_m = 0.5;
    parent.marker.id = 4;
    parent.marker.code = parse_code("1010100010111000011010101");
    add_child(parent, 0, 7, "1101110110111111110111111");
    add_child(parent, 24, 9, "1011101110101011111110111");
    markers_.parents.push_back(parent);
    save_markers(markers_, folder_ / "markers.json");
    camera_ = Camera::pinhole(320, 240, 400.0);
    save_camera(camera_, folder_ / "camera.yaml");
  }

  static void add_child(Parent& parent, int cell, int id, const std::string& code) {
    Marker child;
    child.id = id;
    child.cell = cell;
    child.code = parse_code(code);
    parent.marker.children.push_back(child);
  }

  Eigen::Isometry3d pose(int frame) const {
    return lab::look_at_marker({0.25, 0.25}, 1.2 + 0.1 * frame, 0.3, 0.5 * frame, 0.2 * frame);
  }

  Image frame(int number, bool with_marker = true) const {
    lab::Scene scene;
    scene.camera = camera_;
    if (with_marker) scene.parents.push_back({0, pose(number)});
    return lab::render(scene, markers_, static_cast<std::uint64_t>(number));
  }

  /// Frames 0 … count - 1 as DIR/frame-8.pgm and on, so that natural order differs from that of
  /// bytes.
  fs::path write_frames(const std::string& name, int count) const {
    fs::create_directories(folder_ / name);
    for (int i = 0; i < count; ++i)
      write_file(folder_ / name / ("frame-" + std::to_string(8 + i) + ".pgm"), pgm(frame(i)));
    return folder_ / name;
  }

  std::string path(const std::string& name) const {
    std::string quoted = "'";
    quoted += (folder_ / name).string();
    return quoted += "'";
  }

  CommandResult detect(const std::string& arguments, bool with_camera = true) const {
    return run_harco("detect --markers " + path("markers.json") +
                     (with_camera ? " --camera " + path("camera.yaml") : "") + " " + arguments);
  }

  /// A script: detect reads a pipe into which somebody writes one picture, and which he then holds
  /// open. Once its line has come, Ctrl-C.
  std::string one_picture_then_silence(const std::string& picture) const {
    return "exec 9<>" + path("pipe") + "\n'" HARCO_COMMAND "' detect --markers " +
           path("markers.json") + " --camera " + path("camera.yaml") + " --output " +
           path("seen.jsonl") + " 'pgm:" + (folder_ / "pipe").string() + "' 9>&- & P=$!\ncat " +
           path(picture) + " >&9\nfor i in $(seq 3000); do [ -s " + path("seen.jsonl") +
           " ] && break; sleep 0.02; done\nkill -INT $P; wait $P\n";
  }

  /// A run that must fail with one line that says `what`.
  void expect_refused(const std::string& arguments, const std::string& what) const {
    const CommandResult result = detect(arguments);
    EXPECT_EQ(result.status, 2) << arguments;
    EXPECT_EQ(result.output, "") << arguments;
    EXPECT_EQ(lines_of(result.errors).size(), 1U) << result.errors;
    EXPECT_TRUE(contains(result.errors, what)) << arguments << ": " << result.errors;
  }

  void expect_pose(const json& line, int number) const {
    ASSERT_EQ(line["poses"].size(), 1U) << line;
    const Eigen::Isometry3d truth = pose(number);
    for (int i = 0; i < 3; ++i) {
      const auto index = static_cast<std::size_t>(i);
      EXPECT_NEAR(line["poses"][0]["translation"][index], truth.translation()(i), 5e-3);
      for (int j = 0; j < 3; ++j)
        EXPECT_NEAR(line["poses"][0]["rotation"][index][static_cast<std::size_t>(j)],
                    truth.linear()(i, j), 2e-2);
    }
  }

  TemporaryFolder folder_;
  MarkerSet markers_;
  Camera camera_;
};

TEST_F(DetectVerb, WritesALineAFrameAsAgreed) {
  write_file(folder_ / "a.pgm", pgm(frame(0)));
  const CommandResult result = detect(path("a.pgm"));
  ASSERT_EQ(result.status, 0) << result.errors;
  EXPECT_EQ(result.errors, "");
  ASSERT_EQ(lines_of(result.output).size(), 1U);
  const json line = json::parse(result.output);
  EXPECT_EQ(line["frame"], 0);
  EXPECT_EQ(line["source"], (folder_ / "a.pgm").string());
  EXPECT_EQ(line["timestamp_s"], 0.0);
  EXPECT_EQ(line["size"], json({320, 240}));
  EXPECT_FALSE(line.contains("error"));

  ASSERT_GE(line["markers"].size(), 1U);
  const json& marker = line["markers"][0];
  EXPECT_EQ(marker["parent"], 4);
  EXPECT_EQ(marker["layer"], 1);
  EXPECT_EQ(marker["id"], 4);
  EXPECT_EQ(marker["bit_errors"], 0);
  EXPECT_GT(marker["quality"], 0.7);
  EXPECT_LE(marker["quality"], 1.0);
  const std::vector<Eigen::Vector2d> square{{0.0, 0.0}, {0.5, 0.0}, {0.5, 0.5}, {0.0, 0.5}};
  for (std::size_t i = 0; i < 4; ++i) {
    const Eigen::Vector3d corner(square[i].x(), square[i].y(), 0.0);
    const Eigen::Vector2d expected = *camera_.project(pose(0) * corner);
    EXPECT_NEAR(marker["corners"][i][0], expected.x(), 0.3);
    EXPECT_NEAR(marker["corners"][i][1], expected.y(), 0.3);
  }

  expect_pose(line, 0);
  const json& found = line["poses"][0];
  EXPECT_EQ(found["parent"], 4);
  EXPECT_GE(found["rms_px"], 0.0);
  EXPECT_EQ(found["markers"], line["markers"].size());
  ASSERT_EQ(found["covariance"].size(), 6U);
  for (std::size_t i = 0; i < 6; ++i) {
    ASSERT_EQ(found["covariance"][i].size(), 6U);
    EXPECT_GT(found["covariance"][i][i], 0.0);
    for (std::size_t j = 0; j < 6; ++j)
      EXPECT_DOUBLE_EQ(found["covariance"][i][j], found["covariance"][j][i]);
  }
}

TEST_F(DetectVerb, TellsOfASecondSolutionWhereTheImageDoesNotDecide) {
  // Markers of some 16 pixels, tilted a little: the corners of both solutions look almost alike.
  constexpr int kFrames = 12;
  std::string stream;
  std::vector<Eigen::Isometry3d> truths;
  for (int i = 0; i < kFrames; ++i) {
    lab::Scene scene;
    scene.camera = camera_;
    scene.noise_sigma = 3.0;
    truths.push_back(lab::look_at_marker({0.25, 0.25}, 12.0, 0.3, 0.5 * i, 0.3 * i));
    scene.parents.push_back({0, truths.back()});
    stream += pgm(lab::render(scene, markers_, static_cast<std::uint64_t>(i)));
  }
  write_file(folder_ / "small.pgm", stream);
  const CommandResult result =
      detect("--corners-only 'pgm:" + (folder_ / "small.pgm").string() + "'");
  ASSERT_EQ(result.status, 0) << result.errors;
  const std::vector<json> lines = json_lines(result.output);
  ASSERT_EQ(lines.size(), static_cast<std::size_t>(kFrames));
  const auto rotation_of = [](const json& solution) {
    Eigen::Matrix3d rotation;
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j)
        rotation(i, j) =
            solution["rotation"][static_cast<std::size_t>(i)][static_cast<std::size_t>(j)];
    return rotation;
  };
  const auto away_from = [](const Eigen::Matrix3d& a, const Eigen::Matrix3d& b) {
    return Eigen::AngleAxisd(a.transpose() * b).angle();
  };
  int undecided = 0;
  for (int i = 0; i < kFrames; ++i) {
    const json& poses = lines[static_cast<std::size_t>(i)]["poses"];
    if (poses.empty() || !poses[0].contains("alternative")) continue;
    ++undecided;
    const json& other = poses[0]["alternative"];
    EXPECT_GE(other["log_likelihood_ratio"], 0.0);
    EXPECT_LE(other["log_likelihood_ratio"], 6.0);
    ASSERT_EQ(other["translation"].size(), 3U);
    EXPECT_NEAR(other["translation"][2], truths[static_cast<std::size_t>(i)].translation().z(),
                1.5);
    const Eigen::Matrix3d first = rotation_of(poses[0]);
    const Eigen::Matrix3d second = rotation_of(other);
    EXPECT_NEAR((second.transpose() * second - Eigen::Matrix3d::Identity()).norm(), 0.0, 1e-9);
    EXPECT_GT(away_from(first, second), 0.1);
    // One of them is about the truth.
    const Eigen::Matrix3d truth = truths[static_cast<std::size_t>(i)].linear();
    EXPECT_LT(std::min(away_from(first, truth), away_from(second, truth)), 0.3) << "frame " << i;
  }
  EXPECT_GE(undecided, 6);
}

TEST_F(DetectVerb, PaperFusionKnowsNoCovariance) {
  write_file(folder_ / "a.pgm", pgm(frame(0)));
  const CommandResult result = detect("--fusion paper " + path("a.pgm"));
  ASSERT_EQ(result.status, 0) << result.errors;
  const json line = json::parse(result.output);
  ASSERT_EQ(line["poses"].size(), 1U);
  EXPECT_TRUE(line["poses"][0]["covariance"].is_null());
}

TEST_F(DetectVerb, WithoutACameraThereAreMarkersButNoPoses) {
  write_file(folder_ / "a.pgm", pgm(frame(0)));
  const CommandResult result = detect(path("a.pgm"), /*with_camera=*/false);
  ASSERT_EQ(result.status, 0) << result.errors;
  const json line = json::parse(result.output);
  EXPECT_GE(line["markers"].size(), 1U);
  EXPECT_EQ(line["poses"], json::array());
}

TEST_F(DetectVerb, AnEmptyFrameHasEmptyLists) {
  write_file(folder_ / "a.pgm", pgm(frame(0, /*with_marker=*/false)));
  const CommandResult result = detect(path("a.pgm"));
  ASSERT_EQ(result.status, 0) << result.errors;
  const json line = json::parse(result.output);
  EXPECT_EQ(line["markers"], json::array());
  EXPECT_EQ(line["poses"], json::array());
}

TEST_F(DetectVerb, TakesAFolderInNaturalOrderAndCountsOn) {
  const fs::path pictures = write_frames("pictures", 4);
  write_file(pictures / "notes.txt", "no picture");
  fs::create_directories(pictures / "deeper.png");
  const CommandResult result = detect(path("pictures") + " " + path("pictures/frame-8.pgm"));
  ASSERT_EQ(result.status, 0) << result.errors;
  const std::vector<json> lines = json_lines(result.output);
  ASSERT_EQ(lines.size(), 5U);
  for (int i = 0; i < 5; ++i) {
    const auto index = static_cast<std::size_t>(i);
    EXPECT_EQ(lines[index]["frame"], i);
    const std::string name = "frame-" + std::to_string(8 + i % 4) + ".pgm";
    EXPECT_EQ(lines[index]["source"], (pictures / name).string());
    expect_pose(lines[index], i % 4);
  }
}

TEST_F(DetectVerb, ManyJobsChangeNothing) {
  const fs::path pictures = write_frames("pictures", 12);
  write_file(pictures / "frame-13.pgm", "P5 broken");
  const CommandResult one = detect(path("pictures"));
  const CommandResult many = detect("--jobs 4 " + path("pictures"));
  EXPECT_EQ(one.status, 1);
  EXPECT_EQ(many.status, 1);
  EXPECT_EQ(lines_of(one.output).size(), 12U);
  EXPECT_EQ(one.output, many.output);
}

TEST_F(DetectVerb, ReadsPgmStreamsWithTheirTimes) {
  std::string stream;
  for (int i = 0; i < 3; ++i)
    stream += pgm(frame(i), "# a camera\n# timestamp_s " + std::to_string(100.25 + i) + "\n");
  stream += pgm(frame(3));  // without a time
  write_file(folder_ / "stream", stream);
  const CommandResult file = detect("'pgm:" + (folder_ / "stream").string() + "'");
  const CommandResult piped = detect("pgm:- < " + path("stream"));
  for (const CommandResult* result : {&file, &piped}) {
    ASSERT_EQ(result->status, 0) << result->errors;
    const std::vector<json> lines = json_lines(result->output);
    ASSERT_EQ(lines.size(), 4U);
    for (int i = 0; i < 4; ++i) {
      const auto index = static_cast<std::size_t>(i);
      EXPECT_EQ(lines[index]["timestamp_s"], i < 3 ? 100.25 + i : 0.0);
      expect_pose(lines[index], i);
    }
  }
  EXPECT_EQ(json_lines(piped.output)[0]["source"], "pgm:-");
}

TEST_F(DetectVerb, AnswersEveryStreamedFrameBeforeTheNext) {
  // Two named pipes make a dialogue: the second frame is sent only after the first is answered, so
  // a command that holds its answer back would never end (the test has a time limit).
  const std::string in = (folder_ / "in").string(), out = (folder_ / "out").string();
  ASSERT_EQ(mkfifo(in.c_str(), 0600), 0);
  ASSERT_EQ(mkfifo(out.c_str(), 0600), 0);
  const std::string command = std::string("timeout 60 '") + HARCO_COMMAND + "' detect --markers " +
                              path("markers.json") + " 'pgm:" + in + "' --output '" + out + "' &";
  ASSERT_EQ(std::system(command.c_str()), 0);
  const auto close = [](std::FILE* file) { std::fclose(file); };
  std::unique_ptr<std::FILE, decltype(close)> reader(std::fopen(out.c_str(), "rb"), close);
  std::unique_ptr<std::FILE, decltype(close)> writer(std::fopen(in.c_str(), "wb"), close);
  ASSERT_TRUE(reader && writer);
  for (int i = 0; i < 3; ++i) {
    const std::string bytes = pgm(frame(i));
    ASSERT_EQ(std::fwrite(bytes.data(), 1, bytes.size(), writer.get()), bytes.size());
    std::fflush(writer.get());
    std::string line;
    for (int c = std::getc(reader.get()); c != '\n' && c != EOF; c = std::getc(reader.get()))
      line.push_back(static_cast<char>(c));
    ASSERT_FALSE(line.empty()) << "no answer to frame " << i;
    EXPECT_EQ(json::parse(line)["frame"], i);
  }
}

TEST_F(DetectVerb, OnePictureInEveryFormatGivesTheSame) {
  // Annotated pictures of an empty set of findings are the frame itself: a way to other formats.
  write_file(folder_ / "plain.pgm", pgm(frame(0)));
  const std::string no_markers = "--min-quality 1 --min-side 200 ";
  for (const std::string name : {"a.png", "a.bmp", "a.tiff"})
    ASSERT_EQ(detect(no_markers + path("plain.pgm") + " --annotate " + path(name), false).status,
              0);
  const json expected = json::parse(detect(path("plain.pgm")).output);
  for (const std::string name : {"a.png", "a.bmp", "a.tiff"}) {
    const CommandResult result = detect(path(name));
    ASSERT_EQ(result.status, 0) << result.errors;
    EXPECT_EQ(json::parse(result.output)["markers"], expected["markers"]) << name;
  }
}

TEST_F(DetectVerb, WritesTablesThatHoldWhatTheLinesHold) {
  write_frames("pictures", 2);
  write_file(folder_ / "pictures" / "z, \"quoted\".pgm", pgm(frame(0, /*with_marker=*/false)));
  const CommandResult result =
      detect(path("pictures") + " --output " + path("out.jsonl") + " --csv " + path("out.csv"));
  ASSERT_EQ(result.status, 0) << result.errors;
  EXPECT_EQ(result.output, "");
  const std::vector<json> lines = json_lines(read_file(folder_ / "out.jsonl"));
  std::size_t markers = 0, poses = 0;
  for (const json& line : lines) {
    markers += line["markers"].size();
    poses += line["poses"].size();
  }
  const std::string csv = read_file(folder_ / "out.csv");
  const std::vector<std::string> rows = lines_of(csv);
  const auto count = [&](const std::string& record) {
    return static_cast<std::size_t>(
        std::count_if(rows.begin(), rows.end(),
                      [&](const std::string& row) { return contains(row, "," + record + ","); }));
  };
  EXPECT_EQ(rows[0].rfind("frame,source,timestamp_s,width,height,record,parent,", 0), 0U);
  EXPECT_EQ(count("marker"), markers);
  EXPECT_EQ(count("pose"), poses);
  EXPECT_EQ(count("none"), 1U);
  EXPECT_EQ(rows.size(), 1 + markers + poses + 1);
  EXPECT_TRUE(contains(csv, "z, \"\"quoted\"\".pgm\",0,320,240,none,")) << csv;
  EXPECT_EQ(detect("--format csv " + path("pictures")).output, csv);
}

TEST_F(DetectVerb, AnnotatesPicturesAndVideosAndReadsThemBack) {
  write_frames("pictures", 3);
  ASSERT_EQ(detect(path("pictures") + " --annotate " + path("seen")).status, 0);
  for (const char* name : {"frame-8.png", "frame-9.png", "frame-10.png"})
    EXPECT_TRUE(fs::exists(folder_ / "seen" / name)) << name;
  // A video of plain frames, found in it again, and annotated as a video of its own.
  ASSERT_EQ(detect("--min-quality 1 --min-side 200 " + path("pictures") + " --annotate " +
                   path("film.avi"))
                .status,
            0);
  const CommandResult result = detect(path("film.avi") + " --annotate " + path("films"));
  ASSERT_EQ(result.status, 0) << result.errors;
  const std::vector<json> lines = json_lines(result.output);
  ASSERT_EQ(lines.size(), 3U);
  EXPECT_EQ(lines[1]["source"], (folder_ / "film.avi").string());
  EXPECT_NEAR(lines[2]["timestamp_s"], 2.0 / 30.0, 1e-3);
  for (int i = 0; i < 3; ++i) EXPECT_EQ(lines[static_cast<std::size_t>(i)]["poses"].size(), 1U);
  EXPECT_GT(fs::file_size(folder_ / "films" / "film.mp4"), 1000U);
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_ / "films"), {}), 1);
}

TEST_F(DetectVerb, ExplainsEveryStage) {
  write_file(folder_ / "a.pgm", pgm(frame(0)));
  ASSERT_EQ(detect(path("a.pgm") + " --explain " + path("why")).status, 0);
  const fs::path own = folder_ / "why" / "000000-a";
  for (const char* name : {"1-binary-1.png", "2-contours.png", "3-candidates.png",
                           "4-detections.png", "candidates.txt", "candidates.json"})
    EXPECT_TRUE(fs::exists(own / name)) << name;
  const json list = json::parse(read_file(own / "candidates.json"));
  const auto accepted =
      std::count_if(list["candidates"].begin(), list["candidates"].end(),
                    [](const json& candidate) { return candidate["fate"] == "accepted"; });
  EXPECT_GE(accepted, 1);
  EXPECT_LT(accepted, static_cast<std::ptrdiff_t>(list["candidates"].size()));
  EXPECT_EQ(lines_of(read_file(own / "candidates.txt")).size(), list["candidates"].size() + 1);
}

TEST_F(DetectVerb, RefusesGravityWithoutDirectionOrSigma) {
  write_file(folder_ / "near.pgm", pgm(frame(0)));
  EXPECT_EQ(detect("--gravity 0,0.2,0.98 " + path("near.pgm")).status, 0);
  EXPECT_EQ(detect("--gravity 0,1,0,2 --mount wall " + path("near.pgm")).status, 0);
  expect_refused("--gravity 0,0,0 " + path("near.pgm"), "--gravity");
  expect_refused("--gravity 0,0,1,-2 " + path("near.pgm"), "--gravity");
}

TEST_F(DetectVerb, TracksThroughTime) {
  // The same place in every frame: the low-pass must leave it there, and carry no covariance.
  for (int i = 0; i < 3; ++i)
    write_file(folder_ / ("still-" + std::to_string(i) + ".pgm"), pgm(frame(0)));
  const std::string stills =
      path("still-0.pgm") + " " + path("still-1.pgm") + " " + path("still-2.pgm");
  const CommandResult paper = detect("--track --fusion paper " + stills);
  ASSERT_EQ(paper.status, 0) << paper.errors;
  const std::vector<json> lines = json_lines(paper.output);
  ASSERT_EQ(lines.size(), 3U);
  EXPECT_NEAR(lines[2]["timestamp_s"], 2.0 / 30.0, 1e-12);
  for (const json& line : lines) {
    ASSERT_EQ(line["poses"].size(), 1U);
    EXPECT_TRUE(line["poses"][0]["covariance"].is_null());
    for (std::size_t i = 0; i < 3; ++i)
      EXPECT_NEAR(line["poses"][0]["translation"][i], lines[0]["poses"][0]["translation"][i], 1e-9);
  }
  const CommandResult joint = detect("--track --frame-rate 10 " + stills);
  ASSERT_EQ(joint.status, 0) << joint.errors;
  EXPECT_NEAR(json_lines(joint.output)[2]["timestamp_s"], 0.2, 1e-12);
  EXPECT_FALSE(json_lines(joint.output)[2]["poses"][0]["covariance"].is_null());
}

TEST_F(DetectVerb, TracksHaveVelocityAndCovariance) {
  // Frame i is 0.1 m farther than the one before, ten frames a second; one of them is empty.
  for (int i = 0; i < 8; ++i)
    write_file(folder_ / ("go-" + std::to_string(i) + ".pgm"), pgm(frame(0, i != 6)));
  std::string moving;
  for (int i = 0; i < 8; ++i) moving += path("go-" + std::to_string(i) + ".pgm") + " ";
  const CommandResult result = detect("--track --frame-rate 10 " + moving);
  ASSERT_EQ(result.status, 0) << result.errors;
  const std::vector<json> lines = json_lines(result.output);
  ASSERT_EQ(lines.size(), 8U);
  EXPECT_EQ(lines[0]["tracks"][0]["status"], "searching");
  EXPECT_EQ(lines[5]["tracks"][0]["status"], "tracking");
  EXPECT_TRUE(lines[6]["poses"].empty());
  const json& track = lines[6]["tracks"][0];  // not seen, but foretold
  EXPECT_EQ(track["parent"], 4);
  EXPECT_NEAR(track["measured_s"], 0.5, 1e-9);
  EXPECT_EQ(track["covariance"].size(), 12U);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(track["translation"][i], pose(0).translation()(static_cast<int>(i)), 0.02);
    EXPECT_NEAR(track["velocity"][i], 0.0, 0.1);
  }
  // A tenth of a second without it is too long here.
  const CommandResult lost = detect("--track --coast 0.05 --frame-rate 10 " + moving);
  EXPECT_TRUE(json_lines(lost.output)[6]["tracks"].empty());
  // The paper's filter, chosen for the joint poses.
  const CommandResult paper = detect("--track --filter low-pass " + moving);
  EXPECT_FALSE(json_lines(paper.output)[5].contains("tracks"));
  EXPECT_TRUE(json_lines(paper.output)[5]["poses"][0]["covariance"].is_null());
}

TEST_F(DetectVerb, ARecordPlaysTheSameAgain) {
  const fs::path pictures = write_frames("pictures", 6);
  for (const std::string options : {"--track", "--track --swell 0", "--track --fusion paper", ""}) {
    const CommandResult result =
        detect(options + " --corners-only --record " + path("record.jsonl") + " '" +
               pictures.string() + "' " + path("pictures/frame-8.pgm"));
    ASSERT_EQ(result.status, 0) << result.errors;
    const CommandResult again = run_harco("replay " + path("record.jsonl"));
    EXPECT_EQ(again.status, 0) << again.errors;
    EXPECT_EQ(again.output, result.output) << options;
    const std::vector<json> record = json_lines(read_file(folder_ / "record.jsonl"));
    ASSERT_EQ(record.size(), 8U);
    EXPECT_EQ(record[0]["format"], "harco-record");
    EXPECT_EQ(record[1]["record"]["measured"].size(), 1U);
    EXPECT_GT(record[1]["record"]["detect_ms"], 0.0);
  }
  // Cut off, it ends before; other things are refused.
  const std::string whole = read_file(folder_ / "record.jsonl");
  write_file(folder_ / "cut.jsonl", whole.substr(0, whole.size() - 10));
  EXPECT_EQ(lines_of(run_harco("replay " + path("cut.jsonl")).output).size(), 6U);
  const std::string header = whole.substr(0, whole.find('\n') + 1);
  write_file(folder_ / "odd.jsonl", header + "{}\n");
  for (const auto& [name, what] :
       std::vector<std::pair<std::string, std::string>>{{"missing.jsonl", "can't be opened"},
                                                        {"markers.json", "line 1"},
                                                        {"odd.jsonl", "line 2"},
                                                        {"pictures/frame-8.pgm", "line 1"}}) {
    const CommandResult refused = run_harco("replay " + path(name));
    EXPECT_EQ(refused.status, 2) << name;
    EXPECT_TRUE(contains(refused.errors, what)) << refused.errors;
    EXPECT_EQ(lines_of(refused.errors).size(), 1U);
  }
}

TEST_F(DetectVerb, RecordsVideo) {
  write_frames("pictures", 3);
  ASSERT_EQ(detect(path("pictures") + " --record-video " + path("film.avi")).status, 0);
  EXPECT_EQ(json_lines(detect(path("film.avi")).output).size(), 3U);
}

TEST_F(DetectVerb, CtrlCEndsAStalledPipeAtOnce) {
  ASSERT_EQ(mkfifo((folder_ / "pipe").c_str(), 0600), 0);
  write_file(folder_ / "one.pgm", pgm(frame(0)));
  write_file(folder_ / "script", one_picture_then_silence("one.pgm"));
  const CommandResult result = run_shell("bash -m " + path("script"));
  EXPECT_EQ(result.status, 0) << result.errors;
  EXPECT_EQ(lines_of(read_file(folder_ / "seen.jsonl")).size(), 1U);
}

TEST_F(DetectVerb, AStreamsFirstUnfittingPictureIsToldWhenItComes) {
  ASSERT_EQ(mkfifo((folder_ / "pipe").c_str(), 0600), 0);
  write_file(folder_ / "small.pgm", "P5 2 2 255\nabcd");
  write_file(folder_ / "script", one_picture_then_silence("small.pgm"));
  EXPECT_EQ(run_shell("bash -m " + path("script")).status, 1);
  EXPECT_TRUE(contains(read_file(folder_ / "seen.jsonl"), "320 x 240"));
}

TEST_F(DetectVerb, ReadsAnRtpStreamThatStopsAndComesBack) {
  if (!has_program("gst-launch-1.0")) GTEST_SKIP() << "gst-launch-1.0 is missing";
  ASSERT_EQ(run_shell("gst-inspect-1.0 rtpjpegpay").status, 0);
  write_file(folder_ / "one.pgm", pgm(frame(0)));
  ASSERT_EQ(detect("--annotate " + path("one.png") + " " + path("one.pgm")).status, 0);
  // The first sender is killed in its midst; the second one goes on until it is seen.
  const std::string sender =
      "gst-launch-1.0 -q filesrc location=" + path("one.png") +
      " ! pngdec ! imagefreeze is-live=true ! video/x-raw,framerate=20/1 ! videoconvert ! "
      "video/x-raw,format=I420 ! jpegenc quality=95 ! rtpjpegpay ! "
      "udpsink host=127.0.0.1 port=$PORT & S=$!\n";
  const std::string seen = path("seen.jsonl");
  const auto until_more_than = [&](const std::string& count) {
    return "for i in $(seq 3000); do [ $(cat " + seen + " 2>/dev/null | wc -l) -gt " + count +
           " ] && break; sleep 0.02; done\n";
  };
  write_file(folder_ / "script",
             "PORT=$((20000 + $$ % 20000))\n'" HARCO_COMMAND "' detect --markers " +
                 path("markers.json") + " --camera " + path("camera.yaml") + " --output " + seen +
                 " \"rtp://127.0.0.1:$PORT?encoding=JPEG\" & P=$!\n" + sender +
                 until_more_than("5") + "kill -KILL $S; N=$(wc -l < " + seen + ")\n" + sender +
                 until_more_than("$((N + 5))") + "kill $S; kill -INT $P; wait $P\n");
  const CommandResult result = run_shell("bash -m " + path("script"));
  EXPECT_EQ(result.status, 0) << result.errors;
  const std::vector<json> lines = json_lines(read_file(folder_ / "seen.jsonl"));
  ASSERT_GT(lines.size(), 10U);
  double before = 0.0;
  for (const json& line : lines) {
    EXPECT_GT(line["timestamp_s"], before);  // when they were taken
    before = line["timestamp_s"];
    EXPECT_EQ(line["size"], (json{320, 240}));
    ASSERT_EQ(line["poses"].size(), 1U);
    EXPECT_NEAR(line["poses"][0]["translation"][2], pose(0).translation().z(), 0.02);
  }
}

TEST(Start, NeedsNoVideoLibraries) {
  // What starts slowly is loaded when it is needed; the rest starts in some milliseconds.
  const CommandResult libraries = run_shell("ldd '" HARCO_COMMAND "'");
  ASSERT_EQ(libraries.status, 0);
  for (const char* slow : {"opencv", "gst", "glib", "avcodec"})
    EXPECT_FALSE(contains(libraries.output, slow)) << slow;
  EXPECT_LT(lines_of(libraries.output).size(), 25U) << libraries.output;
}

// --- Wrong input --------------------------------------------------------------------------------

TEST_F(DetectVerb, AnUnreadablePictureAmongManyHasItsLine) {
  write_file(folder_ / "a.pgm", pgm(frame(0)));
  write_file(folder_ / "bad.png", "\x89PNG\r\n\x1a\nnothing");
  write_file(folder_ / "small.pgm", "P5 2 2 255\nabcd");
  for (const std::string order : {"bad.png", "a.pgm"}) {
    const std::string other = order == "bad.png" ? "a.pgm" : "bad.png";
    const CommandResult result = detect(path(order) + " " + path(other) + " " + path("small.pgm") +
                                        " --output " + path("out.jsonl"));
    EXPECT_EQ(result.status, 1);
    EXPECT_EQ(lines_of(result.errors).size(), 2U) << result.errors;
    const std::vector<json> lines = json_lines(read_file(folder_ / "out.jsonl"));
    ASSERT_EQ(lines.size(), 3U);
    const json& bad = lines[order == "bad.png" ? 0 : 1];
    const json& good = lines[order == "bad.png" ? 1 : 0];
    EXPECT_TRUE(contains(bad["error"], "bad.png"));
    EXPECT_TRUE(bad["size"].is_null());
    EXPECT_EQ(bad["markers"], json::array());
    EXPECT_EQ(good["poses"].size(), 1U);
    // Another size than the camera's: both are named.
    EXPECT_TRUE(contains(lines[2]["error"], "2 x 2")) << lines[2];
    EXPECT_TRUE(contains(lines[2]["error"], "320 x 240"));
  }
}

TEST_F(DetectVerb, RefusesSourcesThatGiveNothing) {
  fs::create_directories(folder_ / "empty");
  write_file(folder_ / "zero.png", "");
  write_file(folder_ / "text.jpg", "no picture");
  write_file(folder_ / "text.mp4", "no video");
  write_file(folder_ / "cut.jpg", std::string("\xff\xd8\xff\xe0\0\x10JFIF", 10));
  const std::string out = " --output " + path("out.jsonl") + " --csv " + path("out.csv");
  expect_refused(path("missing.png") + out, "missing.png: there is no such file");
  expect_refused(path("empty") + out, "empty: is a folder without pictures");
  expect_refused(path("zero.png") + out, "zero.png: is empty");
  expect_refused(path("text.jpg") + out, "text.jpg: can't be read as a picture");
  expect_refused(path("cut.jpg") + out, "cut.jpg: is cut short");
  expect_refused(path("text.mp4") + out, "text.mp4: is neither a picture nor a video");
  expect_refused("'pgm:" + (folder_ / "missing").string() + "'" + out, "missing: there is no such");
  expect_refused("'pgm:" + (folder_ / "empty").string() + "'" + out, "is a folder");
  expect_refused("camera:nowhere" + out, "camera nowhere: can't be opened");
  expect_refused("pgm:- " + out + " < /dev/null", "pgm:-: has no frames");
  for (const char* name : {"out.jsonl", "out.jsonl.part", "out.csv", "out.csv.part"})
    EXPECT_FALSE(fs::exists(folder_ / name)) << name;
}

TEST_F(DetectVerb, RefusesAVideoWithoutFrames) {
  write_frames("pictures", 2);
  ASSERT_EQ(detect(path("pictures") + " --annotate " + path("film.avi")).status, 0);
  const std::string film = read_file(folder_ / "film.avi");
  // Up to the list of frames and no further.
  const std::size_t frames = film.find("movi");
  ASSERT_NE(frames, std::string::npos);
  write_file(folder_ / "film.avi", film.substr(0, frames + 4));
  expect_refused(path("film.avi"), "film.avi: ");
}

TEST_F(DetectVerb, RefusesDamagedPgm) {
  const std::vector<std::pair<std::string, std::string>> cases{
      {"P6 2 2 255\nabcdabcdabcd", "no binary PGM"},
      {"P2 2 2 255\n1 2 3 4", "no binary PGM"},
      {"P5 2 2 65535\nabcdabcd", "more than 8 bits"},
      {"P5 2 2 255\nabc", "in the middle of an image"},
      {"P5 2", "in the middle of a header"},
      {"P5 # comment without end", "in the middle of a header"},
      {"P5 0 2 255\n", "width"},
      {"P5 2 -2 255\nabcd", "height"},
      {"P5 2 x 255\nabcd", "height"},
      {"P5 99999999999999999999 2 255\nabcd", "width"},
      {"P5 65535 65535 255\nabcd", "too large"},
      {"P5 2 2 0\nabcd", "grey levels"},
      {"P5 2 2 255abcd", "white space"},
      {"P5 # timestamp_s soon\n2 2 255\nabcd", "timestamp_s"},
      {"P5 # timestamp_s nan\n2 2 255\nabcd", "timestamp_s"},
  };
  for (const auto& [content, what] : cases) {
    write_file(folder_ / "x.pgm", content);
    expect_refused("'pgm:" + (folder_ / "x.pgm").string() + "'", what);
  }
}

TEST_F(DetectVerb, AStreamThatBreaksKeepsWhatItHad) {
  write_file(folder_ / "x.pgm", pgm(frame(0)) + pgm(frame(1)).substr(0, 5000));
  const CommandResult result = detect("'pgm:" + (folder_ / "x.pgm").string() + "'");
  EXPECT_EQ(result.status, 1);
  const std::vector<json> lines = json_lines(result.output);
  ASSERT_EQ(lines.size(), 2U);
  expect_pose(lines[0], 0);
  EXPECT_TRUE(contains(lines[1]["error"], "in the middle of an image"));
}

TEST_F(DetectVerb, SurvivesNoiseInEveryFormat) {
  // Good files with bytes changed, cut and repeated: any answer, but no crash and no second line.
  std::mt19937_64 random(3);
  write_file(folder_ / "a.pgm", pgm(frame(0)));
  ASSERT_EQ(detect(path("a.pgm") + " --annotate " + path("a.png")).status, 0);
  for (const std::string ending : {".pgm", ".png"}) {
    const std::string good = read_file(folder_ / ("a" + ending));
    for (int trial = 0; trial < 12; ++trial) {
      std::string bad = good;
      for (int i = 0; i < 1 + trial; ++i)
        bad[random() % std::min<std::size_t>(bad.size(), trial % 2 == 0 ? 64 : bad.size())] =
            static_cast<char>(random());
      if (trial % 3 == 0) bad.resize(random() % bad.size());
      write_file(folder_ / ("bad" + ending), bad);
      const CommandResult result = detect(path("bad" + ending));
      EXPECT_TRUE(result.status == 0 || result.status == 2) << result.status;
      EXPECT_EQ(lines_of(result.errors).size(), result.status == 0 ? 0U : 1U) << result.errors;
    }
  }
}

TEST_F(DetectVerb, RefusesWhatCantBeWritten) {
  write_frames("pictures", 2);
  const std::string pictures = path("pictures");
  expect_refused(pictures + " --output " + path("no/such/folder"), "can't be written");
  fs::create_directories(folder_ / "other");
  expect_refused(pictures + " --output " + path("other"), "can't be written");
  expect_refused(pictures + " --output /dev/full", "can't be written");
  expect_refused(pictures + " --csv " + path("no/such/folder"), "can't be written");
  expect_refused(pictures + " --annotate " + path("markers.json/x"), "can't be made");
  expect_refused(pictures + " --annotate " + path("no/film.mp4"), "no folder");
  expect_refused(pictures + " --annotate " + path("one.png"), "several frames");
  EXPECT_FALSE(fs::exists(folder_ / "one.png"));
}

TEST_F(DetectVerb, RefusesWrongOptionsAndFiles) {
  write_file(folder_ / "a.pgm", pgm(frame(0)));
  const std::string a = path("a.pgm");
  expect_refused(a + " --min-side -1", "min_side");
  expect_refused(a + " --min-quality nan", "min_quality");
  expect_refused(a + " --kappa 2", "min_quality");
  expect_refused(a + " --max-bit-errors -1", "max_bit_errors");
  expect_refused(a + " --fusion best", "--fusion");
  expect_refused(a + " --format xml", "--format");
  expect_refused(a + " --jobs 0", "--jobs");
  expect_refused(a + " --track --memory 3 3", "--memory");
  expect_refused(a + " --track --memory 3 3 0", "memory");
  expect_refused(a + " --track --time-constant -1", "--time-constant");
  expect_refused(a + " --track --time-constant nan", "--time-constant");
  expect_refused(a + " --frame-rate nan", "--frame-rate");
  expect_refused(a + " --track --swell nan", "--swell");
  expect_refused(a + " --output " + a, "a.pgm: is the output and a source as well");
  expect_refused(a + " --csv " + path("markers.json"), "markers.json: is the table");
  expect_refused("'pgm:" + (folder_ / "a.pgm").string() + "' --record " + path("./a.pgm"),
                 "is the record and a source");
  expect_refused(a + " --output " + path("x") + " --csv " + path("x"), "and the output as well");
  expect_refused(a + " --csv -", "-: is the table");
  expect_refused("", "SOURCE");
  expect_refused(a + " --unknown", "--unknown");

  write_file(folder_ / "newer.json", R"({"format": "harco-markers", "version": 2, "parents": []})");
  for (const auto& [arguments, what] : std::vector<std::pair<std::string, std::string>>{
           {"--markers " + path("newer.json"), "newer.json"},
           {"--markers " + path("missing.json"), "missing.json"},
           {"--markers " + path("a.pgm"), "a.pgm"},
           {"--markers " + path("markers.json") + " --camera " + path("missing.yaml"),
            "missing.yaml"},
           {"--markers " + path("markers.json") + " --camera " + path("a.pgm"), "a.pgm"}}) {
    const CommandResult result = run_harco("detect " + a + " " + arguments);
    EXPECT_EQ(result.status, 2) << arguments;
    EXPECT_EQ(lines_of(result.errors).size(), 1U) << result.errors;
    EXPECT_TRUE(contains(result.errors, what)) << result.errors;
  }
}

}  // namespace
}  // namespace harco::test
