// Between pixels of the image and those of an ideal pinhole camera, where straight edges are
// straight.
#pragma once

#include <optional>

#include <Eigen/Core>

#include "harco/camera.hpp"

namespace harco::detect {

class Lens {
 public:
  Lens() = default;
  explicit Lens(const std::optional<Camera>& camera) {
    if (camera && camera->has_distortion()) camera_ = *camera;
  }

  /// From now on all pixels, ideal ones too, are counted from this one of the image.
  void count_from(const Eigen::Vector2d& origin) { origin_ = origin; }

  /// Whether pixels and ideal ones differ at all.
  bool bends() const { return camera_.has_value(); }

  /// Empty where the lens model can't be inverted.
  std::optional<Eigen::Vector2d> to_ideal(const Eigen::Vector2d& pixel) const {
    return camera_ ? counted(camera_->to_ideal(pixel + origin_)) : pixel;
  }
  std::optional<Eigen::Vector2d> from_ideal(const Eigen::Vector2d& ideal) const {
    return camera_ ? counted(camera_->from_ideal(ideal + origin_)) : ideal;
  }

  /// d(pixel) / d(ideal pixel) by differences of half a pixel.
  Eigen::Matrix2d from_ideal_jacobian(const Eigen::Vector2d& ideal) const {
    Eigen::Matrix2d jacobian = Eigen::Matrix2d::Identity();
    if (!camera_) return jacobian;
    for (int axis = 0; axis < 2; ++axis) {
      const Eigen::Vector2d half = 0.5 * Eigen::Vector2d::Unit(axis);
      const auto ahead = from_ideal(ideal + half);
      const auto behind = from_ideal(ideal - half);
      if (ahead && behind) jacobian.col(axis) = *ahead - *behind;
    }
    return jacobian;
  }

 private:
  std::optional<Eigen::Vector2d> counted(std::optional<Eigen::Vector2d> pixel) const {
    if (pixel) *pixel -= origin_;
    return pixel;
  }

  std::optional<Camera> camera_;
  Eigen::Vector2d origin_ = Eigen::Vector2d::Zero();
};

}  // namespace harco::detect
