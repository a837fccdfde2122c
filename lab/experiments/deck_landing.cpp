// Section 4.6: an oscillating platform, whose level periods are predicted, and landings in them;
// then a thousand landings on ships in rising seas.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>

#include <fmt/format.h>

#include "lab/experiments/chapters.hpp"
#include "lab/experiments/flights.hpp"
#include "lab/experiments/setup.hpp"
#include "lab/flight/flight.hpp"
#include "lab/report/plot.hpp"

namespace harco::lab {
namespace {

constexpr double kSide = 0.7;
constexpr double kInf = std::numeric_limits<double>::infinity();
constexpr double kFrames = 10.0;  // pictures a second

// On the platform.
constexpr double kPlatformLevel = 5.0 * kDegree;
constexpr double kHover_m = 3.0;
constexpr double kDescent = 0.5;  // metres a second, as the paper's linear trajectory

// At sea: what the planner asks for, and what the vehicle bears.
constexpr double kSeaLevel = 3.5 * kDegree;
constexpr double kSeaHeaveRate = 0.5;
constexpr double kMostTilt = 4.5 * kDegree;
constexpr double kMostSink = 0.8;      // m/s, along the deck's normal
constexpr double kMostSideways = 0.5;  // m/s
constexpr double kMostBeside_m = 0.35;
constexpr double kGiveUp_s = 240.0;
constexpr int kStates = 4;  // sea states 2 … 5

/// What one item is.
enum class Kind {
  platform,  ///< the paper's: hover, fit, predict; the first ones land
  sea,       ///< some landings on ships, seen by the model of vision
  twin       ///< a landing at sea by pictures, and the same by the model
};
struct Part {
  Kind kind;
  int index;
};

struct Amounts {
  int platforms, landings, seas, flights_a_sea, twins;
};
Amounts amounts(Extent extent) {
  if (extent == Extent::full) return {60, 12, 50, 20, 8};
  if (extent == Extent::quick) return {3, 1, 1, 12, 0};
  return {1, 1, 0, 0, 0};
}

Part part_of(Extent extent, int item) {
  const Amounts all = amounts(extent);
  if (item < all.platforms) return {Kind::platform, item};
  item -= all.platforms;
  if (item < all.seas) return {Kind::sea, item};
  return {Kind::twin, item - all.seas};
}

const MarkerSet& markers() {
  static const MarkerSet set = paper_markers(2, kSide);
  return set;
}

bool is_level(const DeckMotion& deck, const LevelLimits& limits, double begin_s, double end_s) {
  constexpr double kStep_s = 0.02;
  for (double t = begin_s; t <= end_s; t += kStep_s)
    if (std::abs(deck.value(kRoll, t)) > limits.roll_rad ||
        std::abs(deck.value(kPitch, t)) > limits.pitch_rad ||
        std::abs(deck.rate(kHeave, t)) > limits.heave_rate_mps)
      return false;
  return true;
}

// --- The platform
// ----------------------------------------------------------------------------------

PlatformPlan platform_plan(Extent extent) {
  PlatformPlan plan;
  plan.hover_m = kHover_m;
  plan.speed_mps = kDescent;
  plan.level = {kPlatformLevel, kPlatformLevel, kInf};
  plan.windows.min_duration_s = 0.8;
  plan.windows.min_probability = 0.999;
  plan.windows.level.tilt_sd_rad = VehicleOptions{}.attitude_bias_rad;
  plan.deck.refit_s = 5.0;
  plan.deck.max_samples = 600;
  plan.deck.oscillation.max_order = 3;
  if (extent == Extent::tiny) {
    plan.predict_s = 20.0;
    plan.deck.fit_s = 12.0;
    plan.deck.validate_s = 4.0;
    plan.deck.refit_s = 4.0;
    plan.deck.max_samples = 150;
    plan.deck.oscillation.max_order = 2;
    plan.windows.level.draws = 400;
  }
  return plan;
}

/// The samples, and what was made of them: Figure 12.
Json example(const FlightLog& log, const PlatformApproach& approach) {
  std::vector<double> raw_s, roll, pitch, model_s, model_roll, model_pitch;
  for (const DeckSample& sample : log.samples) {
    raw_s.push_back(sample.time_s);
    roll.push_back(sample.motion[kRoll] / kDegree);
    pitch.push_back(sample.motion[kPitch] / kDegree);
  }
  if (approach.forecast())
    for (double t = 0.0; t < log.end_s; t += 0.1) {
      const auto& axes = approach.forecast()->axes;
      model_s.push_back(t);
      model_roll.push_back(axes[kRoll].fit().oscillation.value(t) / kDegree);
      model_pitch.push_back(axes[kPitch].fit().oscillation.value(t) / kDegree);
    }
  return {{"raw_s", to_json(raw_s)},           {"roll", to_json(roll)},
          {"pitch", to_json(pitch)},           {"model_s", to_json(model_s)},
          {"model_roll", to_json(model_roll)}, {"model_pitch", to_json(model_pitch)}};
}

Json run_platform(Extent extent, int index, std::mt19937_64& random) {
  FlightSetup setup;
  setup.deck = platform_motion(random());
  setup.start_height_m = kHover_m;
  setup.start_m = {uniform(random, -0.2, 0.2), uniform(random, -0.2, 0.2)};
  setup.wind.mean_mps = {uniform(random, -1.0, 1.0), uniform(random, -1.0, 1.0), 0.0};
  setup.wind.gust_mps = 0.2;
  setup.frame_rate = kFrames;
  const PlatformPlan plan = platform_plan(extent);
  const bool lands = index < amounts(extent).landings;
  if (!lands) setup.limit_s = plan.predict_s + 7.0;  // a forecast or two
  for (int i = 0; i < 9; ++i) setup.pictures_s.push_back(plan.predict_s + 3.0 * i);
  PlatformApproach approach(plan);
  const VisionSetup vision = landing_setup(markers(), true);
  std::optional<ModelledVision> model;
  if (extent == Extent::tiny) model.emplace(vision, 2, 1);
  const FlightLog log = fly(setup, vision, model ? &*model : nullptr, approach, random());

  Json json = to_json(log, index == 0 && extent != Extent::tiny, index == 0);
  json["kind"] = "platform";
  json["lands"] = lands;
  json["windows"] = Json::array();
  for (const LevelWindow& window : approach.windows())
    json["windows"].push_back(
        {{"begin_s", window.begin_s},
         {"end_s", window.end_s},
         {"probability", window.probability},
         {"level", is_level(setup.deck, plan.level, window.begin_s, window.end_s)}});
  if (approach.chosen()) json["chosen"] = {approach.chosen()->begin_s, approach.chosen()->end_s};
  if (index == 0) json["example"] = example(log, approach);
  return json;
}

// --- Ships
// -----------------------------------------------------------------------------------------

TouchdownOptions sea_landing() {
  TouchdownOptions landing;
  landing.level = {kSeaLevel, kSeaLevel, kSeaHeaveRate};
  landing.hold_height_m = 2.5;
  landing.look_ahead_s = 12.0;
  landing.max_forecast_age_s = 3.0;
  landing.windows.min_duration_s = 1.2;
  landing.windows.level.draws = 400;
  landing.windows.level.step_s = 0.15;
  landing.windows.level.tilt_sd_rad = VehicleOptions{}.attitude_bias_rad;
  return landing;
}

DeckOptions sea_deck() {
  DeckOptions deck;
  deck.window_s = 45.0;
  deck.refit_s = 2.0;
  deck.relearn_s = 20.0;
  deck.max_samples = 225;
  deck.oscillation.max_order = 3;
  return deck;
}

struct SeaFlight {
  int state;
  FlightSetup setup;
  std::uint64_t seed;
};

SeaFlight sea_flight(int number, std::mt19937_64& random) {
  SeaFlight flight;
  flight.state = 2 + number % kStates;
  Seaway sea = sea_state(flight.state);
  sea.heading_rad = uniform(random, 2.2, 3.1);  // from ahead or the bow
  FlightSetup& setup = flight.setup;
  setup.deck = ship_motion(sea, random());
  constexpr std::array<double, kStates> kWind{4.0, 7.0, 9.0, 11.0};
  const double wind = kWind[static_cast<std::size_t>(flight.state - 2)] * uniform(random, 0.7, 1.1);
  const double from = uniform(random, 0.0, 6.28);
  setup.wind.mean_mps = {wind * std::cos(from), wind * std::sin(from), 0.0};
  setup.wind.gust_mps = 0.12 * wind;
  setup.start_height_m = 3.0;
  setup.start_m = {uniform(random, -0.3, 0.3), uniform(random, -0.3, 0.3)};
  setup.frame_rate = kFrames;
  setup.knows_height = true;
  setup.limit_s = kGiveUp_s + 60.0;
  setup.pilot.height.p = 4.0;
  setup.pilot.height.d = 3.4;
  flight.seed = random();
  return flight;
}

Json run_sea_flight(const SeaFlight& flight, const VisionSetup& vision,
                    const ModelledVision* model) {
  const TouchdownOptions landing = sea_landing();
  PlannedApproach approach(landing, sea_deck(), kGiveUp_s);
  approach.keep_forecast_of(0.0);
  const FlightLog log = fly(flight.setup, vision, model, approach, flight.seed);
  Json json = to_json(log, false, false);
  json["state"] = flight.state;
  json["aborts"] = approach.planner().aborts();
  json["chosen"] = Json::array();
  for (const LevelWindow& window : approach.chosen())
    json["chosen"].push_back(
        {window.probability,
         is_level(flight.setup.deck, landing.level, window.begin_s, window.end_s) ? 1 : 0});
  // What the first forecast says of some times to come, be they likely to be level or not. Later
  // ones are asked only where no window came up, and their average says nothing.
  json["asked"] = Json::array();
  if (approach.kept())
    for (const double ahead_s : {1.0, 3.0, 6.0, 10.0}) {
      const double begin_s = approach.kept()->as_of_s + ahead_s;
      const double end_s = begin_s + 1.0;
      const double probability =
          level_probability(*approach.kept(), landing.level, begin_s, end_s, landing.windows.level);
      json["asked"].push_back(
          {probability, is_level(flight.setup.deck, landing.level, begin_s, end_s) ? 1 : 0});
    }
  return json;
}

/// The model of vision that all flights at sea share.
const ModelledVision& modelled_vision() {
  constexpr int kPictures = 24;  // at each height
  static const ModelledVision model(landing_setup(markers(), true), kPictures, 46);
  return model;
}

Json run_sea(int index, int flights, std::mt19937_64& random) {
  const VisionSetup vision = landing_setup(markers(), true);
  const ModelledVision& model = modelled_vision();
  Json json{{"kind", "sea"},
            {"flights", Json::array()},
            {"error_scale", model.error_scale()},
            {"dropouts", model.dropouts()}};
  for (int i = 0; i < flights; ++i)
    json["flights"].push_back(
        run_sea_flight(sea_flight(index * flights + i, random), vision, &model));
  return json;
}

Json run_twin(int index, std::mt19937_64& random) {
  const VisionSetup vision = landing_setup(markers(), true);
  const SeaFlight flight = sea_flight(index, random);
  return {{"kind", "twin"},
          {"images", run_sea_flight(flight, vision, nullptr)},
          {"model", run_sea_flight(flight, vision, &modelled_vision())}};
}

// --- What it shows
// ---------------------------------------------------------------------------------

/// Whether a flight ended as it should.
enum class End { landed, away, outside };
End end_of(const Json& flight) {
  if (!flight.contains("contact")) return End::away;
  const Json& contact = flight.at("contact");
  const auto number = [&](const char* field) { return contact.at(field).get<double>(); };
  const bool within =
      std::abs(number("roll_rad")) <= kMostTilt && std::abs(number("pitch_rad")) <= kMostTilt &&
      number("sink_mps") <= kMostSink && number("sideways_mps") <= kMostSideways &&
      std::hypot(number("x_m"), number("y_m")) <= kMostBeside_m && flight.at("settled").get<bool>();
  return within ? End::landed : End::outside;
}

/// Pairs of a probability and whether it came true.
class Reliability {
 public:
  void add(const Json& pair) {
    const double probability = pair.at(0).get<double>();
    const auto bin = static_cast<std::size_t>(std::min(9.0, std::floor(10.0 * probability)));
    sums_[bin].foretold += probability;
    sums_[bin].happened += pair.at(1).get<int>();
    ++sums_[bin].count;
  }
  int count() const { return total().count; }
  double foretold() const { return total().foretold / total().count; }
  double happened() const { return total().happened / total().count; }
  std::string line() const {
    if (count() == 0) return "-";
    return fmt::format("{:.1f} % foretold, {:.1f} % came true, of {}", 100.0 * foretold(),
                       100.0 * happened(), count());
  }
  Series series(const std::string& name, const char* colour) const {
    Series one{name, colour, Mark::dots, {}, {}};
    for (const Sum& sum : sums_) {
      if (sum.count == 0) continue;
      one.x.push_back(sum.foretold / sum.count);
      one.y.push_back(sum.happened / sum.count);
    }
    return one;
  }

 private:
  struct Sum {
    double foretold = 0.0, happened = 0.0;
    int count = 0;
  };
  Sum total() const {
    Sum all;
    for (const Sum& sum : sums_) {
      all.foretold += sum.foretold;
      all.happened += sum.happened;
      all.count += sum.count;
    }
    return all;
  }
  std::array<Sum, 10> sums_{};
};

void add_platform(Chapter& chapter, const std::vector<const Json*>& flights) {
  int predictions = 0, right = 0, landings = 0, landed = 0, frames = 0, lost = 0;
  int windows = 0, level_windows = 0;
  for (const Json* flight : flights) {
    frames += flight->at("frames").get<int>();
    lost += flight->at("lost_frames").get<int>();
    // The paper predicts periods and lands in the third.
    const Json& found = flight->at("windows");
    const std::size_t three = std::min<std::size_t>(3, found.size());
    bool all_level = three == 3;
    for (std::size_t i = 0; i < found.size(); ++i) {
      const bool level = found[i].at("level").get<bool>();
      ++windows;
      level_windows += level;
      if (i < three) all_level = all_level && level;
    }
    ++predictions;
    right += all_level;
    if (!flight->at("lands").get<bool>()) continue;
    ++landings;
    if (!flight->contains("contact") || !flight->contains("chosen")) continue;
    const Json& contact = flight->at("contact");
    const double time_s = contact.at("time_s").get<double>();
    const Json& chosen = flight->at("chosen");
    landed += time_s >= chosen.at(0).get<double>() && time_s <= chosen.at(1).get<double>() &&
              std::abs(contact.at("roll_rad").get<double>()) <= kPlatformLevel &&
              std::abs(contact.at("pitch_rad").get<double>()) <= kPlatformLevel &&
              std::hypot(contact.at("x_m").get<double>(), contact.at("y_m").get<double>()) <=
                  kMostBeside_m &&
              flight->at("settled").get<bool>();
  }
  const auto of = [](int count, int all) { return fmt::format("{} of {}", count, all); };
  chapter.findings.push_back({"Platform: predictions whose three level periods were level",
                              "more than 60", of(right, predictions), "", "all",
                              right == predictions});
  chapter.findings.push_back({"Platform: landings in the third period, level, on the marker",
                              "12 of 12", of(landed, landings), "", "all", landed == landings});
  chapter.blocks.emplace_back(Paragraph{fmt::format(
      "A platform that rolls by two sinusoids of about 5 and 2 degrees, pitches by one of 4 "
      "degrees "
      "and heaves by 10 cm, periods of 3 to 8 s, others in every flight. A quadrotor hovers 3 m "
      "above a two-layer marker of 0.7 m for 45 s, fits Eq. 19 to roll and pitch as it sees them "
      "in "
      "{} pictures a second (the paper: 30), validates, predicts periods in which both stay below "
      "{:.0f} "
      "degrees, and comes down linearly to the middle of the third, by P = 1 and D = 0.8. Pictures "
      "without a pose: {} of {}. All periods foretold, not only the first three: {} of {} were "
      "level throughout.",
      kFrames, kPlatformLevel / kDegree, lost, frames, level_windows, windows)});

  const Json& first = *flights.front();
  if (!first.contains("example")) return;
  const Json& shown = first.at("example");
  Plot angles;
  angles.title = "Roll and pitch: measured (dots) and modelled";
  angles.x_label = "time, s";
  angles.y_label = "degrees";
  angles.height = 260;
  const std::vector<double> raw_s = numbers(shown.at("raw_s"));
  const std::vector<double> model_s = numbers(shown.at("model_s"));
  angles.series = {{"roll", palette::kHarco, Mark::dots, raw_s, numbers(shown.at("roll"))},
                   {"pitch", palette::kPaper, Mark::dots, raw_s, numbers(shown.at("pitch"))},
                   {"", palette::kHarco, Mark::line, model_s, numbers(shown.at("model_roll"))},
                   {"", palette::kPaper, Mark::line, model_s, numbers(shown.at("model_pitch"))}};
  for (const Json& window : first.at("windows"))
    angles.bands.push_back(
        {window.at("begin_s").get<double>(), window.at("end_s").get<double>(), ""});
  angles.rules = {{30.0, "fitted"}, {45.0, "predicted"}};
  Plot heights;
  heights.title = "Height of the feet over the platform";
  heights.x_label = "time, s";
  heights.y_label = "m";
  heights.height = 220;
  const std::vector<double> time_s = numbers(first.at("time_s"));
  heights.series = {
      {"command", palette::kTruth, Mark::dashed, time_s, numbers(first.at("commanded_m"))},
      {"HArCo", palette::kHarco, Mark::line, time_s, numbers(first.at("believed_m"))}};
  heights.bands = angles.bands;
  chapter.blocks.emplace_back(
      Figure{"Figure 12 of the paper, the first flight. Shaded: periods foretold to be level.",
             draw_grid({angles, heights}, 1)});
  add_strip(chapter, "Figure 13 of the paper, from the vehicle.", first);
}

void add_sea(Chapter& chapter, const std::vector<const Json*>& flights,
             const std::vector<const Json*>& twins) {
  struct State {
    int flights = 0, landed = 0, away = 0, outside = 0, aborts = 0;
    RootMeanSquare beside, sink;

    void add_contact(const Json& contact) {
      beside.add(std::hypot(contact.at("x_m").get<double>(), contact.at("y_m").get<double>()));
      sink.add(contact.at("sink_mps").get<double>());
    }
  };
  std::map<int, State> states;
  State all;
  Reliability chosen, asked;
  Series touches{"contacts", palette::kHarco, Mark::dots, {}, {}};
  for (const Json* flight : flights) {
    const End end = end_of(*flight);
    for (State* state : {&states[flight->at("state").get<int>()], &all}) {
      ++state->flights;
      state->landed += end == End::landed;
      state->away += end == End::away;
      state->outside += end == End::outside;
      state->aborts += flight->at("aborts").get<int>();
      if (end != End::away) state->add_contact(flight->at("contact"));
    }
    for (const Json& pair : flight->at("chosen")) chosen.add(pair);
    for (const Json& pair : flight->at("asked")) asked.add(pair);
    if (end == End::away) continue;
    touches.x.push_back(flight->at("contact").at("roll_rad").get<double>() / kDegree);
    touches.y.push_back(flight->at("contact").at("pitch_rad").get<double>() / kDegree);
  }
  const auto of = [](int count, int total) { return fmt::format("{} of {}", count, total); };
  constexpr double kHonest = 0.03;
  chapter.findings.push_back({"Ships at sea: contacts outside the limits", "",
                              of(all.outside, all.flights), "", "none", all.outside == 0});
  chapter.findings.push_back({"Ships at sea: landed; the others flew away without a contact",
                              "",
                              of(all.landed, all.flights),
                              "",
                              "",
                              {}});
  const auto honest = [&](const char* what, const Reliability& pairs) {
    if (pairs.count() == 0) return;
    chapter.findings.push_back({what, "", pairs.line(), "", "within 3 %",
                                std::abs(pairs.foretold() - pairs.happened()) <= kHonest});
  };
  honest("Ships at sea: windows that were chosen stay level", chosen);
  honest("Ships at sea: level for a second, 1, 3, 6 and 10 s ahead", asked);

  chapter.blocks.emplace_back(Paragraph{fmt::format(
      "Landings on a ship of 110 m in sea states 2 to 5 (JONSWAP seas from ahead, closed-form "
      "response of the hull, roll as a driven oscillator) with winds of 3 to 12 m/s and gusts. The "
      "deck model runs on roll, pitch and heave; the planner asks for windows of {:.1f} degrees "
      "and "
      "{} m/s of heave with 95 %, aborts below 85 %, and gives up after {} s. A contact is within "
      "limits if roll and pitch are below {:.1f} degrees, it sinks in with less than {} m/s, "
      "slides "
      "with less than {} m/s, lies within {} m of the marker's middle, and the vehicle stays "
      "there. "
      "These flights see by a model: covariances and missing poses are those of pictures rendered "
      "at the same heights, errors are drawn from them.",
      kSeaLevel / kDegree, kSeaHeaveRate, kGiveUp_s, kMostTilt / kDegree, kMostSink, kMostSideways,
      kMostBeside_m)});
  Table table{"By sea state",
              {"sea state", "flights", "landed", "flew away", "outside", "aborted descents",
               "beside the middle, rms", "sinking in, rms"},
              {}};
  const auto row = [&](const std::string& name, const State& state) {
    table.rows.push_back({name, std::to_string(state.flights), std::to_string(state.landed),
                          std::to_string(state.away), std::to_string(state.outside),
                          std::to_string(state.aborts), text(100.0 * state.beside.value()) + " cm",
                          text(state.sink.value()) + " m/s"});
  };
  for (const auto& [number, state] : states) row(std::to_string(number), state);
  row("all", all);
  chapter.blocks.emplace_back(table);

  Plot contacts;
  contacts.title = "Roll and pitch at the contact";
  contacts.x_label = "roll, degrees";
  contacts.y_label = "pitch, degrees";
  const double limit = kMostTilt / kDegree;
  contacts.x_range = contacts.y_range = AxisRange{-1.3 * limit, 1.3 * limit};
  contacts.series = {touches};
  contacts.rules = {{-limit, "", palette::kTruth, true},
                    {limit, "", palette::kTruth, true},
                    {-limit, "", palette::kTruth, false},
                    {limit, "limit", palette::kTruth, false}};
  Plot honesty;
  honesty.title = "Foretold and happened";
  honesty.x_label = "probability of being level";
  honesty.y_label = "share that was level";
  honesty.x_range = honesty.y_range = AxisRange{-0.05, 1.1};
  honesty.series = {{"", palette::kTruth, Mark::dashed, {0.0, 1.0}, {0.0, 1.0}},
                    asked.series("a second, some time ahead", palette::kHarco),
                    chosen.series("windows chosen", palette::kBaseline)};
  chapter.blocks.emplace_back(
      Figure{"Contacts within the limits, and how far probabilities can be trusted.",
             draw_grid({contacts, honesty}, 2)});

  if (twins.empty()) return;
  Table compared{"The same flights seen by pictures and by the model of vision",
                 {"", "landed", "flew away", "outside", "pictures without a pose",
                  "beside the middle, rms", "sinking in, rms", "poses' position off by, rms",
                  "height believed off by, rms", "poses' error over their deviation, rms"},
                 {}};
  for (const char* by : {"images", "model"}) {
    State state;
    RootMeanSquare position, believed, normalised;
    int frames = 0, lost = 0;
    for (const Json* twin : twins) {
      const Json& flight = twin->at(by);
      const auto number = [&](const char* field) { return flight.at(field).get<double>(); };
      const End end = end_of(flight);
      state.landed += end == End::landed;
      state.away += end == End::away;
      state.outside += end == End::outside;
      frames += flight.at("frames").get<int>();
      lost += flight.at("lost_frames").get<int>();
      position.add(number("position_m"));
      believed.add(number("believed_error_m"));
      normalised.add(std::sqrt(number("normalised")));
      if (end != End::away) state.add_contact(flight.at("contact"));
    }
    compared.rows.push_back({by, std::to_string(state.landed), std::to_string(state.away),
                             std::to_string(state.outside), percent(lost, frames),
                             text(100.0 * state.beside.value()) + " cm",
                             text(state.sink.value()) + " m/s",
                             text(1000.0 * position.value()) + " mm",
                             text(100.0 * believed.value()) + " cm", text(normalised.value())});
  }
  chapter.blocks.emplace_back(compared);
}

class DeckLanding final : public Experiment {
 public:
  std::string name() const override { return "4.6"; }
  std::string title() const override { return "Landing on an oscillating deck"; }

  Json settings(Extent extent) const override {
    const Amounts all = amounts(extent);
    return {{"revision", 4},
            {"side_m", kSide},
            {"frame_rate", kFrames},
            {"platform_level_rad", kPlatformLevel},
            {"sea_level_rad", kSeaLevel},
            {"platforms", all.platforms},
            {"landings", all.landings},
            {"sea_flights", all.seas * all.flights_a_sea}};
  }

  int items(Extent extent) const override {
    const Amounts all = amounts(extent);
    return all.platforms + all.seas + all.twins;
  }

  Json run(Extent extent, int item) const override {
    std::mt19937_64 random = generator(name(), item);
    const Part part = part_of(extent, item);
    if (part.kind == Kind::platform) return run_platform(extent, part.index, random);
    if (part.kind == Kind::sea) return run_sea(part.index, amounts(extent).flights_a_sea, random);
    return run_twin(part.index, random);
  }

  Chapter summarise(Extent, const std::vector<Json>& results) const override {
    std::vector<const Json*> platforms, seas, twins;
    for (const Json& result : results) {
      const auto kind = result.at("kind").get<std::string>();
      if (kind == "platform") platforms.push_back(&result);
      if (kind == "twin") twins.push_back(&result);
      if (kind == "sea")
        for (const Json& flight : result.at("flights")) seas.push_back(&flight);
    }
    Chapter chapter;
    if (!platforms.empty()) add_platform(chapter, platforms);
    if (!seas.empty()) add_sea(chapter, seas, twins);
    return chapter;
  }
};

}  // namespace

const Experiment& deck_landing() {
  static const DeckLanding experiment;
  return experiment;
}

}  // namespace harco::lab
