// A quadrotor over a deck, with MuJoCo's rigid bodies and contacts.
//
// World frame: x, y level, z down (deck_motion.hpp). Body frame: x to the nose, y to the right, z
// down; its origin is the camera's optical centre, on the vehicle's axis.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "deck_motion.hpp"
#include "wind.hpp"

namespace harco::lab {

/// The vehicle. The defaults are a quadrotor of the paper's size (0.65 m from rotor to rotor).
struct VehicleOptions {
  double mass_kg = 3.2;
  double foot_m = 0.2;        ///< the feet reach so far below the camera
  double rotor_lag_s = 0.05;  ///< time constant of a rotor's thrust
  double most_thrust_over_weight = 2.0;
  double drag_kgps = 0.35;           ///< force by speed through the air
  double attitude_bandwidth = 10.0;  ///< of the attitude loop, rad/s
  double most_tilt_rad = 0.35;

  // What its autopilot knows.
  double attitude_bias_rad = 0.004;   ///< of roll and pitch, standard deviation: constant
  double attitude_noise_rad = 0.001;  ///< white, at every reading
  double height_drift_m = 0.05;       ///< of the barometric-inertial height, standard deviation
  double height_drift_s = 40.0;       ///< over which that error changes
  double thrust_error = 0.03;         ///< of the rotors' calibration, standard deviation
};

/// Where the vehicle is and how it moves.
struct VehicleState {
  Eigen::Isometry3d world_T_body = Eigen::Isometry3d::Identity();
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();   ///< world frame, m/s
  Eigen::Vector3d turn_rate = Eigen::Vector3d::Zero();  ///< body frame, rad/s

  /// A short time later, if it goes on as it does.
  Eigen::Isometry3d after(double dt_s) const;
};

/// What the autopilot's sensors tell. No position: that comes from images.
struct SensorReading {
  Eigen::Matrix3d level_R_body = Eigen::Matrix3d::Identity();  ///< with the attitude's error
  double height_m = 0.0;  ///< above its start, upwards, with the error of its drift
};

/// The first contact of the feet with the deck.
struct Contact {
  double time_s = 0.0;
  double sink_mps = 0.0;      ///< against the deck, along its normal, positive: into it
  double sideways_mps = 0.0;  ///< against the deck, in its plane
  Eigen::Vector2d place_m = Eigen::Vector2d::Zero();  ///< of the vehicle's axis, deck frame
  double roll_rad = 0.0, pitch_rad = 0.0;             ///< of the deck
  double heave_rate_mps = 0.0;                        ///< of the deck, upwards
  double tilt_rad = 0.0;                              ///< of the vehicle against the deck
};

class World {
 public:
  /// The vehicle hovers at `start` (its camera, world frame). Everything random follows from the
  /// seed.
  World(const VehicleOptions& vehicle, const DeckMotion& deck, const WindOptions& wind,
        const Eigen::Vector3d& start, std::uint64_t seed);
  ~World();
  World(World&&) noexcept;
  World& operator=(World&&) noexcept;

  /// What the attitude loop is to fly from now on: an acceleration in the level frame (z down,
  /// gravity not counted) and a heading.
  void command(const Eigen::Vector3d& acceleration_mps2, double yaw_rad);
  void stop_rotors();

  /// Moves on by some steps of 2 ms.
  void advance(int steps);
  static constexpr double kStep_s = 0.002;

  double time_s() const;
  VehicleState state() const;
  SensorReading sensors() const;
  Eigen::Isometry3d world_T_deck(double time_s) const;

  bool touching() const;                          ///< some foot touches the deck now
  const std::optional<Contact>& contact() const;  ///< the first one, once it was

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace harco::lab
