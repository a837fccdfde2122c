// What a camera sees of inked outlines, patch by patch: exact to the area that ink covers, then
// blurred, with its derivatives.
#pragma once

#include <array>
#include <cstddef>
#include <functional>
#include <vector>

#include <Eigen/Core>

#include "pose/kernels/patch_loops.hpp"

namespace harco {

/// Side of a patch, pixels.
inline constexpr int kPatch = 16;

/// Lens, defocus and motion, beside the pixel's own square.
struct Blur {
  double variance = 0.4;  ///< of a round Gaussian, square pixels
  /// Besides, everything is smeared evenly along this way (pixels).
  Eigen::Vector2d smear = Eigen::Vector2d::Zero();

  /// Second moments, square pixels.
  Eigen::Matrix2d moments() const;
  /// The blur with these second moments: what one direction has more is smeared.
  static Blur with_moments(const Eigen::Matrix2d& moments);
};

/// The share of ink in every pixel of a patch, row by row, and its derivatives by the pixel's
/// place.
struct PatchPicture {
  using Channel = std::array<float, kPatch * kPatch>;
  alignas(64) Channel ink;
  alignas(64) Channel by_x, by_y;
  alignas(64) Channel by_xx, by_xy, by_yy;
};

/// Draws one patch after the other with the same blur.
class PatchPainter {
 public:
  void set_blur(const Blur& blur);

  /// How far beyond its patch the painter must know the outlines, pixels.
  int margin() const { return margin_; }

  /// How often it draws each patch: along the way that is smeared.
  std::size_t places() const { return places_; }

  /// Begins the patch whose first pixel is (x, y).
  void begin(int x, int y);

  /// A piece of an outline, in pixels; on the right-hand side of whoever goes along it (x right, y
  /// down) is ink. Pieces beyond the margin change nothing.
  void add(const Eigen::Vector2d& from, const Eigen::Vector2d& to);

  /// Ends it. `is_black` is asked for one pixel position at the left end of the margin, off all
  /// outlines if that can be: everything else follows from the outlines.
  void finish(const std::function<bool(const Eigen::Vector2d&)>& is_black, PatchPicture& picture);

 private:
  /// Where an outline crosses the margin's left end: below it, `jump` more ink.
  struct Crossing {
    double row;
    float jump;
  };
  /// Of the scratch memory: a row of half pixels.
  struct alignas(64) Row {
    std::array<float, 3 * kPatch> values;
  };

  void set_steps(double variance);
  void set_taps(double sigma, int taps);
  float first_ink(const std::function<bool(const Eigen::Vector2d&)>& is_black);
  void find_starts(float ink, double down, float weight);
  void move_edges(const Eigen::Vector2d& way, float weight);

  int margin_ = 0;  ///< pixels
  int size_ = 0;    ///< of all with the margin, half pixels
  int far_ = 0;     ///< how far from the first pixel an edge can be, pixels
  std::size_t places_ = 1;
  Eigen::Vector2d smear_ = Eigen::Vector2d::Zero();
  std::vector<float> steps_;                 ///< table of kernels::Steps
  std::vector<float> value_, slope_, bend_;  ///< of the blur at 1/2, 3/2 ... half pixels
  int x_ = 0, y_ = 0;
  std::vector<kernels::PatchEdge> edges_, moved_;
  std::vector<Crossing> crossings_;
  std::vector<float> starts_;  ///< ink at the rows' left ends
  std::vector<Row> rows_;
};

}  // namespace harco
