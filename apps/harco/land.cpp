// harco land: a camera, a printed marker and an autopilot become a precise landing.
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "deck_watch.hpp"
#include "frame_clock.hpp"
#include "harco/camera.hpp"
#include "harco/detect.hpp"
#include "harco/error.hpp"
#include "harco/guided.hpp"
#include "harco/mount.hpp"
#include "harco/pose.hpp"
#include "harco/pose_estimator.hpp"
#include "harco/sighting.hpp"
#include "interrupt.hpp"
#include "land_deck.hpp"
#include "land_link.hpp"
#include "land_report.hpp"
#include "live_source.hpp"
#include "message_json.hpp"
#include "stop_signal.hpp"
#include "target_teller.hpp"
#include "verbs.hpp"

namespace harco::cli {
namespace {

constexpr double kDegree = 0.017453292519943295;
/// Where corners alone tell the pad's place so well, standard deviation in metres, its picture
/// isn't aligned: close by, where it would take long.
constexpr double kWellEnough = 0.005;

struct LandOptions {
  std::string source, markers_file, camera_file, mount_file;
  std::string autopilot = "ardupilot";
  std::string connect;

  std::optional<int> parent;
  std::vector<double> target;
  bool angles_only = false;
  bool relative = false;
  double rate_hz = 50.0;
  std::string signing_file;
  int system = 0;

  std::string stamps = "auto";
  double latency_ms = 0.0;
  double max_age_s = 0.5;
  double coast_s = 2.5;
  int threads = static_cast<int>(std::clamp(std::thread::hardware_concurrency(), 1U, 2U));

  bool deck = false;
  bool command = false;
  double level_deg = 3.0;
  double land_speed_mps = 0.5;
  double standing_height_m = 0.2;

  bool dry_run = false;
  std::string record;
};

Autopilot autopilot_of(const LandOptions& options) {
  return options.autopilot == "px4" ? Autopilot::px4 : Autopilot::ardupilot;
}

StampClock stamps_of(const std::string& name) {
  if (name == "monotonic") return StampClock::monotonic;
  if (name == "unix") return StampClock::unix_time;
  if (name == "autopilot") return StampClock::autopilot;
  if (name == "own") return StampClock::own;
  return StampClock::automatic;
}

/// The pass phrase is a file's first line.
mavlink::SigningKey signing_key(const std::string& file) {
  std::FILE* stream = std::fopen(file.c_str(), "rb");
  if (stream == nullptr) throw Error(file + ": can't be opened");
  std::string phrase;
  for (int c = std::getc(stream); c != EOF && c != '\n' && c != '\r'; c = std::getc(stream))
    phrase.push_back(static_cast<char>(c));
  std::fclose(stream);
  if (phrase.empty()) throw Error(file + ": its first line, the pass phrase, is empty");
  return mavlink::SigningKey::from_pass_phrase(phrase);
}

const Parent& parent_of(const LandOptions& options, const MarkerSet& markers) {
  if (!options.parent) return markers.parents.front();
  for (const Parent& parent : markers.parents)
    if (parent.marker.id == *options.parent) return parent;
  throw Error(fmt::format("{}: has no layer-1 marker {}", options.markers_file, *options.parent));
}

TargetOptions target_options(const LandOptions& options, const Parent& parent, const Mount& mount) {
  TargetOptions target;
  target.mount = mount;
  target.parent = parent.marker.id;
  target.side_m = parent.side_m;
  target.point = Eigen::Vector3d(0.5 * parent.side_m, 0.5 * parent.side_m, 0.0);
  if (!options.target.empty())
    target.point = Eigen::Vector3d(options.target[0], options.target[1], 0.0);
  target.autopilot = autopilot_of(options);
  target.angles_only = options.angles_only;
  target.relative = options.relative;
  target.coast_s = options.coast_s;
  return target;
}

DetectorOptions detector_options(const Camera& camera, int threads, bool covered) {
  DetectorOptions options;
  options.covered = covered;
  options.threads = threads;
  options.camera = camera;
  return options;
}

/// Frames to what is told of them.
class Lander {
 public:
  explicit Lander(const LandOptions& options)
      : options_(options),
        markers_(load_markers(options.markers_file)),
        camera_(load_camera(options.camera_file)),
        mount_(options.mount_file.empty() ? Mount() : load_mount(options.mount_file)),
        target_(target_options(options, parent_of(options, markers_), mount_)),
        detector_(markers_, detector_options(camera_, options.threads, false)),
        thorough_(markers_, detector_options(camera_, options.threads, true)),
        estimator_(markers_),
        teller_(target_),
        clock_({stamps_of(options.stamps), 1e-3 * options.latency_ms}),
        log_(options.dry_run, options.record, target_),
        link_(open_link(), link_options(),
              [this](const mavlink::Message& message, double now_s,
                     std::optional<double> captured_s) { note_sent(message, now_s, captured_s); }) {
    if (options.deck) start_deck();
  }

  void run() {
    const InterruptGuard interrupt;
    LiveSource source(options_.source, source_options());
    Frame frame;
    while (source.wait(frame, interrupt.signal())) look_at(frame);
    if (const std::string why = source.error(); !why.empty()) {
      if (frames_ == 0) throw Error(why);
      status_.tell(why);
    }
    deck_.reset();
    link_.stop();
    log_.commit();
    summarise();
  }

 private:
  std::optional<mavlink::Link> open_link() const {
    if (options_.connect.empty()) return std::nullopt;
    mavlink::LinkOptions link;
    if (!options_.signing_file.empty()) link.key = signing_key(options_.signing_file);
    return mavlink::Link(options_.connect, link);
  }

  LandLinkOptions link_options() const {
    LandLinkOptions link;
    link.vehicle.autopilot = autopilot_of(options_);
    link.vehicle.system = static_cast<std::uint8_t>(options_.system);
    link.rate_hz = options_.rate_hz;
    link.max_age_s = options_.max_age_s;
    link.only_listen = options_.dry_run;
    if (options_.connect.empty()) {  // nobody waits: how fast this machine is doesn't matter
      link.rate_hz = 0.0;
      link.max_age_s = std::numeric_limits<double>::infinity();
    }
    return link;
  }

  LiveOptions source_options() {
    LiveOptions live;
    // Who looks at a recording wants to see all of it.
    live.drop = !options_.dry_run;
    live.tell = [this](const std::string& line) { status_.tell(line); };
    return live;
  }

  void start_deck() {
    LandingOrderOptions order;
    order.level.roll_rad = order.level.pitch_rad = options_.level_deg * kDegree;
    order.speed_mps = options_.land_speed_mps;
    make_sample_ = deck_function<MakeDeckSample>("harco_deck_sample");
    deck_ = std::make_unique<LandDeck>(
        order, options_.command, link_,
        [this](const DeckView& view) { log_.add_line(json_line(view)); });
  }

  void look_at(Frame& frame) {
    load(frame, /*colour=*/false);
    ++frames_;
    if (!frame.error.empty()) return status_.tell(frame.error);
    const ImageView image = frame.picture.grey.view();
    if (image.width() != camera_.width || image.height() != camera_.height)
      throw Error(fmt::format("{}: is {} x {} pixels, but the camera of {} has {} x {}",
                              options_.source, image.width(), image.height(), options_.camera_file,
                              camera_.width, camera_.height));
    const auto captured_s =
        clock_.captured_s(frame, [this](double remote_s) { return link_.ours(remote_s); });

    FrameRecord seen;
    seen.vehicle = vehicle_at(frame, captured_s);
    seen.timing.captured_s = captured_s;
    seen.timing.received_s = frame.received_s;
    FrameResult& result = seen.result;
    result.frame = frames_ - 1;
    result.source = options_.source;
    result.timestamp_s = frame.timestamp_s;
    result.dropped = frame.dropped;
    result.width = image.width();
    result.height = image.height();
    const double start_s = monotonic_s();
    result.detections = detector_.detect(image, teller_.tracks(frame.timestamp_s));
    if (!shows_pad(result.detections)) result.detections = thorough_.detect(image);
    const double detected_s = monotonic_s();
    result.poses = poses(image, result.detections, pose_options(seen.vehicle));
    const double posed_s = monotonic_s();
    const Target& target = seen.target.emplace(
        teller_.take({frame.timestamp_s, captured_s, seen.vehicle, result.poses}));
    tell(target, seen);
    seen.timing.done_s = monotonic_s();
    seen.timing.detect_ms = 1e3 * (detected_s - start_s);
    seen.timing.pose_ms = 1e3 * (posed_s - detected_s);
    latency_.add(seen.timing.done_s -
                 (clock_.absolute() && captured_s ? *captured_s : frame.received_s));
    if (!options_.record.empty()) log_.add(seen);
    show(view_of(seen));
  }

  bool shows_pad(const std::vector<Detection>& detections) const {
    return std::any_of(detections.begin(), detections.end(), [this](const Detection& detection) {
      return detection.parent == target_.parent;
    });
  }

  std::optional<VehiclePose> vehicle_at(const Frame& frame,
                                        const std::optional<double>& captured_s) const {
    if (frame.timed && stamps_of(options_.stamps) == StampClock::autopilot)
      return link_.vehicle_pose_by_its_clock(frame.timestamp_s);
    return captured_s ? link_.vehicle_pose(*captured_s) : std::nullopt;
  }

  /// A pad lies flat: the vehicle's own attitude tells a small marker's two solutions apart.
  PoseOptions pose_options(const std::optional<VehiclePose>& vehicle) const {
    PoseOptions options;
    if (!vehicle) return options;
    GravityPrior gravity;
    gravity.in_camera = (vehicle->ned_R_body * mount_.body_T_camera.linear()).transpose() *
                        Eigen::Vector3d::UnitZ();
    gravity.sigma_rad = options_.deck ? 0.2 : 0.1;
    options.gravity = gravity;
    return options;
  }

  std::vector<Pose> poses(const ImageView& image, const std::vector<Detection>& detections,
                          PoseOptions options) {
    options.align = false;
    std::vector<Pose> poses = estimator_.estimate(image, detections, camera_, options);
    const bool enough = std::any_of(poses.begin(), poses.end(), [&](const Pose& pose) {
      if (pose.parent != target_.parent || !pose.covariance || pose.alternative) return false;
      const Sighting sighting = sight(pose, mount_, target_.point, target_.side_m, 0.0);
      return sighting.position_covariance->trace() < kWellEnough * kWellEnough;
    });
    if (enough || poses.empty()) return poses;
    options.align = true;
    return estimator_.estimate(image, detections, camera_, options);
  }

  TargetView view_of(const FrameRecord& seen) const {
    TargetView view;
    view.received_s = seen.timing.received_s;
    for (const Detection& detection : seen.result.detections)
      if (detection.parent == target_.parent &&
          std::find(view.layers.begin(), view.layers.end(), detection.layer) == view.layers.end())
        view.layers.push_back(detection.layer);
    std::sort(view.layers.begin(), view.layers.end());
    const Target& target = *seen.target;
    view.posed = target.pose.has_value();
    view.believed = target.believed;
    view.foretold = target.foretold;
    if (!target.sighting) return view;
    view.range_m = target.sighting->distance();
    if (const auto& covariance = target.sighting->position_covariance)
      view.sd_m = std::sqrt(std::max(0.0, covariance->trace()));
    return view;
  }

  void tell(const Target& target, const FrameRecord& seen) {
    if (target.news.empty()) return;
    const double captured_s = *seen.timing.captured_s;
    link_.tell({target.news, captured_s, clock_.absolute() ? captured_s : seen.timing.received_s});
    if (deck_ && target.believed && seen.vehicle)
      look_at_deck(*target.pose, seen.result.timestamp_s, *seen.vehicle, *target.sighting);
  }

  void look_at_deck(const Pose& pose, double time_s, const VehiclePose& vehicle,
                    const Sighting& sighting) {
    CameraState state;
    state.level_R_camera = vehicle.ned_R_body.toRotationMatrix() * mount_.body_T_camera.linear();
    state.attitude_covariance = std::pow(0.3 * kDegree, 2) * Eigen::Matrix3d::Identity();
    if (vehicle.ned_p_body) {
      const Eigen::Vector3d lever = vehicle.ned_R_body * mount_.body_T_camera.translation();
      state.height_m = -(vehicle.ned_p_body->z() + lever.z());
      state.height_sd_m = 0.05;
    }
    const double height_m = (vehicle.ned_R_body * sighting.body_T_target.translation()).z() -
                            options_.standing_height_m;
    DeckSample sample;
    make_sample_(pose, state, time_s, target_.point, sample);
    deck_->add(sample, height_m);
  }

  void note_sent(const mavlink::Message& message, double now_s, std::optional<double> captured_s) {
    log_.add_line(json_line(message, now_s, captured_s));
    if (const auto* const text = std::get_if<mavlink::StatusText>(&message))
      status_.tell(text->text.substr(text->text.find(' ') + 1));
  }

  void show(const TargetView& view) {
    if (last_received_s_)
      period_s_ += 0.1 * (std::clamp(view.received_s - *last_received_s_, 1e-3, 10.0) - period_s_);
    last_received_s_ = view.received_s;
    const double now_s = monotonic_s();
    if (!status_.due(now_s)) return;
    status_.show(status_text(view, 1.0 / period_s_, latency_, clock_.absolute(), link_.state(),
                             deck_ ? deck_->view() : std::nullopt),
                 now_s);
  }

  void summarise() {
    const LandLinkState link = link_.state();
    std::string text = fmt::format("{} frames, {} targets {}", frames_, link.targets,
                                   options_.dry_run ? "to send" : "sent");
    if (link.too_old > 0) text += fmt::format(", {} too old", link.too_old);
    if (link.too_many > 0) text += fmt::format(", {} beyond the rate", link.too_many);
    if (link.not_taken > 0) text += fmt::format(", {} without a link", link.not_taken);
    if (latency_.count() > 0)
      text += fmt::format("; from {} to message {:.1f} ms, 95 % within {:.1f} ms",
                          clock_.absolute() ? "image" : "arrival", 1e3 * latency_.quantile(0.5),
                          1e3 * latency_.quantile(0.95));
    status_.tell(text);
  }

  const LandOptions& options_;
  MarkerSet markers_;
  Camera camera_;
  Mount mount_;
  TargetOptions target_;
  GuidedDetector detector_;  ///< for markers that are seen whole: close by, the children
  Detector thorough_;        ///< for a pad of which only parts are seen
  PoseEstimator estimator_;
  TargetTeller teller_;
  FrameClock clock_;

  std::size_t frames_ = 0;
  Latencies latency_;
  double period_s_ = 1.0 / 30.0;
  std::optional<double> last_received_s_;
  StatusLine status_;
  LandLog log_;
  LandLink link_;
  MakeDeckSample* make_sample_ = nullptr;
  std::unique_ptr<LandDeck> deck_;
};

void run(const LandOptions& options) {
  if (options.connect.empty() && !options.dry_run)
    throw Error("--connect is needed, unless --dry-run is given");
  if (options.command && !options.deck) throw Error("--command needs --deck");
  Lander(options).run();
}

constexpr const char* kExamples = R"(Examples:
  harco land --source /dev/video0 --camera camera.yaml --mount mount.yaml
    --markers pad/markers.json --autopilot ardupilot --connect serial:/dev/ttyAMA0:921600
  simulator | harco land --source pgm:- --camera camera.yaml --markers pad/markers.json
    --connect tcp:127.0.0.1:5762
  harco land --source flight.mp4 --camera camera.yaml --markers pad/markers.json --dry-run

docs/first-landing.md leads from the printer to the ground.)";

}  // namespace

void add_land(CLI::App& app) {
  auto options = std::make_shared<LandOptions>();
  CLI::App* verb = app.add_subcommand("land", "Lead an autopilot to a marker, by MAVLink");
  verb->footer(kExamples);
  verb->get_formatter()->column_width(34);

  verb->add_option("--source", options->source, "Camera, stream or pipe (as for detect)")
      ->required()
      ->type_name("SOURCE");
  verb->add_option("--markers", options->markers_file, "The pad (markers.json)")
      ->required()
      ->type_name("FILE");
  verb->add_option("--camera", options->camera_file, "Its calibration (YAML)")
      ->required()
      ->type_name("FILE");
  verb->add_option(
          "--mount", options->mount_file,
          "How it sits on the vehicle (YAML); without\nit looks down, image top to the nose")
      ->type_name("FILE");

  const std::string target = "Target";
  verb->add_option("--parent", options->parent, "Layer-1 marker to land on; else the first")
      ->type_name("ID")
      ->group(target);
  verb->add_option("--target", options->target,
                   "Where to land in its frame, metres; else\nits middle")
      ->type_name("X,Y")
      ->delimiter(',')
      ->expected(2)
      ->group(target);

  const std::string link = "Autopilot";
  verb->add_option("--autopilot", options->autopilot, "ardupilot or px4")
      ->check(CLI::IsMember({"ardupilot", "px4"}))
      ->type_name("NAME")
      ->capture_default_str()
      ->group(link);
  verb->add_option("--connect", options->connect,
                   "udpin:HOST:PORT, udpout:HOST:PORT,\ntcp:HOST:PORT or serial:DEVICE:BAUD")
      ->type_name("LINK")
      ->group(link);
  verb->add_flag("--angles-only", options->angles_only, "Send directions instead of positions")
      ->group(link);
  verb->add_flag("--target-relative", options->relative,
                 "Send TARGET_RELATIVE with covariance, too")
      ->group(link);
  verb->add_option("--rate", options->rate_hz, "Most targets a second; 0: one a frame")
      ->check(CLI::NonNegativeNumber)
      ->type_name("HZ")
      ->capture_default_str()
      ->group(link);
  verb->add_option(
          "--sign", options->signing_file,
          "Sign messages, and hear only signed ones;\nthe file's first line is the pass phrase")
      ->type_name("FILE")
      ->group(link);
  verb->add_option("--system", options->system, "The vehicle's system id; 0: the first heard")
      ->check(CLI::Range(0, 255))
      ->type_name("N")
      ->capture_default_str()
      ->group(link);

  const std::string time = "Time";
  verb->add_option("--frame-clock", options->stamps,
                   "The clock of the frames' stamps: monotonic,\nunix, autopilot, own or auto")
      ->check(CLI::IsMember({"auto", "monotonic", "unix", "autopilot", "own"}))
      ->type_name("NAME")
      ->capture_default_str()
      ->group(time);
  verb->add_option("--latency", options->latency_ms,
                   "From image to arrival, milliseconds, where\nstamps don't tell")
      ->check(CLI::Range(0.0, 1000.0))
      ->type_name("MS")
      ->capture_default_str()
      ->group(time);
  verb->add_option("--max-age", options->max_age_s,
                   "Seconds after which an image is too old to\ntell of its target")
      ->check(CLI::Range(0.02, 5.0))
      ->type_name("S")
      ->capture_default_str()
      ->group(time);
  verb->add_option(
          "--coast", options->coast_s,
          "While frames come that don't show a pad that\nmoves, tell for so long where it must "
          "be by\nnow; 0: never")
      ->check(CLI::Range(0.0, 3.0))
      ->type_name("S")
      ->capture_default_str()
      ->group(time);
  verb->add_option("--threads", options->threads, "Threads that work on one frame, for less delay")
      ->check(CLI::Range(1, DetectorOptions::kMostThreads))
      ->type_name("N")
      ->capture_default_str()
      ->group(time);

  const std::string deck = "Moving deck";
  verb->add_flag("--deck", options->deck, "Foretell when the deck will be level")->group(deck);
  verb->add_flag("--command", options->command,
                 "With --deck: order the landing, and call it\noff; else only a pilot does")
      ->group(deck);
  verb->add_option("--level", options->level_deg, "Greatest tilt that counts as level, degrees")
      ->check(CLI::Range(0.1, 45.0))
      ->type_name("DEG")
      ->capture_default_str()
      ->group(deck);
  verb->add_option("--land-speed", options->land_speed_mps,
                   "Of the autopilot's descent, m/s\n(ArduPilot: LAND_SPEED)")
      ->check(CLI::Range(0.05, 5.0))
      ->type_name("MPS")
      ->capture_default_str()
      ->group(deck);
  verb->add_option("--standing-height", options->standing_height_m,
                   "Of the autopilot above the ground on which\nthe vehicle stands, metres")
      ->check(CLI::Range(0.0, 5.0))
      ->type_name("M")
      ->capture_default_str()
      ->group(deck);

  const std::string out = "Output";
  verb->add_flag("--dry-run", options->dry_run,
                 "Send no targets and no orders; print them\nas JSON lines")
      ->group(out);
  verb->add_option("--record", options->record,
                   "Write frames, poses and messages as JSON\nlines, for harco replay")
      ->type_name("FILE")
      ->group(out);
  verb->callback([options] { run(*options); });
}

}  // namespace harco::cli
