#include "bound.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <stdexcept>

#include <Eigen/Dense>

namespace harco::lab {
namespace {

using Vector6d = Eigen::Matrix<double, 6, 1>;

// About so far, in pixels, the outline moves for a difference: small against the blur of any
// picture, large against the rounding of its float values.
constexpr double kStepPx = 0.03;

// Information of a direction of the pose, over that of the best known one, below which the picture
// can't be said to fix it. Both in steps of kStepPx.
constexpr double kLeastShare = 1e-9;

Eigen::Isometry3d moved(const Eigen::Isometry3d& pose, const Vector6d& by) {
  Eigen::Isometry3d result = pose;
  result.translation() += by.head<3>();
  const double angle = by.tail<3>().norm();
  if (angle > 0.0) result.rotate(Eigen::AngleAxisd(angle, by.tail<3>() / angle));
  return result;
}

/// Changes of the six parameters that move the picture of `square` by about kStepPx.
Vector6d steps_of(const Scene& scene, const Rect& square, const Eigen::Isometry3d& pose) {
  const Eigen::Vector3d middle(0.5 * (square.x0 + square.x1), 0.5 * (square.y0 + square.y1), 0.0);
  const double distance = (pose * middle).norm();
  const double sideways = kStepPx * distance / std::max(scene.camera.fx, scene.camera.fy);
  const double reach = std::max(square.width(), square.height());
  Vector6d steps;
  steps << sideways, sideways, sideways * distance / reach,
      Eigen::Vector3d::Constant(sideways / reach);
  return steps;
}

/// The information about the parameters in units of `steps`.
Matrix6d information_in_steps(const Scene& original, const std::vector<Sheet>& sheets, int placed,
                              const Effect& effect, const Vector6d& steps) {
  Scene scene = original;
  scene.background.reset();
  scene.grey = scene.white;
  Eigen::Isometry3d& pose = scene.parents[static_cast<std::size_t>(placed)].camera_T_marker;
  const Eigen::Isometry3d truth = pose;
  const auto pixels = static_cast<Eigen::Index>(scene.camera.width) *
                      static_cast<Eigen::Index>(scene.camera.height);
  const auto picture = [&] {
    FloatImage image = render_exact(scene, sheets);
    if (effect) effect(image);
    return image;
  };
  Eigen::Matrix<float, Eigen::Dynamic, 6> gradient(pixels, 6);
  for (int i = 0; i < 6; ++i) {
    pose = moved(truth, steps[i] * Vector6d::Unit(i));
    const FloatImage ahead = picture();
    pose = moved(truth, -steps[i] * Vector6d::Unit(i));
    const FloatImage behind = picture();
    gradient.col(i) = 0.5F * (Eigen::Map<const Eigen::VectorXf>(ahead.pixels.data(), pixels) -
                              Eigen::Map<const Eigen::VectorXf>(behind.pixels.data(), pixels));
  }
  const double variance = scene.noise_sigma * scene.noise_sigma + 1.0 / 12.0;
  Matrix6d information = Matrix6d::Zero();
  for (Eigen::Index pixel = 0; pixel < pixels; ++pixel) {
    const Vector6d g = gradient.row(pixel).transpose().cast<double>();
    if (!g.isZero(0.0)) information.noalias() += g * g.transpose();
  }
  return information / variance;
}

Vector6d checked_steps(const Scene& scene, const std::vector<Sheet>& sheets, int placed) {
  if (placed < 0 || static_cast<std::size_t>(placed) >= scene.parents.size())
    throw std::invalid_argument("pose_bound: the scene has no such sheet");
  if (scene.gain_left != 1.0 || scene.gain_right != 1.0)
    throw std::invalid_argument("pose_bound: paper without end needs even light of gain 1");
  const PlacedParent& parent = scene.parents[static_cast<std::size_t>(placed)];
  if (parent.parent_index < 0 || static_cast<std::size_t>(parent.parent_index) >= sheets.size())
    throw std::invalid_argument("pose_bound: the scene names a sheet that is not there");
  return steps_of(scene, sheets[static_cast<std::size_t>(parent.parent_index)].ink.square,
                  parent.camera_T_marker);
}

}  // namespace

Matrix6d pose_information(const Scene& scene, const std::vector<Sheet>& sheets, int placed) {
  const Vector6d steps = checked_steps(scene, sheets, placed);
  const Vector6d inverse = steps.cwiseInverse();
  return inverse.asDiagonal() * information_in_steps(scene, sheets, placed, {}, steps) *
         inverse.asDiagonal();
}

Matrix6d pose_bound(const Scene& scene, const std::vector<Sheet>& sheets, int placed) {
  return pose_bound(scene, sheets, {}, placed);
}

Matrix6d pose_bound(const Scene& scene, const std::vector<Sheet>& sheets, const Effect& effect,
                    int placed) {
  const Vector6d steps = checked_steps(scene, sheets, placed);
  const Eigen::SelfAdjointEigenSolver<Matrix6d> solver(
      information_in_steps(scene, sheets, placed, effect, steps));
  const Vector6d& values = solver.eigenvalues();
  if (!(values[0] > kLeastShare * values[5]))
    throw std::invalid_argument("pose_bound: the picture does not fix the pose");
  const Matrix6d root = steps.asDiagonal() * solver.eigenvectors();
  return root * values.cwiseInverse().asDiagonal() * root.transpose();
}

}  // namespace harco::lab
