// The pose straight from the grey values: the marker's own description, blurred and lit, laid over
// the image.
#pragma once

#include <memory>
#include <optional>

#include <Eigen/Geometry>

#include "harco/camera.hpp"
#include "harco/image.hpp"
#include "harco/pose.hpp"
#include "pose/ink_outline.hpp"
#include "pose/patch_painter.hpp"

namespace harco {

/// Even light varies smoothly over the marker; a shadow leaves less of it in one part; in uneven
/// light each patch has a gain of its own besides.
enum class LightModel { even, shadow, uneven };

/// What alignment found.
struct Alignment {
  Eigen::Isometry3d camera_T_marker = Eigen::Isometry3d::Identity();
  Matrix6d covariance = Matrix6d::Zero();  ///< of (dt, w) as in Pose, from the residuals
  double share = 0.0;   ///< of the pixels compared: how many fit, each by its weight, 0 ... 1
  Blur blur;            ///< beside the pixel's own square
  double noise = 0.0;   ///< grey levels, standard deviation of what remains
  double loss = 0.0;    ///< robust squared residuals in units of the noise
  int pixels = 0;       ///< how many were compared
  bool plain = false;   ///< fits well, in even light or nearly so
  bool fits = false;    ///< to the noise, in its light
  bool shaded = false;  ///< with a shadow's edge on the marker
  LightModel light = LightModel::even;  ///< in which it was found
  double evenness = 0.0;  ///< how well patches fit as a whole: 1 for noise alone, more otherwise
};

/// Least squares on the intensities near the marker's edges (Tukey's weights: pixels that don't
/// fit, such as an occluder's, are left out) over the pose, the blur, the camera's response and the
/// levels of black and white, which may vary over the marker; where much doesn't fit,
/// parts of the marker may besides stand in different light. Keeps its memory for the next time.
class Aligner {
 public:
  Aligner();
  ~Aligner();
  Aligner(Aligner&&) noexcept;
  Aligner& operator=(Aligner&&) noexcept;

  /// `quiet_m` is the width of the paper around the square. `start_covariance`, of (dt, w) as in
  /// Pose, tells how far `start` can be trusted: parts of the marker where it may be wrong by more
  /// than the blur allows come in later, when the others have made it better. Without it, all of
  /// `start` is taken to be right to about half a pixel.
  ///
  /// A `rival` is what another start has come to, and bears the picture out: no light is tried that
  /// the rival doesn't need. Where `light` is given, no other is tried.
  ///
  /// Empty if it doesn't converge near `start`, or if too little of the marker fits: then the image
  /// doesn't bear the pose out.
  std::optional<Alignment> align(const ImageView& image, const InkOutline& outline, double quiet_m,
                                 const Camera& camera, const Eigen::Isometry3d& start,
                                 const std::optional<Matrix6d>& start_covariance,
                                 const std::optional<Alignment>& rival = std::nullopt,
                                 std::optional<LightModel> light = std::nullopt);

  /// Bounds the work of all alignments that follow, until it is called again: to some milliseconds,
  /// or a share of that. Once it is spent, other light than even isn't tried any more.
  void refill(double share = 1.0);
  bool spent() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace harco
