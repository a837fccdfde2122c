// harco calibrate: from pictures of a board or a printed marker to a camera file.
#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "calibration_report.hpp"
#include "coverage_picture.hpp"
#include "frame_source.hpp"
#include "frames.hpp"
#include "harco/error.hpp"
#include "interrupt.hpp"
#include "ordered_work.hpp"
#include "progress.hpp"
#include "target_finder.hpp"
#include "verbs.hpp"
#include "write_file.hpp"

namespace harco::cli {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector2d;

constexpr int kSomeFailed = 1;

struct CalibrateOptions {
  std::vector<std::string> sources;
  std::string board;
  double square_m = 0.0;
  double marker_m = 0.0;
  std::string markers_file;
  std::string model = "pinhole";
  std::string output;
  std::string coverage;
  std::string report;
  bool force = false;
  int jobs = 1;
};

void require(bool condition, const std::string& what) {
  if (!condition) throw Error(what);
}

CalibrationTarget target_of(const CalibrateOptions& options) {
  require(options.board.empty() != options.markers_file.empty(),
          "calibrate: needs --board or --markers, one of both");
  CalibrationTarget target;
  if (options.board.empty()) {
    require(options.square_m == 0.0 && options.marker_m == 0.0,
            "calibrate: --square and --marker-side belong to --board; the markers' file has their "
            "side");
    target.markers = load_markers(options.markers_file);
    return target;
  }
  target.board = parse_board(options.board);
  const auto is_length = [](double value) { return std::isfinite(value) && value > 0.0; };
  require(is_length(options.square_m),
          "calibrate: --board needs --square, the side of a square in metres");
  target.square_m = options.square_m;
  if (target.board->kind == Board::Kind::charuco) {
    require(is_length(options.marker_m) && options.marker_m < options.square_m,
            "calibrate: a ChArUco board needs --marker-side, the side of its ArUco markers in "
            "metres, which is less than --square");
    target.board->marker_share = options.marker_m / options.square_m;
  } else {
    require(options.marker_m == 0.0, "calibrate: a chessboard has no --marker-side");
  }
  return target;
}

CalibrationModel model_of(const std::string& name) {
  if (name == "rational") return CalibrationModel::rational;
  return name == "fisheye" ? CalibrationModel::fisheye : CalibrationModel::pinhole;
}

/// Whether frames follow one another so quickly that many are alike.
bool is_film(const Frame& frame) { return frame.moving || frame.source.rfind("pgm:", 0) == 0; }

/// Lets through a film's frames that are some time apart, where they tell their time.
class Thinning {
 public:
  bool passes(const Frame& frame) {
    constexpr double kApart_s = 0.2;
    if (!is_film(frame) || !frame.timed) return true;
    const bool follows = frame.sequence == sequence_ && frame.timestamp_s > last_s_;
    if (follows && frame.timestamp_s < last_s_ + kApart_s) return false;
    sequence_ = frame.sequence;
    last_s_ = frame.timestamp_s;
    return true;
  }

 private:
  std::size_t sequence_ = 0;
  double last_s_ = -1e9;
};

/// A frame and what it shows of the target.
struct Look {
  Frame frame;
  std::vector<TargetView> views;
};

/// The pictures from which the camera will be calibrated.
class Collection {
 public:
  /// `keep_images` if they will be looked at again.
  explicit Collection(bool keep_images) : keep_images_(keep_images) {}

  void add(Look look) {
    const Frame& frame = look.frame;
    const Image& image = frame.picture.grey;
    if (!frame.error.empty()) {
      fmt::print(stderr, "harco: {}\n", frame.error);
      ++failed_;
      entries_.push_back({{frame.source, "can't be read"}, {}, {}, 0.0});
      return;
    }
    ++looked_at_;
    if (width_ == 0) {
      width_ = image.width;
      height_ = image.height;
    }
    if (image.width != width_ || image.height != height_) {
      entries_.push_back({{frame.source, fmt::format("is {} x {} pixels, the first picture {} x {}",
                                                     image.width, image.height, width_, height_)},
                          {},
                          {},
                          0.0});
      return;
    }
    if (look.views.empty()) {
      if (without_.size() < kMostWithout) without_.push_back(image);
      before_.clear();
      // Of a film, frames without the target are nothing to tell of.
      if (!is_film(frame))
        entries_.push_back({{frame.source, "the target isn't found"}, {}, {}, 0.0});
      return;
    }
    if (is_film(frame))
      add_moving(std::move(look));
    else
      append(std::move(look), 0.0);
  }

  int failed() const { return failed_; }
  int looked_at() const { return looked_at_; }
  int width() const { return width_; }
  int height() const { return height_; }
  std::size_t shown() const {
    return static_cast<std::size_t>(std::count_if(
        entries_.begin(), entries_.end(), [](const Entry& entry) { return !entry.views.empty(); }));
  }

  /// The first pictures in which the target was not found.
  const std::vector<Image>& without() const { return without_; }

  std::vector<CalibrationPicture> pictures() const {
    std::vector<CalibrationPicture> list;
    for (const Entry& entry : entries_) list.push_back(entry.picture);
    return list;
  }

  std::vector<TargetView> views() const {
    std::vector<TargetView> list;
    for (std::size_t i = 0; i < entries_.size(); ++i)
      for (TargetView view : entries_[i].views) {
        view.picture = i;
        list.push_back(std::move(view));
      }
    return list;
  }

  /// Finds the target anew in all pictures.
  void look_again(TargetFinder& finder) {
    for (Entry& entry : entries_)
      if (!entry.image.pixels.empty()) {
        entry.views = finder.find(entry.image.view());
        if (entry.views.empty()) entry.picture.left_out = "the target isn't found";
      }
  }

 private:
  struct Entry {
    CalibrationPicture picture;
    std::vector<TargetView> views;
    Image image;
    double motion_px = 0.0;
  };

  /// Where the target's points are seen, by their place on it.
  static std::map<std::pair<double, double>, Vector2d> points_of(
      const std::vector<TargetView>& views) {
    std::map<std::pair<double, double>, Vector2d> points;
    for (const TargetView& view : views)
      for (const Feature& feature : view.features)
        for (std::size_t i = 0; i < feature.target_m.size(); ++i)
          points[{feature.target_m[i].x(), feature.target_m[i].y()}] = feature.image_px[i];
    return points;
  }

  /// Mean distance in the image of points that both show; infinite if there are none.
  static double distance(const std::vector<TargetView>& a, const std::vector<TargetView>& b) {
    const auto others = points_of(b);
    double sum = 0.0;
    int count = 0;
    for (const auto& [target, seen] : points_of(a))
      if (const auto other = others.find(target); other != others.end()) {
        sum += (seen - other->second).norm();
        ++count;
      }
    return count > 0 ? sum / count : std::numeric_limits<double>::infinity();
  }

  void append(Look look, double motion_px) {
    Entry entry{{look.frame.source, ""}, std::move(look.views), {}, motion_px};
    if (is_film(look.frame))
      entry.picture.source += fmt::format(" at {:.3f} s", look.frame.timestamp_s);
    if (keep_images_) entry.image = std::move(look.frame.picture.grey);
    entries_.push_back(std::move(entry));
  }

  /// Of a film's many frames, those that differ; where some are alike, the stillest of them.
  void add_moving(Look look) {
    constexpr double kAlike = 0.05;  // of the image's diagonal
    const double motion_px = distance(look.views, before_);
    before_ = look.views;
    const auto alike = std::find_if(entries_.begin(), entries_.end(), [&](const Entry& entry) {
      return !entry.views.empty() &&
             distance(look.views, entry.views) < kAlike * std::hypot(width_, height_);
    });
    if (alike == entries_.end()) return append(std::move(look), motion_px);
    if (!(motion_px < alike->motion_px)) return;
    entries_.erase(alike);
    append(std::move(look), motion_px);
  }

  static constexpr std::size_t kMostWithout = 3;

  bool keep_images_;
  int width_ = 0, height_ = 0;
  int failed_ = 0, looked_at_ = 0;
  std::vector<Entry> entries_;
  std::vector<TargetView> before_;  ///< of the film's last frame
  std::vector<Image> without_;
};

Collection collect(const CalibrateOptions& options, const CalibrationTarget& target) {
  Collection collection(gains_by_camera(target));
  const InterruptGuard interrupt;  // ends a camera's stream; what was seen is calibrated from
  Frames frames(options.sources, {}, interrupt.signal());
  std::vector<std::unique_ptr<TargetFinder>> finders;
  for (int i = 0; i < options.jobs; ++i) finders.push_back(target_finder(target, std::nullopt));
  Thinning thinning;
  ProgressBar progress("harco calibrate");
  work_in_order(
      options.jobs,
      [&]() -> std::optional<Frame> {
        std::optional<Frame> frame;
        do {
          if (interrupt.interrupted()) return std::nullopt;
          frame = frames.next();
        } while (frame && !thinning.passes(*frame));
        return frame;
      },
      [&](std::size_t worker, Frame frame) {
        load(frame, /*colour=*/false);
        Look look{std::move(frame), {}};
        if (look.frame.error.empty())
          look.views = finders[worker]->find(look.frame.picture.grey.view());
        return look;
      },
      [&](Look look) {
        collection.add(std::move(look));
        const auto count = frames.count();
        progress.show(count ? collection.looked_at() / static_cast<double>(*count) : 0.0,
                      fmt::format("{} pictures show the target", collection.shown()));
      });
  return collection;
}

/// The chessboard that pictures show in place of the one that was named, if somebody has miscounted
/// by one, as who counts squares does.
std::optional<Board> miscounted(const Board& named, const std::vector<Image>& pictures) {
  constexpr std::array<std::pair<int, int>, 7> kMistakes{
      {{-1, -1}, {1, 1}, {-1, 0}, {0, -1}, {1, 0}, {0, 1}, {-2, -2}}};
  for (const auto& [columns, rows] : kMistakes) {
    Board other = named;
    other.columns += columns;
    other.rows += rows;
    if (other.columns >= 3 && other.rows >= 3 &&
        std::any_of(pictures.begin(), pictures.end(), [&](const Image& picture) {
          return !find_board(other, picture.view()).empty();
        }))
      return other;
  }
  return std::nullopt;
}

/// Says why nothing, or too little, was found.
[[noreturn]] void refuse(const CalibrateOptions& options, const CalibrationTarget& target,
                         const Collection& collection) {
  require(collection.looked_at() > 0, "calibrate: none of the pictures can be read");
  std::string what =
      fmt::format("calibrate: the target is found in {} of {} pictures; at least 3 are needed",
                  collection.shown(), collection.looked_at());
  if (target.board && target.board->kind == Board::Kind::chessboard)
    if (const auto other = miscounted(*target.board, collection.without()))
      what += fmt::format(
          " (wrong board size: --board is {}, but they show {} x {} inner corners, where four "
          "squares meet)",
          options.board, other->columns, other->rows);
  throw Error(what);
}

/// A marker's sides are straight where the lens doesn't bend them, so the markers are found again
/// once the lens is known.
CalibrationReport fit(const CalibrationTarget& target, CalibrationModel model,
                      Collection& collection) {
  constexpr int kLooks = 3;
  CalibrationReport report;
  report.model = model;
  report.views = collection.views();
  Camera camera = rough_calibration(report.views, model, collection.width(), collection.height());
  for (int look = 1;; ++look) {
    report.calibration = calibrate(report.views, model, camera);
    if (!gains_by_camera(target) || look == kLooks) break;
    camera = report.calibration.camera;
    const auto finder = target_finder(target, camera);
    collection.look_again(*finder);
    report.views = collection.views();
  }
  report.pictures = collection.pictures();
  for (std::size_t i = 0; i < report.views.size(); ++i)
    if (!report.calibration.views[i].used)
      report.pictures[report.views[i].picture].left_out = "doesn't agree with the others";
  report.evidence = evidence_of(report.views, report.calibration, model);
  report.verdict = judge(report.evidence);
  return report;
}

/// Where nothing can be written is said before the work, not after it.
void check_place(const std::string& file) {
  if (file.empty()) return;
  std::error_code ignored;
  const fs::path folder = fs::path(file).parent_path();
  require(folder.empty() || fs::is_directory(folder, ignored),
          file + ": can't be written (there is no folder " + folder.string() + ")");
  require(!fs::is_directory(file, ignored), file + ": is a folder, not a file");
}

void run(const CalibrateOptions& options) {
  const CalibrationTarget target = target_of(options);
  for (const std::string& file : {options.output, options.coverage, options.report})
    check_place(file);
  if (!options.coverage.empty())  // the format, too
    media().encode({1, 1, {0, 0, 0}}, fs::path(options.coverage).extension().string());

  Collection collection = collect(options, target);
  if (collection.shown() < 3) refuse(options, target, collection);
  const CalibrationReport report = fit(target, model_of(options.model), collection);

  fmt::print("{}", report_text(report));
  if (!options.report.empty()) write_file(options.report, report_json(report));
  if (!options.coverage.empty()) {
    const ColourImage picture =
        coverage_picture(report.views, report.calibration, report.evidence.coverage);
    const auto bytes = media().encode(picture, fs::path(options.coverage).extension().string());
    write_file(options.coverage, {bytes.begin(), bytes.end()});
  }
  if (report.verdict.grade == Grade::bad && !options.force)
    throw Error(fmt::format("{}: not written, for the calibration isn't usable (--force writes it)",
                            options.output));
  write_file(options.output, format_camera(report.calibration.camera));
  fmt::print("written:    {}\n", options.output);
  if (collection.failed() > 0) throw ExitStatus{kSomeFailed};
}

constexpr const char* kFooter = R"(Examples:
  harco calibrate --board chessboard:9x6 --square 0.025 --output camera.yaml pictures/
  harco calibrate --board charuco:7x5:4x4_50 --square 0.04 --marker-side 0.03 --output camera.yaml film.mp4
  harco calibrate --markers deck/markers.json --model fisheye --output camera.yaml pictures/

Take 15 pictures or more, with the target tilted by 20 to 45 degrees to all sides and, taken
together, seen in every part of the image. Ctrl-C ends a camera's stream; what was seen counts.
Exit status: 0 the camera file is written, 1 it is, but some pictures could not be read, 2 it isn't.)";

}  // namespace

void add_calibrate(CLI::App& app) {
  const auto options = std::make_shared<CalibrateOptions>();
  CLI::App& verb =
      *app.add_subcommand("calibrate", "Calibrate a camera from pictures of a board or a marker");
  verb.footer(kFooter);
  verb.add_option("SOURCE", options->sources,
                  "Pictures, folders of pictures, videos, camera:0, /dev/video0 or pgm:PATH")
      ->required();

  const std::string target = "Target";
  verb.add_option("--board", options->board,
                  "chessboard:9x6, counted in inner corners, or charuco:7x5:4x4_50, counted in "
                  "squares, with its dictionary")
      ->type_name("BOARD")
      ->group(target);
  verb.add_option("--square", options->square_m, "Side of one of the board's squares, in metres")
      ->type_name("METRES")
      ->group(target);
  verb.add_option("--marker-side", options->marker_m,
                  "Side of a ChArUco board's markers, in metres")
      ->type_name("METRES")
      ->group(target);
  verb.add_option("--markers", options->markers_file,
                  "In place of a board: printed HArCo markers (markers.json)")
      ->type_name("FILE")
      ->group(target);

  verb.add_option("--model", options->model,
                  "pinhole (k1 k2 p1 p2 k3), rational (with k4 k5 k6, for wide lenses) or fisheye "
                  "(k1 k2 k3 k4, for very wide ones)")
      ->check(CLI::IsMember({"pinhole", "rational", "fisheye"}))
      ->type_name("NAME")
      ->capture_default_str();
  verb.add_option("--jobs", options->jobs, "Pictures looked at at once; the result is the same")
      ->check(CLI::Range(1, 256).description(""))
      ->type_name("N")
      ->capture_default_str();

  const std::string out = "Output";
  verb.add_option("--output", options->output, "The camera file, as OpenCV writes them (YAML)")
      ->required()
      ->type_name("FILE")
      ->group(out);
  verb.add_option("--coverage", options->coverage,
                  "A picture of where in the image the target was seen, with enlarged residuals")
      ->type_name("FILE")
      ->group(out);
  verb.add_option("--report", options->report, "All figures, picture by picture (JSON)")
      ->type_name("FILE")
      ->group(out);
  verb.add_flag("--force", options->force, "Write the camera file whatever the verdict")
      ->group(out);
  verb.callback([options] { run(*options); });
}

}  // namespace harco::cli
