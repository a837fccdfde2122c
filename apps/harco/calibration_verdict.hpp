// What a calibration is worth, in words.
#pragma once

#include <string>
#include <vector>

#include "calibration.hpp"

namespace harco::cli {

/// Where in the image points of the target were seen: counts in nearly square cells, row by row.
struct ImageCoverage {
  static constexpr int kUnseen = -1;  ///< count of a cell that the lens can't see, as a fisheye's
                                      ///< corners

  int columns = 0, rows = 0;
  std::vector<int> points;

  double share() const;  ///< of the cells that have points
  /// Names of the image's regions (a corner, an edge, the middle) with points in less than half of
  /// their cells.
  std::vector<std::string> missing() const;
};
ImageCoverage coverage_of(const std::vector<Eigen::Vector2d>& points, const Camera& camera);

/// All points that took part.
std::vector<Eigen::Vector2d> kept_points(const std::vector<TargetView>& views,
                                         const Calibration& calibration);

/// How much the camera's directions may be off, in pixels (one standard deviation of the distance),
/// besides a rotation of all of them, which nobody can tell from the camera's mount.
struct DirectionUncertainty {
  double middle_px = 0.0;  ///< in the image's middle
  double worst_px = 0.0;   ///< where it is greatest, mostly in a corner
  bool everywhere = true;  ///< whether the lens's formula holds in all of the image
};
DirectionUncertainty direction_uncertainty(const Calibration& calibration, CalibrationModel model);

/// How differently the target was tilted.
struct TiltDiversity {
  double widest_deg = 0.0;  ///< largest angle between the target's normals in two pictures
  int tilted = 0;           ///< pictures whose normal is kTilted from the mean of all
};
inline constexpr double kTilted_deg = 12.0;
TiltDiversity tilt_diversity(const Calibration& calibration);

enum class Grade { good, usable, bad };
const char* to_string(Grade grade);

struct Verdict {
  Grade grade = Grade::good;
  std::vector<std::string> reasons;  ///< the worst first; what to do about it in the same sentence
};

/// All that is judged.
struct Evidence {
  int width = 0, height = 0;  ///< pixels
  std::size_t views = 0;      ///< that took part
  std::size_t dropped = 0;    ///< that show the target and don't agree with the others
  double noise_px = 0.0, rms_px = 0.0, held_out_rms_px = 0.0;
  double focal_px = 0.0, focal_sigma_px = 0.0;
  ImageCoverage coverage;
  DirectionUncertainty direction;
  TiltDiversity tilt;
};
Evidence evidence_of(const std::vector<TargetView>& views, const Calibration& calibration,
                     CalibrationModel model);
Verdict judge(const Evidence& evidence);

}  // namespace harco::cli
