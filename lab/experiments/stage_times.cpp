// Section 4.2: how long detection and poses take, over the number of markers in view, with other
// markers around that confuse.
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include <Eigen/Dense>

#include "lab/aruco.hpp"
#include "lab/experiments/chapters.hpp"
#include "lab/experiments/picture.hpp"
#include "lab/experiments/setup.hpp"
#include "lab/report/plot.hpp"
#include "lab/thread_time.hpp"

namespace harco::lab {
namespace {

constexpr double kSide = 0.2;
constexpr double kArucoSide = 0.07;
constexpr int kMostParents = 6;
constexpr int kRow = 3;          // sheets on the wall: 3 x 3 places
constexpr double kPitch = 0.32;  // of the places, metres
constexpr int kFramesAnItem = 50;
constexpr AxisRange kDistances{0.45, 1.8};

/// Table 1 of the paper, ms.
constexpr double kPaperFirst = 2.8192, kPaperEach = 0.0537, kPaperFusion = 0.5559,
                 kPaperTotal = 4.0618;

/// A wall with HArCo markers in some places and four ArUco markers in each of the others.
struct Wall {
  std::vector<Sheet> sheets;
  std::vector<Eigen::Isometry3d> wall_T_sheet;  ///< the HArCo markers come first

  Wall(const MarkerSet& markers, std::mt19937_64& random) {
    std::array<int, kRow * kRow> places{};
    for (std::size_t i = 0; i < places.size(); ++i) places[i] = static_cast<int>(i);
    std::shuffle(places.begin(), places.end(), random);
    int aruco = 0;
    for (std::size_t i = 0; i < places.size(); ++i) {
      const int row = places[i] / kRow, column = places[i] % kRow;
      const Eigen::Vector3d middle(kPitch * (column - 1), kPitch * (row - 1), 0.0);
      if (i < markers.parents.size()) {
        add(middle, sheet_of(markers, static_cast<int>(i)), kSide);
        continue;
      }
      for (const double x : {-0.07, 0.07})
        for (const double y : {-0.07, 0.07}) {
          add(middle + Eigen::Vector3d(x, y, 0.0), aruco_sheet(kArucoSide, aruco++), kArucoSide);
        }
    }
  }

 private:
  void add(const Eigen::Vector3d& middle, const Sheet& sheet, double side) {
    sheets.push_back(sheet);
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.translation() = middle - Eigen::Vector3d(0.5 * side, 0.5 * side, 0.0);
    wall_T_sheet.push_back(pose);
  }
};

/// A camera that looks around before the wall.
class Path {
 public:
  explicit Path(std::mt19937_64& random)
      : distance_(random, 0.1, 0.4),
        aim_x_(random, 0.1, 0.6),
        aim_y_(random, 0.1, 0.6),
        tilt_(random, 0.1, 0.6),
        roll_(random, 0.1, 0.4),
        axis_(uniform(random, 0.0, 2.0 * std::numbers::pi)) {}

  double distance(double t) const {
    const double middle = 0.5 * (kDistances.low + kDistances.high);
    return std::clamp(middle + 1.2 * (middle - kDistances.low) * distance_(t), kDistances.low,
                      kDistances.high);
  }

  Eigen::Isometry3d operator()(double t) const {
    return look_at_marker({0.25 * aim_x_(t), 0.25 * aim_y_(t)}, distance(t),
                          0.5 * std::abs(tilt_(t)), axis_, 0.5 * roll_(t));
  }

 private:
  Wander distance_, aim_x_, aim_y_, tilt_, roll_;
  double axis_;
};

/// How many of the poses are of a marker that isn't there.
int wrong_poses(const std::vector<Pose>& poses, const Wall& wall,
                const Eigen::Isometry3d& camera_T_wall) {
  return static_cast<int>(std::count_if(poses.begin(), poses.end(), [&](const Pose& pose) {
    const Eigen::Isometry3d truth =
        camera_T_wall * wall.wall_T_sheet[static_cast<std::size_t>(pose.parent)];
    return !is_right(pose.camera_T_marker, truth);
  }));
}

class StageTimes final : public Experiment {
 public:
  std::string name() const override { return "4.2"; }
  std::string title() const override { return "Processing time"; }

  Json settings(Extent extent) const override {
    return {{"revision", 2},
            {"side_m", kSide},
            {"layers", 2},
            {"focal_px", kFarFocal},
            {"distances_m", {kDistances.low, kDistances.high}},
            {"frames_an_item", frames(extent)}};
  }

  int items(Extent extent) const override {
    return extent == Extent::full ? 102 : extent == Extent::quick ? 6 : 1;
  }

  Json run(Extent extent, int item) const override;
  Chapter summarise(Extent, const std::vector<Json>& results) const override;

 private:
  static int frames(Extent extent) {
    return extent == Extent::full ? kFramesAnItem : extent == Extent::quick ? 40 : 3;
  }
};

Json StageTimes::run(Extent extent, int item) const {
  std::mt19937_64 random = generator(name(), item);
  MarkerSet markers = paper_markers(2, kSide, kMostParents);
  markers.parents.resize(static_cast<std::size_t>(1 + item % kMostParents));
  const Wall wall(markers, random);
  const Stage stage = stage_of(wall.sheets, wall.wall_T_sheet);
  const Studio studio(kFarFocal);
  const Camera& camera = studio.camera();
  DetectorOptions options;
  options.camera = camera;
  Detector detector(markers, options);
  options.covered = false;
  Detector of_whole_markers(markers, options);
  const Path path(random);

  std::vector<double> seen, aruco_seen, whole_ms, detect_ms, joint_ms, paper_ms, aruco_ms;
  int wrong = 0;
  Json pictures = Json::array();
  for (int frame = 0; frame < frames(extent); ++frame) {
    const double t = frame / kFrameRate;
    const Eigen::Isometry3d camera_T_wall = path(t);
    const Image image = studio.shoot(stage, path, t, random());
    if (frame == 0) {  // their memory is there from then on
      detector.detect(image.view());
      of_whole_markers.detect(image.view());
    }

    const double before = thread_ms();
    of_whole_markers.detect(image.view());
    const double begin = thread_ms();
    const std::vector<Detection> detections = detector.detect(image.view());
    const double detected = thread_ms();
    const std::vector<Pose> poses = estimate_poses(image.view(), detections, markers, camera);
    const double joint = thread_ms();
    PoseOptions as_paper;
    as_paper.fusion = Fusion::paper;
    estimate_poses(image.view(), detections, markers, camera, as_paper);
    const double paper = thread_ms();
    const auto arucos =
        aruco_poses(image, camera, kArucoSide, kFarFocal * kArucoSide / path.distance(t));
    const double aruco = thread_ms();

    seen.push_back(static_cast<double>(std::count_if(
        detections.begin(), detections.end(), [](const Detection& one) { return !one.inferred; })));
    aruco_seen.push_back(static_cast<double>(arucos.size()));
    whole_ms.push_back(begin - before);
    detect_ms.push_back(detected - begin);
    joint_ms.push_back(joint - detected);
    paper_ms.push_back(paper - joint);
    aruco_ms.push_back(aruco - paper);
    wrong += wrong_poses(poses, wall, camera_T_wall);
    if (frame == frames(extent) / 2 && item < kMostParents)
      pictures.push_back(to_json(picture_of(
          image.view(), fmt::format("{:.0f} of ours, {} of ArUco", seen.back(), arucos.size()),
          detections)));
  }
  return {{"seen", to_json(seen)},
          {"aruco_seen", to_json(aruco_seen)},
          {"wrong", wrong},
          {"whole_ms", to_json(whole_ms)},
          {"detect_ms", to_json(detect_ms)},
          {"joint_ms", to_json(joint_ms)},
          {"paper_ms", to_json(paper_ms)},
          {"aruco_ms", to_json(aruco_ms)},
          {"pictures", pictures}};
}

/// All frames of all items.
struct Frames {
  std::vector<double> seen, aruco_seen, whole, detect, joint, paper, aruco;
  int wrong = 0;

  explicit Frames(const std::vector<Json>& results) {
    for (const Json& result : results) {
      const auto add = [&](std::vector<double>& to, const char* key) {
        const std::vector<double> more = numbers(result.at(key));
        to.insert(to.end(), more.begin(), more.end());
      };
      add(seen, "seen");
      add(aruco_seen, "aruco_seen");
      add(whole, "whole_ms");
      add(detect, "detect_ms");
      add(joint, "joint_ms");
      add(paper, "paper_ms");
      add(aruco, "aruco_ms");
      wrong += result.at("wrong").get<int>();
    }
  }
};

double mean(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double value : values) sum += value;
  return sum / static_cast<double>(values.size());
}

/// The straight line through times over markers in view, by least squares.
struct Line {
  double first = 0.0, each = 0.0;

  Line(const std::vector<double>& x, const std::vector<double>& y) {
    const double mx = mean(x), my = mean(y);
    double xx = 0.0, xy = 0.0;
    for (std::size_t i = 0; i < x.size(); ++i) {
      xx += (x[i] - mx) * (x[i] - mx);
      xy += (x[i] - mx) * (y[i] - my);
    }
    each = xx > 0.0 ? xy / xx : 0.0;
    first = my - each * mx;
  }
};

/// Mean time of frames with so many markers in view, three numbers of markers at a time.
Series over_markers(const char* label, const char* colour, const std::vector<double>& seen,
                    const std::vector<double>& ms) {
  constexpr int kWidth = 3;
  constexpr std::size_t kFewest = 5;
  std::array<std::vector<double>, 6 * kMostParents / kWidth + 1> groups;
  for (std::size_t i = 0; i < seen.size(); ++i)
    groups[static_cast<std::size_t>(seen[i]) / kWidth].push_back(ms[i]);
  Series series{label, colour, Mark::line, {}, {}};
  for (std::size_t g = 0; g < groups.size(); ++g) {
    if (groups[g].size() < kFewest) continue;
    series.x.push_back(kWidth * static_cast<double>(g) + 0.5 * (kWidth - 1));
    series.y.push_back(mean(groups[g]));
  }
  return series;
}

Chapter StageTimes::summarise(Extent, const std::vector<Json>& results) const {
  const Frames frames(results);
  const Line detection(frames.seen, frames.whole);
  const double joint = mean(frames.joint), paper = mean(frames.paper);
  const double whole = mean(frames.whole), detect = mean(frames.detect);
  const double aruco = mean(frames.aruco);

  Chapter chapter;
  const auto ms = [](double value) { return text(value) + " ms"; };
  chapter.findings = {{"Mean time of a frame as the paper does it: whole markers, its fusion",
                       ms(kPaperTotal),
                       ms(whole + paper),
                       ms(aruco),
                       "",
                       {}},
                      {"Mean time of a frame, covered markers too, aligned poses",
                       "",
                       ms(detect + joint),
                       "",
                       "",
                       {}},
                      {"Poses of a marker that isn't there", "", fmt::format("{}", frames.wrong),
                       "", "none", frames.wrong == 0}};

  Plot plot;
  plot.title = "Time over markers in view";
  plot.x_label = "HArCo markers found, parents and children";
  plot.y_label = "CPU time of a frame, ms";
  plot.width = 800;
  plot.height = 340;
  std::vector<double> as_paper = frames.whole, all = frames.detect;
  for (std::size_t i = 0; i < all.size(); ++i) {
    as_paper[i] += frames.paper[i];
    all[i] += frames.joint[i];
  }
  const auto dots = [&](const char* colour, const std::vector<double>& values) {
    constexpr std::size_t kMost = 600;
    Series series{"", colour, Mark::dots, {}, {}};
    for (std::size_t i = 0; i < values.size();
         i += std::max<std::size_t>(1, values.size() / kMost)) {
      series.x.push_back(frames.seen[i]);
      series.y.push_back(values[i]);
    }
    return series;
  };
  plot.series = {dots("#b9cfe8", all),
                 over_markers("HArCo, covered ones too", palette::kHarco, frames.seen, all),
                 over_markers("HArCo, whole ones", palette::kPaper, frames.seen, as_paper),
                 over_markers("OpenCV's ArUco", palette::kBaseline, frames.seen, frames.aruco)};

  chapter.blocks = {
      Paragraph{fmt::format(
          "{} frames of a wall with one to six two-layer markers of 0.2 m and twelve to thirty-two "
          "ArUco markers that confuse, 750 x 480 pixels, from {} to {} m. CPU time of one thread. "
          "The detector's stages are not the paper's: what a frame costs and what each marker adds "
          "are taken from the straight line of its time over the markers found. By default it "
          "looks "
          "for covered markers, too, wherever it finds no whole parent, which takes most of the "
          "time of such frames; the paper's detector and ArUco don't.",
          frames.seen.size(), kDistances.low, kDistances.high)},
      Table{"Table 1 of the paper",
            {"", "paper", "HArCo here"},
            {{"preprocessing of a frame", ms(kPaperFirst), ms(detection.first)},
             {"identification, each marker", ms(kPaperEach), ms(detection.each)},
             {"poses of a frame, the paper's fusion", ms(kPaperFusion), ms(paper)},
             {fmt::format("total ({} markers a frame here)", text(mean(frames.seen))),
              ms(kPaperTotal), ms(whole + paper)},
             {"detection with covered markers", "", ms(detect)},
             {"aligned poses with covariance", "", ms(joint)},
             {fmt::format("ArUco of OpenCV on the same frames ({} of its own markers a frame)",
                          text(mean(frames.aruco_seen))),
              "", ms(aruco)}}},
      Figure{"Time over the number of markers in view; each dot is a frame.", draw(plot)}};
  Strip strip{"A frame of each number of sheets.", {}};
  for (const Json& result : results)
    for (const Json& picture : result.at("pictures"))
      strip.pictures.push_back(picture_from(picture));
  if (!strip.pictures.empty()) chapter.blocks.emplace_back(strip);
  chapter.overview = plot;
  return chapter;
}

}  // namespace

const Experiment& stage_times() {
  static const StageTimes experiment;
  return experiment;
}

}  // namespace harco::lab
