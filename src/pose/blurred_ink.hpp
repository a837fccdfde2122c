// What a blurred eye sees of a parent's ink.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "harco/geometry.hpp"

namespace harco {

/// Mean whiteness under a Gaussian, 0 black ... 1 white, and how it changes.
struct Whiteness {
  double share = 1.0;
  Eigen::Vector2d gradient = Eigen::Vector2d::Zero();  ///< by the Gaussian's middle, per metre
  double by_log_sigma = 0.0;  ///< by the logarithm of the Gaussian's size, its shape kept
};

/// The ink of one parent under any Gaussian. Every rectangle is a sum over its corners of
/// the bivariate normal distribution, so that lines and cells of all layers are right at every
/// scale: resolved or not.
class BlurredInk {
 public:
  /// `detail` is about the size of the Gaussians that will be asked for, metres (> 0): it decides
  /// how the ink is filed, not what is answered.
  BlurredInk(const InkPlan& plan, double detail);

  /// Whiteness under a Gaussian with its middle at `point` of the parent's plane (metres) and a
  /// positive definite covariance (square metres).
  Whiteness at(const Eigen::Vector2d& point, const Eigen::Matrix2d& covariance) const;

 private:
  struct Patch {
    Rect rect;
    double sign;  ///< +1 adds white, -1 takes it
  };

  int bin(double coordinate) const;

  Rect square_;
  int bins_ = 1;
  std::vector<Patch> patches_;
  std::vector<std::vector<int>> by_bin_;  ///< row-first, indices into patches_
};

}  // namespace harco
