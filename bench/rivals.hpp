// Poses of other people's markers, each at its best documented settings, in our conventions.
#pragma once

#include <optional>

#include <Eigen/Geometry>

#include "harco/camera.hpp"
#include "harco/image.hpp"
#include "lab/render.hpp"

namespace harco::bench {

/// One marker of OpenCV's DICT_4X4_50, `side_m` from edge to edge of its black square. Origin and
/// axes of the marker frame as everywhere.
lab::Sheet aruco_sheet(double side_m);

/// One marker of AprilTag's family 36h11; `side_m` as above.
lab::Sheet apriltag_sheet(double side_m);

/// 24 markers of DICT_4X4_50 in a square of `side_m`: five by five without the middle one, a
/// quarter of a marker's side apart. (A regular grid of 6 x 4 would leave a third of the square
/// empty and its markers smaller.)
lab::Sheet board_sheet(double side_m);

/// OpenCV's detector with its corners refined to sub-pixels, in a window that keeps within the
/// border's cells as OpenCV 4.7 and later choose it; then IPPE_SQUARE, the solution of the lesser
/// error, and Levenberg-Marquardt on the four corners. `side_px` is the marker's side in the image.
/// Empty if the marker isn't found.
std::optional<Eigen::Isometry3d> aruco_pose(const Image& image, const Camera& camera, double side_m,
                                            double side_px);

/// libapriltag on the full resolution with its edges refined, its half-pixel convention corrected;
/// then the pose from its corners as above.
std::optional<Eigen::Isometry3d> apriltag_pose(const Image& image, const Camera& camera,
                                               double side_m);

/// How OpenCV refines corners: by cornerSubPix, or as AprilTag does by lines fitted to the edges,
/// of which the half pixel that OpenCV 4.6 leaves in is taken off.
enum class Refinement { sub_pixel, edges };

/// Both poses of the board from one detection, which looks a second time for markers that the
/// board's first ones promise (refineDetectedMarkers).
struct BoardPoses {
  std::optional<Eigen::Isometry3d>
      averaged;  ///< mean of the single markers' poses made as aruco_pose's
  std::optional<Eigen::Isometry3d> joint;  ///< estimatePoseBoard: one solution for all corners
};
BoardPoses board_poses(const Image& image, const Camera& camera, double side_m, double side_px,
                       Refinement refinement);

}  // namespace harco::bench
