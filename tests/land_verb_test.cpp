// harco land as a whole program: a simulated vehicle at the other end of its link, a simulated
// camera at the other end of its pipe.
#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <iterator>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include "command.hpp"
#include "land_rig.hpp"

namespace harco::test {
namespace {

using nlohmann::json;
using namespace mavlink;  // NOLINT(google-build-using-namespace): messages are all over here
using std::chrono::milliseconds;

class LandVerb : public ::testing::Test {
 protected:
  LandVerb() {
    pad_ = shared_pad();
    save_markers(pad_, folder_ / "markers.json");
    camera_ = Camera::pinhole(360, 270, 248.0);
    save_camera(camera_, folder_ / "camera.yaml");
    write_file(folder_ / "mount.yaml",
               "looks: down\nimage_top: right\nroll_pitch_yaw_deg: [2, -3, 0]\n"
               "offset_m: [0.12, -0.05, 0.04]\n");
    mount_ = load_mount(folder_ / "mount.yaml");
  }

  /// Planned once for all tests: with children everywhere, for a camera that isn't over the middle.
  static const MarkerSet& shared_pad() {
    static const MarkerSet pad = [] {
      const TemporaryFolder folder;
      const std::string out = (folder / "pad").string();
      const CommandResult made = run_harco("generate --layers 3 --parents 1 --side 1.2 --out '" +
                                           out + "' --children checkerboard --seed 1");
      if (made.status != 0) throw std::runtime_error(made.errors);
      return load_markers(out + "/markers.json");
    }();
    return pad;
  }

  std::vector<std::string> arguments(const std::vector<std::string>& more) const {
    std::vector<std::string> all{"land",
                                 "--source",
                                 "pgm:-",
                                 "--markers",
                                 (folder_ / "markers.json").string(),
                                 "--camera",
                                 (folder_ / "camera.yaml").string(),
                                 "--mount",
                                 (folder_ / "mount.yaml").string(),
                                 "--rate",
                                 "0",
                                 "--record",
                                 "-"};
    all.insert(all.end(), more.begin(), more.end());
    return all;
  }

  std::string errors() const { return read_file(folder_ / "errors"); }

  TemporaryFolder folder_;
  MarkerSet pad_;
  Camera camera_;
  Mount mount_;
};

TEST_F(LandVerb, LandsOnThePadThroughLatencyNoiseAndABlockedView) {
  const std::string place = "127.0.0.1:" + std::to_string(free_port(SOCK_DGRAM));
  Vehicle vehicle("udpin:" + place, value::kAutopilotArduPilot);
  Harco harco(
      HARCO_COMMAND,
      arguments({"--connect", "udpout:" + place, "--frame-clock", "autopilot", "--max-age", "5"}),
      folder_ / "errors");
  SimCopter::Parameters parameters;
  parameters.land_speed_mps = 0.8;
  SimCopter copter({3.0 * 0.8, 3.0 * 0.6, -12.0}, 0.7, parameters);
  SimCamera camera(pad_, camera_, mount_);
  vehicle.work(milliseconds(5000), [&] { return vehicle.has<Heartbeat>(); });
  vehicle.beat();
  Flight flight;
  flight.tells_pose = true;
  fly(flight, copter, camera, harco, vehicle);
  RecordProperty("off_m", std::to_string(flight.off_m));
  EXPECT_LT(flight.off_m, 0.05);
  EXPECT_EQ(flight.while_blocked, 0);
  EXPECT_GT(flight.targets, flight.posed * 9 / 10) << flight.posed << errors();
  EXPECT_TRUE(vehicle.was_told("target found"));
  EXPECT_EQ(harco.finish(), 0) << errors();
  EXPECT_NE(errors().find(" targets sent"), std::string::npos) << errors();
}

/// A ship's deck goes on under the vehicle. Two seconds without a view are as long as ArduCopter
/// waits, so it is told where the deck must be.
TEST_F(LandVerb, LandsOnADeckThatMovesOn) {
  const std::string place = "127.0.0.1:" + std::to_string(free_port(SOCK_DGRAM));
  Vehicle vehicle("udpin:" + place, value::kAutopilotArduPilot);
  Harco harco(
      HARCO_COMMAND,
      arguments({"--connect", "udpout:" + place, "--frame-clock", "autopilot", "--max-age", "5"}),
      folder_ / "errors");
  SimCopter::Parameters parameters;
  parameters.moving_target = true;
  parameters.land_speed_mps = 0.8;
  SimCopter copter({2.4, -1.8, -12.0}, 0.7, parameters);
  SimCamera camera(pad_, camera_, mount_);
  vehicle.work(milliseconds(5000), [&] { return vehicle.has<Heartbeat>(); });
  vehicle.beat();
  Flight flight;
  flight.deck_velocity = {1.2, 1.6};
  flight.tells_pose = true;
  fly(flight, copter, camera, harco, vehicle);
  RecordProperty("off_m", std::to_string(flight.off_m));
  EXPECT_LT(flight.off_m, 0.1);
  EXPECT_EQ(flight.lost, 0);
  EXPECT_GT(flight.while_blocked, 20);
  EXPECT_EQ(harco.finish(), 0) << errors();
}

/// Every target that is sent is that of a frame just shown.
TEST_F(LandVerb, NothingStaleIsSentWhenFramesStop) {
  const std::string place = "127.0.0.1:" + std::to_string(free_port(SOCK_DGRAM));
  Vehicle vehicle("udpin:" + place, value::kAutopilotArduPilot);
  Harco harco(HARCO_COMMAND, arguments({"--connect", "udpout:" + place}), folder_ / "errors");
  const SimCopter copter({0.2, -0.3, -5.0}, 0.0, {});
  SimCamera camera(pad_, camera_, mount_);
  for (int i = 0; i < 8; ++i) {
    harco.show(camera.shoot(copter.state()), 10.0 + i / 30.0);
    ASSERT_FALSE(harco.next("poses").is_null()) << errors();
  }
  vehicle.work(milliseconds(3000), [&] { return vehicle.was_told("target lost"); });
  EXPECT_TRUE(vehicle.was_told("target lost")) << errors();
  const auto sent = vehicle.take<LandingTarget>();
  ASSERT_EQ(sent.size(), 6U) << "from the third pose on that agrees";
  // The vehicle is level with its nose to the north: the pad is at -position.
  EXPECT_LT((Eigen::Vector3f(sent[5].x, sent[5].y, sent[5].z) - Eigen::Vector3f(-0.2F, 0.3F, 5.0F))
                .norm(),
            0.02F);
  EXPECT_TRUE(harco.running());
  vehicle.work(milliseconds(100), [] { return false; });
  EXPECT_FALSE(vehicle.has<LandingTarget>());
  EXPECT_EQ(harco.finish(), 0) << errors();
}

TEST_F(LandVerb, AKilledLinkComesBackWithoutOldNews) {
  const int port = free_port(SOCK_STREAM);
  Harco harco(HARCO_COMMAND, arguments({"--connect", "tcp:127.0.0.1:" + std::to_string(port)}),
              folder_ / "errors");
  SimCopter copter({0.0, 0.0, -5.0}, 0.0, {});
  SimCamera camera(pad_, camera_, mount_);
  double time_s = 0.0;
  const auto show = [&](double height_m) {
    SimCopter::State state = copter.state();
    state.position.z() = -height_m;
    harco.show(camera.shoot(state), time_s += 1.0 / 30.0);
    ASSERT_FALSE(harco.next("poses").is_null()) << errors();
  };
  for (int i = 0; i < 5; ++i) show(5.0);  // nobody listens yet
  for (const double height_m : {4.98, 4.96}) {
    const int listener = socket(AF_INET, SOCK_STREAM, 0);
    const int yes = 1;
    setsockopt(listener, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
    const timeval patience{5, 0};
    setsockopt(listener, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    address.sin_port = htons(static_cast<std::uint16_t>(port));
    ASSERT_EQ(bind(listener, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
    listen(listener, 1);
    const int vehicle = accept(listener, nullptr, nullptr);
    ASSERT_GE(vehicle, 0);
    const timeval moment{0, 20000};
    setsockopt(vehicle, SOL_SOCKET, SO_RCVTIMEO, &moment, sizeof moment);
    // What comes first is what is shown now, not what was shown before.
    Parser parser;
    std::vector<Received> received;
    std::optional<double> first;
    for (int tries = 0; tries < 100 && !first; ++tries) {
      show(height_m);
      std::array<std::uint8_t, 512> bytes{};
      const ssize_t size = recv(vehicle, bytes.data(), bytes.size(), 0);
      if (size <= 0) continue;
      parser.feed(bytes.data(), static_cast<std::size_t>(size), received);
      for (const Received& r : received)
        if (const auto* target = std::get_if<LandingTarget>(&r.message); target && !first)
          first = target->z;
    }
    ASSERT_TRUE(first);
    // The mount's tilt and lever are in it; the vehicle is level over the pad's middle.
    EXPECT_NEAR(*first, height_m, 0.008);
    close(vehicle);
    close(listener);
    for (int i = 0; i < 5; ++i) show(height_m);
  }
  EXPECT_TRUE(harco.running());
  EXPECT_EQ(harco.finish(), 0) << errors();
}

TEST_F(LandVerb, Px4IsToldThePlaceInItsOwnFrame) {
  const std::string place = "127.0.0.1:" + std::to_string(free_port(SOCK_DGRAM));
  Vehicle vehicle("udpin:" + place, value::kAutopilotPx4);
  Harco harco(HARCO_COMMAND,
              arguments({"--connect", "udpout:" + place, "--autopilot", "px4", "--frame-clock",
                         "autopilot", "--max-age", "5", "--target-relative"}),
              folder_ / "errors");
  SimCamera camera(pad_, camera_, mount_);
  vehicle.work(milliseconds(5000), [&] { return vehicle.has<Heartbeat>(); });
  vehicle.beat();
  vehicle.work(milliseconds(2000), [&] { return vehicle.has<CommandLong>(); });
  EXPECT_EQ(vehicle.take<CommandLong>().at(0).command, value::kCommandSetMessageInterval);

  // It flies past the pad at 2 m/s, leaning; its own frame begins somewhere else.
  const Eigen::Vector3d origin(40.0, -7.0, 2.0);
  std::vector<LandingTarget> targets;
  std::vector<TargetRelative> relatives;
  for (int i = 0; i < 12; ++i) {
    SimCopter::State state;
    for (int j = 0; j < 3; ++j) {
      const double time_s = 20.0 + 0.1 * i + 0.02 * j;  // the picture is of the middle one
      SimCopter::State now;
      now.position = Eigen::Vector3d(-1.0 + 2.0 * (time_s - 20.0), 0.4, -4.0);
      now.ned_R_body = Eigen::AngleAxisd(0.9, Eigen::Vector3d::UnitZ()) *
                       Eigen::AngleAxisd(-0.15 + 0.1 * (time_s - 20.0), Eigen::Vector3d::UnitY());
      now.time_s = time_s;
      if (j == 1) state = now;
      const Eigen::Vector3d own = now.position + origin;
      const auto ms = static_cast<std::uint32_t>(std::lround(1e3 * time_s));
      AttitudeQuaternion attitude;
      attitude.time_boot_ms = ms;
      attitude.q1 = static_cast<float>(now.ned_R_body.w());
      attitude.q2 = static_cast<float>(now.ned_R_body.x());
      attitude.q3 = static_cast<float>(now.ned_R_body.y());
      attitude.q4 = static_cast<float>(now.ned_R_body.z());
      LocalPositionNed position;
      position.time_boot_ms = ms;
      position.x = static_cast<float>(own.x());
      position.y = static_cast<float>(own.y());
      position.z = static_cast<float>(own.z());
      position.vx = 2.0F;
      vehicle.link().send(attitude);
      vehicle.link().send(position);
      vehicle.set_time(time_s);
    }
    vehicle.beat();
    vehicle.work(milliseconds(60), [] { return false; });  // its clock is told
    harco.show(camera.shoot(state), state.time_s);
    ASSERT_FALSE(harco.next("poses").is_null()) << errors();
    vehicle.work(milliseconds(i < 3 ? 20 : 500), [&] { return vehicle.has<TargetRelative>(); });
    for (const LandingTarget& target : vehicle.take<LandingTarget>()) targets.push_back(target);
    for (const TargetRelative& target : vehicle.take<TargetRelative>()) relatives.push_back(target);
  }
  ASSERT_GE(targets.size(), 8U) << errors();
  for (const LandingTarget& target : targets) {
    EXPECT_EQ(target.frame, value::kFrameLocalNed);
    EXPECT_EQ(target.position_valid, 1);
    const Eigen::Vector3d position = Eigen::Vector3f(target.x, target.y, target.z).cast<double>();
    EXPECT_LT((position - origin).norm(), 0.05) << target.x << " " << target.y << " " << target.z;
  }
  ASSERT_EQ(relatives.size(), targets.size());
  EXPECT_GT(relatives.back().pos_std[2], 0.0F);
  EXPECT_LT(relatives.back().pos_std[2], 0.05F);
  EXPECT_EQ(harco.finish(), 0) << errors();
}

/// The deck rolls by five degrees, once in 11 s. The first time that a landing is ordered, a gust
/// holds the vehicle where it is until the deck would no longer be level: it must be called off.
TEST_F(LandVerb, OrdersTheLandingSoThatTheDeckIsLevelOnContact) {
  camera_ = Camera::pinhole(240, 180, 165.0);  // enough for a low hover
  save_camera(camera_, folder_ / "camera.yaml");
  const std::string place = "127.0.0.1:" + std::to_string(free_port(SOCK_DGRAM));
  Vehicle vehicle("udpin:" + place, value::kAutopilotArduPilot);
  Harco harco(HARCO_COMMAND,
              arguments({"--connect", "udpout:" + place, "--frame-clock", "autopilot", "--max-age",
                         "5", "--deck", "--command", "--level", "3", "--land-speed", "0.5"}),
              folder_ / "errors");
  SimCamera camera(pad_, camera_, mount_);
  vehicle.work(milliseconds(5000), [&] { return vehicle.has<Heartbeat>(); });
  constexpr std::uint32_t kLoiter = 5, kLand = 9;
  const double level = 3.0 * std::acos(-1.0) / 180.0;
  const auto roll = [](double time_s) {
    return 0.09 * std::sin(2.0 * std::acos(-1.0) / 11.0 * time_s);
  };
  std::vector<std::uint32_t> modes{kLoiter};
  double height_m = 1.7, time_s = 10.0, ordered_s = 0.0;
  for (; height_m > kStandingHeight && time_s < 110.0; time_s += 1.0 / 6.0) {
    SimCopter::State state;
    state.time_s = time_s;
    state.position.z() = -height_m;
    vehicle.set_time(time_s);
    vehicle.set_mode(modes.back());
    vehicle.beat();
    tell_pose(vehicle, state);
    vehicle.work(milliseconds(2), [] { return false; });
    const Eigen::Isometry3d ned_T_pad(Eigen::AngleAxisd(roll(time_s), Eigen::Vector3d::UnitX()));
    harco.show(camera.shoot(state, ned_T_pad), time_s);
    ASSERT_FALSE(harco.next("poses").is_null()) << errors();
    // To foretell takes as long as it takes: the vehicle's clock waits for it.
    while (time_s > 12.0 && (harco.deck().is_null() || harco.deck()["time_s"] < time_s - 0.5))
      ASSERT_FALSE(harco.next("deck").is_null()) << errors();
    vehicle.work(milliseconds(2), [] { return false; });
    for (const CommandLong& command : vehicle.take<CommandLong>()) {
      if (command.command != value::kCommandDoSetMode) continue;
      const auto mode = static_cast<std::uint32_t>(command.param[1]);
      if (mode == modes.back()) continue;
      modes.push_back(mode);
      ordered_s = time_s;
    }
    // It comes down after a second, at half a metre a second.
    if (modes.size() > 2 && modes.back() == kLand && time_s > ordered_s + 1.0)
      height_m -= 0.5 / 6.0;
  }
  ASSERT_GE(modes.size(), 4U) << "until " << time_s << ": " << harco.deck() << errors();
  RecordProperty("contact_s", std::to_string(time_s));
  EXPECT_EQ(modes[1], kLand);
  EXPECT_EQ(modes[2], kLoiter);
  EXPECT_EQ(modes.back(), kLand);
  EXPECT_LE(height_m, kStandingHeight);
  EXPECT_LT(std::abs(roll(time_s)), 1.1 * level) << "at " << time_s << ", ordered " << ordered_s;
  EXPECT_TRUE(vehicle.was_told("deck level in"));
  EXPECT_TRUE(vehicle.was_told("landing called off"));
  EXPECT_EQ(harco.finish(), 0) << errors();
}

/// What was recorded is played again to the last bit, and so is what was made of it.
TEST_F(LandVerb, ARecordedFlightIsPlayedAgain) {
  const std::string record = (folder_ / "flight.jsonl").string();
  std::vector<std::string> recording =
      arguments({"--dry-run", "--target-relative", "--target", "0.5,0.7"});
  *std::next(std::find(recording.begin(), recording.end(), "--record")) = record;
  Harco harco(HARCO_COMMAND, recording, folder_ / "errors");
  SimCopter copter({0.4, 0.3, -3.0}, 0.3, {});
  SimCamera camera(pad_, camera_, mount_);
  for (int i = 0; i < 20; ++i) {
    SimCopter::State state = copter.state();
    state.position.x() += 0.02 * i;
    harco.show(i == 12 ? camera.shoot_nothing() : camera.shoot(state), i / 30.0);
  }
  EXPECT_EQ(harco.finish(), 0) << errors();

  const CommandResult again = run_harco("replay '" + record + "'");
  ASSERT_EQ(again.status, 0) << again.errors;
  std::istringstream recorded(read_file(record)), played(again.output);
  std::string line, other;
  ASSERT_TRUE(std::getline(recorded, line));
  EXPECT_EQ(json::parse(line)["verb"], "land");
  int frames = 0, news = 0, sent = 0;
  while (std::getline(recorded, line)) {
    auto expected = nlohmann::ordered_json::parse(line);
    if (expected.contains("record")) {
      expected.erase("record");
      line = expected.dump();
      ++frames;
      for (const auto& message : expected["target"]["news"])
        news += message["message"] == "LANDING_TARGET" ? 1 : 0;
    } else {
      sent += expected["message"] == "LANDING_TARGET" ? 1 : 0;
    }
    ASSERT_TRUE(std::getline(played, other));
    EXPECT_EQ(other, line);
  }
  EXPECT_FALSE(std::getline(played, other));
  EXPECT_EQ(frames, 20);
  EXPECT_EQ(news, 17) << "not the first two, nor where nothing is seen";
  EXPECT_EQ(sent, news);

  // It isn't merely copied: with another target point it says something else.
  std::string text = read_file(record);
  const std::size_t at = text.find("\"point\":[0.5,");
  ASSERT_NE(at, std::string::npos);
  text.replace(at, 13, "\"point\":[0.6,");
  write_file(folder_ / "other.jsonl", text);
  const CommandResult elsewhere = run_harco("replay '" + (folder_ / "other.jsonl").string() + "'");
  EXPECT_EQ(elsewhere.status, 0) << elsewhere.errors;
  EXPECT_NE(elsewhere.output, again.output);
}

TEST_F(LandVerb, DryRunPrintsWhatItWouldSend) {
  std::vector<std::string> dry = arguments({"--dry-run", "--angles-only"});
  dry.erase(std::find(dry.begin(), dry.end(), "--record"), dry.end() - 2);
  Harco harco(HARCO_COMMAND, dry, folder_ / "errors");
  const SimCopter copter({-0.5, 0.25, -4.0}, 0.0, {});
  SimCamera camera(pad_, camera_, mount_);
  for (int i = 0; i < 6; ++i) harco.show(camera.shoot(copter.state()), i / 30.0);
  const json line = harco.next("message");
  ASSERT_FALSE(line.is_null()) << errors();
  EXPECT_EQ(line["message"], "LANDING_TARGET");
  const json& fields = line["fields"];
  EXPECT_EQ(fields["position_valid"], 0);
  EXPECT_NEAR(fields["angle_x"], std::atan2(-0.25, 4.0), 0.005);
  EXPECT_NEAR(fields["angle_y"], std::atan2(-0.5, 4.0), 0.005);
  EXPECT_NEAR(fields["distance"], std::sqrt(16.0 + 0.0625 + 0.25), 0.03);
  EXPECT_EQ(harco.finish(), 0) << errors();
}

TEST_F(LandVerb, SaysInOneLineWhatIsWrong) {
  const auto run = [&](const std::string& replaced, const std::string& by,
                       const std::string& more) {
    std::string line = "land --source pgm:/dev/null";
    for (const char* name : {"markers.json", "camera.yaml", "mount.yaml"}) {
      const std::string path = (folder_ / name).string();
      const std::string option = std::string(name).substr(0, std::string(name).find('.'));
      line += " --" + option + " '" + (replaced == name ? by : path) + "'";
    }
    return run_harco(line + " " + more);
  };
  const auto expect = [&](const CommandResult& result, const std::string& part) {
    EXPECT_EQ(result.status, 2);
    EXPECT_EQ(std::count(result.errors.begin(), result.errors.end(), '\n'), 1) << result.errors;
    EXPECT_NE(result.errors.find(part), std::string::npos) << result.errors;
  };
  write_file(folder_ / "wrong.yaml", "looks: sideways\n");
  expect(run("", "", ""), "--connect");
  expect(run("", "", "--dry-run --command"), "--deck");
  expect(run("mount.yaml", (folder_ / "wrong.yaml").string(), "--dry-run"), "wrong.yaml: 'looks'");
  expect(run("camera.yaml", "/nonexistent", "--dry-run"), "/nonexistent");
  expect(run("", "", "--connect carrier-pigeon:roof:1"), "carrier-pigeon");
  expect(run("", "", "--dry-run --parent 7"), "no layer-1 marker 7");
  expect(run("", "", "--dry-run"), "has no frames");
  expect(run("", "", "--connect udpout:127.0.0.1:14550 --sign /nonexistent"), "/nonexistent");
  Harco harco(HARCO_COMMAND, arguments({"--dry-run"}), folder_ / "errors");
  harco.show(Image(64, 48, 100), 0.0);
  EXPECT_EQ(harco.finish(), 2);
  EXPECT_NE(errors().find("is 64 x 48 pixels, but the camera"), std::string::npos) << errors();
}

}  // namespace
}  // namespace harco::test
