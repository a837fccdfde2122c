// Whole flights: vehicle, deck, wind, camera and pilot, from the hover to the deck.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <vector>

#include "harco/forecast.hpp"
#include "harco/touchdown.hpp"
#include "pilot.hpp"
#include "vision.hpp"
#include "world.hpp"

namespace harco::lab {

/// Where the vehicle's feet are over the touchdown point.
struct Place {
  double height_m = 0.0;
  double climb_mps = 0.0;  ///< the height's rate
  double beside_m = 0.0;   ///< level distance
};

/// How a flight comes down: what it makes of the samples of the deck, and which heights it wants.
class Approach {
 public:
  Approach() = default;
  virtual ~Approach() = default;
  Approach(const Approach&) = delete;
  Approach& operator=(const Approach&) = delete;

  virtual void take(const DeckSample& sample) = 0;
  /// Thinks; called at every control step, with the vehicle's place as believed.
  virtual void update(double now_s, const Place& place, bool sees_deck) = 0;
  virtual HeightCommand command(double now_s) const = 0;
  /// What the deck is expected to accelerate upwards, m/s^2.
  virtual double deck_lift_mps2(double /*now_s*/) const { return 0.0; }
  /// Whether it has given up for good.
  virtual bool gave_up(double /*now_s*/) const { return false; }
};

/// Section 4.4: hovers until a time, then descends at a constant speed to 0.2 m below the ground.
class LinearApproach final : public Approach {
 public:
  LinearApproach(double hover_m, double start_s, double speed_mps)
      : hover_m_(hover_m), start_s_(start_s), speed_mps_(speed_mps) {}
  void take(const DeckSample&) override {}
  void update(double now_s, const Place& place, bool sees_deck) override;
  HeightCommand command(double now_s) const override;

 private:
  double hover_m_, start_s_, speed_mps_;
  std::optional<LinearDescent> descent_;
};

/// Section 4.6: hovers while the deck is fitted and validated, predicts level periods, and comes
/// down linearly to the middle of the third.
struct PlatformPlan {
  double hover_m = 3.0;     ///< feet over the deck
  double predict_s = 45.0;  ///< from when on level periods are predicted, until there are three
  double speed_mps = 0.5;   ///< of the descent
  double ahead_s = 40.0;    ///< periods are sought for so long
  LevelLimits level;
  WindowOptions windows;
  DeckOptions deck;
};

class PlatformApproach final : public Approach {
 public:
  explicit PlatformApproach(const PlatformPlan& plan);
  void take(const DeckSample& sample) override { model_.add(sample); }
  void update(double now_s, const Place& place, bool sees_deck) override;
  HeightCommand command(double now_s) const override;
  bool gave_up(double now_s) const override;

  const std::vector<LevelWindow>& windows() const { return windows_; }
  const std::optional<LevelWindow>& chosen() const { return chosen_; }
  /// By which the periods were predicted.
  const std::optional<DeckForecast>& forecast() const { return forecast_; }
  const std::optional<Validation>& validation() const { return validation_; }

 private:
  PlatformPlan plan_;
  DeckModel model_;
  std::vector<LevelWindow> windows_;
  std::optional<LevelWindow> chosen_;
  std::optional<DeckForecast> forecast_;
  std::optional<Validation> validation_;
  std::optional<LinearDescent> descent_;
};

/// harco::TouchdownPlanner with a running DeckModel.
class PlannedApproach final : public Approach {
 public:
  PlannedApproach(const TouchdownOptions& landing, const DeckOptions& deck, double give_up_s);
  void take(const DeckSample& sample) override { model_.add(sample); }
  void update(double now_s, const Place& place, bool sees_deck) override;
  HeightCommand command(double now_s) const override;
  double deck_lift_mps2(double now_s) const override;
  bool gave_up(double now_s) const override;

  const TouchdownPlanner& planner() const { return planner_; }
  /// Every window that was chosen, as it was when it was.
  const std::vector<LevelWindow>& chosen() const { return chosen_; }
  /// The first forecast to be trusted that was made at this time or later.
  void keep_forecast_of(double time_s) { keep_s_ = time_s; }
  const std::optional<DeckForecast>& kept() const { return kept_; }

 private:
  TouchdownPlanner planner_;
  DeckModel model_;
  double give_up_s_;
  double thought_s_ = -std::numeric_limits<double>::infinity();
  std::vector<LevelWindow> chosen_;
  double keep_s_ = std::numeric_limits<double>::infinity();
  std::optional<DeckForecast> kept_;
};

/// What is flown.
struct FlightSetup {
  VehicleOptions vehicle;
  PilotOptions pilot;  ///< touchdown point and foot are set from vision and vehicle
  DeckMotion deck;
  WindOptions wind;
  Eigen::Vector2d start_m = Eigen::Vector2d::Zero();  ///< beside the touchdown point
  double start_height_m = 4.0;                        ///< of the feet over the deck at rest
  double limit_s = 150.0;                             ///< no flight takes longer

  double frame_rate = 30.0;        ///< pictures a second
  double latency_s = 0.05;         ///< from the middle of an exposure until its pose is known
  bool knows_height = false;       ///< whether samples of the deck take the autopilot's height
  std::vector<double> pictures_s;  ///< times of pictures to keep
  /// Sees every picture; false ends the flight.
  std::function<bool(const Sight&, double time_s)> on_frame;
};

/// One moment of a flight.
struct Moment {
  double time_s = 0.0;
  double height_m = 0.0;    ///< of the feet over the touchdown point, along gravity: truth
  double believed_m = 0.0;  ///< the same, as the pilot believes it; NaN if it doesn't know
  double commanded_m = 0.0;
  double beside_m = 0.0;                   ///< level distance from the touchdown point
  double roll_rad = 0.0, pitch_rad = 0.0;  ///< of the deck
  std::vector<int> layers;                 ///< seen in the newest picture
};

struct FlightPicture {
  double time_s;
  double height_m;
  Image image;
  std::vector<Detection> detections;
};

struct FlightLog {
  std::vector<Moment> moments;      ///< ten a second
  std::vector<DeckSample> samples;  ///< of the deck, as measured
  std::optional<Contact> contact;
  bool settled = false;     ///< after the contact it stood where it had come down
  bool gave_up = false;     ///< flew away without one
  int frames = 0;           ///< pictures taken
  int lost_frames = 0;      ///< of them without a pose
  double normalised = 0.0;  ///< mean squared error of poses over their covariance, per dimension
  double position_m = 0.0;  ///< root mean square error of the poses' positions
  std::vector<FlightPicture> pictures;
  double end_s = 0.0;
};

/// Flies. Sees by `images`, or by `model` if that isn't null.
FlightLog fly(const FlightSetup& setup, const VisionSetup& vision, const ModelledVision* model,
              Approach& approach, std::uint64_t seed);

}  // namespace harco::lab
