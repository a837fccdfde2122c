#include "world.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <mutex>
#include <random>
#include <stdexcept>
#include <string>

#include <fmt/format.h>
#include <mujoco/mujoco.h>

namespace harco::lab {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kGravity = 9.81;
constexpr double kDeckMass = 1e6;  // contacts don't move it
constexpr double kArm_m = 0.23;    // of a rotor along x and along y
constexpr double kYawByThrust_m = 0.016;
const Vector3d kInertia(0.045, 0.045, 0.075);

struct DeleteModel {
  void operator()(mjModel* model) const { mj_deleteModel(model); }
};
struct DeleteData {
  void operator()(mjData* data) const { mj_deleteData(data); }
};
using Model = std::unique_ptr<mjModel, DeleteModel>;
using Data = std::unique_ptr<mjData, DeleteData>;

/// Joints in this order: the deck's heave, pitch and roll, then the vehicle's seven coordinates.
std::string description(const VehicleOptions& vehicle) {
  return fmt::format(R"(<mujoco>
  <option timestep="{}" gravity="0 0 {}" cone="elliptic"/>
  <worldbody>
    <body name="deck">
      <joint type="slide" axis="0 0 -1"/>
      <joint type="hinge" axis="0 1 0"/>
      <joint type="hinge" axis="1 0 0"/>
      <inertial pos="0 0 0" mass="{}" diaginertia="{} {} {}"/>
      <geom type="box" size="4 4 0.5" pos="0 0 0.5" friction="0.9 0.01 0.001" solref="0.01 1"/>
    </body>
    <body name="vehicle">
      <freejoint/>
      <inertial pos="0 0 0" mass="{}" diaginertia="{} {} {}"/>
      <geom type="box" size="0.1 0.1 0.03" contype="1"/>
      <geom type="sphere" size="0.02" pos=" 0.2  0.2 {}" solref="0.015 1"/>
      <geom type="sphere" size="0.02" pos=" 0.2 -0.2 {}" solref="0.015 1"/>
      <geom type="sphere" size="0.02" pos="-0.2  0.2 {}" solref="0.015 1"/>
      <geom type="sphere" size="0.02" pos="-0.2 -0.2 {}" solref="0.015 1"/>
    </body>
  </worldbody>
</mujoco>)",
                     World::kStep_s, kGravity, kDeckMass, kDeckMass, kDeckMass, kDeckMass,
                     vehicle.mass_kg, kInertia.x(), kInertia.y(), kInertia.z(),
                     vehicle.foot_m - 0.02, vehicle.foot_m - 0.02, vehicle.foot_m - 0.02,
                     vehicle.foot_m - 0.02);
}

Model compiled(const std::string& xml) {
  static std::mutex compiling;  // MuJoCo's compiler isn't made for several threads
  const std::lock_guard lock(compiling);
  mju_user_warning = [](const char*) {};  // else it writes a file
  auto files = std::make_unique<mjVFS>();
  mj_defaultVFS(files.get());
  const int index = mj_makeEmptyFileVFS(files.get(), "world.xml", static_cast<int>(xml.size()));
  std::memcpy(files->filedata[index], xml.data(), xml.size());
  std::array<char, 500> error{};
  Model model(mj_loadXML("world.xml", files.get(), error.data(), error.size()));
  mj_deleteFileVFS(files.get(), "world.xml");
  if (!model) throw std::logic_error(std::string("MuJoCo: ") + error.data());
  return model;
}

/// A deck's axis at a time.
struct Course {
  double value, rate, acceleration;
};

/// A sum of many sinusoids at every step of a simulation: computed at knots, by their values and
/// rates between them (cubic Hermite), off by less than a part in a million.
class DeckCourse {
 public:
  Course at(const Oscillation& oscillation, double time_s) {
    const double number = std::floor(time_s / kApart_s);
    if (number != number_) {
      number_ = number;
      for (std::size_t i = 0; i < 2; ++i) {
        value_[i] = oscillation.value((number + static_cast<double>(i)) * kApart_s);
        slope_[i] = oscillation.rate((number + static_cast<double>(i)) * kApart_s) * kApart_s;
      }
    }
    const double t = time_s / kApart_s - number;
    const double rise = value_[1] - value_[0];
    const double b = 3.0 * rise - 2.0 * slope_[0] - slope_[1];
    const double c = slope_[0] + slope_[1] - 2.0 * rise;
    return {value_[0] + t * (slope_[0] + t * (b + t * c)),
            (slope_[0] + t * (2.0 * b + t * 3.0 * c)) / kApart_s,
            (2.0 * b + 6.0 * c * t) / (kApart_s * kApart_s)};
  }

 private:
  static constexpr double kApart_s = 0.04;
  double number_ = -1e9;
  std::array<double, 2> value_{}, slope_{};
};

/// Of a rotation, as a vector.
Vector3d turn_of(const Matrix3d& rotation) {
  const Eigen::AngleAxisd turn(rotation);
  return turn.angle() * turn.axis();
}

Matrix3d rotated_by(const Vector3d& turn) {
  const double angle = turn.norm();
  if (angle < 1e-12) return Matrix3d::Identity();
  return Eigen::AngleAxisd(angle, turn / angle).toRotationMatrix();
}

}  // namespace

Eigen::Isometry3d VehicleState::after(double dt_s) const {
  Eigen::Isometry3d later = world_T_body;
  later.translation() += velocity * dt_s;
  later.linear() = world_T_body.linear() * rotated_by(turn_rate * dt_s);
  return later;
}

struct World::Impl {
  Impl(const VehicleOptions& v, const DeckMotion& d, const WindOptions& w, const Vector3d& start,
       std::uint64_t seed)
      : vehicle(v),
        deck(d),
        wind(w, seed ^ 0x57494E44U),
        random(seed),
        model(compiled(description(v))),
        data(mj_makeData(model.get())) {
    weight = vehicle.mass_kg * kGravity;
    thrusts.fill(weight / 4.0);
    attitude_bias = vehicle.attitude_bias_rad * Vector3d(draw(), draw(), 0.0);
    thrust_gain = 1.0 + vehicle.thrust_error * draw();
    height_drift = drift_goal = vehicle.height_drift_m * draw();
    start_height_m = -start.z();
    for (int i = 0; i < 3; ++i) data->qpos[3 + i] = start[i];
    data->qpos[6] = 1.0;
    place_deck();
    mj_forward(model.get(), data.get());
    air = wind.step(0.0);
  }

  double draw() { return normal(random); }

  void place_deck() {
    const std::array<DeckAxis, 3> order{kHeave, kPitch, kRoll};
    for (int i = 0; i < 3; ++i) {
      const DeckAxis axis = order[static_cast<std::size_t>(i)];
      const Course now = courses[axis].at(deck.axes[axis], data->time);
      data->qpos[i] = now.value;
      data->qvel[i] = now.rate;
      // What holds the deck up against gravity and moves it.
      data->qfrc_applied[i] = axis == kHeave ? kDeckMass * (kGravity + now.acceleration) : 0.0;
    }
  }

  Matrix3d rotation() const {
    const mjtNum* q = data->qpos + 6;
    return Eigen::Quaterniond(q[0], q[1], q[2], q[3]).toRotationMatrix();
  }

  VehicleState state() const {
    VehicleState now;
    now.world_T_body.translation() = Vector3d(data->qpos[3], data->qpos[4], data->qpos[5]);
    now.world_T_body.linear() = rotation();
    now.velocity = Vector3d(data->qvel[3], data->qvel[4], data->qvel[5]);
    now.turn_rate = Vector3d(data->qvel[6], data->qvel[7], data->qvel[8]);
    return now;
  }

  /// Thrust and torques to have, shared among the rotors, with their lag.
  void drive_rotors(double thrust, const Vector3d& torque) {
    // Front right, back left (one way round), front left, back right (the other).
    constexpr std::array<std::array<double, 3>, 4> kSigns{
        {{-1.0, 1.0, 1.0}, {1.0, -1.0, 1.0}, {1.0, 1.0, -1.0}, {-1.0, -1.0, -1.0}}};
    const double most = vehicle.most_thrust_over_weight * weight / 4.0;
    const double keep = std::exp(-kStep_s / vehicle.rotor_lag_s);
    for (std::size_t i = 0; i < 4; ++i) {
      const double share =
          0.25 * (thrust + kSigns[i][0] * torque.x() / kArm_m + kSigns[i][1] * torque.y() / kArm_m +
                  kSigns[i][2] * torque.z() / kYawByThrust_m);
      thrusts[i] = keep * thrusts[i] + (1.0 - keep) * std::clamp(share, 0.0, most);
    }
    total = 0.0;
    moment.setZero();
    for (std::size_t i = 0; i < 4; ++i) {
      total += thrusts[i];
      moment += thrusts[i] * Vector3d(kSigns[i][0] * kArm_m, kSigns[i][1] * kArm_m,
                                      kSigns[i][2] * kYawByThrust_m);
    }
    total *= thrust_gain;
  }

  void fly() {
    const VehicleState now = state();
    const Matrix3d seen = now.world_T_body.linear() * rotated_by(attitude_bias);
    // The body's z axis points against the thrust that is wanted.
    const Vector3d asked = wanted - kGravity * Vector3d::UnitZ();
    Vector3d force = vehicle.mass_kg * (asked + trim * Vector3d::UnitZ());
    const double level = force.head<2>().norm();
    const double most = std::tan(vehicle.most_tilt_rad) * std::max(1.0, -force.z());
    if (level > most) force.head<2>() *= most / level;
    const Vector3d down = -force.normalized();
    const Vector3d nose(std::cos(yaw), std::sin(yaw), 0.0);
    const Vector3d right = down.cross(nose).normalized();
    Matrix3d goal;
    goal << right.cross(down), right, down;
    const Vector3d off = turn_of(seen.transpose() * goal);
    const double b = vehicle.attitude_bandwidth;
    const Vector3d torque = kInertia.cwiseProduct(Vector3d(b * b * off - 1.6 * b * now.turn_rate));
    drive_rotors(std::max(0.0, force.norm()), torque);

    // The accelerometer tells what the rotors really do along z: so the trim learns their error.
    constexpr double kTrimRate = 0.7;  // 1/s
    trim += kStep_s * kTrimRate * (total / vehicle.mass_kg - asked.norm());
    trim = std::clamp(trim, -2.0, 2.0);
  }

  void step() {
    place_deck();
    if (running)
      fly();
    else
      drive_rotors(0.0, Vector3d::Zero());
    air = wind.step(kStep_s);
    const VehicleState now = state();
    const Matrix3d& r = now.world_T_body.linear();
    const Vector3d force = -total * r.col(2) - vehicle.drag_kgps * (now.velocity - air);
    const Vector3d torque = r * moment;
    const int body = 2;
    for (int i = 0; i < 3; ++i) {
      data->xfrc_applied[6 * body + i] = force[i];
      data->xfrc_applied[6 * body + 3 + i] = torque[i];
    }
    mj_step(model.get(), data.get());
    const double keep = std::exp(-kStep_s / vehicle.height_drift_s);
    height_drift =
        keep * height_drift + std::sqrt(1.0 - keep * keep) * vehicle.height_drift_m * draw();
    if (!contact && touching()) contact = contact_now(now);
  }

  bool touching() const { return data->ncon > 0; }

  /// `before`: as it came, before the contact slowed it.
  Contact contact_now(const VehicleState& before) const {
    const double t = data->time;
    const Eigen::Isometry3d world_T_deck = deck.world_T_deck(t);
    const Eigen::Isometry3d deck_T_world = world_T_deck.inverse();
    constexpr double kShort_s = 1e-3;
    const Vector3d place = deck_T_world * before.world_T_body.translation();
    const Vector3d later = deck.world_T_deck(t + kShort_s).inverse() *
                           (before.world_T_body.translation() + kShort_s * before.velocity);
    const Vector3d speed = (later - place) / kShort_s;
    Contact made;
    made.time_s = t;
    made.sink_mps = speed.z();
    made.sideways_mps = speed.head<2>().norm();
    made.place_m = place.head<2>();
    made.roll_rad = deck.value(kRoll, t);
    made.pitch_rad = deck.value(kPitch, t);
    made.heave_rate_mps = deck.rate(kHeave, t);
    made.tilt_rad = std::acos(
        std::clamp((deck_T_world.linear() * before.world_T_body.linear())(2, 2), -1.0, 1.0));
    return made;
  }

  VehicleOptions vehicle;
  DeckMotion deck;
  std::array<DeckCourse, 3> courses{};
  Wind wind;
  std::mt19937_64 random;
  std::normal_distribution<double> normal;
  Model model;
  Data data;
  double weight = 0.0;
  std::array<double, 4> thrusts{};
  double total = 0.0;
  Vector3d moment = Vector3d::Zero();
  Vector3d air = Vector3d::Zero();
  Vector3d attitude_bias = Vector3d::Zero();
  double thrust_gain = 1.0;
  double height_drift = 0.0;
  double drift_goal = 0.0;  ///< which it follows, since accelerometers smooth it
  double start_height_m = 0.0;
  double trim = 0.0;
  Vector3d wanted = Vector3d::Zero();
  double yaw = 0.0;
  bool running = true;
  std::optional<Contact> contact;
};

World::World(const VehicleOptions& vehicle, const DeckMotion& deck, const WindOptions& wind,
             const Vector3d& start, std::uint64_t seed)
    : impl_(std::make_unique<Impl>(vehicle, deck, wind, start, seed)) {}
World::~World() = default;
World::World(World&&) noexcept = default;
World& World::operator=(World&&) noexcept = default;

void World::command(const Vector3d& acceleration_mps2, double yaw_rad) {
  impl_->wanted = acceleration_mps2;
  impl_->yaw = yaw_rad;
}
void World::stop_rotors() { impl_->running = false; }
void World::advance(int steps) {
  for (int i = 0; i < steps; ++i) impl_->step();
}
double World::time_s() const { return impl_->data->time; }
VehicleState World::state() const { return impl_->state(); }
Eigen::Isometry3d World::world_T_deck(double time_s) const {
  return impl_->deck.world_T_deck(time_s);
}
bool World::touching() const { return impl_->touching(); }
const std::optional<Contact>& World::contact() const { return impl_->contact; }

SensorReading World::sensors() const {
  Impl& impl = *impl_;
  SensorReading reading;
  const VehicleState now = impl.state();
  const Vector3d noise =
      impl.vehicle.attitude_noise_rad * Vector3d(impl.draw(), impl.draw(), impl.draw());
  reading.level_R_body = now.world_T_body.linear() * rotated_by(impl.attitude_bias + noise);
  reading.height_m = -now.world_T_body.translation().z() - impl.start_height_m + impl.height_drift;
  return reading;
}

}  // namespace harco::lab
