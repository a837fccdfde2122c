// Flights of a simulated vehicle that harco land leads to a pad: where it touches down. The vehicle
// estimates its target as ArduCopter's precision landing does (tests/sim_copter.hpp); frames and
// messages go through the pipe and the link of the real command.
#include <cstdio>
#include <filesystem>
#include <random>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "harco/camera.hpp"
#include "harco/marker.hpp"
#include "harco/mount.hpp"
#include "tests/land_rig.hpp"

using namespace harco;        // NOLINT(google-build-using-namespace)
using namespace harco::test;  // NOLINT(google-build-using-namespace)
namespace fs = std::filesystem;

namespace {

struct Options {
  std::string command, markers;
  int flights = 5;
  int width = 640, height = 480;
  double focal_px = 460.0;
  double deck_mps = 0.0, frame_rate = 30.0, latency_s = 0.05, blocked_s = 2.0, coast_s = 2.5;
  double stamps_late_s = 0.0;
  SimCopter::Parameters vehicle;
};

Flight fly_once(const Options& options, const MarkerSet& pad, const fs::path& folder, int number) {
  std::mt19937 random(static_cast<unsigned>(number));
  std::uniform_real_distribution<double> turn(-std::acos(-1.0), std::acos(-1.0));
  const double bearing = turn(random), heading = turn(random), course = turn(random);
  const Camera camera = Camera::pinhole(options.width, options.height, options.focal_px);
  save_camera(camera, folder / "camera.yaml");
  const std::string place = "127.0.0.1:" + std::to_string(free_port(SOCK_DGRAM));
  Vehicle autopilot("udpin:" + place, mavlink::value::kAutopilotArduPilot);
  const std::vector<std::string> arguments{"land",
                                           "--source",
                                           "pgm:-",
                                           "--markers",
                                           options.markers,
                                           "--camera",
                                           (folder / "camera.yaml").string(),
                                           "--connect",
                                           "udpout:" + place,
                                           "--frame-clock",
                                           "autopilot",
                                           "--max-age",
                                           "5",
                                           "--rate",
                                           "0",
                                           "--record",
                                           "-",
                                           "--coast",
                                           std::to_string(options.coast_s)};
  Harco harco(options.command, arguments, folder / "errors");
  autopilot.work(std::chrono::seconds(5), [&] { return autopilot.has<mavlink::Heartbeat>(); });
  autopilot.beat();

  Flight flight;
  flight.deck_velocity = options.deck_mps * Eigen::Vector2d(std::cos(course), std::sin(course));
  flight.frame_rate = options.frame_rate;
  flight.latency_s = options.latency_s;
  flight.blocked_s = options.blocked_s;
  flight.stamps_late_s = options.stamps_late_s;
  flight.tells_pose = true;
  SimCopter copter({3.0 * std::cos(bearing), 3.0 * std::sin(bearing), -12.0}, heading,
                   options.vehicle);
  SimCamera eye(pad, camera, Mount());
  fly(flight, copter, eye, harco, autopilot);
  return flight;
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  CLI::App app{"Landings from 12 m, 3 m off to a random side, with the view blocked on the way"};
  app.add_option("--harco", options.command, "The command")->required();
  app.add_option("--markers", options.markers, "The pad (markers.json)")->required();
  app.add_option("--flights", options.flights)->capture_default_str();
  app.add_option("--width", options.width, "Of the picture, pixels")->capture_default_str();
  app.add_option("--height", options.height)->capture_default_str();
  app.add_option("--focal", options.focal_px, "Pixels")->capture_default_str();
  app.add_option("--deck", options.deck_mps, "The pad's speed, m/s")->capture_default_str();
  app.add_option("--frame-rate", options.frame_rate)->capture_default_str();
  app.add_option("--latency", options.latency_s, "Seconds")->capture_default_str();
  app.add_option("--blocked", options.blocked_s, "Seconds")->capture_default_str();
  app.add_option("--stamps-late", options.stamps_late_s, "Error of the pictures' times, seconds")
      ->capture_default_str();
  app.add_option("--coast", options.coast_s, "harco land --coast")->capture_default_str();
  app.add_option("--lag", options.vehicle.lag_s, "PLND_LAG")->capture_default_str();
  app.add_option("--land-speed", options.vehicle.land_speed_mps)->capture_default_str();
  app.add_option("--off-most", options.vehicle.off_most_m, "PLND_XY_DIST_MAX")
      ->capture_default_str();
  app.add_flag("--moving-target", options.vehicle.moving_target, "PLND_OPTIONS 1");
  CLI11_PARSE(app, argc, argv);

  const MarkerSet pad = load_markers(options.markers);
  const fs::path folder = fs::temp_directory_path() / ("landing-" + std::to_string(getpid()));
  fs::create_directories(folder);
  std::printf("flight  off cm  frames  posed  told  of those hidden  lost  worst share\n");
  for (int i = 0; i < options.flights; ++i) {
    const Flight f = fly_once(options, pad, folder, i);
    std::printf("%6d  %6.1f  %6d  %5d  %4d  %15d  %4d  %11.4f\n", i,
                100.0 * std::min(f.off_m, 99.0), f.frames, f.posed, f.targets, f.while_blocked,
                f.lost, f.worst_share);
    std::fflush(stdout);
  }
  fs::remove_all(folder);
}
