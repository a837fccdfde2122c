// Where one marker that is seen says that the others of its sheet are.
#pragma once

#include <array>
#include <optional>

#include <Eigen/Core>

#include "detect/lens.hpp"
#include "detect/quad.hpp"
#include "harco/detect.hpp"
#include "harco/marker.hpp"

namespace harco::detect {

/// A marker's square where it should be seen, ideal pixels.
struct PredictedQuad {
  Quad corners;
  Matrix8d covariance;  ///< of x and y of the corners one after the other
};

/// The homography through one detection's corners, carried over to its whole sheet.
class Prediction {
 public:
  /// Empty where the lens model can't be inverted.
  static std::optional<Prediction> from(const Detection& seen, const PlacedMarker& marker,
                                        const Lens& lens);

  /// Empty if a part of it would lie behind the camera.
  std::optional<PredictedQuad> of(const PlacedMarker& other) const;

 private:
  const PlacedMarker* marker_ = nullptr;
  Eigen::Matrix3d image_H_square_;
  /// By each of the eight coordinates of the corners, moved by kMove.
  std::array<Eigen::Matrix3d, 8> moved_;
  Matrix8d covariance_ = Matrix8d::Zero();
};

}  // namespace harco::detect
