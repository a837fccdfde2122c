// Section 4.5: a three-layer marker of 1.6 m on a wall; the camera walks a triangle before it, from
// as near as it sees anything to as far.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "lab/aruco.hpp"
#include "lab/experiments/chapters.hpp"
#include "lab/experiments/picture.hpp"
#include "lab/experiments/setup.hpp"
#include "lab/report/plot.hpp"

namespace harco::lab {
namespace {

constexpr double kSide = 1.6;
constexpr int kLayers = 3;
constexpr AxisRange kPaperRange{0.15, 32.0};
constexpr AxisRange kWanted{0.10, 40.0};
constexpr AxisRange kDistances{0.10, 80.0};  // of the path
constexpr int kBins = 20;                    // of distances, even in their logarithm
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

/// Where the paper's layers serve, the last one first.
constexpr std::array<AxisRange, kLayers> kPaperLayers{{{4.5, 32.0}, {0.4, 4.5}, {0.15, 0.4}}};

enum class Method { aligned, paper, board };
constexpr std::size_t kMethods = 3;
struct MethodInfo {
  const char* key;
  const char* name;
  const char* colour;
};
constexpr std::array<MethodInfo, kMethods> kMethodInfo{
    {{"harco", "HArCo", palette::kHarco},
     {"harco_paper", "HArCo, paper's fusion", palette::kPaper},
     {"board_joint", "board of ArUco markers, joint", palette::kBaseline2}}};

/// Out along one side of a triangle, across at 32 m, back along the other side; always with an eye
/// on the marker's middle.
class Triangle {
 public:
  Triangle(std::mt19937_64& random, int frames_a_leg)
      : frames_a_leg_(frames_a_leg), half_angle_(uniform(random, 5.0, 25.0) * kDegree) {}

  int frames() const { return 2 * frames_a_leg_ + across(); }

  /// The camera about a frame, at time 0, on its way: in a second it goes a fifth of the distance,
  /// and the hand that holds it moves its aim by as much.
  Motion camera_T_marker(int frame, std::mt19937_64& random) const {
    constexpr double kRate = 0.2;
    const double distance = this->distance(frame);
    // The aim of a hand, and of a wall that ends: farther off, a smaller part of the distance.
    const double reach = std::min(0.08 * distance, 0.3 * kSide);
    const Eigen::Vector2d aim =
        Eigen::Vector2d::Constant(0.5 * kSide) +
        Eigen::Vector2d(uniform(random, -reach, reach), uniform(random, -reach, reach));
    const double turn = uniform(random, 0.0, 360.0) * kDegree;
    const Eigen::Vector2d drift =
        kRate * distance * Eigen::Vector2d(std::cos(turn), std::sin(turn));
    const double tilt = std::abs(angle(frame));
    const double axis = (angle(frame) < 0.0 ? -90.0 : 90.0) * kDegree;
    const double roll = uniform(random, -10.0, 10.0) * kDegree;
    return [=](double t) {
      return look_at_marker(aim + t * drift, distance * (1.0 + kRate * t), tilt, axis,
                            roll + kRate * t);
    };
  }

  double distance(int frame) const {
    if (frame < frames_a_leg_) return on_leg(frame);
    if (frame < frames_a_leg_ + across())
      return kPaperRange.high * std::cos(half_angle_) / std::cos(angle(frame));
    return on_leg(frames() - 1 - frame);
  }

 private:
  int across() const { return frames_a_leg_ / 4; }

  double on_leg(int i) const {
    return kDistances.low * std::pow(kDistances.high / kDistances.low, (i + 0.5) / frames_a_leg_);
  }

  double angle(int frame) const {
    if (frame < frames_a_leg_) return -half_angle_;
    if (frame >= frames_a_leg_ + across()) return half_angle_;
    const double share = (frame - frames_a_leg_ + 0.5) / across();
    return std::atan((2.0 * share - 1.0) * std::tan(half_angle_));
  }

  int frames_a_leg_;
  double half_angle_;
};

/// What frames of about one distance have shown.
struct Bin {
  int frames = 0;
  std::array<int, kLayers> seen{};
  std::array<int, kMethods> posed{};
  std::array<RootMeanSquare, kMethods> position, depth, angle;
};

std::size_t bin_of(double distance) {
  const double share =
      std::log(distance / kDistances.low) / std::log(kDistances.high / kDistances.low);
  return static_cast<std::size_t>(std::clamp(static_cast<int>(share * kBins), 0, kBins - 1));
}

double edge_of(std::size_t bin) {
  return kDistances.low *
         std::pow(kDistances.high / kDistances.low, static_cast<double>(bin) / kBins);
}

double middle_of(std::size_t bin) { return std::sqrt(edge_of(bin) * edge_of(bin + 1)); }

class LargeScale final : public Experiment {
 public:
  std::string name() const override { return "4.5"; }
  std::string title() const override { return "From centimetres to tens of metres"; }

  Json settings(Extent extent) const override {
    return {{"revision", 1},
            {"side_m", kSide},
            {"layers", kLayers},
            {"focal_px", kFarFocal},
            {"distances_m", {kDistances.low, kDistances.high}},
            {"frames_a_leg", frames_a_leg(extent)}};
  }

  int items(Extent extent) const override {
    return extent == Extent::full ? 30 : extent == Extent::quick ? 4 : 1;
  }

  Json run(Extent extent, int item) const override;
  Chapter summarise(Extent, const std::vector<Json>& results) const override;

 private:
  static int frames_a_leg(Extent extent) {
    return extent == Extent::full ? 40 : extent == Extent::quick ? 24 : 4;
  }
};

Json LargeScale::run(Extent extent, int item) const {
  std::mt19937_64 random = generator(name(), item);
  const Triangle path(random, frames_a_leg(extent));
  const Studio studio(kFarFocal);
  const Camera& camera = studio.camera();
  const MarkerSet markers = paper_markers(kLayers, kSide);
  Detector detector(markers, camera);
  const Stage stage = stage_of(sheet_of(markers, 0));
  const Stage board = stage_of(aruco_board_sheet(kSide));

  std::vector<double> distances, layers;
  std::array<std::vector<double>, kMethods> position, depth, angle;
  Json pictures = Json::array();
  for (int frame = 0; frame < path.frames(); ++frame) {
    const Motion walk = path.camera_T_marker(frame, random);
    const Eigen::Isometry3d truth = walk(0.0);
    const Image image = studio.shoot(stage, walk, 0.0, random());
    const std::vector<Detection> detections = detector.detect(image.view());
    const double distance = path.distance(frame);
    const Image other = studio.shoot(board, walk, 0.0, random());
    const std::array<std::optional<Eigen::Isometry3d>, kMethods> estimates{
        pose_by(Fusion::joint, image, detections, markers, camera),
        pose_by(Fusion::paper, image, detections, markers, camera),
        aruco_board_poses(other, camera, kSide, kFarFocal * kSide / distance, Refinement::sub_pixel)
            .joint};
    distances.push_back(distance);
    layers.push_back(layers_seen(detections));
    for (std::size_t m = 0; m < kMethods; ++m) {
      const Vector6d error =
          estimates[m] ? pose_error(*estimates[m], truth) : Vector6d::Constant(kNaN);
      position[m].push_back(error.head<3>().norm());
      depth[m].push_back(error.z());
      angle[m].push_back(error.tail<3>().norm());
    }
    if (item == 0 && frame < path.frames() / 2 && frame % std::max(1, path.frames() / 16) == 0)
      pictures.push_back(
          to_json(picture_of(image.view(), fmt::format("{} m", text(distance)), detections)));
  }
  Json result{
      {"distance_m", to_json(distances)}, {"layers", to_json(layers)}, {"pictures", pictures}};
  for (std::size_t m = 0; m < kMethods; ++m)
    result[kMethodInfo[m].key] = {{"position_m", to_json(position[m])},
                                  {"depth_m", to_json(depth[m])},
                                  {"angle_rad", to_json(angle[m])}};
  return result;
}

std::array<Bin, kBins> bins_of(const std::vector<Json>& results) {
  std::array<Bin, kBins> bins;
  for (const Json& result : results) {
    const std::vector<double> distances = numbers(result.at("distance_m"));
    const std::vector<double> layers = numbers(result.at("layers"));
    for (std::size_t i = 0; i < distances.size(); ++i) {
      Bin& bin = bins[bin_of(distances[i])];
      ++bin.frames;
      for (std::size_t layer = 0; layer < kLayers; ++layer)
        bin.seen[layer] += (static_cast<unsigned>(layers[i]) >> layer & 1U) != 0;
    }
    for (std::size_t m = 0; m < kMethods; ++m) {
      const Json& of = result.at(kMethodInfo[m].key);
      const std::vector<double> position = numbers(of.at("position_m"));
      const std::vector<double> depth = numbers(of.at("depth_m"));
      const std::vector<double> angle = numbers(of.at("angle_rad"));
      for (std::size_t i = 0; i < distances.size(); ++i) {
        if (!std::isfinite(position[i])) continue;
        Bin& bin = bins[bin_of(distances[i])];
        ++bin.posed[m];
        bin.position[m].add(position[i]);
        bin.depth[m].add(depth[i]);
        bin.angle[m].add(angle[i]);
      }
    }
  }
  return bins;
}

/// The longest stretch of bins of which all satisfy a condition, as distances; empty if none does.
template <typename Condition>
std::string longest(const std::array<Bin, kBins>& bins, Condition condition) {
  std::size_t best = 0, length = 0;
  for (std::size_t from = 0; from < bins.size(); ++from) {
    std::size_t to = from;
    while (to < bins.size() && bins[to].frames > 0 && condition(bins[to])) ++to;
    if (to - from > length) best = from, length = to - from;
  }
  return length > 0
             ? fmt::format("{} to {} m", text(edge_of(best), 2), text(edge_of(best + length), 2))
             : "none";
}

Series over_distance(const std::array<Bin, kBins>& bins, const char* label, const char* colour,
                     Mark mark, const std::function<double(const Bin&)>& value) {
  Series series{label, colour, mark, {}, {}};
  for (std::size_t k = 0; k < bins.size(); ++k) {
    if (bins[k].frames == 0) continue;
    series.x.push_back(middle_of(k));
    series.y.push_back(value(bins[k]));
  }
  return series;
}

Chapter LargeScale::summarise(Extent, const std::vector<Json>& results) const {
  const std::array<Bin, kBins> bins = bins_of(results);
  int wanted = 0, wanted_lost = 0, paper = 0, board_lost = 0;
  for (const Json& result : results) {
    const std::vector<double> distances = numbers(result.at("distance_m"));
    const std::vector<double> ours = numbers(result.at("harco").at("position_m"));
    const std::vector<double> board = numbers(result.at("board_joint").at("position_m"));
    for (std::size_t i = 0; i < distances.size(); ++i) {
      if (distances[i] >= kWanted.low && distances[i] <= kWanted.high) {
        ++wanted;
        wanted_lost += !std::isfinite(ours[i]);
        board_lost += !std::isfinite(board[i]);
      }
      paper += distances[i] >= kPaperRange.low && distances[i] <= kPaperRange.high;
    }
  }
  const auto unbroken = [&](std::size_t m) {
    return longest(bins, [m](const Bin& bin) { return bin.posed[m] == bin.frames; });
  };

  Chapter chapter;
  chapter.findings = {
      {"Distances with a pose in every frame", "0.15 to 32 m", unbroken(0), unbroken(2), "", {}},
      {"Frames lost from 0.10 to 40 m", "", fmt::format("{} of {}", wanted_lost, wanted),
       fmt::format("{} of {}", board_lost, wanted), "none", wanted_lost == 0}};

  Plot error;
  error.title = "RMSE of position over distance";
  error.x_label = "distance, m";
  error.y_label = "m";
  error.log_x = error.log_y = true;
  error.bands = {{kPaperRange.low, kPaperRange.high, "the paper's range"}};
  Plot angle = error;
  angle.title = "RMSE of attitude over distance";
  angle.y_label = "rad";
  for (std::size_t m = 0; m < kMethods; ++m) {
    const MethodInfo& info = kMethodInfo[m];
    error.series.push_back(over_distance(bins, info.name, info.colour, Mark::line,
                                         [m](const Bin& bin) { return bin.position[m].value(); }));
    angle.series.push_back(over_distance(bins, info.name, info.colour, Mark::line,
                                         [m](const Bin& bin) { return bin.angle[m].value(); }));
  }
  Plot layers = error;
  layers.title = "Which layer serves where";
  layers.y_label = "frames in which it is seen, %";
  layers.log_y = false;
  layers.y_range = {-3.0, 116.0};
  layers.series.clear();
  constexpr std::array<const char*, kLayers> kColours{palette::kHarco, palette::kPaper,
                                                      palette::kBaseline2};
  Table serving{"Where each layer is found in 95 % of the frames", {"", "paper", "here"}, {}};
  for (std::size_t layer = 0; layer < kLayers; ++layer) {
    const std::string name = fmt::format("layer {}", layer + 1);
    layers.series.push_back(
        over_distance(bins, name.c_str(), kColours[layer], Mark::line,
                      [layer](const Bin& bin) { return 100.0 * bin.seen[layer] / bin.frames; }));
    serving.rows.push_back(
        {name, fmt::format("{:g} to {:g} m", kPaperLayers[layer].low, kPaperLayers[layer].high),
         longest(bins, [layer](const Bin& bin) { return bin.seen[layer] >= 0.95 * bin.frames; })});
  }

  Table rows{"Over the distance: frames with a pose, RMSE of position and attitude",
             {"distance, m", "frames", "HArCo", "mm", "mrad", "paper's fusion, mm", "mrad", "board",
              "mm", "mrad"},
             {}};
  for (std::size_t k = 0; k < bins.size(); ++k) {
    const Bin& bin = bins[k];
    if (bin.frames == 0) continue;
    const auto mm = [&](std::size_t m) { return text(1e3 * bin.position[m].value()); };
    const auto mrad = [&](std::size_t m) { return text(1e3 * bin.angle[m].value()); };
    rows.rows.push_back({fmt::format("{} to {}", text(edge_of(k), 2), text(edge_of(k + 1), 2)),
                         fmt::format("{}", bin.frames), percent(bin.posed[0], bin.frames), mm(0),
                         mrad(0), mm(1), mrad(1), percent(bin.posed[2], bin.frames), mm(2),
                         mrad(2)});
  }

  chapter.blocks = {
      Paragraph{fmt::format(
          "A three-layer marker of 1.6 m on a wall, 750 x 480 pixels, f = 700 px (35 px of side at "
          "32 m, as in the paper). The camera goes out along one side of a triangle, across at 32 "
          "m "
          "and back along the other side, with the marker's middle in view as a hand would hold "
          "it; "
          "{} runs, {} frames within the paper's distances and more beyond: to 0.10 m and to 80 m. "
          "The paper measured against differential GPS and gives its curve without numbers; here "
          "it is the truth. The baseline is a board of 24 ArUco markers in the same square.",
          results.size(), paper)},
      Figure{"Figure 10 of the paper: its three layers, and where each is seen.", draw(layers)},
      serving,
      Figure{
          "Figure 11 of the paper. Errors grow with the distance, along the optical axis with its "
          "square (Eq. 18 and the errata).",
          draw_grid({error, angle}, 2)},
      rows};
  if (const Json& pictures = results.front().at("pictures"); !pictures.empty()) {
    Strip strip{"On the way out. Orange, green, blue: layers 1, 2, 3.", {}};
    for (const Json& picture : pictures) strip.pictures.push_back(picture_from(picture));
    chapter.blocks.emplace_back(strip);
  }
  chapter.overview = error;
  return chapter;
}

}  // namespace

const Experiment& large_scale() {
  static const LargeScale experiment;
  return experiment;
}

}  // namespace harco::lab
