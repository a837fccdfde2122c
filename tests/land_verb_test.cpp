// harco land as a whole program: a simulated vehicle at the other end of its link, a simulated
// camera at the other end of its pipe. Frames go one by one, each after the answer to the one
// before it, so nothing depends on how fast this machine is.
#include <algorithm>
#include <array>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <functional>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include "command.hpp"
#include "harco/link.hpp"
#include "harco/vehicle.hpp"
#include "sim_copter.hpp"

namespace harco::test {
namespace {

using nlohmann::json;
using namespace mavlink;  // NOLINT(google-build-using-namespace): messages are all over here
using std::chrono::milliseconds;

constexpr double kStandingHeight = 0.2;

int free_port(int type) {
  const int fd = socket(AF_INET, type, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  bind(fd, reinterpret_cast<sockaddr*>(&address), sizeof address);
  socklen_t size = sizeof address;
  getsockname(fd, reinterpret_cast<sockaddr*>(&address), &size);
  close(fd);
  return ntohs(address.sin_port);
}

/// harco, with a pipe to its standard input and one from its standard output.
class Harco {
 public:
  Harco(const std::vector<std::string>& arguments, const std::filesystem::path& errors) {
    std::array<int, 2> in{}, out{};
    if (pipe(in.data()) != 0 || pipe(out.data()) != 0) throw std::runtime_error("no pipes");
    pid_ = fork();
    if (pid_ == 0) {
      dup2(in[0], STDIN_FILENO);
      dup2(out[1], STDOUT_FILENO);
      if (std::freopen(errors.c_str(), "w", stderr) == nullptr) _exit(125);
      for (const int fd : {in[0], in[1], out[0], out[1]}) close(fd);
      std::vector<char*> words{const_cast<char*>(HARCO_COMMAND)};
      for (const std::string& word : arguments) words.push_back(const_cast<char*>(word.c_str()));
      words.push_back(nullptr);
      execv(HARCO_COMMAND, words.data());
      _exit(126);
    }
    close(in[0]);
    close(out[1]);
    to_ = fdopen(in[1], "wb");
    from_ = fdopen(out[0], "rb");
  }
  ~Harco() {
    if (pid_ > 0) kill(pid_, SIGKILL);
    finish();
    std::fclose(from_);
  }
  Harco(const Harco&) = delete;
  Harco& operator=(const Harco&) = delete;

  void show(const Image& image, double time_s) {
    std::fprintf(to_, "P5\n# timestamp_s %.6f\n%d %d\n255\n", time_s, image.width, image.height);
    std::fwrite(image.pixels.data(), 1, image.pixels.size(), to_);
    std::fflush(to_);
  }

  /// The next line that has this member; null at the end.
  json next(const std::string& member) {
    std::string line;
    for (int c = std::getc(from_); c != EOF; c = std::getc(from_)) {
      if (c != '\n') {
        line.push_back(static_cast<char>(c));
        continue;
      }
      json parsed = json::parse(line);
      if (parsed.contains(member)) return parsed;
      line.clear();
    }
    return nullptr;
  }

  bool running() const { return pid_ > 0 && waitpid(pid_, nullptr, WNOHANG) == 0; }

  /// Ends its input and waits for it. Its exit status.
  int finish() {
    if (to_ != nullptr) std::fclose(to_);
    to_ = nullptr;
    if (pid_ <= 0) return status_;
    while (std::getc(from_) != EOF) {
    }
    int status = 0;
    waitpid(pid_, &status, 0);
    pid_ = -1;
    return status_ = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  }

 private:
  pid_t pid_ = -1;
  int status_ = -1;
  std::FILE* to_ = nullptr;
  std::FILE* from_ = nullptr;
};

/// The autopilot's end of the link.
class Vehicle {
 public:
  Vehicle(const std::string& link, std::uint8_t autopilot) : link_(link, options()) {
    heartbeat_.type = 2;
    heartbeat_.autopilot = autopilot;
    heartbeat_.base_mode = 129;
  }

  Link& link() { return link_; }
  void set_mode(std::uint32_t mode) { heartbeat_.custom_mode = mode; }
  void set_time(double time_s) { time_s_ = time_s; }

  void beat() { link_.send(heartbeat_); }

  /// Hears what has come, and answers what is asked. At most for so long; ends with `enough`.
  void work(milliseconds most, const std::function<bool()>& enough) {
    const auto end = std::chrono::steady_clock::now() + most;
    do {
      std::vector<Received> received;
      link_.wait(milliseconds(2), -1, received);
      for (const Received& r : received) hear(r.message);
    } while (!enough() && std::chrono::steady_clock::now() < end);
  }

  template <typename M>
  std::vector<M> take() {
    std::vector<M> taken;
    for (const Message& message : heard_)
      if (const auto* m = std::get_if<M>(&message)) taken.push_back(*m);
    heard_.erase(std::remove_if(heard_.begin(), heard_.end(),
                                [](const Message& m) { return std::holds_alternative<M>(m); }),
                 heard_.end());
    return taken;
  }
  template <typename M>
  bool has() const {
    return std::any_of(heard_.begin(), heard_.end(),
                       [](const Message& m) { return std::holds_alternative<M>(m); });
  }
  bool was_told(const std::string& text) const {
    return std::any_of(heard_.begin(), heard_.end(), [&](const Message& m) {
      const auto* status = std::get_if<StatusText>(&m);
      return status != nullptr && status->text.find(text) != std::string::npos;
    });
  }

 private:
  static LinkOptions options() {
    LinkOptions options;
    options.from = {1, 1};
    return options;
  }

  void hear(const Message& message) {
    if (const auto* question = std::get_if<Timesync>(&message); question && question->tc1 == 0) {
      Timesync answer = *question;
      answer.tc1 = static_cast<std::int64_t>(1e9 * time_s_);
      link_.send(answer);
      return;
    }
    heard_.push_back(message);
  }

  Link link_;
  Heartbeat heartbeat_;
  double time_s_ = 1.0;
  std::vector<Message> heard_;
};

class LandVerb : public ::testing::Test {
 protected:
  LandVerb() {
    pad_ = shared_pad();
    save_markers(pad_, folder_ / "markers.json");
    camera_ = Camera::pinhole(480, 360, 330.0);
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
  const int port = free_port(SOCK_DGRAM);
  const std::string place = "127.0.0.1:" + std::to_string(port);
  Vehicle vehicle("udpin:" + place, value::kAutopilotArduPilot);
  Harco harco(arguments({"--connect", "udpout:" + place}), folder_ / "errors");
  SimCopter copter({3.0 * 0.8, 3.0 * 0.6, -12.0}, 0.7);
  SimCamera camera(pad_, camera_, mount_);

  const double period = 1.0 / 15.0, latency = 0.05, dt = 1.0 / 300.0;
  int frames = 0, targets = 0, while_blocked = 0;
  double blocked_from = 1e9;
  while (copter.state().position.z() < -kStandingHeight && frames < 900) {
    const SimCopter::State seen = copter.state();
    copter.wind = {0.15 * std::sin(0.7 * seen.time_s), 0.25, 0.0};
    if (seen.position.z() > -6.0 && blocked_from > 1e8) blocked_from = seen.time_s;
    const bool blocked = seen.time_s >= blocked_from && seen.time_s < blocked_from + 2.0;
    const Image image = blocked ? camera.shoot_nothing() : camera.shoot(seen);
    // The frame arrives a little later.
    for (int i = 0; i < std::lround(latency / dt); ++i) copter.step(dt);
    if (frames % 10 == 0) vehicle.beat();
    harco.show(image, seen.time_s);
    const json answer = harco.next("frame");
    ASSERT_FALSE(answer.is_null()) << errors();
    const bool posed = !answer["poses"].empty();
    vehicle.work(posed ? milliseconds(150) : milliseconds(0),
                 [&] { return vehicle.has<LandingTarget>(); });
    for (const LandingTarget& target : vehicle.take<LandingTarget>()) {
      EXPECT_EQ(target.position_valid, 1);
      EXPECT_EQ(target.frame, value::kFrameBodyFrd);
      copter.hear(target);
      ++targets;
      if (blocked) ++while_blocked;
    }
    for (int i = 0; i < std::lround((period - latency) / dt); ++i) copter.step(dt);
    ++frames;
  }
  const Eigen::Vector3d at = copter.state().position;
  EXPECT_LT(at.head<2>().norm(), 0.05) << at.transpose();
  RecordProperty("off_m", std::to_string(at.head<2>().norm()));
  EXPECT_GT(at.z(), -kStandingHeight - 1e-9)
      << "it came down, in " << copter.state().time_s << " s";
  EXPECT_EQ(while_blocked, 0);
  const int in_view = frames - 30;
  harco.finish();
  EXPECT_GT(targets, in_view * 3 / 4) << errors();
  EXPECT_TRUE(vehicle.was_told("target found"));
  EXPECT_EQ(harco.finish(), 0) << errors();
  EXPECT_NE(errors().find(" targets sent"), std::string::npos) << errors();
}

/// Every target that is sent is that of a frame just shown.
TEST_F(LandVerb, NothingStaleIsSentWhenFramesStop) {
  const std::string place = "127.0.0.1:" + std::to_string(free_port(SOCK_DGRAM));
  Vehicle vehicle("udpin:" + place, value::kAutopilotArduPilot);
  Harco harco(arguments({"--connect", "udpout:" + place}), folder_ / "errors");
  const SimCopter copter({0.2, -0.3, -5.0}, 0.0);
  SimCamera camera(pad_, camera_, mount_);
  for (int i = 0; i < 8; ++i) {
    harco.show(camera.shoot(copter.state()), 10.0 + i / 30.0);
    ASSERT_FALSE(harco.next("frame").is_null()) << errors();
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
  Harco harco(arguments({"--connect", "tcp:127.0.0.1:" + std::to_string(port)}),
              folder_ / "errors");
  SimCopter copter({0.0, 0.0, -5.0}, 0.0);
  SimCamera camera(pad_, camera_, mount_);
  double time_s = 0.0;
  const auto show = [&](double height_m) {
    SimCopter::State state = copter.state();
    state.position.z() = -height_m;
    harco.show(camera.shoot(state), time_s += 1.0 / 30.0);
    ASSERT_FALSE(harco.next("frame").is_null()) << errors();
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
  Harco harco(arguments({"--connect", "udpout:" + place, "--autopilot", "px4", "--frame-clock",
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
    ASSERT_FALSE(harco.next("frame").is_null()) << errors();
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

TEST_F(LandVerb, DryRunPrintsWhatItWouldSend) {
  std::vector<std::string> dry = arguments({"--dry-run", "--angles-only"});
  dry.erase(std::find(dry.begin(), dry.end(), "--record"), dry.end() - 2);
  Harco harco(dry, folder_ / "errors");
  const SimCopter copter({-0.5, 0.25, -4.0}, 0.0);
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
  Harco harco(arguments({"--dry-run"}), folder_ / "errors");
  harco.show(Image(64, 48, 100), 0.0);
  EXPECT_EQ(harco.finish(), 2);
  EXPECT_NE(errors().find("is 64 x 48 pixels, but the camera"), std::string::npos) << errors();
}

}  // namespace
}  // namespace harco::test
