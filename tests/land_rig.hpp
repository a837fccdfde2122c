// What harco land is tried out with as a whole program: its process, the autopilot at the other end
// of its link, and flights of a simulated vehicle between them. Frames go one by one, each after
// the answer to the one before it, so nothing depends on how fast this machine is.
#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <deque>
#include <filesystem>
#include <functional>
#include <optional>
#include <stdexcept>
#include <string>
#include <variant>
#include <vector>

#include <nlohmann/json.hpp>

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include "harco/image.hpp"
#include "harco/link.hpp"
#include "sim_copter.hpp"

namespace harco::test {

constexpr double kStandingHeight = 0.2;  ///< of the vehicle's origin above its feet

inline int free_port(int type) {
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
  Harco(const std::string& command, const std::vector<std::string>& arguments,
        const std::filesystem::path& errors) {
    std::array<int, 2> in{}, out{};
    if (pipe(in.data()) != 0 || pipe(out.data()) != 0) throw std::runtime_error("no pipes");
    pid_ = fork();
    if (pid_ == 0) {
      dup2(in[0], STDIN_FILENO);
      dup2(out[1], STDOUT_FILENO);
      if (std::freopen(errors.c_str(), "w", stderr) == nullptr) _exit(125);
      for (const int fd : {in[0], in[1], out[0], out[1]}) close(fd);
      std::vector<char*> words{const_cast<char*>(command.c_str())};
      for (const std::string& word : arguments) words.push_back(const_cast<char*>(word.c_str()));
      words.push_back(nullptr);
      execv(command.c_str(), words.data());
      _exit(126);
    }
    close(in[0]);
    close(out[1]);
    to_ = fdopen(in[1], "wb");
    from_ = out[0];
  }
  ~Harco() {
    if (pid_ > 0) kill(pid_, SIGKILL);
    finish();
    close(from_);
  }
  Harco(const Harco&) = delete;
  Harco& operator=(const Harco&) = delete;

  void show(const Image& image, double time_s) {
    std::fprintf(to_, "P5\n# timestamp_s %.6f\n%d %d\n255\n", time_s, image.width, image.height);
    std::fwrite(image.pixels.data(), 1, image.pixels.size(), to_);
    std::fflush(to_);
  }

  /// The next line that has this member; null at the end, or when nothing comes for ten seconds.
  nlohmann::json next(const std::string& member) {
    for (;;) {
      const std::size_t end = text_.find('\n');
      if (end == std::string::npos) {
        pollfd file{from_, POLLIN, 0};
        std::array<char, 4096> bytes{};
        const ssize_t size =
            poll(&file, 1, 10000) == 1 ? read(from_, bytes.data(), bytes.size()) : 0;
        if (size <= 0) return nullptr;
        text_.append(bytes.data(), static_cast<std::size_t>(size));
        continue;
      }
      nlohmann::json line = nlohmann::json::parse(text_.substr(0, end));
      text_.erase(0, end + 1);
      if (line.contains("deck")) deck_ = line["deck"];
      if (line.contains(member)) return line;
    }
  }

  /// The newest that was said of the deck; null if nothing was.
  const nlohmann::json& deck() const { return deck_; }

  bool running() const { return pid_ > 0 && waitpid(pid_, nullptr, WNOHANG) == 0; }

  /// Ends its input and waits for it. Its exit status.
  int finish() {
    if (to_ != nullptr) std::fclose(to_);
    to_ = nullptr;
    if (pid_ <= 0) return status_;
    std::array<char, 4096> rest{};
    while (read(from_, rest.data(), rest.size()) > 0) {
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
  int from_ = -1;
  std::string text_;  ///< read, but not looked at
  nlohmann::json deck_;
};

/// The autopilot's end of the link.
class Vehicle {
 public:
  Vehicle(const std::string& link, std::uint8_t autopilot) : link_(link, options()) {
    heartbeat_.type = 2;
    heartbeat_.autopilot = autopilot;
    heartbeat_.base_mode = 129;
  }

  mavlink::Link& link() { return link_; }
  void set_mode(std::uint32_t mode) { heartbeat_.custom_mode = mode; }
  void set_time(double time_s) { time_s_ = time_s; }

  void beat() { link_.send(heartbeat_); }

  /// Hears what has come, and answers what is asked. At most for so long; ends with `enough`.
  void work(std::chrono::milliseconds most, const std::function<bool()>& enough) {
    const auto end = std::chrono::steady_clock::now() + most;
    do {
      std::vector<mavlink::Received> received;
      link_.wait(std::chrono::milliseconds(2), -1, received);
      for (const mavlink::Received& r : received) hear(r.message);
    } while (!enough() && std::chrono::steady_clock::now() < end);
  }

  template <typename M>
  std::vector<M> take() {
    std::vector<M> taken;
    for (const mavlink::Message& message : heard_)
      if (const auto* m = std::get_if<M>(&message)) taken.push_back(*m);
    heard_.erase(
        std::remove_if(heard_.begin(), heard_.end(),
                       [](const mavlink::Message& m) { return std::holds_alternative<M>(m); }),
        heard_.end());
    return taken;
  }
  template <typename M>
  bool has() const {
    return std::any_of(heard_.begin(), heard_.end(),
                       [](const mavlink::Message& m) { return std::holds_alternative<M>(m); });
  }
  bool was_told(const std::string& text) const {
    return std::any_of(heard_.begin(), heard_.end(), [&](const mavlink::Message& m) {
      const auto* status = std::get_if<mavlink::StatusText>(&m);
      return status != nullptr && status->text.find(text) != std::string::npos;
    });
  }

 private:
  static mavlink::LinkOptions options() {
    mavlink::LinkOptions options;
    options.from = {1, 1};
    return options;
  }

  void hear(const mavlink::Message& message) {
    if (const auto* question = std::get_if<mavlink::Timesync>(&message);
        question && question->tc1 == 0) {
      mavlink::Timesync answer = *question;
      answer.tc1 = static_cast<std::int64_t>(1e9 * time_s_);
      link_.send(answer);
      return;
    }
    heard_.push_back(message);
  }

  mavlink::Link link_;
  mavlink::Heartbeat heartbeat_;
  double time_s_ = 1.0;
  std::vector<mavlink::Message> heard_;
};

/// How a flight is flown, and how it went.
struct Flight {
  Eigen::Vector2d deck_velocity = Eigen::Vector2d::Zero();  ///< NED, m/s
  double frame_rate = 15.0;
  double latency_s = 0.05;
  double stamps_late_s = 0.0;  ///< error of the frames' times
  double blocked_m = 6.0;      ///< below this height nothing is seen ...
  double blocked_s = 2.0;      ///< ... for so long
  bool tells_pose = false;     ///< the vehicle says where it is

  double off_m = 1e9;  ///< of the touchdown
  int frames = 0, posed = 0, targets = 0, while_blocked = 0;
  int lost = 0;  ///< how often the autopilot gave its target up
  double worst_share =
      0.0;  ///< greatest error of a target told while it was seen, over its distance
};

/// Attitude and position, as an autopilot sends them.
inline void tell_pose(Vehicle& vehicle, const SimCopter::State& state) {
  const auto ms = static_cast<std::uint32_t>(std::lround(1e3 * state.time_s));
  mavlink::AttitudeQuaternion attitude;
  attitude.time_boot_ms = ms;
  attitude.q1 = static_cast<float>(state.ned_R_body.w());
  attitude.q2 = static_cast<float>(state.ned_R_body.x());
  attitude.q3 = static_cast<float>(state.ned_R_body.y());
  attitude.q4 = static_cast<float>(state.ned_R_body.z());
  mavlink::LocalPositionNed position;
  position.time_boot_ms = ms;
  position.x = static_cast<float>(state.position.x());
  position.y = static_cast<float>(state.position.y());
  position.z = static_cast<float>(state.position.z());
  position.vx = static_cast<float>(state.velocity.x());
  position.vy = static_cast<float>(state.velocity.y());
  position.vz = static_cast<float>(state.velocity.z());
  vehicle.link().send(attitude);
  vehicle.link().send(position);
}

/// Flies until it is down, or for a minute.
inline void fly(Flight& flight, SimCopter& copter, SimCamera& camera, Harco& harco,
                Vehicle& vehicle) {
  constexpr double kStep = 1.0 / 300.0, kPosePeriod = 1.0 / 60.0;
  struct Shot {
    Image image;
    double time_s;
    bool blocked;
    Eigen::Vector3d body_p_target;
  };
  std::deque<Shot> on_the_way;
  std::optional<double> blocked_s;
  double next_shot_s = 0.0, next_pose_s = 0.0;
  const auto deck = [&](double time_s) {
    const Eigen::Vector2d moved = time_s * flight.deck_velocity;
    return Eigen::Vector3d(moved.x(), moved.y(), 0.0);
  };
  const auto shoot = [&] {
    const SimCopter::State& state = copter.state();
    if (state.position.z() > -flight.blocked_m && !blocked_s) blocked_s = state.time_s;
    const bool blocked = blocked_s && state.time_s < *blocked_s + flight.blocked_s;
    const Eigen::Vector3d pad = deck(state.time_s);
    const Eigen::Isometry3d ned_T_pad(Eigen::Translation3d{pad});
    on_the_way.push_back({blocked ? camera.shoot_nothing() : camera.shoot(state, ned_T_pad),
                          state.time_s, blocked,
                          state.ned_R_body.inverse() * (pad - state.position)});
  };
  const auto arrive = [&](const Shot& shot) {
    if (flight.frames++ % 10 == 0) vehicle.beat();
    vehicle.work(std::chrono::milliseconds(0), [] { return true; });
    harco.show(shot.image, shot.time_s + flight.stamps_late_s);
    const nlohmann::json answer = harco.next("poses");
    if (answer.is_null()) throw std::runtime_error("harco land has ended");
    flight.posed += answer["poses"].empty() ? 0 : 1;
    if (!answer["target"]["news"].empty())
      vehicle.work(std::chrono::milliseconds(1000),
                   [&] { return vehicle.has<mavlink::LandingTarget>(); });
    for (const mavlink::LandingTarget& target : vehicle.take<mavlink::LandingTarget>()) {
      if (target.position_valid != 1 || target.frame != mavlink::value::kFrameBodyFrd)
        throw std::runtime_error("a target that ArduCopter doesn't take");
      copter.hear(target);
      ++flight.targets;
      flight.while_blocked += shot.blocked ? 1 : 0;
      if (answer["target"]["foretold"] == true) continue;
      const Eigen::Vector3d told = Eigen::Vector3f(target.x, target.y, target.z).cast<double>();
      flight.worst_share = std::max(flight.worst_share,
                                    (told - shot.body_p_target).norm() / shot.body_p_target.norm());
    }
  };
  while (copter.state().position.z() < -kStandingHeight && copter.state().time_s < 60.0) {
    const double now_s = copter.state().time_s + 1e-9;
    copter.wind = {0.1 * std::sin(0.7 * now_s), 0.25, 0.0};
    vehicle.set_time(now_s);
    if (flight.tells_pose && now_s >= next_pose_s) {
      tell_pose(vehicle, copter.state());
      next_pose_s += kPosePeriod;
    }
    if (now_s >= next_shot_s) {
      shoot();
      next_shot_s += 1.0 / flight.frame_rate;
    }
    if (!on_the_way.empty() && now_s >= on_the_way.front().time_s + flight.latency_s) {
      arrive(on_the_way.front());
      on_the_way.pop_front();
    }
    const bool had_target = copter.has_target();
    copter.step(kStep);
    flight.lost += had_target && !copter.has_target() ? 1 : 0;
  }
  const SimCopter::State& at = copter.state();
  if (at.position.z() > -kStandingHeight - 1e-9)
    flight.off_m = (at.position - deck(at.time_s)).head<2>().norm();
}

}  // namespace harco::test
