// Pictures of markers as a camera would take them, exact to the area that ink covers in each pixel:
// the ground truth for tests, experiments and bounds.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "coverage.hpp"
#include "harco/camera.hpp"
#include "harco/geometry.hpp"
#include "harco/image.hpp"
#include "harco/marker.hpp"

namespace harco::lab {

/// What is printed: a marker, or anything else that rectangles can draw.
struct Sheet {
  InkPlan ink;
  Rect paper;  ///< white wherever no ink is; holds all the ink
};

/// A parent of the set on paper that reaches `quiet_zone_cells` of its layer-1 cells beyond its
/// square. Throws std::invalid_argument for an index that is not there.
Sheet sheet_of(const MarkerSet& markers, int parent_index, double quiet_zone_cells = 1.0);

/// One sheet before the camera.
struct PlacedParent {
  int parent_index = 0;  ///< index into MarkerSet::parents, or into a list of sheets
  Eigen::Isometry3d camera_T_marker = Eigen::Isometry3d::Identity();
};

/// What stands before the camera, and the camera.
struct Scene {
  Camera camera;                      ///< size, intrinsics, lens
  std::vector<PlacedParent> parents;  ///< a later one hides an earlier one; from behind none shows

  double quiet_zone_cells = 1.0;  ///< of the sheets of a MarkerSet, see sheet_of
  double black = 25.0;            ///< grey level of ink
  double white = 220.0;           ///< grey level of paper

  /// Light on each sheet: gain at its left (x = 0) and right (x = side) edge, linear between and
  /// beyond.
  double gain_left = 1.0;
  double gain_right = 1.0;

  std::optional<Image> background;  ///< of the camera's size, taken as it is (not blurred again)
  double grey = 128.0;              ///< the background where there is no picture

  double psf_sigma_px = 0.6;  ///< blur of lens and sensor beside the pixel's own square
  int oversampling = 4;       ///< see Psf
  double noise_sigma = 2.0;   ///< grey levels, Gaussian and independent
};

/// Grey levels without noise and without rounding; they may leave 0 … 255. Throws
/// std::invalid_argument for a scene that makes no sense.
FloatImage render_exact(const Scene& scene, const MarkerSet& markers);
FloatImage render_exact(const Scene& scene, const std::vector<Sheet>& sheets);

/// The same with noise, in whole grey levels 0 … 255. The same seed gives the same picture.
Image render(const Scene& scene, const MarkerSet& markers, std::uint64_t noise_seed);
Image render(const Scene& scene, const std::vector<Sheet>& sheets, std::uint64_t noise_seed);

/// The picture that a sensor takes: Gaussian noise, whole grey levels 0 ... 255.
Image expose(const FloatImage& exact, double noise_sigma, std::uint64_t noise_seed);

/// camera_T_marker of a camera whose optical axis meets the marker's plane at `marker_point_m`, at
/// `distance_m` along the axis. All angles zero is the frontal view, where the axes of camera and
/// marker agree. The marker is turned by `tilt_rad` about an axis in its plane, at
/// `tilt_axis_angle_rad` from its x axis towards y, then by `roll_rad` about the optical axis.
Eigen::Isometry3d look_at_marker(const Eigen::Vector2d& marker_point_m, double distance_m,
                                 double tilt_rad = 0.0, double tilt_axis_angle_rad = 0.0,
                                 double roll_rad = 0.0);

}  // namespace harco::lab
