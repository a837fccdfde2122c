#include "calibration.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "harco/error.hpp"
#include "harco/pose.hpp"

namespace harco::cli {
namespace {

using Eigen::Isometry3d;
using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;
using Vector6d = Eigen::Matrix<double, 6, 1>;

constexpr double kLeastNoise = 0.01;  ///< pixels; nobody's corners are better in earnest
constexpr double kMostNoise = 1e4;
constexpr double kOutlierSigmas = 3.5;
constexpr std::size_t kLeastPoints = 6;  ///< of a view: below, its pose explains anything
constexpr std::size_t kLeastViews = 3;

// --- Parameters ---------------------------------------------------------------------------------

int coefficient_count(CalibrationModel model) {
  switch (model) {
    case CalibrationModel::pinhole:
      return 5;
    case CalibrationModel::rational:
      return 8;
    case CalibrationModel::fisheye:
      return 4;
  }
  return 0;
}

void add_to_parameters(const VectorXd& step, Camera& camera) {
  camera.fx += step[0];
  camera.fy += step[1];
  camera.cx += step[2];
  camera.cy += step[3];
  for (Eigen::Index i = 4; i < step.size(); ++i)
    camera.coefficients[static_cast<std::size_t>(i - 4)] += step[i];
}

/// d(distorted normalised point) / d(coefficients), in the coefficients' order.
Eigen::Matrix<double, 2, Eigen::Dynamic> by_coefficients(const Camera& camera,
                                                         CalibrationModel model,
                                                         const Vector2d& point) {
  const double x = point.x(), y = point.y(), s = point.squaredNorm();
  Eigen::Matrix<double, 2, Eigen::Dynamic> jacobian(2, coefficient_count(model));
  if (model == CalibrationModel::fisheye) {
    const double r = std::sqrt(s), theta = std::atan(r);
    double factor = r > 0.0 ? theta / r : 1.0;
    for (Eigen::Index i = 0; i < 4; ++i) jacobian.col(i) = (factor *= theta * theta) * point;
    return jacobian;
  }
  const auto& k = camera.coefficients;
  const double above = 1.0 + s * (k[0] + s * (k[1] + s * k[4]));
  const double below = 1.0 + s * (k[5] + s * (k[6] + s * k[7]));
  jacobian.col(0) = s / below * point;
  jacobian.col(1) = s * s / below * point;
  jacobian.col(2) << 2.0 * x * y, s + 2.0 * y * y;
  jacobian.col(3) << s + 2.0 * x * x, 2.0 * x * y;
  jacobian.col(4) = s * s * s / below * point;
  for (Eigen::Index i = 5; i < jacobian.cols(); ++i)
    jacobian.col(i) = -above / (below * below) * std::pow(s, static_cast<double>(i - 4)) * point;
  return jacobian;
}

// --- Poses --------------------------------------------------------------------------------------

Matrix3d cross_matrix(const Vector3d& v) {
  Matrix3d matrix;
  matrix << 0.0, -v.z(), v.y(), v.z(), 0.0, -v.x(), -v.y(), v.x(), 0.0;
  return matrix;
}

/// t + dt, R Exp(w).
Isometry3d moved(const Isometry3d& pose, const Vector6d& step) {
  Isometry3d result = pose;
  result.translation() += step.head<3>();
  const Vector3d turn = step.tail<3>();
  const double angle = turn.norm();
  if (angle > 0.0)
    result.linear() = pose.linear() * Eigen::AngleAxisd(angle, turn / angle).toRotationMatrix();
  return result;
}

// --- Weights ------------------------------------------------------------------------------------

/// A feature's covariance on its own axes, so that noise common to all coordinates is quickly
/// added.
struct Axes {
  MatrixXd directions;  ///< columns
  VectorXd variances;

  explicit Axes(const MatrixXd& covariance) {
    const Eigen::SelfAdjointEigenSolver<MatrixXd> solver(covariance);
    directions = solver.eigenvectors();
    variances = solver.eigenvalues().cwiseMax(0.0);
  }

  /// Scales a residual, or its derivatives, to unit covariance.
  MatrixXd whitened(const MatrixXd& residual, double noise) const {
    const VectorXd scale = (variances.array() + noise * noise).rsqrt();
    return scale.asDiagonal() * (directions.transpose() * residual);
  }

  double distance2(const VectorXd& residual, double noise) const {
    return whitened(residual, noise).squaredNorm();
  }
};

/// Quantile of the chi-squared distribution `sigmas` above its median (Wilson and Hilferty).
double chi2_quantile(double freedom, double sigmas) {
  const double spread = 2.0 / (9.0 * freedom);
  return freedom * std::pow(1.0 - spread + sigmas * std::sqrt(spread), 3);
}

double freedom(const Feature& feature) {
  return 2.0 * static_cast<double>(feature.target_m.size());
}

double chi2_limit(const Feature& feature) {
  return chi2_quantile(freedom(feature), kOutlierSigmas);
}

/// The noise at which `excess`, which falls with it, is zero.
template <typename Excess>
double noise_where_zero(const Excess& excess) {
  if (excess(kLeastNoise) <= 0.0) return kLeastNoise;
  double low = std::log(kLeastNoise), high = std::log(kMostNoise);
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    (excess(std::exp(middle)) > 0.0 ? low : high) = middle;
  }
  return std::exp(high);
}

// --- The fit ------------------------------------------------------------------------------------

/// Camera, poses and which measurements take part.
struct State {
  Camera camera;
  std::vector<FittedView> views;
};

/// Normal equations of one view.
struct Normals {
  MatrixXd camera, cross;  ///< by parameters, by parameters and pose
  Eigen::Matrix<double, 6, 6> pose = Eigen::Matrix<double, 6, 6>::Zero();
  VectorXd camera_gradient;
  Vector6d pose_gradient = Vector6d::Zero();
};

class Fit {
 public:
  Fit(const std::vector<TargetView>& views, CalibrationModel model) : views_(views), model_(model) {
    for (const TargetView& view : views) {
      std::vector<Axes>& axes = axes_.emplace_back();
      for (const Feature& feature : view.features) axes.emplace_back(feature.covariance_px2);
    }
  }

  Calibration run(const Camera& start) {
    constexpr int kRobustRounds = 3, kRounds = 10;
    State state{start, {}};
    for (const TargetView& view : views_) {
      FittedView& fitted = state.views.emplace_back();
      fitted.kept.assign(view.features.size(), true);
    }
    find_poses(state);
    require_enough(state);

    noise_ = typical_noise(state);
    for (int round = 0; round < kRobustRounds; ++round) {
      adjust(state, all_used(state), Loss::robust);
      noise_ = typical_noise(state);
    }
    MatrixXd information;
    for (int round = 0; round < kRounds; ++round) {
      const bool changed = select(state);
      require_enough(state);
      information = adjust(state, all_used(state), Loss::plain);
      noise_ = mean_noise(state);
      if (round > 0 && !changed) break;
    }
    return result(state, information);
  }

 private:
  enum class Loss { plain, robust };

  std::vector<std::size_t> all_used(const State& state) const {
    std::vector<std::size_t> used;
    for (std::size_t i = 0; i < state.views.size(); ++i)
      if (state.views[i].used) used.push_back(i);
    return used;
  }

  void require_enough(const State& state) const {
    if (const std::size_t used = all_used(state).size(); used < kLeastViews)
      throw Error(
          "calibration: only " + std::to_string(used) + " of " + std::to_string(views_.size()) +
          " views of the target agree with one camera; at least 3 have to (is the board the "
          "one that was named, and is it flat?)");
  }

  /// Residuals of a feature, measured minus expected; empty where the camera can't see it.
  std::optional<VectorXd> residual(const State& state, std::size_t view, std::size_t index) const {
    const Feature& feature = views_[view].features[index];
    VectorXd values(2 * static_cast<Eigen::Index>(feature.target_m.size()));
    for (std::size_t i = 0; i < feature.target_m.size(); ++i) {
      const Vector3d target(feature.target_m[i].x(), feature.target_m[i].y(), 0.0);
      const auto pixel = state.camera.project(state.views[view].camera_T_target * target);
      if (!pixel) return std::nullopt;
      values.segment<2>(2 * static_cast<Eigen::Index>(i)) = feature.image_px[i] - *pixel;
    }
    return values;
  }

  /// Squared distance in units of the noise; infinite where the camera can't see it.
  double distance2(const State& state, std::size_t view, std::size_t index) const {
    const auto values = residual(state, view, index);
    return values ? axes_[view][index].distance2(*values, noise_)
                  : std::numeric_limits<double>::infinity();
  }

  double loss(const State& state, std::size_t view, Loss kind) const {
    double sum = 0.0;
    for (std::size_t i = 0; i < views_[view].features.size(); ++i) {
      if (!state.views[view].kept[i]) continue;
      const double d2 = distance2(state, view, i);
      const double limit = chi2_limit(views_[view].features[i]);
      // Cauchy's: nearly quadratic for what fits, nearly flat for what doesn't.
      sum += kind == Loss::plain ? d2 : limit * std::log1p(std::min(d2, 1e12) / limit);
    }
    return sum;
  }

  Normals normals(const State& state, std::size_t view, Loss kind, bool with_camera) const {
    const Eigen::Index count = with_camera ? parameter_count(model_) : 0;
    Normals sum;
    sum.camera = MatrixXd::Zero(count, count);
    sum.cross = MatrixXd::Zero(count, 6);
    sum.camera_gradient = VectorXd::Zero(count);
    const Isometry3d& pose = state.views[view].camera_T_target;
    for (std::size_t index = 0; index < views_[view].features.size(); ++index) {
      if (!state.views[view].kept[index]) continue;
      const Feature& feature = views_[view].features[index];
      const auto rows = 2 * static_cast<Eigen::Index>(feature.target_m.size());
      // Derivatives by parameters, then pose, then the residual: whitened together.
      MatrixXd system(rows, count + 7);
      bool seen = true;
      for (std::size_t i = 0; i < feature.target_m.size() && seen; ++i) {
        const Vector3d target(feature.target_m[i].x(), feature.target_m[i].y(), 0.0);
        ProjectedPoint at;
        seen = project(state.camera, model_, pose * target, at);
        if (!seen) break;
        auto block = system.middleRows<2>(2 * static_cast<Eigen::Index>(i));
        if (with_camera) block.leftCols(count) = at.by_parameters;
        block.middleCols<3>(count) = at.by_point;
        block.middleCols<3>(count + 3) = -at.by_point * pose.linear() * cross_matrix(target);
        block.col(count + 6) = feature.image_px[i] - at.pixel;
      }
      if (!seen) continue;
      system = axes_[view][index].whitened(system, noise_);
      if (kind == Loss::robust)
        system /= std::sqrt(1.0 + system.rightCols<1>().squaredNorm() / chi2_limit(feature));
      const auto by_camera = system.leftCols(count);
      const auto by_pose = system.middleCols<6>(count);
      const auto misfit = system.rightCols<1>();
      sum.camera += by_camera.transpose() * by_camera;
      sum.cross += by_camera.transpose() * by_pose;
      sum.pose += by_pose.transpose() * by_pose;
      sum.camera_gradient += by_camera.transpose() * misfit;
      sum.pose_gradient += by_pose.transpose() * misfit;
    }
    return sum;
  }

  /// Levenberg-Marquardt over the poses of `which` and, unless it is held, the camera, whose
  /// information matrix it returns, the poses eliminated.
  MatrixXd adjust(State& state, const std::vector<std::size_t>& which, Loss kind,
                  bool with_camera = true) const {
    constexpr int kIterations = 100;
    constexpr double kSettled = 1e-9, kMostDamping = 1e12;
    const auto total = [&](const State& at) {
      double sum = 0.0;
      for (const std::size_t view : which) sum += loss(at, view, kind);
      return sum;
    };
    double damping = 1e-3, cost = total(state);
    for (int i = 0; i < kIterations && damping < kMostDamping; ++i) {
      std::vector<Normals> all;
      for (const std::size_t view : which) all.push_back(normals(state, view, kind, with_camera));
      bool settled = false;
      for (; damping < kMostDamping; damping *= 10.0) {
        State next = step(state, which, all, damping);
        const double after = total(next);
        if (!(after < cost)) continue;
        settled = cost - after < kSettled * cost;
        state = std::move(next);
        cost = after;
        damping = std::max(damping / 10.0, 1e-12);
        break;
      }
      if (settled) break;
    }
    if (!with_camera) return {};
    MatrixXd information = MatrixXd::Zero(parameter_count(model_), parameter_count(model_));
    for (const std::size_t view : which) {
      const Normals own = normals(state, view, kind, true);
      information += own.camera - own.cross * own.pose.ldlt().solve(own.cross.transpose());
    }
    return information;
  }

  /// One damped step: the poses are eliminated from the equations, then found again.
  static State step(const State& state, const std::vector<std::size_t>& which,
                    const std::vector<Normals>& all, double damping) {
    const auto damped = [&](MatrixXd matrix) {
      matrix.diagonal() *= 1.0 + damping;
      return matrix;
    };
    const Eigen::Index count = all.front().camera.rows();
    State next = state;
    VectorXd camera_step(count);
    if (count > 0) {  // else the camera is kept
      MatrixXd reduced = MatrixXd::Zero(count, count);
      VectorXd gradient = VectorXd::Zero(count);
      for (const Normals& own : all) {
        const Eigen::LDLT<MatrixXd> pose(damped(own.pose));
        reduced += damped(own.camera) - own.cross * pose.solve(own.cross.transpose());
        gradient += own.camera_gradient - own.cross * pose.solve(own.pose_gradient);
      }
      camera_step = solve_scaled(reduced, gradient);
      add_to_parameters(camera_step, next.camera);
    }
    for (std::size_t i = 0; i < which.size(); ++i) {
      const Vector6d pose_step =
          damped(all[i].pose)
              .ldlt()
              .solve(all[i].pose_gradient - all[i].cross.transpose() * camera_step);
      Isometry3d& pose = next.views[which[i]].camera_T_target;
      pose = moved(pose, pose_step);
    }
    return next;
  }

  /// Parameters differ by many orders of magnitude: solved with a unit diagonal.
  static VectorXd solve_scaled(const MatrixXd& matrix, const VectorXd& right) {
    const VectorXd scale = matrix.diagonal().cwiseMax(1e-300).array().rsqrt();
    const MatrixXd unit = scale.asDiagonal() * matrix * scale.asDiagonal();
    return scale.asDiagonal() * unit.ldlt().solve(scale.asDiagonal() * right);
  }

  /// From the plane's homography, as a camera that looks straight at the target would see it: rays
  /// far off the axis have no place in the plane of an image.
  void find_poses(State& state) const {
    for (std::size_t view = 0; view < views_.size(); ++view) {
      std::vector<Vector2d> plane, image;
      std::vector<Vector3d> rays;
      Vector3d mean = Vector3d::Zero();
      for (const Feature& feature : views_[view].features)
        for (std::size_t i = 0; i < feature.target_m.size(); ++i)
          if (const auto ray = state.camera.unproject(feature.image_px[i])) {
            plane.push_back(feature.target_m[i]);
            rays.push_back(ray->homogeneous().normalized());
            mean += rays.back();
          }
      FittedView& fitted = state.views[view];
      fitted.used = plane.size() >= kLeastPoints;
      if (!fitted.used) continue;
      const Eigen::Quaterniond turn = Eigen::Quaterniond::FromTwoVectors(mean, Vector3d::UnitZ());
      for (const Vector3d& ray : rays) image.emplace_back((turn * ray).hnormalized());
      try {
        fitted.camera_T_target = turn.inverse() * solve_planar_pose(plane, image).camera_T_plane[0];
      } catch (const std::invalid_argument&) {  // all points on a line
        fitted.used = false;
      }
    }
  }

  /// The noise that the median of the measurements speaks for.
  double typical_noise(const State& state) const {
    std::vector<std::pair<VectorXd, const Axes*>> residuals;
    for (const std::size_t view : all_used(state))
      for (std::size_t i = 0; i < views_[view].features.size(); ++i)
        if (auto values = residual(state, view, i))
          residuals.emplace_back(std::move(*values), &axes_[view][i]);
    if (residuals.empty()) return kMostNoise;
    return noise_where_zero([&](double noise) {
      std::vector<double> ratios;
      for (const auto& [values, axes] : residuals)
        ratios.push_back(axes->distance2(values, noise) /
                         chi2_quantile(static_cast<double>(values.size()), 0.0));
      const auto middle = ratios.begin() + static_cast<std::ptrdiff_t>(ratios.size() / 2);
      std::nth_element(ratios.begin(), middle, ratios.end());
      return *middle - 1.0;
    });
  }

  /// The noise that makes all kept measurements together as far off as they should be.
  double mean_noise(const State& state) const {
    std::vector<std::pair<VectorXd, const Axes*>> residuals;
    double free = -static_cast<double>(parameter_count(model_));
    for (const std::size_t view : all_used(state)) {
      free -= 6.0;
      for (std::size_t i = 0; i < views_[view].features.size(); ++i) {
        if (!state.views[view].kept[i]) continue;
        if (auto values = residual(state, view, i)) {
          free += static_cast<double>(values->size());
          residuals.emplace_back(std::move(*values), &axes_[view][i]);
        }
      }
    }
    return noise_where_zero([&](double noise) {
      double sum = -std::max(free, 1.0);
      for (const auto& [values, axes] : residuals) sum += axes->distance2(values, noise);
      return sum;
    });
  }

  /// Decides anew which features and views take part. Returns whether that changed anything.
  bool select(State& state) const {
    const std::vector<FittedView> before = state.views;
    for (std::size_t view = 0; view < views_.size(); ++view) {
      if (before[view].used) continue;  // others may fit the camera by now
      state.views[view].kept.assign(views_[view].features.size(), true);
      adjust(state, {view}, Loss::robust, /*with_camera=*/false);
    }
    bool changed = false;
    for (std::size_t view = 0; view < views_.size(); ++view) {
      FittedView& fitted = state.views[view];
      const std::vector<Feature>& features = views_[view].features;
      std::size_t points = 0, all_points = 0;
      double sum = 0.0, free = 0.0;
      for (std::size_t i = 0; i < features.size(); ++i) {
        const double d2 = distance2(state, view, i);
        fitted.kept[i] = d2 <= chi2_limit(features[i]);
        all_points += features[i].target_m.size();
        if (!fitted.kept[i]) continue;
        points += features[i].target_m.size();
        sum += d2;
        free += freedom(features[i]);
      }
      // A view as a whole may be worse than the others, moved or bent, with no point that stands
      // out.
      constexpr double kMostVariance = 4.0;
      fitted.used =
          points >= kLeastPoints && 3 * points >= all_points && sum <= kMostVariance * free;
      changed = changed || fitted.used != before[view].used ||
                (fitted.used && fitted.kept != before[view].kept);
    }
    return changed;
  }

  /// Sum of squared distances in pixels over a view's kept points, and their number.
  std::pair<double, std::size_t> squared_px(const State& state, std::size_t view) const {
    double sum = 0.0;
    std::size_t points = 0;
    for (std::size_t i = 0; i < views_[view].features.size(); ++i) {
      if (!state.views[view].kept[i]) continue;
      if (const auto values = residual(state, view, i)) {
        sum += values->squaredNorm();
        points += views_[view].features[i].target_m.size();
      }
    }
    return {sum, points};
  }

  double rms_px(const State& state, const std::vector<std::size_t>& which) const {
    double sum = 0.0;
    std::size_t points = 0;
    for (const std::size_t view : which) {
      const auto [own, count] = squared_px(state, view);
      sum += own;
      points += count;
    }
    return points > 0 ? std::sqrt(sum / static_cast<double>(points)) : 0.0;
  }

  /// How far off views are that had no part in the camera: each fifth of them in turn.
  double held_out_rms_px(const State& state) const {
    const std::vector<std::size_t> used = all_used(state);
    const std::size_t folds = std::min<std::size_t>(5, used.size());
    double sum = 0.0;
    std::size_t points = 0;
    for (std::size_t fold = 0; fold < folds; ++fold) {
      std::vector<std::size_t> fitted, held_out;
      for (std::size_t i = 0; i < used.size(); ++i)
        (i % folds == fold ? held_out : fitted).push_back(used[i]);
      State own = state;
      adjust(own, fitted, Loss::plain);
      for (const std::size_t view : held_out) {
        adjust(own, {view}, Loss::plain, /*with_camera=*/false);
        const auto [squared, count] = squared_px(own, view);
        sum += squared;
        points += count;
      }
    }
    return points > 0 ? std::sqrt(sum / static_cast<double>(points)) : 0.0;
  }

  Calibration result(State& state, const MatrixXd& information) const {
    Calibration calibration;
    const VectorXd scale = information.diagonal().cwiseMax(1e-300).array().rsqrt();
    const Eigen::LDLT<MatrixXd> unit(
        MatrixXd(scale.asDiagonal() * information * scale.asDiagonal()));
    const MatrixXd identity = MatrixXd::Identity(information.rows(), information.cols());
    calibration.covariance = scale.asDiagonal() * unit.solve(identity) * scale.asDiagonal();
    if (!calibration.covariance.allFinite() ||
        !(calibration.covariance.diagonal().array() > 0.0).all())
      throw Error(
          "calibration: the pictures don't determine the camera; take some with the target tilted "
          "to all sides");
    for (std::size_t view = 0; view < views_.size(); ++view)
      state.views[view].rms_px = rms_px(state, {view});
    calibration.rms_px = rms_px(state, all_used(state));
    calibration.held_out_rms_px = held_out_rms_px(state);
    calibration.noise_px = noise_;
    calibration.camera = state.camera;
    calibration.views = state.views;
    return calibration;
  }

  const std::vector<TargetView>& views_;
  CalibrationModel model_;
  std::vector<std::vector<Axes>> axes_;  ///< by view and feature
  double noise_ = kMostNoise;
};

}  // namespace

int parameter_count(CalibrationModel model) { return 4 + coefficient_count(model); }

std::vector<std::string> parameter_names(CalibrationModel model) {
  std::vector<std::string> names{"fx", "fy", "cx", "cy", "k1", "k2"};
  if (model == CalibrationModel::fisheye) {
    names.insert(names.end(), {"k3", "k4"});
  } else {
    names.insert(names.end(), {"p1", "p2", "k3"});
    if (model == CalibrationModel::rational) names.insert(names.end(), {"k4", "k5", "k6"});
  }
  return names;
}

VectorXd parameters_of(const Camera& camera, CalibrationModel model) {
  VectorXd values(parameter_count(model));
  values.head<4>() << camera.fx, camera.fy, camera.cx, camera.cy;
  for (Eigen::Index i = 4; i < values.size(); ++i)
    values[i] = camera.coefficients[static_cast<std::size_t>(i - 4)];
  return values;
}

bool project(const Camera& camera, CalibrationModel model, const Vector3d& point,
             ProjectedPoint& projected) {
  const auto pixel = camera.project(point, &projected.by_point);
  if (!pixel) return false;
  projected.pixel = *pixel;
  const Vector2d distorted((pixel->x() - camera.cx) / camera.fx,
                           (pixel->y() - camera.cy) / camera.fy);
  projected.by_parameters.resize(2, parameter_count(model));
  projected.by_parameters.leftCols<4>() << distorted.x(), 0.0, 1.0, 0.0, 0.0, distorted.y(), 0.0,
      1.0;
  projected.by_parameters.rightCols(coefficient_count(model)) =
      Eigen::DiagonalMatrix<double, 2>(camera.fx, camera.fy) *
      by_coefficients(camera, model, point.head<2>() / point.z());
  return true;
}

Calibration calibrate(const std::vector<TargetView>& views, CalibrationModel model,
                      const Camera& start) {
  return Fit(views, model).run(start);
}

}  // namespace harco::cli
