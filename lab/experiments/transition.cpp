// Section 4.1: a camera sweeps through the heights at which a two-layer marker leaves the image and
// its children take over.
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "lab/aruco.hpp"
#include "lab/experiments/chapters.hpp"
#include "lab/experiments/picture.hpp"
#include "lab/experiments/setup.hpp"
#include "lab/render.hpp"
#include "lab/report/plot.hpp"

namespace harco::lab {
namespace {

constexpr double kSide = 0.2;
constexpr double kChildSide = kSide / 7.0;
constexpr int kSweeps = 57;
constexpr AxisRange kLowEnd{0.27, 0.40}, kHighEnd{1.00, 1.30};  // of a sweep, metres
constexpr AxisRange kSpeed{0.3, 0.9};                           // metres per second
constexpr double kMostTilt = 25.0 * kDegree;
constexpr double kAim = 0.025;  // how far beside the centre the camera looks, metres
constexpr double kFirstBin = 0.25, kBin = 0.05;  // of heights: from, width, metres
constexpr int kPictures = 7;

/// What one system made of one frame.
enum class Seen { lost, right, wrong };

Seen judged(const std::optional<Eigen::Isometry3d>& pose, const Eigen::Isometry3d& truth) {
  if (!pose) return Seen::lost;
  return is_right(*pose, truth) ? Seen::right : Seen::wrong;
}

/// A camera on its way up or down.
class Sweep {
 public:
  Sweep(std::mt19937_64& random, Extent extent)
      : wander_x_(random, 0.1, 0.6), wander_y_(random, 0.1, 0.6), wander_tilt_(random, 0.1, 0.6) {
    from_ = uniform(random, kLowEnd.low, kLowEnd.high);
    to_ = uniform(random, kHighEnd.low, kHighEnd.high);
    const double speed = uniform(random, kSpeed.low, kSpeed.high);
    frames_ = extent == Extent::tiny ? 4 : static_cast<int>((to_ - from_) / speed * kFrameRate);
    if (uniform(random, 0.0, 1.0) < 0.5) std::swap(from_, to_);
    tilt_ = uniform(random, 0.0, kMostTilt);
    tilt_axis_ = uniform(random, 0.0, 2.0 * std::numbers::pi);
    roll_ = uniform(random, 0.0, 2.0 * std::numbers::pi);
  }

  int frames() const { return frames_; }
  double height(double t) const { return from_ + (to_ - from_) * (kFrameRate * t + 0.5) / frames_; }

  Eigen::Isometry3d camera_T_marker(double t) const {
    const Eigen::Vector2d aim(0.5 * kSide + kAim * wander_x_(t), 0.5 * kSide + kAim * wander_y_(t));
    const double tilt = std::abs(tilt_ + 3.0 * kDegree * wander_tilt_(t));
    return look_at_marker(aim, height(t), tilt, tilt_axis_, roll_ + 0.2 * wander_tilt_(t));
  }

 private:
  Wander wander_x_, wander_y_, wander_tilt_;
  double from_ = 0.0, to_ = 0.0, tilt_ = 0.0, tilt_axis_ = 0.0, roll_ = 0.0;
  int frames_ = 0;
};

/// How often something happened in frames of one height.
struct Bin {
  int frames = 0, lost = 0, aruco_lost = 0, small_lost = 0, parent_seen = 0, child_seen = 0;
};

class Transition final : public Experiment {
 public:
  std::string name() const override { return "4.1"; }
  std::string title() const override { return "Through the transition area"; }

  Json settings(Extent) const override {
    return {{"revision", 1},
            {"side_m", kSide},
            {"layers", 2},
            {"focal_px", kNearFocal},
            {"frame_rate", kFrameRate},
            {"heights_m", {kLowEnd.low, kHighEnd.high}},
            {"speeds_m_s", {kSpeed.low, kSpeed.high}}};
  }

  int items(Extent extent) const override {
    return extent == Extent::full ? kSweeps : extent == Extent::quick ? 7 : 1;
  }

  Json run(Extent extent, int item) const override {
    std::mt19937_64 random = generator(name(), item);
    const Sweep sweep(random, extent);
    const Studio studio(kNearFocal);
    const Camera& camera = studio.camera();
    const MarkerSet markers = paper_markers(2, kSide);
    Detector detector(markers, camera);
    const Stage stage = stage_of(sheet_of(markers, 0, 1.5));
    const Stage aruco_large = stage_of(aruco_sheet(kSide));
    const Stage aruco_small = stage_of(aruco_sheet(kChildSide));
    // The small ArUco marker lies where the marker's middle child does.
    const Eigen::Translation3d marker_T_small(0.5 * (kSide - kChildSide),
                                              0.5 * (kSide - kChildSide), 0.0);
    std::vector<double> heights, harco, layers, aruco, small;
    Json pictures = Json::array();
    for (int frame = 0; frame < sweep.frames(); ++frame) {
      const double t = frame / kFrameRate;
      const Motion motion = [&](double time) { return sweep.camera_T_marker(time); };
      const Motion small_motion = [&](double time) { return motion(time) * marker_T_small; };
      const double height = sweep.height(t);
      const Image image = studio.shoot(stage, motion, t, random());
      const std::vector<Detection> detections = detector.detect(image.view());
      heights.push_back(height);
      layers.push_back(layers_seen(detections));
      const auto note = [](std::vector<double>& to, Seen seen) {
        to.push_back(static_cast<double>(seen));
      };
      note(harco, judged(pose_by(Fusion::joint, image, detections, markers, camera), motion(t)));
      const auto aruco_seen = [&](const Stage& print, const Motion& moves, double side) {
        const Image other = studio.shoot(print, moves, t, random());
        return judged(aruco_pose(other, camera, side, kNearFocal * side / height), moves(t));
      };
      note(aruco, aruco_seen(aruco_large, motion, kSide));
      note(small, aruco_seen(aruco_small, small_motion, kChildSide));
      const int every = std::max(1, sweep.frames() / kPictures);
      if (item == 0 && frame % every == every / 2)
        pictures.push_back(
            to_json(picture_of(image.view(), fmt::format("{:.2f} m", height), detections)));
    }
    return {{"height_m", to_json(heights)},  {"harco", to_json(harco)},
            {"layers", to_json(layers)},     {"aruco", to_json(aruco)},
            {"aruco_small", to_json(small)}, {"pictures", pictures}};
  }

  Chapter summarise(Extent, const std::vector<Json>& results) const override;
};

struct Totals {
  int frames = 0, lost = 0, wrong = 0, aruco_lost = 0, small_lost = 0, either_lost = 0;
};

Chapter Transition::summarise(Extent, const std::vector<Json>& results) const {
  const int bins = static_cast<int>(std::ceil((kHighEnd.high - kFirstBin) / kBin));
  std::vector<Bin> by_height(static_cast<std::size_t>(bins));
  Totals all, area;
  Chapter chapter;
  for (const Json& result : results) {
    const std::vector<double> heights = numbers(result.at("height_m"));
    const std::vector<double> harco = numbers(result.at("harco"));
    const std::vector<double> layers = numbers(result.at("layers"));
    const std::vector<double> aruco = numbers(result.at("aruco"));
    const std::vector<double> small = numbers(result.at("aruco_small"));
    const auto is = [](double value, Seen seen) { return value == static_cast<double>(seen); };
    for (std::size_t i = 0; i < heights.size(); ++i) {
      const bool lost = is(harco[i], Seen::lost);
      const bool aruco_lost = !is(aruco[i], Seen::right), small_lost = !is(small[i], Seen::right);
      const auto count = [&](Totals& totals) {
        ++totals.frames;
        totals.lost += lost;
        totals.wrong += is(harco[i], Seen::wrong);
        totals.aruco_lost += aruco_lost;
        totals.small_lost += small_lost;
        totals.either_lost += aruco_lost && small_lost;
      };
      count(all);
      if (heights[i] > kTransitionLow && heights[i] < kTransitionHigh) count(area);
      const int k = std::clamp(static_cast<int>((heights[i] - kFirstBin) / kBin), 0, bins - 1);
      Bin& bin = by_height[static_cast<std::size_t>(k)];
      ++bin.frames;
      bin.lost += lost;
      bin.aruco_lost += aruco_lost;
      bin.small_lost += small_lost;
      const auto seen = static_cast<unsigned>(layers[i]);
      bin.parent_seen += (seen & 1U) != 0;
      bin.child_seen += (seen & 2U) != 0;
    }
  }

  const auto series = [&](const char* label, const char* colour, Mark mark, int Bin::*count) {
    Series one{label, colour, mark, {}, {}};
    for (std::size_t k = 0; k < by_height.size(); ++k) {
      if (by_height[k].frames == 0) continue;
      one.x.push_back(kFirstBin + kBin * (static_cast<double>(k) + 0.5));
      one.y.push_back(100.0 * by_height[k].*count / by_height[k].frames);
    }
    return one;
  };
  const Band band{kTransitionLow, kTransitionHigh, "transition area"};
  Plot lost;
  lost.title = "Lost frames over height";
  lost.x_label = "height, m";
  lost.y_label = "frames without a pose, %";
  lost.y_range = {-3.0, 116.0};
  lost.bands = {band};
  lost.series = {series("ArUco, 0.2 m", palette::kBaseline, Mark::line, &Bin::aruco_lost),
                 series("ArUco, a child's size", palette::kBaseline2, Mark::line, &Bin::small_lost),
                 series("HArCo", palette::kHarco, Mark::line, &Bin::lost)};
  Plot layers = lost;
  layers.title = "Which layer serves";
  layers.y_label = "frames in which it is seen, %";
  layers.series = {series("parent", palette::kHarco, Mark::line, &Bin::parent_seen),
                   series("children", palette::kPaper, Mark::line, &Bin::child_seen)};

  const auto share = [](int count, const Totals& of) {
    return fmt::format("{} of {} ({})", count, of.frames, percent(count, of.frames));
  };
  chapter.findings = {
      {"Frames lost in the transition area (0.55 to 0.88 m)", "drops within the area, to a few %",
       share(area.lost, area), share(area.aruco_lost, area), "none", area.lost == 0},
      {"Frames lost at all heights of the sweeps",
       "",
       share(all.lost, all),
       share(all.aruco_lost, all),
       "",
       {}},
      {"Wrong poses at all heights", "", share(all.wrong, all), "", "none", all.wrong == 0}};
  chapter.blocks = {
      Paragraph{fmt::format(
          "A two-layer marker of 0.2 m; the camera (750 x 480, f = 1310 px, which the paper's "
          "transition area implies) goes up or down through the heights at which the parent leaves "
          "the image, {} sweeps at 0.3 to 0.9 m/s, tilted by up to 25 degrees, turned in any way, "
          "looking beside the centre by up to 2.5 cm. Beside it two ArUco markers alone, in the "
          "same places: one as large as the parent, one as large as a child.",
          results.size())},
      Figure{
          "Figure 5 of the paper. ArUco loses a marker as soon as an edge of it leaves the image.",
          draw_grid({lost, layers}, 2)},
      Table{
          "Frames without a right pose",
          {"", "transition area", "all heights"},
          {{"HArCo, two layers", share(area.lost + area.wrong, area),
            share(all.lost + all.wrong, all)},
           {"ArUco of the parent's size", share(area.aruco_lost, area), share(all.aruco_lost, all)},
           {"ArUco of a child's size", share(area.small_lost, area), share(all.small_lost, all)},
           {"both ArUco markers together", share(area.either_lost, area),
            share(all.either_lost, all)}}}};
  if (const Json& pictures = results.front().at("pictures"); !pictures.empty()) {
    Strip strip{"One sweep. Orange: the parent, green: children.", {}};
    for (const Json& picture : pictures) strip.pictures.push_back(picture_from(picture));
    chapter.blocks.emplace_back(strip);
  }
  chapter.overview = lost;
  return chapter;
}

}  // namespace

const Experiment& transition() {
  static const Transition experiment;
  return experiment;
}

}  // namespace harco::lab
