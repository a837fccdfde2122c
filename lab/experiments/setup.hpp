// What the experiments share: the paper's camera and markers, seeds, errors, numbers as JSON.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "harco/camera.hpp"
#include "harco/detect.hpp"
#include "harco/image.hpp"
#include "harco/marker.hpp"
#include "harco/pose.hpp"
#include "lab/camera_simulator.hpp"
#include "lab/experiments/experiment.hpp"
#include "lab/render.hpp"

namespace harco::lab {

using Vector6d = Eigen::Matrix<double, 6, 1>;

constexpr double kDegree = 0.017453292519943295;

// --- The paper's hardware -----------------------------------------------------------------------

/// The paper names the camera, 750 x 480 pixels at 30 Hz, but not its lens. A side of 35 px at 32 m
/// (section 4.5) means 700 px of focal length, the transition area of section 4.1 means 1310.
constexpr double kFarFocal = 700.0;
constexpr double kNearFocal = 1310.0;
constexpr double kFrameRate = 30.0;
Camera paper_camera(double focal_px);

/// Exposed for 4 ms, with the blur and the noise of a small camera in daylight (CameraEffects).
CameraEffects paper_effects();

/// Sheets on a ground with patches and grains of all sizes, about as coarse as they are large. The
/// world's frame is the marker frame of the first sheet.
Stage stage_of(const Sheet& sheet);
Stage stage_of(const std::vector<Sheet>& sheets,
               const std::vector<Eigen::Isometry3d>& world_T_sheet);

/// A stage before the paper's camera, moving.
class Studio {
 public:
  explicit Studio(double focal_px) : camera_(paper_camera(focal_px), paper_effects()) {}
  const Camera& camera() const { return camera_.camera(); }

  /// The picture at `time_s`, the middle of its exposure; `seed` is that of its noise.
  Image shoot(const Stage& stage, const Motion& camera_T_world, double time_s,
              std::uint64_t seed) const;

 private:
  CameraSimulator camera_;
};

/// The transition area of sections 4.1 and 4.3, metres of height above a marker of 0.2 m.
constexpr double kTransitionLow = 0.5468;
constexpr double kTransitionHigh = 0.8784;

/// Markers with the paper's five children (quincunx), ids and codes always the same.
MarkerSet paper_markers(int layers, double side_m, int parents = 1);

// --- Poses --------------------------------------------------------------------------------------

/// What an estimate adds to the truth: translation in the camera frame, metres, then the rotation
/// vector of R_estimate R_truthᵀ in the camera frame, radians: about x (roll), y (pitch), z (yaw).
Vector6d pose_error(const Eigen::Isometry3d& estimate, const Eigen::Isometry3d& truth);

/// x, y, z and the angles roll, pitch, yaw of R = Rz(yaw) Ry(pitch) Rx(roll).
Vector6d coordinates(const Eigen::Isometry3d& pose);

/// The pose of parent 0, from detections of one frame; empty if there is none.
std::optional<Eigen::Isometry3d> pose_by(Fusion fusion, const Image& image,
                                         const std::vector<Detection>& detections,
                                         const MarkerSet& markers, const Camera& camera);

/// Whether a pose is nearer than 5 % of the distance and 5 degrees: a pose of this marker at all.
bool is_right(const Eigen::Isometry3d& estimate, const Eigen::Isometry3d& truth);

/// Bit i - 1 is set if a marker of layer i is among the detections; inferred ones don't count.
int layers_seen(const std::vector<Detection>& detections);

/// Root mean square of what was added; NaN if nothing was.
class RootMeanSquare {
 public:
  void add(double value) {
    sum_ += value * value;
    ++count_;
  }
  int count() const { return count_; }
  double value() const;

 private:
  double sum_ = 0.0;
  int count_ = 0;
};

// --- Numbers ------------------------------------------------------------------------------------

/// Random numbers of one item.
std::mt19937_64 generator(const std::string& experiment, int item);

/// Evenly between low and high.
double uniform(std::mt19937_64& random, double low, double high);

/// A smooth random function of time, between -1 and 1 nearly always: five sines with frequencies
/// between the two, in Hz.
class Wander {
 public:
  Wander(std::mt19937_64& random, double low_hz, double high_hz);
  double operator()(double time_s) const;

 private:
  struct Sine {
    double amplitude, rate, phase;
  };
  std::array<Sine, 5> sines_{};
};

/// Numbers with five digits; null for what is not finite. And back, null as NaN.
Json to_json(const std::vector<double>& values);
std::vector<double> numbers(const Json& json);

/// With so many digits that count; "-" for NaN.
std::string text(double value, int digits = 3);
/// "98.3 %" of a count; "-" if there is nothing to count.
std::string percent(int count, int of);

}  // namespace harco::lab
