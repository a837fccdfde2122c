// harco simulate: pictures of a described scene or flight, and what they show.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "harco/camera.hpp"
#include "harco/error.hpp"
#include "interrupt.hpp"
#include "lab/scene_file.hpp"
#include "lab_module.hpp"
#include "media.hpp"
#include "output_stream.hpp"
#include "picture_file.hpp"
#include "png_file.hpp"
#include "progress.hpp"
#include "results.hpp"
#include "staged_folder.hpp"
#include "verbs.hpp"
#include "write_file.hpp"

namespace harco::cli {
namespace {

namespace fs = std::filesystem;

struct SimulateOptions {
  fs::path scene;
  std::string out;
  std::string truth;
  int frames = 0;
};

/// Where pictures go.
class FrameWriter {
 public:
  FrameWriter() = default;
  virtual ~FrameWriter() = default;
  FrameWriter(const FrameWriter&) = delete;
  FrameWriter& operator=(const FrameWriter&) = delete;

  virtual std::string write(const lab::SimulatedFrame& frame) = 0;  ///< what truth calls it
  virtual void truth(const std::string& line) { lines_ += line; }
  virtual void finish() {}

 protected:
  std::string lines_;
};

/// PNG files, the truth and the camera beside them; all of them appear at the end.
class FolderWriter final : public FrameWriter {
 public:
  FolderWriter(const fs::path& folder, const Camera& camera) : folder_(folder), staged_(folder) {
    write_file(staged_.file("camera.yaml"), format_camera(camera));
  }
  std::string write(const lab::SimulatedFrame& frame) override {
    const std::string name = fmt::format("frame-{:06}.png", frame.number);
    write_png(frame.image.view(), staged_.file(name));
    return (folder_ / name).string();
  }
  void finish() override {
    write_file(staged_.file("truth.jsonl"), lines_);
    staged_.commit();
  }

 private:
  fs::path folder_;
  StagedFolder staged_;
};

/// Binary PGM pictures, one after the other, each with its time: what `harco detect pgm:-` reads.
class PgmWriter final : public FrameWriter {
 public:
  explicit PgmWriter(const std::string& path)
      : name_(path), file_(path == "-" ? stdout : std::fopen(path.c_str(), "wb")) {
    if (file_ == nullptr) throw Error(path + ": can't be written");
  }
  ~PgmWriter() override {
    if (file_ != stdout) std::fclose(file_);
  }
  PgmWriter(const PgmWriter&) = delete;
  PgmWriter& operator=(const PgmWriter&) = delete;

  std::string write(const lab::SimulatedFrame& frame) override {
    const Image& image = frame.image;
    const std::string head = fmt::format("P5\n# timestamp_s {:.9f}\n{} {}\n255\n", frame.time_s,
                                         image.width, image.height);
    if (std::fwrite(head.data(), 1, head.size(), file_) != head.size() ||
        std::fwrite(image.pixels.data(), 1, image.pixels.size(), file_) != image.pixels.size() ||
        std::fflush(file_) != 0)
      throw Error(name_ + ": can't be written");
    return "pgm:" + name_;
  }

 private:
  std::string name_;
  std::FILE* file_;
};

class FilmWriter final : public FrameWriter {
 public:
  FilmWriter(std::string file, const lab::SceneDescription& scene)
      : name_(std::move(file)),
        video_(media().create_video(name_, scene.camera.width, scene.camera.height,
                                    scene.frame_rate)) {}
  std::string write(const lab::SimulatedFrame& frame) override {
    video_->write(to_colour(frame.image));
    return name_;
  }

 private:
  std::string name_;
  std::unique_ptr<VideoWriter> video_;
};

std::unique_ptr<FrameWriter> open_output(const std::string& out,
                                         const lab::SceneDescription& scene) {
  constexpr const char* kPgm = "pgm:";
  if (out.rfind(kPgm, 0) == 0) return std::make_unique<PgmWriter>(out.substr(4));
  const std::string ending = fs::path(out).extension().string();
  for (const char* video : {".mp4", ".m4v", ".mov", ".mkv", ".avi"})
    if (ending == video) return std::make_unique<FilmWriter>(out, scene);
  return std::make_unique<FolderWriter>(out, scene.camera);
}

/// What the picture shows, in the form in which `harco detect` says what it found: poses, and the
/// markers that are whole in the picture and not tiny.
FrameResult truth_of(const lab::SimulatedFrame& frame, const lab::SceneDescription& scene,
                     const std::vector<PlacedMarker>& placed) {
  constexpr double kSmallest_px = 8.0;
  FrameResult truth;
  truth.frame = static_cast<std::size_t>(frame.number);
  truth.timestamp_s = frame.time_s;
  truth.width = scene.camera.width;
  truth.height = scene.camera.height;
  const auto& poses = frame.camera_T_marker;
  for (std::size_t i = 0; i < placed.size(); ++i) {
    const auto parent = static_cast<std::size_t>(placed[i].parent_index);
    if (parent >= poses.size()) continue;
    Detection marker;
    marker.parent = scene.markers.parents[parent].marker.id;
    marker.layer = placed[i].layer;
    marker.id = placed[i].id;
    marker.placed = static_cast<int>(i);
    marker.quality = 1.0;
    bool whole = (poses[parent].inverse().translation()).z() < 0.0;
    const auto corners = placed[i].corners_m();
    for (std::size_t k = 0; k < 4 && whole; ++k) {
      const auto pixel = scene.camera.project(poses[parent] *
                                              Eigen::Vector3d(corners[k].x(), corners[k].y(), 0.0));
      whole = pixel && pixel->x() >= 0.0 && pixel->y() >= 0.0 &&
              pixel->x() <= scene.camera.width - 1.0 && pixel->y() <= scene.camera.height - 1.0;
      if (whole) marker.corners[k] = *pixel;
    }
    for (std::size_t k = 0; k < 4 && whole; ++k)
      whole = (marker.corners[k] - marker.corners[(k + 1) % 4]).norm() >= kSmallest_px;
    if (whole) truth.detections.push_back(marker);
  }
  for (std::size_t i = 0; i < poses.size(); ++i) {
    Pose pose;
    pose.parent = scene.markers.parents[i].marker.id;
    pose.camera_T_marker = poses[i];
    truth.poses.push_back(pose);
  }
  return truth;
}

void run(const SimulateOptions& options) {
  const auto load_picture = [](const fs::path& file) {
    return read_picture(file, false).picture.grey;
  };
  lab::SceneDescription scene;
  lab_function<void(const fs::path&, const lab::PictureLoader&, lab::SceneDescription&)>(
      "harco_lab_load_scene")(options.scene, load_picture, scene);
  if (options.frames > 0) scene.frames = options.frames;
  const std::vector<PlacedMarker> placed = place(scene.markers);
  std::optional<OutputStream> truth;
  if (!options.truth.empty()) truth.emplace(options.truth);
  const std::unique_ptr<FrameWriter> writer = open_output(options.out, scene);

  const InterruptGuard interrupt;
  ProgressBar bar("simulate");
  const lab::FrameSink sink = [&](const lab::SimulatedFrame& frame) {
    FrameResult shown = truth_of(frame, scene, placed);
    shown.source = writer->write(frame);
    const std::string line = json_line(shown);
    writer->truth(line);
    if (truth) truth->write(line);
    if (!scene.flight) bar.show((frame.number + 1.0) / scene.frames);
    const bool enough = options.frames > 0 && frame.number + 1 >= options.frames;
    return !enough && !interrupt.interrupted();
  };
  lab_function<void(const lab::SceneDescription&, const lab::FrameSink&)>("harco_lab_simulate")(
      scene, sink);
  writer->finish();
  if (truth) truth->commit();
}

}  // namespace

void add_simulate(CLI::App& app) {
  auto options = std::make_shared<SimulateOptions>();
  CLI::App* verb = app.add_subcommand(
      "simulate", "render a described scene or flight, with what the pictures show");
  verb->add_option("scene", options->scene, "description: YAML or JSON, see docs/simulation.md")
      ->required();
  verb->add_option("--out", options->out,
                   "folder for PNG files, camera.yaml and truth.jsonl; a video (mp4, mkv, avi); or "
                   "pgm:- and pgm:PATH, a stream for `harco detect pgm:-`")
      ->required();
  verb->add_option("--truth", options->truth,
                   "file for what the pictures show, as JSON lines like those of `harco detect`");
  verb->add_option("--frames", options->frames, "at most so many pictures")
      ->check(CLI::PositiveNumber);
  verb->callback([options] { run(*options); });
}

}  // namespace harco::cli
