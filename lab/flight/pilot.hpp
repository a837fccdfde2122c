// What flies on the vehicle's computer: poses of the deck in, accelerations out. It knows nothing
// that a real one doesn't.
#pragma once

#include <optional>

#include "harco/deck.hpp"
#include "harco/filter.hpp"
#include "harco/mount.hpp"
#include "harco/touchdown.hpp"
#include "world.hpp"

namespace harco::lab {

/// The touchdown point as the vehicle believes it to be.
struct Belief {
  Eigen::Vector3d position =
      Eigen::Vector3d::Zero();  ///< of the camera from it, level frame (z down)
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();  ///< of the camera past it
  double age_s = 0.0;                                  ///< since the last measurement
};

struct PilotOptions {
  HeightController height;  ///< the paper's P = 1, D = 0.8 by default
  double level_p = 1.2;     ///< of the position beside the touchdown point, 1/s^2
  double level_d = 1.8;     ///< 1/s
  double level_i = 0.25;    ///< 1/s^3: takes out the wind
  double most_level_mps2 = 2.5;
  double foot_m = 0.2;  ///< the feet reach so far below the camera
  Eigen::Vector3d touchdown_point = Eigen::Vector3d::Zero();  ///< marker frame
  Eigen::Isometry3d body_T_camera = Mount::looking_down();
  FilterOptions filter;
};

class Pilot {
 public:
  explicit Pilot(const PilotOptions& options);

  /// A pose from the image of `time_s`, with what the sensors told then.
  void see(const Pose& pose, double time_s, const SensorReading& then);

  /// What it believes now; empty if it has lost the deck.
  std::optional<Belief> belief(double now_s, const SensorReading& now) const;

  /// Height of the feet over the touchdown point, and its rate.
  double height(const Belief& belief) const { return -belief.position.z() - options_.foot_m; }
  static double climb(const Belief& belief) { return -belief.velocity.z(); }

  /// What to fly: above the touchdown point, at the height commanded. `deck_lift_mps2` is what the
  /// deck itself accelerates upwards, as far as that is foreseen. Without belief it climbs gently.
  Eigen::Vector3d acceleration(const std::optional<Belief>& belief, const HeightCommand& command,
                               double deck_lift_mps2, double dt_s);

  /// What a pose says about the deck's motion.
  DeckSample sample(const Pose& pose, double time_s, const SensorReading& then,
                    const VehicleOptions& vehicle, bool with_height) const;

 private:
  Eigen::Isometry3d level_T_camera(const SensorReading& reading) const;

  PilotOptions options_;
  PoseFilter filter_;
  Eigen::Vector2d wind_ = Eigen::Vector2d::Zero();  ///< acceleration against it
};

}  // namespace harco::lab
