// A shadow on the marker: one of two parts of the plane, in a light of its own.
#pragma once

#include <optional>
#include <span>

#include <Eigen/Core>

namespace harco {

/// Where the shadow lies: its border is where a polynomial of second degree in the place (u, v)
/// vanishes: a straight line or a bent one, a strip's two sides, an ellipse. How steep it is says
/// how soon the border fades.
class ShadowShape {
 public:
  static constexpr int kTerms = 6;
  using Terms = Eigen::Matrix<float, kTerms, 1>;
  static Terms terms(float u, float v) {
    Terms terms;
    terms << 1.0F, u, v, u * u, u * v, v * v;
    return terms;
  }

  /// The share of the missing light that is missing here, 0 ... 1, and how that changes with the
  /// polynomial's value.
  struct Depth {
    float share, slope;
  };
  static Depth depth(float value);
};

/// A shadow as one pixel after the other of the paper shows it.
struct Shadow {
  double lit = 0.0, shaded = 0.0;  ///< grey levels of paper
  Eigen::Matrix<double, ShadowShape::kTerms, 1> shape;
};

/// The shadow that splits pixels of white paper, with grey levels `grey` at places (u, v) of -1 to
/// 1, into brighter and darker ones. Empty if there is none, or not of that shape.
std::optional<Shadow> find_shadow(std::span<const float> grey, std::span<const float> u,
                                  std::span<const float> v);

}  // namespace harco
