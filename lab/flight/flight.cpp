#include "flight.hpp"

#include <algorithm>
#include <cmath>
#include <deque>
#include <limits>

namespace harco::lab {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;

constexpr int kStepsAControl = 5;  // of 2 ms
constexpr double kControl_s = kStepsAControl * World::kStep_s;
constexpr double kFar = std::numeric_limits<double>::quiet_NaN();

/// A look at the deck that waits until its latency has passed.
struct Pending {
  double time_s;
  SensorReading then;
  Pose pose;
};

/// Squared error over the covariance, per dimension.
double normalised_error(const Sight& sight) {
  Eigen::Matrix<double, 6, 1> error;
  error.head<3>() = sight.truth.translation() - sight.pose->camera_T_marker.translation();
  const Eigen::AngleAxisd turn(
      Eigen::Matrix3d(sight.pose->camera_T_marker.linear().transpose() * sight.truth.linear()));
  error.tail<3>() = turn.angle() * turn.axis();
  return error.dot(sight.pose->covariance->ldlt().solve(error)) / 6.0;
}

}  // namespace

// --- Approaches
// ------------------------------------------------------------------------------------

void LinearApproach::update(double now_s, const Place& place, bool sees_deck) {
  if (descent_ || now_s < start_s_ || !sees_deck) return;
  descent_.emplace();
  descent_->start_s = now_s;
  descent_->start_height_m = place.height_m;
  descent_->speed_mps = speed_mps_;
}

HeightCommand LinearApproach::command(double now_s) const {
  return descent_ ? descent_->at(now_s) : HeightCommand{hover_m_, 0.0, 0.0};
}

PlatformApproach::PlatformApproach(const PlatformPlan& plan) : plan_(plan), model_(plan.deck) {}

void PlatformApproach::update(double now_s, const Place& place, bool sees_deck) {
  if (!chosen_) {
    const bool anew = model_.update();
    if (!anew || now_s < plan_.predict_s || model_.phase() != DeckPhase::ready) return;
    forecast_ = model_.forecast();
    validation_ = model_.validation();
    constexpr double kLead_s = 3.0;  // so that the third can be reached
    const double from_s = now_s + kLead_s;
    windows_ =
        level_windows(*forecast_, plan_.level, from_s, from_s + plan_.ahead_s, plan_.windows);
    for (std::size_t i = 2; i < windows_.size() && !chosen_; ++i)
      if (windows_[i].middle_s() > now_s + place.height_m / plan_.speed_mps) chosen_ = windows_[i];
    return;
  }
  if (descent_ || !sees_deck) return;
  const LinearDescent planned =
      LinearDescent::to_touch_at(chosen_->middle_s(), place.height_m, plan_.speed_mps);
  if (now_s < planned.start_s) return;
  descent_ = planned;
  descent_->start_s = now_s;
}

HeightCommand PlatformApproach::command(double now_s) const {
  return descent_ ? descent_->at(now_s) : HeightCommand{plan_.hover_m, 0.0, 0.0};
}

bool PlatformApproach::gave_up(double now_s) const {
  return !chosen_ && now_s > plan_.predict_s + 40.0;
}

PlannedApproach::PlannedApproach(const TouchdownOptions& landing, const DeckOptions& deck,
                                 double give_up_s)
    : planner_(landing), model_(deck), give_up_s_(give_up_s) {}

void PlannedApproach::update(double now_s, const Place& place, bool sees_deck) {
  constexpr double kThink_s = 2.0;  // also without a new forecast
  const bool anew = model_.update();
  const bool thinks = anew || now_s - thought_s_ >= kThink_s;
  if (!thinks && sees_deck) planner_.watch(now_s, place.height_m, place.climb_mps, place.beside_m);
  if (!thinks) return;
  thought_s_ = now_s;
  const bool trusted = sees_deck && model_.phase() == DeckPhase::ready;
  planner_.update(now_s, place.height_m, place.climb_mps, trusted ? &*model_.forecast() : nullptr);
  if (trusted && !kept_ && now_s >= keep_s_) kept_ = model_.forecast();
  const auto& plan = planner_.plan();
  if (plan && (chosen_.empty() || plan->window.begin_s > chosen_.back().end_s))
    chosen_.push_back(plan->window);
}

HeightCommand PlannedApproach::command(double now_s) const { return planner_.command(now_s); }

double PlannedApproach::deck_lift_mps2(double now_s) const {
  constexpr double kAhead_s = 0.06;  // the rotors' lag
  constexpr double kApart_s = 0.1;
  constexpr double kOld_s = 3.0;
  if (model_.phase() != DeckPhase::ready || now_s - model_.forecast()->as_of_s > kOld_s) return 0.0;
  const AxisForecast& heave = model_.forecast()->axes[kHeave];
  const double at_s = std::max(now_s + kAhead_s, heave.as_of_s() + kApart_s);
  return (heave.at(at_s + kApart_s).rate - heave.at(at_s - kApart_s).rate) / (2.0 * kApart_s);
}

bool PlannedApproach::gave_up(double now_s) const {
  const TouchdownPhase phase = planner_.phase(now_s);
  return now_s > give_up_s_ &&
         (phase == TouchdownPhase::holding || phase == TouchdownPhase::waiting);
}

// --- Flight
// ----------------------------------------------------------------------------------------

FlightLog fly(const FlightSetup& setup, const VisionSetup& vision, const ModelledVision* model,
              Approach& approach, std::uint64_t seed) {
  constexpr double kStand_s = 1.5;  // watched after the contact
  constexpr double kSlipped_m = 0.5;
  constexpr double kTipped_rad = 0.3;
  constexpr double kRotorsOff_s = 0.1;  // after contact: the landing gear's switch
  const Isometry3d body_T_camera = Mount::looking_down();
  const Isometry3d deck_T_marker = vision.deck_T_marker();

  PilotOptions options = setup.pilot;
  options.touchdown_point = vision.touchdown_point();
  options.foot_m = setup.vehicle.foot_m;
  Pilot pilot(options);
  const Vector3d start(setup.start_m.x(), setup.start_m.y(),
                       -setup.start_height_m - setup.vehicle.foot_m);
  World world(setup.vehicle, setup.deck, setup.wind, start, seed);
  std::optional<ImageVision> images;
  if (model == nullptr) images.emplace(vision);

  FlightLog log;
  std::deque<Pending> pending;
  std::vector<int> layers;
  std::mt19937_64 seeds(seed ^ 0x696D616765U);
  double next_frame_s = 0.0;
  double next_moment_s = 0.0;
  std::size_t next_picture = 0;
  double squares = 0.0, position_squares = 0.0;
  const Motion deck = [&world](double t) { return world.world_T_deck(t); };

  while (world.time_s() < setup.limit_s) {
    const double now_s = world.time_s();
    const SensorReading reading = world.sensors();
    const bool flying = !world.contact();
    if (flying && now_s >= next_frame_s - 1e-9) {
      next_frame_s += 1.0 / setup.frame_rate;
      const VehicleState state = world.state();
      const Motion camera = [&](double t) { return state.after(t - now_s) * body_T_camera; };
      const Eigen::Matrix3d level_R_camera = reading.level_R_body * body_T_camera.linear();
      Sight sight =
          images ? images->look(camera, deck, now_s, level_R_camera.transpose() * Vector3d::UnitZ(),
                                seeds())
                 : model->look(camera(now_s).inverse() * deck(now_s) * deck_T_marker, seeds());
      ++log.frames;
      if (setup.on_frame && !setup.on_frame(sight, now_s)) break;
      layers = sight.layers;
      if (sight.pose && sight.pose->covariance) {
        squares += normalised_error(sight);
        position_squares +=
            (sight.pose->camera_T_marker.translation() - sight.truth.translation()).squaredNorm();
        pending.push_back({now_s, reading, *sight.pose});
      } else {
        ++log.lost_frames;
      }
      if (images && next_picture < setup.pictures_s.size() &&
          now_s >= setup.pictures_s[next_picture]) {
        ++next_picture;
        log.pictures.push_back({now_s, 0.0, std::move(sight.image), std::move(sight.detections)});
        log.pictures.back().height_m = (sight.truth * options.touchdown_point).norm();
      }
    }
    while (!pending.empty() && pending.front().time_s + setup.latency_s <= now_s) {
      const Pending& look = pending.front();
      pilot.see(look.pose, look.time_s, look.then);
      const DeckSample sample =
          pilot.sample(look.pose, look.time_s, look.then, setup.vehicle, setup.knows_height);
      approach.take(sample);
      log.samples.push_back(sample);
      pending.pop_front();
    }

    const auto belief = pilot.belief(now_s, reading);
    if (flying) {
      // Until it sees the deck it takes itself to be where it should be.
      Place place{setup.start_height_m, 0.0, 0.0};
      if (belief)
        place = {pilot.height(*belief), Pilot::climb(*belief), belief->position.head<2>().norm()};
      const bool begun = belief || now_s > 1.0;
      if (begun) approach.update(now_s, place, belief.has_value());
      const HeightCommand command =
          begun ? approach.command(now_s) : HeightCommand{setup.start_height_m, 0.0, 0.0};
      if (now_s >= next_moment_s - 1e-9) {
        next_moment_s += 0.1;
        const Vector3d away =
            world.state().world_T_body.translation() - world.world_T_deck(now_s).translation();
        log.moments.push_back({now_s, -away.z() - setup.vehicle.foot_m,
                               belief ? place.height_m : kFar, command.height_m,
                               away.head<2>().norm(), setup.deck.value(kRoll, now_s),
                               setup.deck.value(kPitch, now_s), layers});
      }
      if (begun && approach.gave_up(now_s)) {
        log.gave_up = true;
        break;
      }
      if (begun)
        world.command(
            pilot.acceleration(belief, command, approach.deck_lift_mps2(now_s), kControl_s), 0.0);
    } else if (now_s > world.contact()->time_s + kStand_s) {
      break;
    } else if (now_s > world.contact()->time_s + kRotorsOff_s) {
      world.stop_rotors();
    }
    world.advance(kStepsAControl);
  }

  log.end_s = world.time_s();
  log.contact = world.contact();
  const int seen = log.frames - log.lost_frames;
  log.normalised = seen > 0 ? squares / seen : 0.0;
  log.position_m = seen > 0 ? std::sqrt(position_squares / seen) : 0.0;
  if (log.contact) {
    const Isometry3d standing =
        world.world_T_deck(log.end_s).inverse() * world.state().world_T_body;
    const double slipped_m = (standing.translation().head<2>() - log.contact->place_m).norm();
    log.settled = slipped_m < kSlipped_m && world.touching() &&
                  std::acos(std::clamp(standing.linear()(2, 2), -1.0, 1.0)) < kTipped_rad;
  }
  return log;
}

}  // namespace harco::lab
