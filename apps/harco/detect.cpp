// harco detect: what is seen in pictures, videos and streams, and where it stands.
#include <atomic>
#include <cmath>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <string>
#include <system_error>
#include <tuple>
#include <vector>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "annotate.hpp"
#include "explain.hpp"
#include "frames.hpp"
#include "harco/camera.hpp"
#include "harco/detect.hpp"
#include "harco/error.hpp"
#include "harco/guided.hpp"
#include "harco/merge.hpp"
#include "harco/pose.hpp"
#include "harco/pose_estimator.hpp"
#include "harco/track.hpp"
#include "interrupt.hpp"
#include "ordered_work.hpp"
#include "output_stream.hpp"
#include "overlay.hpp"
#include "progress.hpp"
#include "record.hpp"
#include "results.hpp"
#include "tracking.hpp"
#include "verbs.hpp"

namespace harco::cli {
namespace {

constexpr int kSomeFailed = 1;
constexpr double kUsualFrameRate = 30.0;

struct DetectOptions {
  std::vector<std::string> markers_files;
  std::string camera_file;
  std::vector<std::string> sources;

  std::string output = "-";
  std::string format = "json";
  std::string csv_file;
  std::string annotate;
  std::string explain;

  std::string fusion = "joint";
  bool corners_only = false;
  std::vector<double> gravity;  ///< x, y, z in the camera's frame and, if given, sigma in degrees
  std::string mount = "ground";
  DetectorOptions detector;
  bool track = false;
  std::tuple<int, int, int> memory{3, 3, 10};  ///< a, b, c of the paper's rule
  std::string filter;                          ///< "" goes by the fusion
  double time_constant_s = 0.1;
  std::optional<double> swell_s;
  double coast_s = FilterOptions().coast_s;
  std::string record;
  std::string record_video;
  double frame_rate = 0.0;
  bool live = false;
  int jobs = 1;
};

/// How poses over time are filtered, if they are.
std::optional<TrackingOptions> tracking_of(const DetectOptions& options) {
  if (!options.track) return std::nullopt;
  TrackingOptions tracking;
  const bool paper =
      options.filter.empty() ? options.fusion == "paper" : options.filter == "low-pass";
  if (paper) tracking.kind = FilterKind::low_pass;
  tracking.time_constant_s = options.time_constant_s;
  tracking.filter.coast_s = options.coast_s;
  if (options.swell_s) {
    tracking.filter.swell.emplace();
    tracking.filter.swell->period_s = *options.swell_s;
  }
  return tracking;
}

/// A frame on its way from the threads that look at it to the one that writes.
struct Finished {
  Frame frame;
  FrameResult result;
  ColourImage annotated;       ///< empty unless it was asked for
  std::vector<Pose> measured;  ///< the poses before anything made use of time
  FrameTiming timing;
};

/// Looks at frames: a detector and all that it needs to become poses.
class Observer {
 public:
  Observer(const DetectOptions& options, const MarkerSet& markers,
           const std::optional<Camera>& camera)
      : options_(options),
        camera_(camera),
        pose_options_{options.fusion == "paper" ? Fusion::paper : Fusion::joint,
                      !options.corners_only, gravity_of(options)},
        estimator_(markers) {
    // What is explained is explained of whole pictures.
    if (options.track && camera && options.explain.empty())
      guided_.emplace(markers, detector_options());
    else
      detector_.emplace(markers, detector_options());
    if (options.track) start_tracking();
  }

  /// Whether frames are wanted in colour.
  static bool needs_colour(const DetectOptions& options) {
    return !options.annotate.empty() || !options.explain.empty() || !options.record_video.empty();
  }

  Finished look_at(Frame frame) {
    load(frame, needs_colour(options_));
    Finished finished{std::move(frame), {}, {}, {}, {}};
    FrameResult& result = finished.result;
    result.frame = finished.frame.number;
    result.source = finished.frame.source;
    result.timestamp_s = finished.frame.timestamp_s;
    result.dropped = finished.frame.dropped;
    result.error = finished.frame.error;
    if (!result.error.empty()) return finished;

    result.width = finished.frame.picture.grey.width;
    result.height = finished.frame.picture.grey.height;
    if (camera_ && (result.width != camera_->width || result.height != camera_->height)) {
      result.error = fmt::format("{}: is {} x {} pixels, but the camera of {} has {} x {}",
                                 result.source, result.width, result.height, options_.camera_file,
                                 camera_->width, camera_->height);
      return finished;
    }
    measure(finished);
    return finished;
  }

 private:
  static std::optional<GravityPrior> gravity_of(const DetectOptions& options) {
    if (options.gravity.empty()) return std::nullopt;
    GravityPrior prior;
    prior.in_camera = Eigen::Map<const Eigen::Vector3d>(options.gravity.data());
    if (options.mount == "wall") prior.in_marker = Eigen::Vector3d::UnitY();
    if (options.gravity.size() == 4) prior.sigma_rad = options.gravity[3] * std::acos(-1.0) / 180.0;
    return prior;
  }

  DetectorOptions detector_options() const {
    DetectorOptions all = options_.detector;
    all.camera = camera_;
    all.tentative_bit_errors = options_.track ? std::get<0>(options_.memory) : 0;
    return all;
  }

  void start_tracking() {
    const auto [a, b, c] = options_.memory;
    memory_.emplace(MemoryOptions{a, b, c});
    tracking_.emplace(*tracking_of(options_));
  }

  const Detector& detector() const { return guided_ ? guided_->detector() : *detector_; }

  std::vector<Detection> detect(const ImageView& image, double time_s, DetectionTrace* trace) {
    if (!guided_) return detector_->detect(image, trace);
    return guided_->detect(image, tracking_->tracks(time_s).value_or(std::vector<Track>{}), trace);
  }

  void measure(Finished& finished) {
    const Frame& frame = finished.frame;
    FrameResult& result = finished.result;
    const ImageView image = frame.picture.grey.view();
    if (options_.track && frame.sequence != sequence_) start_tracking();
    sequence_ = frame.sequence;

    FrameTiming& timing = finished.timing;
    const double start = monotonic_s();
    DetectionTrace trace;
    result.detections =
        detect(image, result.timestamp_s, options_.explain.empty() ? nullptr : &trace);
    if (memory_) result.detections = memory_->confirm(result.detections);
    const double detected = monotonic_s();
    if (camera_)
      result.poses = estimator_.estimate(image, result.detections, *camera_, pose_options_);
    if (!options_.record.empty()) finished.measured = result.poses;
    const double posed = monotonic_s();
    if (tracking_) {
      tracking_->take(result.poses, result.timestamp_s);
      if (camera_) result.tracks = tracking_->tracks(result.timestamp_s);
    }
    timing = {frame.captured_s, frame.received_s, monotonic_s(), 1e3 * (detected - start),
              1e3 * (posed - detected)};

    if (!needs_colour(options_)) return;
    const Overlay overlay = overlay_of(result, detector().markers(), camera_);
    if (!options_.explain.empty())
      explain(options_.explain, frame, result, trace, detector().placed(), overlay);
    if (options_.annotate.empty()) return;
    finished.annotated = frame.picture.colour;
    media().draw(overlay, finished.annotated);
  }

  const DetectOptions& options_;
  const std::optional<Camera>& camera_;
  PoseOptions pose_options_;
  PoseEstimator estimator_;
  std::optional<Detector> detector_;  // one of both
  std::optional<GuidedDetector> guided_;
  std::optional<Memory> memory_;
  std::optional<Tracking> tracking_;
  std::size_t sequence_ = 0;
};

/// Takes finished frames in order and writes all that was asked for.
class Report {
 public:
  Report(const DetectOptions& options, const Frames& frames)
      : live_(frames.live()), csv_(options.format == "csv"), output_(options.output, live_) {
    if (!options.csv_file.empty()) csv_file_.emplace(options.csv_file, live_);
    if (!options.annotate.empty())
      annotations_.emplace(options.annotate, frames.count() == std::size_t{1});
    if (!options.record.empty()) record_.emplace(options.record, tracking_of(options), live_);
    if (!options.record_video.empty()) video_.emplace(options.record_video, false);
  }

  void add(const Finished& finished) {
    if (!finished.result.error.empty()) ++failed_;
    // A failure that stays alone is bad input and leaves no output: wait for what follows. A stream
    // that gives unfitting pictures goes on, and somebody reads along.
    const bool goes_on = live_ && finished.result.width > 0;
    if (count_++ == 0 && failed_ == 1 && !goes_on) {
      first_failure_ = finished.result;
      return;
    }
    flush_first_failure();
    write(finished.result);
    if (record_)
      record_->add({finished.result, finished.frame.sequence, finished.measured, std::nullopt,
                    finished.timing, std::nullopt, std::nullopt});
    if (video_ && finished.result.width > 0)
      video_->add(finished.frame, finished.frame.picture.colour);
    if (annotations_ && !finished.annotated.bgr.empty())
      annotations_->add(finished.frame, finished.annotated);
  }

  /// All frames have come. Returns how many have failed. Throws Error if that is all there was.
  int finish() {
    if (first_failure_) throw Error(first_failure_->error);
    if (!header_written_) write_header();
    output_.commit();
    if (csv_file_) csv_file_->commit();
    if (annotations_) annotations_->commit();
    if (record_) record_->commit();
    if (video_) video_->commit();
    return failed_;
  }

  int count() const { return count_; }

 private:
  void write_header() {
    header_written_ = true;
    if (csv_) output_.write(csv_header());
    if (csv_file_) csv_file_->write(csv_header());
  }

  void write(const FrameResult& result) {
    if (!header_written_) write_header();
    if (!result.error.empty()) fmt::print(stderr, "harco: {}\n", result.error);
    output_.write(csv_ ? csv_rows(result) : json_line(result));
    if (csv_file_) csv_file_->write(csv_rows(result));
  }

  void flush_first_failure() {
    if (first_failure_) {
      write(*first_failure_);
      if (record_)
        record_->add({*first_failure_, 0, {}, std::nullopt, {}, std::nullopt, std::nullopt});
    }
    first_failure_.reset();
  }

  bool live_;
  bool csv_;
  OutputStream output_;
  std::optional<OutputStream> csv_file_;
  std::optional<Annotations> annotations_;
  std::optional<RecordWriter> record_;
  std::optional<Annotations> video_;  ///< the frames as they came
  std::optional<FrameResult> first_failure_;
  bool header_written_ = false;
  int count_ = 0;
  int failed_ = 0;
};

/// `all` is 0 if nobody knows how many frames there will be.
void show_progress(ProgressBar& progress, int done, std::size_t all) {
  if (all > 0)
    progress.show(done / static_cast<double>(all), fmt::format("{} of {} frames", done, all));
  else
    progress.show(0.0, fmt::format("{} frames", done));
}

/// X,Y,Z or X,Y,Z,SIGMA_DEG.
void check_gravity(const std::vector<double>& gravity) {
  if (gravity[0] == 0.0 && gravity[1] == 0.0 && gravity[2] == 0.0)
    throw Error("--gravity: 0,0,0 is no direction");
  if (gravity.size() == 4 && !(gravity[3] > 0.0))
    throw Error("--gravity: the sigma must be positive degrees");
}

/// What is written must be neither read nor written by anybody else.
void refuse_clashes(const DetectOptions& options) {
  namespace fs = std::filesystem;
  std::map<fs::path, std::string> known;
  const auto note = [&](const std::string& word, const char* what, bool written) {
    std::error_code ignored;
    const bool file = word == "-" ? written : !fs::is_character_file(word, ignored);
    if (word.empty() || !file) return;
    const fs::path path = word == "-" ? fs::path(word) : fs::weakly_canonical(word, ignored);
    const auto [before, first] = known.emplace(path, what);
    if (written && !first)
      throw Error(fmt::format("{}: is {} and {} as well", word, what, before->second));
  };
  for (const std::string& file : options.markers_files) note(file, "a markers' file", false);
  note(options.camera_file, "the camera file", false);
  for (const std::string& source : options.sources)
    note(source.rfind("pgm:", 0) == 0 ? source.substr(4) : source, "a source", false);
  note(options.output, "the output", true);
  note(options.csv_file, "the table (--csv)", true);
  note(options.annotate, "what is annotated", true);
  note(options.explain, "what is explained", true);
  note(options.record, "the record", true);
  note(options.record_video, "the recorded video", true);
}

/// The markers of all files, for one pass.
MarkerSet load_all(const std::vector<std::string>& files) {
  std::vector<MarkerSet> sets;
  for (const std::string& file : files) sets.push_back(load_markers(file));
  try {
    return merge(sets);
  } catch (const std::invalid_argument& clash) {
    throw Error(fmt::format("{}: {}", fmt::join(files, ", "), clash.what()));
  }
}

void run(DetectOptions options) {
  refuse_clashes(options);
  if (!options.gravity.empty()) check_gravity(options.gravity);
  const MarkerSet markers = load_all(options.markers_files);
  std::optional<Camera> camera;
  if (!options.camera_file.empty()) camera = load_camera(options.camera_file);
  if (options.track && options.frame_rate == 0.0) options.frame_rate = kUsualFrameRate;
  // What one frame leaves behind for the next needs them in order.
  const int jobs = options.track ? 1 : options.jobs;

  std::vector<Observer> observers;
  for (int i = 0; i < jobs; ++i) observers.emplace_back(options, markers, camera);
  const InterruptGuard interrupt;
  Frames frames(options.sources,
                {options.frame_rate, Observer::needs_colour(options), options.live},
                interrupt.signal());
  Report report(options, frames);
  std::atomic<std::size_t> expected = 0;
  ProgressBar progress("harco detect");

  work_in_order(
      jobs,
      [&]() -> std::optional<Frame> {
        std::optional<Frame> frame = frames.next();
        expected = frames.count().value_or(0);  // a video says so once it is open
        return frame;
      },
      [&](std::size_t worker, Frame frame) { return observers[worker].look_at(std::move(frame)); },
      [&](Finished finished) {
        report.add(finished);
        frames.recycle(std::move(finished.frame.picture));
        show_progress(progress, report.count(), expected);
      });
  if (report.finish() > 0) throw ExitStatus{kSomeFailed};
}

constexpr const char* kSourcesHelp =
    "A picture, a folder of pictures, a video; camera:0 or /dev/video0; rtsp://…, "
    "rtp://HOST:PORT[?encoding=JPEG] (H264 if nothing is said), gst:PIPELINE of GStreamer; "
    "pgm:PATH "
    "or pgm:- for binary PGM images one after the other in a file, a named pipe or on standard "
    "input";

/// Breaks a description into lines that fit beside the options' names.
std::string wrapped(const std::string& text) {
  constexpr std::size_t kColumns = 66;
  std::istringstream words(text);
  std::string lines, word;
  std::size_t column = 0;
  while (words >> word) {
    const bool breaks = column > 0 && column + 1 + word.size() > kColumns;
    if (column > 0) lines += breaks ? '\n' : ' ';
    column = (column == 0 || breaks ? 0 : column + 1) + word.size();
    lines += word;
  }
  return lines;
}

/// A number between bounds, which NaN is not.
CLI::Validator within(double low, double high) {
  return {[=](const std::string& text) {
            double value = 0.0;
            const bool number = CLI::detail::lexical_cast(text, value);
            if (number && value >= low && value <= high) return std::string();
            return fmt::format("{} is no number from {} to {}", text, low, high);
          },
          ""};
}

constexpr const char* kExamples = R"(Examples:
  harco detect --markers deck/markers.json photo.jpg
  harco detect --markers deck/markers.json --camera camera.yaml --output poses.jsonl flight.mp4
  harco detect --markers deck/markers.json --camera camera.yaml --annotate seen/ pictures/
  harco detect --markers deck/markers.json --explain why/ photo.jpg
  ffmpeg -i rtsp://drone -f image2pipe -c:v pgm - |
    harco detect --markers deck/markers.json --camera camera.yaml pgm:-

A line of output is a frame: {"frame", "source", "timestamp_s", "size", "markers", "poses"}.
Exit status: 0 all frames were read, 1 some could not be (their lines hold an "error"), 2 bad input.)";

}  // namespace

void add_detect(CLI::App& app) {
  auto options = std::make_shared<DetectOptions>();
  CLI::App* verb = app.add_subcommand("detect", "Find markers in pictures, videos or a camera");
  verb->footer(kExamples);
  verb->get_formatter()->column_width(34);

  verb->add_option("SOURCE", options->sources, wrapped(kSourcesHelp))->required();
  verb->add_option(
          "--markers", options->markers_files,
          wrapped("The markers to look for (markers.json); once for each of several files, "
                  "whose ids and codes have to differ"))
      ->required()
      ->allow_extra_args(false)
      ->type_name("FILE");
  verb->add_option(
          "--camera", options->camera_file,
          wrapped("Calibration as OpenCV or ROS write it (YAML); without it there are no poses"))
      ->type_name("FILE");

  const std::string out = "Output";
  verb->add_option("--output", options->output, wrapped("Where the lines go; - is standard output"))
      ->type_name("FILE")
      ->capture_default_str()
      ->group(out);
  verb->add_option("--format", options->format, wrapped("json: an object a line; csv: a table"))
      ->check(CLI::IsMember({"json", "csv"}))
      ->type_name("NAME")
      ->capture_default_str()
      ->group(out);
  verb->add_option("--csv", options->csv_file, wrapped("Write the table as well"))
      ->type_name("FILE")
      ->group(out);
  verb->add_option(
          "--annotate", options->annotate,
          wrapped("Draw what was found: into a folder (a picture a picture, a video a video), or "
                  "into one file (.png, .mp4, …)"))
      ->type_name("FOLDER|FILE")
      ->group(out);
  verb->add_option(
          "--explain", options->explain,
          wrapped("Draw every stage of every frame and list what became of each quad, and why"))
      ->type_name("FOLDER")
      ->group(out);

  verb->add_option("--record", options->record,
                   wrapped("Keep what was measured and when, for harco replay"))
      ->type_name("FILE")
      ->group(out);
  verb->add_option("--record-video", options->record_video,
                   wrapped("Keep the frames as they came, as a video (.mp4, .avi, …)"))
      ->type_name("FILE")
      ->group(out);

  const std::string detection = "Detection and pose";
  verb->add_option(
          "--fusion", options->fusion,
          wrapped("How markers of one parent become its pose: joint is the best estimate, paper "
                  "averages by area as the paper does"))
      ->check(CLI::IsMember({"joint", "paper"}))
      ->type_name("NAME")
      ->capture_default_str()
      ->group(detection);
  verb->add_flag("--corners-only", options->corners_only,
                 wrapped("Joint poses from corners alone, without aligning the marker's picture to "
                         "the image: some ten times faster and less accurate"))
      ->group(detection);
  verb->add_option(
          "--gravity", options->gravity,
          wrapped("Direction of gravity in the camera's frame (x right, y down, z forward) and how "
                  "far it may be off, in degrees (5): tells the two solutions of a small marker's "
                  "pose"))
      ->delimiter(',')
      ->expected(3, 4)
      ->type_name("X,Y,Z[,SIGMA]")
      ->check(CLI::Number.description(""))
      ->group(detection);
  verb->add_option("--mount", options->mount,
                   wrapped("With --gravity: where the marker is. Flat on the ground, "
                           "or upright on a wall"))
      ->check(CLI::IsMember({"ground", "wall"}))
      ->type_name("NAME")
      ->capture_default_str()
      ->group(detection);
  verb->add_flag(
          "!--whole-only", options->detector.covered,
          wrapped(
              "Don't look for layer-1 markers of which parts are covered or out of view (faster)"))
      ->group(detection);
  verb->add_flag(
          "!--measured-only", options->detector.infer,
          wrapped(
              "Leave out markers too small to be found by themselves, which a larger one of their "
              "sheet leads to (those marked as inferred)"))
      ->group(detection);
  verb->add_option("--min-side", options->detector.min_side_px,
                   wrapped("Smallest side of a marker looked for, in pixels"))
      ->type_name("PX")
      ->capture_default_str()
      ->group(detection);
  verb->add_option("--max-bit-errors", options->detector.max_bit_errors,
                   wrapped("Wrong bits corrected in a code without other evidence"))
      ->type_name("N")
      ->capture_default_str()
      ->group(detection);
  verb->add_option("--min-quality,--kappa", options->detector.min_quality,
                   wrapped("Least quality of a detection, 0 to 1"))
      ->type_name("Q")
      ->capture_default_str()
      ->group(detection);

  const std::string time = "Frames over time";
  verb->add_flag(
          "--track", options->track,
          wrapped(
              "Use earlier frames too: believe a code with more wrong bits if its marker was "
              "seen before, tell the two solutions of a small marker's pose by the frames before, "
              "filter the poses, and look for markers where they are expected"))
      ->group(time);
  verb->add_option(
          "--memory", options->memory,
          wrapped("With --track: a code with up to A wrong bits is believed if its marker was "
                  "seen in more than B of the last C frames"))
      ->type_name("A B C")
      ->default_str("3 3 10")
      ->group(time);
  verb->add_option(
          "--filter", options->filter,
          wrapped(
              "With --track: kalman gives tracks, with velocities and covariance, beside the "
              "poses as measured (with --fusion joint the default); low-pass is the paper's and "
              "smooths the poses themselves (with --fusion paper the default)"))
      ->check(CLI::IsMember({"kalman", "low-pass"}))
      ->type_name("NAME")
      ->group(time);
  verb->add_option("--time-constant", options->time_constant_s,
                   wrapped("Of the low-pass, in seconds; 0 is none"))
      ->check(within(0.0, 1e6))
      ->type_name("S")
      ->capture_default_str()
      ->group(time);
  verb->add_option("--swell", options->swell_s,
                   wrapped("With --track: the markers are on a deck that oscillates with this "
                           "period, in seconds; 0 finds it"))
      ->check(within(0.0, 1e3))
      ->type_name("S")
      ->group(time);
  verb->add_option(
          "--coast", options->coast_s,
          wrapped("With --track: a marker that isn't seen is foretold for so many seconds, "
                  "ever less surely; then its track is lost"))
      ->check(within(1e-3, 1e3))
      ->type_name("S")
      ->capture_default_str()
      ->group(time);
  verb->add_option(
          "--frame-rate", options->frame_rate,
          wrapped("Frames a second of sources that don't say when a frame was taken; by default "
                  "all are taken at 0 s, with --track 30 a second"))
      ->check(within(0.0, 1e6))
      ->type_name("HZ")
      ->group(time);
  verb->add_flag("--live", options->live,
                 wrapped("Drop frames of a PGM stream for which there is no time, and open a named "
                         "pipe again when it ends; cameras and network streams always do so"))
      ->group(time);
  verb->add_option(
          "--threads", options->detector.threads,
          wrapped("Threads that work on one frame, for less delay; the output is the same. Where "
                  "there are many frames, --jobs makes more of them"))
      ->check(CLI::Range(1, DetectorOptions::kMostThreads).description(""))
      ->type_name("N")
      ->capture_default_str()
      ->group(time);
  verb->add_option(
          "--jobs", options->jobs,
          wrapped("Frames looked at at once; the output is the same (with --track always one)"))
      ->check(CLI::Range(1, 256).description(""))
      ->type_name("N")
      ->capture_default_str()
      ->group(time);

  verb->callback([options] { run(*options); });
}

}  // namespace harco::cli
