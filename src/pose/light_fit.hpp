// The light on a marker by itself: levels of black and white and a shadow, fitted to some pixels.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include "pose/shade.hpp"

namespace harco {

/// Grey levels over the marker, at places (u, v) of -1 to 1.
struct Light {
  /// Of black a plane (1, u, v), of white a parabola (1, u, v, uu, uv, vv); black bows as white
  /// does.
  static constexpr int kLevels = 9, kWhite = 3, kBow = 6;
  using Levels = Eigen::Matrix<double, kLevels, 1>;
  using Shape = Eigen::Matrix<double, ShadowShape::kTerms, 1>;

  Levels levels = Levels::Zero();
  double shaded_white = 1.0, shaded_black = 1.0;  ///< what is left of their light in the shadow
  Shape shape = Shape::Zero();                    ///< of the shadow

  /// Black's level as a share of white's.
  double black_part() const;
};

/// What is known of light beforehand, as standard deviations.
struct LightPrior {
  static constexpr double kUsualBow = 0.04;    ///< over the marker, as a share of it
  static constexpr double kUsualTint = 0.3;    ///< how much more of black's than of white's is left
  static constexpr double kMostShape = 100.0;  ///< by which a shadow's shape changes in a step
};

/// Levenberg-Marquardt with Huber's weights. Keeps its memory for the next time.
class LightFit {
 public:
  void clear() { count_ = 0; }
  /// A pixel at (u, v) that sees `white` of what is between black and white, 0 ... 1.
  void add(float grey, float white, float u, float v);
  std::size_t size() const { return count_; }

  /// Improves levels and shadow. `steepest` is the most that the shadow's polynomial may change
  /// from here to there, over (u, v), root mean square where it isn't flat. Returns how many steps
  /// it took.
  std::size_t fit(Light& light, double steepest);

  /// How much steeper than given the shadow's edge is: what fits best of some.
  double best_steepness(const Light& light);

 private:
  static constexpr int kShade = Light::kLevels, kShape = kShade + 2,
                       kUnknowns = kShape + ShadowShape::kTerms;
  using Row = Eigen::Matrix<double, kUnknowns, 1>;
  using Normal = Eigen::Matrix<double, kUnknowns, kUnknowns>;

  void linearise(const Light& light);
  double misfit() const;
  void solve(const Light& light);
  void blunt(Light& light, double steepest) const;

  std::size_t count_ = 0;
  std::vector<float> grey_, white_, u_, v_;
  std::array<std::vector<float>, kUnknowns> columns_;
  std::vector<float> residuals_, weights_, sizes_;
  double noise2_ = 0.0;  ///< of the residuals, variance
  Normal normal_ = Normal::Zero();
  Row pull_ = Row::Zero();
};

}  // namespace harco
