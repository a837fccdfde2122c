#include "lab/flight/flight.hpp"

#include <cmath>
#include <limits>
#include <stdexcept>

#include <gtest/gtest.h>

#include "sample_markers.hpp"

namespace harco::lab {
namespace {

using Eigen::Vector3d;

constexpr double kInf = std::numeric_limits<double>::infinity();

double variance(const Oscillation& motion) {
  double sum = 0.0;
  for (const Sinusoid& part : motion.parts) sum += 0.5 * part.amplitude * part.amplitude;
  return sum;
}

TEST(DeckMotion, PoseHasTheAnglesThatSamplesHave) {
  const DeckMotion deck = platform_motion(3);
  for (double t : {0.0, 1.7, 20.3}) {
    const Eigen::Isometry3d pose = deck.world_T_deck(t);
    Pose seen;  // by a level camera at the world's origin, image axes along the world's
    seen.camera_T_marker = pose;
    seen.covariance = Matrix6d::Identity();
    const DeckSample sample = deck_sample(seen, CameraState{}, t);
    EXPECT_NEAR(sample.motion[kRoll], deck.value(kRoll, t), 1e-12);
    EXPECT_NEAR(sample.motion[kPitch], deck.value(kPitch, t), 1e-12);
    EXPECT_NEAR(sample.motion[kHeave], deck.value(kHeave, t), 1e-12);
  }
}

TEST(DeckMotion, ShipsFollowLongWavesAndRestInShortOnes) {
  Seaway swell;
  swell.spreading_rad = 0.0;
  swell.heading_rad = 3.14159265;  // from ahead
  swell.deck_aft_m = 0.0;
  swell.peak_period_s = 40.0;  // 2.5 km long
  swell.wave_height_m = 2.0;
  const DeckMotion slow = ship_motion(swell, 1);
  EXPECT_NEAR(std::sqrt(variance(slow.axes[kHeave])), 0.5, 0.02);  // as the surface
  EXPECT_LT(std::sqrt(variance(slow.axes[kRoll])), 1e-6);
  swell.peak_period_s = 3.0;  // 14 m long
  const DeckMotion quick = ship_motion(swell, 1);
  EXPECT_LT(std::sqrt(variance(quick.axes[kHeave])), 0.05);
  swell.heading_rad = 1.5708;  // abeam
  swell.peak_period_s = swell.roll_period_s;
  EXPECT_GT(std::sqrt(variance(ship_motion(swell, 1).axes[kRoll])), 0.03);
}

TEST(DeckMotion, RougherSeasMoveItMore) {
  double before = -1.0;
  for (int state = 0; state <= 6; ++state) {
    const double roll = variance(ship_motion(sea_state(state), 5).axes[kRoll]);
    EXPECT_GT(roll, before);
    before = roll;
  }
  EXPECT_THROW(sea_state(7), std::invalid_argument);
  Seaway none;
  none.length_m = 0.0;
  EXPECT_THROW(ship_motion(none, 1), std::invalid_argument);
}

TEST(Wind, HasTheSpreadAndMeanAskedFor) {
  WindOptions options;
  options.mean_mps = {5.0, 0.0, 0.0};
  options.gust_mps = 1.5;
  Wind wind(options, 1);
  double sum = 0.0, squares = 0.0;
  constexpr int kSteps = 200000;
  for (int i = 0; i < kSteps; ++i) {
    const double now = wind.step(0.2).x();
    sum += now;
    squares += now * now;
  }
  const double mean = sum / kSteps;
  EXPECT_NEAR(mean, 5.0, 0.1);
  EXPECT_NEAR(std::sqrt(squares / kSteps - mean * mean), 1.5, 0.1);
}

TEST(World, FallsWithoutRotorsAndHoversWithThem) {
  VehicleOptions perfect;
  perfect.drag_kgps = 0.0;
  perfect.thrust_error = 0.0;
  perfect.attitude_bias_rad = 0.0;
  World falling(perfect, DeckMotion{}, WindOptions{}, {0.0, 0.0, -20.0}, 1);
  falling.stop_rotors();
  falling.advance(500);  // 1 s; the rotors take a moment to stop
  EXPECT_NEAR(falling.state().velocity.z(), 9.81 * (1.0 - perfect.rotor_lag_s), 0.1);
  World hovering(VehicleOptions{}, DeckMotion{}, WindOptions{}, {0.0, 0.0, -20.0}, 1);
  hovering.command(Vector3d::Zero(), 0.0);
  hovering.advance(5000);
  // Its trim has learnt the thrust's error by then.
  const double before = hovering.state().velocity.z();
  hovering.advance(500);
  EXPECT_NEAR(hovering.state().velocity.z() - before, 0.0, 0.02);
  EXPECT_FALSE(hovering.contact());
}

TEST(World, FliesTheAccelerationAskedFor) {
  VehicleOptions perfect;
  perfect.drag_kgps = 0.0;
  perfect.thrust_error = 0.0;
  perfect.attitude_bias_rad = 0.0;
  World world(perfect, DeckMotion{}, WindOptions{}, {0.0, 0.0, -50.0}, 1);
  world.command({1.0, -0.5, 0.3}, 0.4);
  world.advance(1000);
  const Vector3d before = world.state().velocity;
  world.advance(500);
  const Vector3d gained = world.state().velocity - before;
  EXPECT_NEAR((gained - Vector3d(1.0, -0.5, 0.3)).norm(), 0.0, 0.05);
  const Eigen::Matrix3d attitude = world.state().world_T_body.linear();
  EXPECT_NEAR(std::atan2(attitude(1, 0), attitude(0, 0)), 0.4, 0.02);
}

TEST(World, TellsHowItTouchedDown) {
  DeckMotion deck;
  deck.axes[kHeave].parts = {{0.5, 1.0, 0.0}};
  deck.axes[kRoll].mean = 0.03;
  VehicleOptions perfect;
  perfect.drag_kgps = 0.0;
  perfect.thrust_error = 0.0;
  perfect.attitude_bias_rad = 0.0;
  // It drops from rest onto a deck that rises: sink = fall + rise.
  World world(perfect, deck, WindOptions{}, {0.1, 0.0, -1.0 - perfect.foot_m}, 1);
  world.stop_rotors();
  double falling_mps = 0.0;
  while (!world.contact() && world.time_s() < 3.0) {
    falling_mps = world.state().velocity.z();
    world.advance(1);
  }
  ASSERT_TRUE(world.contact());
  const Contact& contact = *world.contact();
  EXPECT_NEAR(contact.heave_rate_mps, deck.rate(kHeave, contact.time_s), 0.01);
  EXPECT_GT(contact.heave_rate_mps, 0.2);
  EXPECT_NEAR(contact.sink_mps, falling_mps + contact.heave_rate_mps, 0.05);
  EXPECT_NEAR(contact.roll_rad, 0.03, 1e-9);
  EXPECT_NEAR(contact.tilt_rad, 0.03, 0.01);
  EXPECT_NEAR(contact.place_m.x(), 0.1, 0.02);
  world.advance(1500);  // 3 s later it stands on the deck and goes up and down with it
  EXPECT_TRUE(world.touching());
  const Eigen::Isometry3d standing =
      world.world_T_deck(world.time_s()).inverse() * world.state().world_T_body;
  EXPECT_NEAR(-standing.translation().z(), perfect.foot_m, 0.02);
  EXPECT_NEAR(standing.linear()(2, 2), 1.0, 1e-3);
}

/// 0.7 m large.
MarkerSet deck_markers() {
  MarkerSet set = test::three_layers();
  set.parents.front().side_m = 0.7;
  return set;
}

TEST(ModelledVision, SaysWhatPicturesSay) {
  const VisionSetup setup = landing_setup(deck_markers(), false);
  const ModelledVision model(setup, 2, 1);
  EXPECT_LT(model.dropouts(), 0.3);
  EXPECT_LT(model.error_scale(), 3.0);
  Eigen::Isometry3d truth = look_at_marker({0.35, 0.35}, 2.0, 0.05, 0.3, 0.1);
  const Sight sight = model.look(truth, 5);
  ASSERT_TRUE(sight.pose);
  EXPECT_LT((sight.pose->camera_T_marker.translation() - truth.translation()).norm(), 0.02);
  EXPECT_EQ(sight.truth.matrix(), truth.matrix());
  EXPECT_EQ(model.look(truth, 5).pose->camera_T_marker.matrix(),
            sight.pose->camera_T_marker.matrix());
  EXPECT_NE(model.look(truth, 6).pose->camera_T_marker.matrix(),
            sight.pose->camera_T_marker.matrix());
}

TEST(Flight, LandsByPicturesAlone) {
  VisionSetup vision = landing_setup(deck_markers(), false);
  FlightSetup setup;
  setup.start_height_m = 0.8;
  setup.start_m = {0.1, -0.05};
  setup.wind.mean_mps = {1.0, 0.0, 0.0};
  setup.frame_rate = 15.0;
  setup.limit_s = 12.0;
  int frames = 0;
  setup.on_frame = [&](const Sight& sight, double) {
    EXPECT_FALSE(sight.image.pixels.empty());
    ++frames;
    return true;
  };
  LinearApproach approach(setup.start_height_m, 0.6, 0.4);
  const FlightLog log = fly(setup, vision, nullptr, approach, 2);
  ASSERT_TRUE(log.contact);
  EXPECT_EQ(frames, log.frames);
  EXPECT_LE(log.lost_frames, log.frames / 10);
  EXPECT_LT(log.contact->place_m.norm(), 0.15);
  EXPECT_LT(log.contact->sink_mps, 0.7);
  EXPECT_TRUE(log.settled);
  for (const Moment& moment : log.moments) {
    if (!std::isfinite(moment.believed_m)) continue;
    EXPECT_NEAR(moment.believed_m, moment.height_m, 0.05) << moment.time_s;
  }
}

TEST(Flight, PlatformPeriodsThatAreForetoldAreLevel) {
  const VisionSetup vision = landing_setup(deck_markers(), true);
  const ModelledVision model(vision, 2, 1);
  FlightSetup setup;
  setup.deck = platform_motion(11);
  setup.start_height_m = 2.0;
  setup.frame_rate = 8.0;
  setup.limit_s = 60.0;
  PlatformPlan plan;
  plan.hover_m = 2.0;
  plan.predict_s = 32.0;
  plan.level = {0.07, 0.07, kInf};
  plan.windows.min_duration_s = 0.8;
  plan.windows.min_probability = 0.99;
  plan.windows.level.draws = 400;
  plan.windows.level.tilt_sd_rad = setup.vehicle.attitude_bias_rad;
  plan.deck.fit_s = 20.0;
  plan.deck.refit_s = 5.0;
  plan.deck.max_samples = 200;
  plan.deck.oscillation.max_order = 2;
  PlatformApproach approach(plan);
  const FlightLog log = fly(setup, vision, &model, approach, 3);
  ASSERT_GE(approach.windows().size(), 3U);
  for (const LevelWindow& window : approach.windows())
    for (double t = window.begin_s; t <= window.end_s; t += 0.05) {
      EXPECT_LT(std::abs(setup.deck.value(kRoll, t)), 0.07) << t;
      EXPECT_LT(std::abs(setup.deck.value(kPitch, t)), 0.07) << t;
    }
  ASSERT_TRUE(log.contact);
  EXPECT_GE(log.contact->time_s, approach.chosen()->begin_s);
  EXPECT_LE(log.contact->time_s, approach.chosen()->end_s);
  EXPECT_TRUE(log.settled);
}

}  // namespace
}  // namespace harco::lab
