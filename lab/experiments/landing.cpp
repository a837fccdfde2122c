// Section 4.4: a quadrotor comes down from 4 m onto a marker of 0.7 m, by what its camera sees
// alone.
#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>

#include "lab/experiments/chapters.hpp"
#include "lab/experiments/flights.hpp"
#include "lab/experiments/picture.hpp"
#include "lab/experiments/setup.hpp"
#include "lab/flight/flight.hpp"
#include "lab/report/plot.hpp"

namespace harco::lab {
namespace {

constexpr double kSide = 0.7;
constexpr double kStart_m = 4.0;  // of the camera above the ground
constexpr double kSpeed = 0.4;    // metres per second
constexpr double kHover_s = 2.0;  // before the descent
constexpr int kFlights = 12;
// The paper's limits for a landing aren't given; these are ours.
constexpr double kMostBeside_m = 0.25;
constexpr double kMostSink = 0.8;

FlightSetup setup_of(Extent extent, std::mt19937_64& random) {
  FlightSetup setup;
  setup.start_height_m = extent == Extent::tiny ? 0.6 : kStart_m - setup.vehicle.foot_m;
  setup.start_m = {uniform(random, -0.25, 0.25), uniform(random, -0.25, 0.25)};
  const double speed = uniform(random, 0.0, 2.5);
  const double from = uniform(random, 0.0, 6.28);
  setup.wind.mean_mps = {speed * std::cos(from), speed * std::sin(from), 0.0};
  setup.wind.gust_mps = 0.2 * speed;
  setup.frame_rate = extent == Extent::tiny ? 15.0 : kFrameRate;
  setup.limit_s = 40.0;
  return setup;
}

class Landing final : public Experiment {
 public:
  std::string name() const override { return "4.4"; }
  std::string title() const override { return "Landing by vision alone"; }

  Json settings(Extent extent) const override {
    return {{"revision", 1},
            {"side_m", kSide},
            {"layers", 2},
            {"start_m", kStart_m},
            {"p", 1.0},
            {"d", 0.8},
            {"speed_m_s", kSpeed},
            {"focal_px", landing_setup(markers(), false).camera.fx},
            {"frame_rate", extent == Extent::tiny ? 15.0 : kFrameRate}};
  }

  int items(Extent extent) const override {
    return extent == Extent::full ? kFlights : extent == Extent::quick ? 2 : 1;
  }

  Json run(Extent extent, int item) const override {
    std::mt19937_64 random = generator(name(), item);
    FlightSetup setup = setup_of(extent, random);
    const double hover_s = extent == Extent::tiny ? 0.7 : kHover_s;
    const double descent_s = setup.start_height_m / kSpeed;
    for (const double share : {0.0, 0.35, 0.6, 0.75, 0.85, 0.93, 0.98})
      setup.pictures_s.push_back(hover_s + share * descent_s);
    LinearApproach approach(setup.start_height_m, hover_s, kSpeed);
    const VisionSetup vision = landing_setup(markers(), false);
    const FlightLog log = fly(setup, vision, nullptr, approach, random());
    return to_json(log, item == 0);
  }

  Chapter summarise(Extent extent, const std::vector<Json>& results) const override;

 private:
  static const MarkerSet& markers() {
    static const MarkerSet set = paper_markers(2, kSide);
    return set;
  }
};

Chapter Landing::summarise(Extent, const std::vector<Json>& results) const {
  int landed = 0, frames = 0, lost = 0;
  double sink = 0.0;
  RootMeanSquare beside, believed;
  for (const Json& result : results) {
    frames += result.at("frames").get<int>();
    lost += result.at("lost_frames").get<int>();
    const auto truth = numbers(result.at("height_m"));
    const auto belief = numbers(result.at("believed_m"));
    for (std::size_t i = 0; i < truth.size(); ++i)
      if (std::isfinite(belief[i])) believed.add(belief[i] - truth[i]);
    if (!result.contains("contact")) continue;
    const Json& contact = result.at("contact");
    const double off = std::hypot(contact.at("x_m").get<double>(), contact.at("y_m").get<double>());
    beside.add(off);
    sink = std::max(sink, contact.at("sink_mps").get<double>());
    landed += off < kMostBeside_m && contact.at("sink_mps").get<double>() < kMostSink &&
              result.at("settled").get<bool>();
  }

  const Json& first = results.front();
  const double foot_m = VehicleOptions{}.foot_m;
  const auto raised = [&](const char* field) {
    std::vector<double> heights = numbers(first.at(field));
    for (double& height : heights) height += foot_m;
    return heights;
  };
  const std::vector<double> time_s = numbers(first.at("time_s"));
  Plot heights;
  heights.title = "Height of the camera";
  heights.x_label = "time, s";
  heights.y_label = "m";
  heights.series = {{"command", palette::kTruth, Mark::dashed, time_s, raised("commanded_m")},
                    {"HArCo", palette::kHarco, Mark::line, time_s, raised("believed_m")}};
  heights.rules = {{foot_m, "on the ground", palette::kTruth, false}};
  Plot layers;
  layers.title = "Markers in the pose";
  layers.x_label = "height of the camera, m";
  layers.y_label = "markers";
  layers.y_range = AxisRange{-0.3, 6.5};
  const std::vector<double> height_m = raised("height_m");
  layers.series = {
      {"parent", palette::kHarco, Mark::dots, height_m, numbers(first.at("layer_1"))},
      {"children", palette::kPaper, Mark::dots, height_m, numbers(first.at("layer_2"))}};

  // Below which height the parent takes no part any more, and above which no child does.
  double handover_m = 0.0, first_child_m = 0.0;
  for (std::size_t i = 0; i < height_m.size(); ++i) {
    if (numbers(first.at("layer_1"))[i] > 0.0) handover_m = height_m[i];
    if (first_child_m == 0.0 && numbers(first.at("layer_2"))[i] > 0.0) first_child_m = height_m[i];
  }

  const int count = static_cast<int>(results.size());
  Chapter chapter;
  chapter.findings = {{"Landings on the marker", "shown once",
                       fmt::format("{} of {}", landed, count), "", "all", landed == count},
                      {"Pictures without a pose, hover to contact", "none mentioned",
                       fmt::format("{} of {}", lost, frames), "", "none", lost == 0},
                      {"The parent leaves the image, its children serve, at",
                       "about 0.5 m",
                       fmt::format("{:.2f} m", handover_m),
                       "",
                       "",
                       {}}};
  chapter.blocks = {
      Paragraph{fmt::format(
          "A quadrotor of 0.65 m (rigid bodies and contacts by MuJoCo, rotors that lag, wind up to "
          "2.5 m/s with gusts) hovers 4 m above a two-layer marker of 0.7 m and comes down at {} "
          "m/s "
          "to 0.2 m below the ground, by the paper's controller, P = 1 and D = 0.8. Position comes "
          "from pictures alone, 30 a second, 50 ms late; attitude from inertial sensors that are "
          "off "
          "by some tenths of a degree. The paper doesn't name the lens; that the parent leaves the "
          "image at about 0.5 m means 350 px of focal length, which is used here. The camera "
          "stands "
          "0.2 m above the ground when landed. Touching down at less than {} m/s within {} m of "
          "the "
          "marker's middle and standing there counts as a landing.",
          kSpeed, kMostSink, kMostBeside_m)},
      Figure{"Figures 8 and 9 of the paper, the first flight.", draw_grid({heights, layers}, 2)},
      Table{
          "All flights",
          {"", ""},
          {{"error of the height believed, root mean square",
            text(100.0 * believed.value()) + " cm"},
           {"beside the middle at contact, root mean square", text(100.0 * beside.value()) + " cm"},
           {"greatest speed of contact", text(sink) + " m/s"},
           {"first child seen at", text(first_child_m) + " m"}}}};
  add_strip(chapter,
            "Figure 8 of the paper, from the vehicle. Orange: the parent, green: children.", first);
  return chapter;
}

}  // namespace

const Experiment& landing() {
  static const Landing experiment;
  return experiment;
}

}  // namespace harco::lab
