// harco mount: is the camera mounted as its mount file says?
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "annotate.hpp"
#include "frames.hpp"
#include "harco/detect.hpp"
#include "harco/error.hpp"
#include "harco/mount.hpp"
#include "interrupt.hpp"
#include "mount_check.hpp"
#include "overlay.hpp"
#include "verbs.hpp"

namespace harco::cli {
namespace {

constexpr int kSomeFailed = 1;

struct MountOptions {
  std::string mount_file, camera_file, markers_file, annotate;
  std::vector<std::string> sources;
};

void append(Overlay more, Overlay& overlay) {
  std::move(more.strokes.begin(), more.strokes.end(), std::back_inserter(overlay.strokes));
  std::move(more.labels.begin(), more.labels.end(), std::back_inserter(overlay.labels));
}

/// Loads the frame's picture. Throws Error if that fails or it isn't one of the camera's.
void read(Frame& frame, const Camera& camera, bool colour) {
  load(frame, colour);
  if (!frame.error.empty()) throw Error(frame.error);
  const Image& image = frame.picture.grey;
  if (image.width != camera.width || image.height != camera.height)
    throw Error(fmt::format("{}: is {} x {} pixels, but the camera has {} x {}", frame.source,
                            image.width, image.height, camera.width, camera.height));
}

/// Says where markers are, and draws all over the frame.
void show(const Frame& frame, const Mount& mount, const Camera& camera, Detector* detector,
          Annotations* annotations) {
  Overlay overlay = mount_overlay(mount, camera);
  if (detector != nullptr) {
    const ImageView image = frame.picture.grey.view();
    const auto detections = detector->detect(image);
    for (const Pose& pose : estimate_poses(image, detections, detector->markers(), camera))
      fmt::print("{}: {}\n", frame.source, place_text(pose, detector->markers(), mount));
    append(overlay_of_detections(detections), overlay);
  }
  if (annotations == nullptr) return;
  ColourImage picture = frame.picture.colour;
  media().draw(overlay, picture);
  annotations->add(frame, picture);
}

void run(const MountOptions& options) {
  const Mount mount = load_mount(options.mount_file);
  if (options.sources.empty()) {
    if (!options.annotate.empty() || !options.markers_file.empty())
      throw Error("mount: --annotate and --markers need a SOURCE");
    fmt::print("{}", mount_text(mount));
    return;
  }
  if (options.camera_file.empty()) throw Error("mount: a SOURCE needs --camera");
  if (options.annotate.empty() && options.markers_file.empty())
    throw Error("mount: a SOURCE needs --annotate, --markers or both");
  const Camera camera = load_camera(options.camera_file);
  std::optional<Detector> detector;
  if (!options.markers_file.empty()) detector.emplace(load_markers(options.markers_file), camera);
  const InterruptGuard interrupt;
  Frames frames(options.sources, {0.0, /*colour=*/!options.annotate.empty()}, interrupt.signal());
  std::optional<Annotations> annotations;
  if (!options.annotate.empty())
    annotations.emplace(options.annotate, frames.count() == std::size_t{1});

  bool described = false;
  int failed = 0;
  while (!interrupt.interrupted()) {
    std::optional<Frame> frame = frames.next();
    if (!frame) break;
    try {
      read(*frame, camera, annotations.has_value());
    } catch (const Error& error) {
      if (frames.count() == std::size_t{1}) throw;
      fmt::print(stderr, "harco: {}\n", error.what());
      ++failed;
      continue;
    }
    if (!described) fmt::print("{}", mount_text(mount));
    described = true;
    show(*frame, mount, camera, detector ? &*detector : nullptr,
         annotations ? &*annotations : nullptr);
  }
  if (annotations) annotations->commit();
  if (failed > 0) throw ExitStatus{kSomeFailed};
}

constexpr const char* kFooter = R"(Examples:
  harco mount --mount mount.yaml
  harco mount --mount mount.yaml --camera camera.yaml --annotate seen.png photo.jpg
  harco mount --mount mount.yaml --camera camera.yaml --markers deck/markers.json photo.jpg

Put something before the vehicle's nose and take a picture: the red arrow has to point to it.)";

}  // namespace

void add_mount(CLI::App& app) {
  const auto options = std::make_shared<MountOptions>();
  CLI::App& verb =
      *app.add_subcommand("mount", "Show how a camera is mounted, in words and over its pictures");
  verb.footer(kFooter);
  verb.add_option("--mount", options->mount_file, "How the camera sits on the vehicle (YAML)")
      ->required()
      ->type_name("FILE");
  verb.add_option("--camera", options->camera_file,
                  "The camera's calibration (YAML), needed for pictures")
      ->type_name("FILE");
  verb.add_option("--markers", options->markers_file,
                  "Say where these markers are, seen from the vehicle (markers.json)")
      ->type_name("FILE");
  verb.add_option("--annotate", options->annotate,
                  "Draw the vehicle's axes, its horizon and its nose: into a folder or one file")
      ->type_name("FOLDER|FILE");
  verb.add_option("SOURCE", options->sources,
                  "Pictures, folders of pictures, videos, camera:0, /dev/video0 or pgm:PATH");
  verb.callback([options] { run(*options); });
}

}  // namespace harco::cli
