#include "harco/vehicle.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include <gtest/gtest.h>

namespace harco {
namespace {

using Eigen::Vector3d;
using mavlink::CommandAck;
using mavlink::CommandLong;
using mavlink::Heartbeat;
using mavlink::Message;
using mavlink::Timesync;

const double kNan = std::numeric_limits<double>::quiet_NaN();

// ------------------------------------------------------------------------------------ RemoteClock

TEST(RemoteClock, TakesTheMiddleOfTheQuickestAnswer) {
  RemoteClock clock;
  EXPECT_FALSE(clock.remote(1.0));
  clock.answered(10.00, 100.04, 10.10);  // the way back was slow
  clock.answered(10.20, 100.21, 10.22);  // offset 90, quick
  clock.answered(10.40, 100.49, 10.50);
  EXPECT_NEAR(*clock.remote(11.0), 101.0, 1e-9);
  EXPECT_NEAR(*clock.ours(101.0), 11.0, 1e-9);
  EXPECT_NEAR(*clock.round_trip_s(), 0.02, 1e-9);
}

TEST(RemoteClock, FollowsASimulatorsSpeed) {
  RemoteClock clock;
  for (int i = 0; i < 20; ++i)
    clock.answered(0.2 * i, 5.0 + 3.0 * (0.2 * i + 0.001), 0.2 * i + 0.002);
  EXPECT_NEAR(*clock.remote(4.0), 17.0, 0.01);
  EXPECT_NEAR(*clock.ours(17.0), 4.0, 0.01);
}

TEST(RemoteClock, IgnoresWhatCantBe) {
  RemoteClock clock;
  clock.answered(10.0, 50.0, 9.9);
  clock.answered(10.0, 50.0, 11.5);
  clock.answered(10.0, kNan, 10.1);
  EXPECT_FALSE(clock.remote(10.0));
}

TEST(RemoteClock, BeginsAnewWithTheOtherOne) {
  RemoteClock clock;
  for (int i = 0; i < 5; ++i) clock.answered(i, 1000.0 + i, i + 0.01);
  clock.answered(5.0, 2.005, 5.01);  // it was switched off and on
  EXPECT_NEAR(*clock.remote(5.005), 2.005, 1e-9);
}

TEST(RemoteClock, StampsHelpUntilThereAreAnswers) {
  RemoteClock clock;
  clock.stamped(7.0, 1.30);
  clock.stamped(7.2, 1.41);  // least delayed
  clock.stamped(7.4, 1.66);
  EXPECT_NEAR(*clock.remote(1.41), 7.2, 1e-9);
  clock.answered(2.0, 7.86, 2.02);
  EXPECT_NEAR(*clock.remote(2.01), 7.86, 1e-9);
}

// --------------------------------------------------------------------------------- VehicleHistory

mavlink::Attitude attitude(std::uint32_t ms, float yaw, float yawspeed = 0.0F) {
  mavlink::Attitude message;
  message.time_boot_ms = ms;
  message.yaw = yaw;
  message.yawspeed = yawspeed;
  return message;
}

mavlink::LocalPositionNed position(std::uint32_t ms, float x, float vx) {
  mavlink::LocalPositionNed message;
  message.time_boot_ms = ms;
  message.x = x;
  message.vx = vx;
  return message;
}

double yaw_of(const Eigen::Quaterniond& q) { return 2.0 * std::atan2(q.z(), q.w()); }

TEST(VehicleHistory, InterpolatesAndForetells) {
  VehicleHistory history;
  EXPECT_TRUE(history.add(attitude(1000, 0.1F)));
  EXPECT_TRUE(history.add(attitude(1100, 0.3F, 2.0F)));
  EXPECT_NEAR(yaw_of(*history.ned_R_body(1.05)), 0.2, 1e-6);
  EXPECT_NEAR(yaw_of(*history.ned_R_body(1.2)), 0.5, 1e-6) << "by its rate";
  EXPECT_FALSE(history.ned_R_body(1.5)) << "too far ahead";
  EXPECT_FALSE(history.ned_R_body(0.9)) << "before anything is known";
  EXPECT_TRUE(history.add(position(1000, 5.0F, 1.0F)));
  EXPECT_TRUE(history.add(position(1200, 6.0F, 3.0F)));
  EXPECT_NEAR(history.ned_p_body(1.1)->x(), 5.5, 1e-6);
  EXPECT_NEAR(history.ned_p_body(1.3)->x(), 6.3, 1e-6);
  EXPECT_NEAR(history.ned_v_body(1.1)->x(), 2.0, 1e-6);
}

TEST(VehicleHistory, AttitudeIsYawThenPitchThenRoll) {
  mavlink::Attitude message = attitude(1, 0.5F);
  message.pitch = 0.3F;
  message.roll = -0.2F;
  VehicleHistory history;
  ASSERT_TRUE(history.add(message));
  // The nose in NED: cos(pitch) cos(yaw), cos(pitch) sin(yaw), -sin(pitch).
  const Vector3d nose = *history.ned_R_body(0.001) * Vector3d::UnitX();
  EXPECT_LT((nose -
             Vector3d(std::cos(0.3) * std::cos(0.5), std::cos(0.3) * std::sin(0.5), -std::sin(0.3)))
                .norm(),
            1e-6);
}

TEST(VehicleHistory, WrongMessagesChangeNothing) {
  VehicleHistory history;
  ASSERT_TRUE(history.add(attitude(2000, 0.1F)));
  EXPECT_FALSE(history.add(attitude(2000, 0.2F))) << "doubled";
  EXPECT_FALSE(history.add(attitude(1990, 0.2F))) << "late";
  EXPECT_FALSE(history.add(attitude(2010, std::numeric_limits<float>::quiet_NaN())));
  mavlink::AttitudeQuaternion wrong;
  wrong.time_boot_ms = 2010;
  wrong.q1 = 3.0F;
  EXPECT_FALSE(history.add(wrong));
  EXPECT_FALSE(history.add(position(2010, std::numeric_limits<float>::infinity(), 0.0F)));
  EXPECT_NEAR(yaw_of(*history.ned_R_body(2.0)), 0.1, 1e-6);
}

TEST(VehicleHistory, ARestartForgets) {
  VehicleHistory history;
  ASSERT_TRUE(history.add(attitude(90000, 0.1F)));
  ASSERT_TRUE(history.add(attitude(500, 0.7F)));
  EXPECT_NEAR(yaw_of(*history.ned_R_body(0.5)), 0.7, 1e-6);
  EXPECT_FALSE(history.ned_R_body(90.0));
}

// ------------------------------------------------------------------------------------ VehicleLink

const mavlink::Address kVehicle{3, 1};

Heartbeat heartbeat(std::uint32_t mode = 4) {
  Heartbeat message;
  message.type = 2;
  message.autopilot = mavlink::value::kAutopilotArduPilot;
  message.base_mode = 1;
  message.custom_mode = mode;
  return message;
}

template <typename M>
std::vector<M> of_kind(const std::vector<Message>& messages) {
  std::vector<M> found;
  for (const Message& message : messages)
    if (const auto* m = std::get_if<M>(&message)) found.push_back(*m);
  return found;
}

TEST(VehicleLink, BeatsOnceASecondBeforeItHearsAnything) {
  VehicleLink link;
  int beats = 0;
  for (int i = 0; i < 500; ++i) beats += static_cast<int>(link.due(100.0 + 0.01 * i).size());
  EXPECT_EQ(beats, 5);
  EXPECT_EQ(link.presence(105.0), Presence::unheard);
}

TEST(VehicleLink, KeepsToTheFirstAutopilot) {
  VehicleLink link;
  Heartbeat ground = heartbeat();
  ground.type = 6;
  Heartbeat camera = heartbeat();
  camera.autopilot = 8;
  link.receive({{255, 190}, ground}, 0.0);
  link.receive({{3, 100}, camera}, 0.0);
  EXPECT_FALSE(link.vehicle());
  link.receive({kVehicle, heartbeat()}, 0.1);
  link.receive({{9, 1}, heartbeat(9)}, 0.2);
  EXPECT_EQ(*link.vehicle(), kVehicle);
  EXPECT_FALSE(link.landing());
  EXPECT_EQ(link.presence(1.0), Presence::heard);
  EXPECT_EQ(link.presence(4.0), Presence::silent);
  link.receive({{9, 1}, heartbeat()}, 4.0);
  EXPECT_EQ(link.presence(4.0), Presence::silent) << "others don't count";
}

TEST(VehicleLink, SynchronisesClocksBothWays) {
  VehicleLink link;
  link.receive({kVehicle, heartbeat()}, 10.0);
  const auto questions = of_kind<Timesync>(link.due(10.0));
  ASSERT_EQ(questions.size(), 1U);
  EXPECT_EQ(questions[0].tc1, 0);
  Timesync forged = questions[0];
  forged.tc1 = 77000000000;
  forged.ts1 += 1;
  link.receive({kVehicle, forged}, 10.01);
  EXPECT_FALSE(link.clock().remote(10.0)) << "not what was asked";
  Timesync answer = questions[0];
  answer.tc1 = 500000000000;  // 500 s
  link.receive({kVehicle, answer}, 10.02);
  EXPECT_NEAR(*link.clock().remote(10.01), 500.0, 1e-6);

  Timesync question;
  question.ts1 = 123;
  link.receive({kVehicle, question}, 10.05);
  EXPECT_LT(link.next_due_s(), 10.05) << "an answer is owed at once";
  const auto answers = of_kind<Timesync>(link.due(10.05));
  ASSERT_EQ(answers.size(), 1U);
  EXPECT_EQ(answers[0].ts1, 123);
  EXPECT_EQ(answers[0].tc1, 10050000000);
}

TEST(VehicleLink, KnowsWhereTheVehicleWasAtATimeOfOurs) {
  VehicleLink link;
  link.receive({kVehicle, heartbeat()}, 10.0);
  const auto question = of_kind<Timesync>(link.due(10.0)).at(0);
  Timesync answer = question;
  answer.tc1 = 2000000000;  // 2 s at 10.0
  link.receive({kVehicle, answer}, 10.0);
  EXPECT_FALSE(link.pose(10.0));
  link.receive({kVehicle, attitude(1900, 0.2F)}, 10.0);
  link.receive({kVehicle, attitude(2000, 0.4F)}, 10.05);
  EXPECT_NEAR(yaw_of(link.pose(9.95)->ned_R_body), 0.3, 1e-6);
  EXPECT_FALSE(link.pose(9.95)->ned_p_body);
  link.receive({kVehicle, position(2000, 4.0F, 2.0F)}, 10.05);
  EXPECT_NEAR(link.pose(10.1)->ned_p_body->x(), 4.2, 1e-6);
}

TEST(VehicleLink, AsksForThePoseItNeeds) {
  VehicleLinkOptions options;
  options.want_pose = false;
  VehicleLink quiet(options), link;
  quiet.receive({kVehicle, heartbeat()}, 0.0);
  link.receive({kVehicle, heartbeat()}, 0.0);
  EXPECT_TRUE(of_kind<CommandLong>(quiet.due(0.0)).empty());
  const auto wishes = of_kind<CommandLong>(link.due(0.0));
  ASSERT_EQ(wishes.size(), 2U);
  EXPECT_EQ(wishes[0].command, 511);
  EXPECT_EQ(wishes[0].param[0], 31.0F);
  EXPECT_EQ(wishes[0].param[1], 20000.0F) << "microseconds: 50 Hz";
  EXPECT_EQ(wishes[0].target_system, 3);
}

TEST(VehicleLink, OrdersUntilItIsObeyed) {
  VehicleLink link;
  link.receive({kVehicle, heartbeat()}, 0.0);
  link.due(0.0);
  link.order(FlightMode::land, 1.0);
  const auto orders = [&](double now_s) {
    auto all = of_kind<CommandLong>(link.due(now_s));
    all.erase(std::remove_if(all.begin(), all.end(),
                             [](const CommandLong& c) { return c.command != 176; }),
              all.end());
    return all;
  };
  auto sent = orders(1.0);
  ASSERT_EQ(sent.size(), 1U);
  EXPECT_EQ(sent[0].param[0], 1.0F);
  EXPECT_EQ(sent[0].param[1], 9.0F) << "LAND of a copter";
  EXPECT_EQ(orders(1.1).size(), 0U);
  sent = orders(1.6);
  ASSERT_EQ(sent.size(), 1U);
  EXPECT_EQ(sent[0].confirmation, 1);
  EXPECT_FALSE(link.order_result());
  link.receive({kVehicle, heartbeat(9)}, 1.7);
  EXPECT_EQ(link.order_result(), VehicleLink::OrderResult::obeyed);
  EXPECT_TRUE(link.landing());
  EXPECT_EQ(orders(2.5).size(), 0U);

  link.order(FlightMode::wait, 3.0);
  CommandAck refusal;
  refusal.command = 176;
  refusal.result = 4;
  link.receive({kVehicle, refusal}, 3.1);
  EXPECT_EQ(link.order_result(), VehicleLink::OrderResult::refused);

  link.order(FlightMode::wait, 4.0);
  int tries = 0;
  for (int i = 0; i < 500; ++i) tries += static_cast<int>(orders(4.0 + 0.01 * i).size());
  EXPECT_EQ(tries, 6) << "for three seconds";
  EXPECT_EQ(link.order_result(), VehicleLink::OrderResult::unanswered);
}

TEST(VehicleLink, Px4sModesHaveTwoNumbers) {
  VehicleLinkOptions options;
  options.autopilot = Autopilot::px4;
  options.want_pose = false;
  VehicleLink link(options);
  Heartbeat px4 = heartbeat(0);
  px4.autopilot = mavlink::value::kAutopilotPx4;
  link.receive({kVehicle, px4}, 0.0);
  link.order(FlightMode::land, 0.0);
  const auto sent = of_kind<CommandLong>(link.due(0.0));
  ASSERT_EQ(sent.size(), 1U);
  EXPECT_EQ(sent[0].param[1], 4.0F);
  EXPECT_EQ(sent[0].param[2], 9.0F);
  px4.custom_mode = 0x09040000;
  link.receive({kVehicle, px4}, 0.1);
  EXPECT_TRUE(link.landing());
}

}  // namespace
}  // namespace harco
