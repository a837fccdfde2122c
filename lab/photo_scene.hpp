// Markers laid into photographs of a chessboard: a real lens, real light, real surroundings, and a
// pose that is known from the board's own corners.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "harco/camera.hpp"
#include "harco/image.hpp"
#include "harco/marker.hpp"

namespace harco::lab {

/// Counted in inner corners, where four squares meet. Its frame: origin at the first corner, x
/// along its rows, y along its columns, z into the board.
struct Chessboard {
  int columns = 9;
  int rows = 6;
  double square_m = 0.025;
};

struct ChessboardPhoto {
  std::string name;  ///< of the file, without folder and ending
  Image image;
  std::vector<Eigen::Vector2d> corners;  ///< in pixels, row by row
  Eigen::Isometry3d camera_T_board = Eigen::Isometry3d::Identity();
};

/// Photographs taken with one camera, and what they tell about it.
struct PhotoSeries {
  Chessboard board;
  Camera camera;
  double rms_px = 0.0;  ///< of the corners' distances to where the calibration puts them
  std::vector<ChessboardPhoto> photos;
};

/// Calibrates the camera and finds each photograph's pose from the board's corners. Photographs in
/// which the whole board can't be found are left out. Throws Error for a file that is no picture,
/// for pictures of different size, and if fewer than three show the board.
PhotoSeries calibrate(const std::vector<std::filesystem::path>& files,
                      const Chessboard& board = {});

/// A quantity that varies smoothly over the board: a polynomial of second degree in x and y, in
/// squares, from the board's middle.
struct SmoothField {
  Eigen::Matrix<double, 6, 1> coefficients = Eigen::Matrix<double, 6, 1>::Zero();
  double at(const Eigen::Vector2d& squares) const;
};

/// What a photograph tells about light, lens and sensor.
struct BoardLook {
  SmoothField white, black;   ///< grey levels of the board's white and black
  double psf_sigma_px = 0.0;  ///< blur of its edges beside the pixel's own square
  double noise_sigma = 0.0;   ///< grey levels, within its squares
};
BoardLook measure_look(const ChessboardPhoto& photo, const Camera& camera, const Chessboard& board);

/// A photograph in which a marker covers the board.
struct StagedPhoto {
  Image image;
  MarkerSet markers;  ///< the set with the parent's side as it is in the picture
  Eigen::Isometry3d camera_T_marker = Eigen::Isometry3d::Identity();
};

/// Lays white paper over the board's squares and a parent onto it, with the light, blur and noise
/// of the photograph. Of the parent's layer `layer`, the marker nearest to its middle comes to lie
/// in the middle of the paper, as large as paper and quiet zone allow: with 1 the whole parent
/// shows, with more what a camera sees that came nearer. What lies beyond the paper is cut off. The
/// same seed gives the same picture. Throws std::invalid_argument if there is no such parent or
/// layer.
StagedPhoto lay_marker(const ChessboardPhoto& photo, const Camera& camera, const Chessboard& board,
                       const MarkerSet& markers, int parent_index, int layer,
                       std::uint64_t noise_seed);

/// How far an estimated pose is off.
struct PoseError {
  double distance_percent = 0.0;  ///< |t - t_true| / |t_true|
  double rotation_deg = 0.0;
};
PoseError pose_error(const Eigen::Isometry3d& estimate, const Eigen::Isometry3d& truth);

/// The photographs of Debian's package opencv-doc. Each throws Error, naming the package, if they
/// aren't there.
std::vector<std::filesystem::path> opencv_chessboard_photos(
    const std::string& camera);             ///< "left" or "right"
std::filesystem::path opencv_desk_photo();  ///< six markers of ArUco's DICT_6X6_250 on a sheet

/// A picture file in grey. Throws Error.
Image load_grey(const std::filesystem::path& file);

}  // namespace harco::lab
