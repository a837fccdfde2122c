// Camera calibration: the camera that explains best where the points of a flat target were seen.
//
// Every picture of the target is a view with a pose of its own. The camera and all poses are fitted
// at once, each measurement weighted by its covariance; measurements and views that don't fit are
// left out, and looked at again as the fit gets better.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "harco/camera.hpp"

namespace harco::cli {

/// What is measured at once: one corner of a board, or the four corners of a marker.
struct Feature {
  std::vector<Eigen::Vector2d> target_m;  ///< on the target's plane
  std::vector<Eigen::Vector2d> image_px;  ///< where they were seen, in the same order
  Eigen::MatrixXd covariance_px2;  ///< of the image's coordinates, x and y in turn; zero if unknown
};

/// One target in one picture.
struct TargetView {
  std::size_t picture = 0;  ///< index into the pictures
  std::vector<Feature> features;
};

enum class CalibrationModel {
  pinhole,   ///< k1 k2 p1 p2 k3 of Brown and Conrady
  rational,  ///< k1 … k6 and p1 p2
  fisheye    ///< k1 … k4 of Kannala and Brandt
};

/// fx, fy, cx, cy and the model's coefficients: how many, their names, their values.
int parameter_count(CalibrationModel model);
std::vector<std::string> parameter_names(CalibrationModel model);
Eigen::VectorXd parameters_of(const Camera& camera, CalibrationModel model);

/// Pixel of a point in the camera's frame with its derivatives. False for points that the camera
/// can't image.
struct ProjectedPoint {
  Eigen::Vector2d pixel;
  Eigen::Matrix<double, 2, 3> by_point;
  Eigen::Matrix<double, 2, Eigen::Dynamic> by_parameters;
};
bool project(const Camera& camera, CalibrationModel model, const Eigen::Vector3d& point,
             ProjectedPoint& projected);

/// What became of a view.
struct FittedView {
  bool used = false;
  Eigen::Isometry3d camera_T_target = Eigen::Isometry3d::Identity();
  std::vector<bool> kept;  ///< by feature, whether it took part
  double rms_px = 0.0;     ///< of the distances of its kept points to where the camera sees them
};

struct Calibration {
  Camera camera;
  Eigen::MatrixXd covariance;  ///< of the parameters, in the order of parameter_names
  std::vector<FittedView> views;

  /// Standard deviation of a coordinate that the measurements' own covariance doesn't explain: what
  /// lens model, paper and print leave.
  double noise_px = 0.0;
  double rms_px = 0.0;           ///< over all kept points, as OpenCV counts it
  double held_out_rms_px = 0.0;  ///< the same for views that the camera was fitted without
};

/// Fits camera and poses, from `start` on, whose size, model and rough focal length have to be
/// right. Throws Error if fewer than three views can be used or the views don't determine the
/// camera at all.
Calibration calibrate(const std::vector<TargetView>& views, CalibrationModel model,
                      const Camera& start);

}  // namespace harco::cli
