// Boards that others calibrate with: chessboards and ChArUco boards. OpenCV finds them.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "calibration.hpp"
#include "harco/image.hpp"
#include "opencv_module.hpp"

namespace harco::cli {

struct Board {
  enum class Kind { chessboard, charuco };
  Kind kind = Kind::chessboard;

  /// A chessboard is counted in inner corners, where four squares meet; a ChArUco board in squares.
  int columns = 0, rows = 0;
  std::string dictionary;      ///< of a ChArUco board: aruco:4x4_50 …
  double marker_share = 0.75;  ///< side of its markers in squares
};

/// `chessboard:9x6`, or `charuco:7x5:4x4_50` with the name of its ArUco dictionary. Throws Error.
Board parse_board(const std::string& text);

/// An inner corner of a board: its place in squares from the first inner corner (chessboard) or
/// from the board's top-left corner (ChArUco), x right, y down, and where it is seen.
struct BoardCorner {
  Eigen::Vector2d squares, pixel;
};

/// The corners that are seen; empty if the board isn't. Thread-safe.
std::vector<BoardCorner> find_board(const Board& board, const ImageView& image);

/// A camera from which calibrate() can start: OpenCV's calibration from all points alike.
/// Throws Error.
Camera rough_calibration(const std::vector<TargetView>& views, CalibrationModel model, int width,
                         int height);

// The module's part, which does all the work: see opencv_module.hpp.
HARCO_OPENCV_EXPORT void harco_check_board(const Board& board);
HARCO_OPENCV_EXPORT void harco_find_board(const Board& board, const ImageView& image,
                                          std::vector<BoardCorner>& corners);
HARCO_OPENCV_EXPORT void harco_rough_calibration(const std::vector<TargetView>& views,
                                                 CalibrationModel model, int width, int height,
                                                 Camera& camera);

}  // namespace harco::cli
