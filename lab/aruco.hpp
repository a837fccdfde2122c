// The paper's baseline: ArUco markers and boards, read by OpenCV at its best documented settings,
// in our conventions.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "harco/camera.hpp"
#include "harco/image.hpp"
#include "lab/render.hpp"

namespace harco::lab {

/// One marker of OpenCV's DICT_4X4_50, `side_m` from edge to edge of its black square. Origin and
/// axes of the marker frame as everywhere.
Sheet aruco_sheet(double side_m, int id = 0);

/// 24 markers of DICT_4X4_50 in a square of `side_m`: five by five without the middle one, a
/// quarter of a marker's side apart. (A regular grid of 6 x 4 would leave a third of the square
/// empty and its markers smaller.)
Sheet aruco_board_sheet(double side_m);

/// A marker of the dictionary and its pose.
struct ArucoPose {
  int id = 0;
  Eigen::Isometry3d camera_T_marker = Eigen::Isometry3d::Identity();
};

/// All markers of the dictionary in the image: OpenCV's detector with its corners refined to
/// sub-pixels, in a window that keeps within the border's cells as OpenCV 4.7 and later choose it;
/// then IPPE_SQUARE, the solution of the lesser error, and Levenberg-Marquardt on the four corners.
/// `side_px` is the markers' side in the image, about.
std::vector<ArucoPose> aruco_poses(const Image& image, const Camera& camera, double side_m,
                                   double side_px);

/// The pose of marker 0; empty if it isn't found.
std::optional<Eigen::Isometry3d> aruco_pose(const Image& image, const Camera& camera, double side_m,
                                            double side_px);

/// The last steps of it, from corners in pixels: top-left, top-right, bottom-right, bottom-left.
Eigen::Isometry3d pose_of_square(const std::array<Eigen::Vector2d, 4>& corners,
                                 const Camera& camera, double side_m);

/// How OpenCV refines corners: by cornerSubPix, or as AprilTag does by lines fitted to the edges,
/// of which the half pixel that OpenCV 4.6 leaves in is taken off.
enum class Refinement { sub_pixel, edges };

/// Both poses of the board from one detection, which looks a second time for markers that the
/// board's first ones promise (refineDetectedMarkers).
struct BoardPoses {
  std::optional<Eigen::Isometry3d>
      averaged;  ///< mean of the single markers' poses made as aruco_poses does
  std::optional<Eigen::Isometry3d> joint;  ///< estimatePoseBoard: one solution for all corners
};
BoardPoses aruco_board_poses(const Image& image, const Camera& camera, double side_m,
                             double side_px, Refinement refinement);

}  // namespace harco::lab
