// Camera models: pinhole with Brown-Conrady distortion or the equidistant fisheye, and their files.
//
// Camera frame: x right, y down, z forward. A point (X, Y, Z) has the normalised image coordinates
// (X/Z, Y/Z); distortion maps these to the distorted ones; K maps those to pixels, with (0, 0) the
// centre of the top-left pixel.
#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace harco {

enum class LensModel {
  brown_conrady,  ///< k1 k2 p1 p2 [k3 [k4 k5 k6]], OpenCV's order; all zero is an ideal pinhole
  equidistant     ///< k1 k2 k3 k4 of Kannala-Brandt, OpenCV's fisheye; rays up to 90 degrees
};

struct Camera {
  int width = 0;                                  ///< pixels
  int height = 0;                                 ///< pixels
  double fx = 0.0, fy = 0.0, cx = 0.0, cy = 0.0;  ///< pixels
  LensModel lens = LensModel::brown_conrady;
  std::array<double, 8> coefficients{};  ///< in the order of the lens model; the rest zero

  /// Ideal pinhole with the principal point in the image's middle.
  static Camera pinhole(int width, int height, double focal_px);

  bool has_distortion() const;
  Eigen::Matrix3d matrix() const;

  /// Normalised -> distorted normalised, with the 2 x 2 Jacobian if asked for. The bare formula: it
  /// answers beyond the lens's monotonic range as well, where it means nothing.
  Eigen::Vector2d distort(const Eigen::Vector2d& normalised,
                          Eigen::Matrix2d* jacobian = nullptr) const;

  /// Whether the model can be trusted at a normalised point: from the centre out to there, a ray
  /// farther out is seen farther out (the lens's monotonic range).
  bool in_range(const Eigen::Vector2d& normalised) const;

  /// The inverse of distort, by Newton's method with the analytic Jacobian. Empty where the model
  /// can't be inverted: nothing in the lens's monotonic range is seen there.
  std::optional<Eigen::Vector2d> undistort(const Eigen::Vector2d& distorted,
                                           Eigen::Matrix2d* jacobian = nullptr) const;

  /// Pixel of a point in the camera frame, with d(pixel)/d(point) if asked for. Empty for points
  /// that the model can't image: behind the camera, or beyond the lens's monotonic range.
  std::optional<Eigen::Vector2d> project(const Eigen::Vector3d& point,
                                         Eigen::Matrix<double, 2, 3>* jacobian = nullptr) const;

  /// Normalised coordinates (X/Z, Y/Z) of the ray through a pixel, with d(normalised)/d(pixel) if
  /// asked for.
  std::optional<Eigen::Vector2d> unproject(const Eigen::Vector2d& pixel,
                                           Eigen::Matrix2d* jacobian = nullptr) const;

  /// Pixel that an ideal pinhole with the same fx, fy, cx, cy would see, and back. Straight lines
  /// of the world are straight there.
  std::optional<Eigen::Vector2d> to_ideal(const Eigen::Vector2d& pixel) const;
  std::optional<Eigen::Vector2d> from_ideal(const Eigen::Vector2d& ideal_pixel) const;
};

/// Throws std::invalid_argument, naming the field, for a size, focal length or centre that no
/// camera has (or is not finite), or a coefficient that the lens model doesn't have.
void validate(const Camera& camera);

/// Reads an OpenCV FileStorage YAML or a ROS camera_info YAML: image_width, image_height,
/// camera_matrix, distortion_coefficients (none means no distortion; 4, 5 or 8 values, or 12 or 14
/// of which the last are zero), distortion_model (equidistant or fisheye selects the fisheye; so
/// does OpenCV's `fisheye_model: 1`). Throws Error.
Camera load_camera(const std::filesystem::path& file);

/// The text form of the same, and back. parse_camera throws Error; `name` stands in its message.
Camera parse_camera(const std::string& yaml, const std::string& name = "camera");

/// Text that both OpenCV's FileStorage and our reader take.
std::string format_camera(const Camera& camera);

/// Writes a camera file; it appears whole or not at all. Throws Error.
void save_camera(const Camera& camera, const std::filesystem::path& file);

}  // namespace harco
