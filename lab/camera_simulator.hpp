// A camera, from the light before it to the bytes that its driver hands over: lens, shutter,
// sensor.
//
// What stands before it is a stage of flat things in a world frame of the caller's choice (metres).
// Where things move while the shutter is open, pictures are blurred and, with a rolling shutter,
// sheared as they really are: every edge is drawn at several instants of the exposure, each of its
// points at the time of its own row. Edges stay exact to the area that ink covers; what is
// approximate (backgrounds, soft shadows) never moves an edge.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "blobs.hpp"
#include "harco/camera.hpp"
#include "harco/image.hpp"
#include "photo.hpp"
#include "render.hpp"

namespace harco::lab {

/// A pose over time.
using Motion = std::function<Eigen::Isometry3d(double time_s)>;

/// One that stays.
Motion still(const Eigen::Isometry3d& pose = Eigen::Isometry3d::Identity());

// --- What stands before the camera
// ----------------------------------------------------------------

/// A sheet in the world.
struct StagedSheet {
  Sheet sheet{};
  Motion world_T_marker = still();
  double black = 25.0;        ///< grey level of ink where the light is 1
  double white = 220.0;       ///< grey level of paper
  std::vector<Blob> blobs{};  ///< things that lie on it, later ones on earlier ones
};

/// A plane with a photograph on it: ground, a wall, a deck, the sea. Its frame is the photograph's:
/// origin in the middle of it, x right, y down, z away from who looks at it.
struct Surface {
  std::shared_ptr<const Photo> photo;
  double metres_per_pixel = 0.01;  ///< size of the photograph's pixels; it repeats beyond its edges
  std::optional<Rect> extent;      ///< in its own frame; empty: it has no end
  Motion world_T_surface = still();
};

/// A shadow with a straight edge, over everything in it.
struct Shadow {
  /// Points of the world with towards . X > offset are in it.
  Eigen::Vector3d towards = Eigen::Vector3d::UnitX();  ///< of length 1
  double offset_m = 0.0;
  double penumbra_m = 0.01;  ///< width over which the light falls, metres
  double light = 0.4;        ///< what is left of it, 0 … 1
};

/// What stands before the camera; later things hide earlier ones.
struct Stage {
  double grey = 128.0;  ///< where there is nothing else

  /// A photograph that is far away all around: it doesn't change as the camera moves, only as it
  /// turns. It has so many pixels a radian.
  std::shared_ptr<const Photo> far;
  double far_pixels_per_radian = 700.0;

  std::vector<Surface> surfaces;
  std::vector<StagedSheet> sheets;

  /// Light is 1 + slope . X at a point X of the world, not below 0, times what shadows leave of it.
  Eigen::Vector3d light_slope_per_m = Eigen::Vector3d::Zero();
  std::vector<Shadow> shadows;
};

// --- The camera
// -----------------------------------------------------------------------------------

/// How much work a picture is worth.
enum class Quality {
  moderate,  ///< blur of edges within 1 % of their step: fast; corners within 0.01 px of exact
  exact      ///< within 0.2 %
};

/// What lens, shutter and sensor do. The defaults are a good small camera in daylight.
struct CameraEffects {
  // Lens. Distortion belongs to the Camera.
  double psf_sigma_px = 0.6;  ///< blur of lens and sensor as a Gaussian, pixels
  double defocus_px = 0.0;    ///< radius of the disc that a point out of focus becomes, pixels
  double vignetting = 0.0;    ///< share of light that the image's corners lack, 0 … 1

  // Shutter.
  double exposure_s = 0.0;  ///< how long every row is exposed: what moves meanwhile smears
  double readout_s = 0.0;   ///< from the first to the last row's exposure; 0: global shutter

  // Sensor.
  double gain = 1.0;         ///< multiplies light and the noise that is in it
  double black_level = 0.0;  ///< grey levels added to everything
  double gamma = 1.0;        ///< response: level ~ light^(1/gamma); 1 is linear
  double read_noise = 1.0;   ///< standard deviation at gain 1, grey levels
  /// Electrons that make a grey level at gain 1: the fewer, the more shot noise. Its variance is
  /// gain x level / electrons. 0: no shot noise.
  double electrons_per_level = 60.0;
  int bits = 8;  ///< of the converter, 1 … 8; levels are spread over 0 … 255

  Quality quality = Quality::moderate;
};

/// Throws std::invalid_argument, naming the field, for a value out of range.
void validate(const CameraEffects& effects);

/// A picture and what it shows.
struct Shot {
  Image image;
  double time_s = 0.0;  ///< the middle of the exposure of the image's middle row
  std::vector<Eigen::Isometry3d> camera_T_marker;  ///< of the stage's sheets at that time
};

class CameraSimulator {
 public:
  /// Throws std::invalid_argument for an impossible camera or effects.
  CameraSimulator(const Camera& camera, const CameraEffects& effects);

  /// The picture taken about `time_s`, which is the middle of the exposure of the middle row;
  /// `seed` is that of its noise.
  Shot shoot(const Stage& stage, const Motion& world_T_camera, double time_s,
             std::uint64_t seed) const;

  /// The light that reaches the sensor, in grey levels before gain, noise and rounding.
  FloatImage light(const Stage& stage, const Motion& world_T_camera, double time_s) const;

  /// What the sensor makes of that light.
  Image expose(FloatImage light, std::uint64_t seed) const;

  const Camera& camera() const { return camera_; }
  const CameraEffects& effects() const { return effects_; }

 private:
  Camera camera_;
  CameraEffects effects_;
  FieldOfView field_;
  FloatImage defocus_;             ///< kernel, empty if in focus
  std::vector<float> vignette_x_;  ///< share of light lost by column ...
  std::vector<float> vignette_y_;  ///< ... and by row: their sum
};

}  // namespace harco::lab
