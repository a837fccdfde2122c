// What a camera is calibrated with, found in pictures.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "calibration.hpp"
#include "calibration_board.hpp"
#include "harco/camera.hpp"
#include "harco/image.hpp"
#include "harco/marker.hpp"

namespace harco::cli {

/// What to look for: a board, or markers of a set.
struct CalibrationTarget {
  std::optional<Board> board;
  double square_m = 0.0;  ///< side of one of its squares
  MarkerSet markers;      ///< without a board
};

/// Looks for one kind of target. Use one a thread.
class TargetFinder {
 public:
  virtual ~TargetFinder() = default;
  /// What one picture shows of the target, one entry for each of several parents. `picture` is left
  /// zero.
  virtual std::vector<TargetView> find(const ImageView& image) = 0;
};

/// `camera`, if it is known well enough, lets edges be fitted where they are straight.
std::unique_ptr<TargetFinder> target_finder(const CalibrationTarget& target,
                                            const std::optional<Camera>& camera);

/// Whether knowing the camera helps to find the target more exactly.
bool gains_by_camera(const CalibrationTarget& target);

}  // namespace harco::cli
