// Straight edges between even dark and even bright: what is left of a square's sides when something
// covers the rest.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "detect/step_map.hpp"
#include "detect/workers.hpp"
#include "harco/image.hpp"

namespace harco::detect {

using Point = Eigen::Vector2d;

/// A straight edge. Walking from `a` to `b`, the dark lies on the right-hand side as seen on the
/// screen.
struct Segment {
  Point a, b;
  double dark = 0.0, bright = 255.0;  ///< grey levels of both sides
  double length() const { return (b - a).norm(); }
  Point direction() const { return (b - a).normalized(); }
};

/// Finds straight edges by where scan lines step across them: rows for those that are steeper than
/// 45 degrees, columns for all others. Steps of neighbouring scan lines that go on straight, by
/// where they lie, by the gradient's direction and by their grey levels, are one edge. So texture,
/// of which hardly a step goes on to the next scan line, costs next to nothing.
class SegmentFinder {
 public:
  /// Edges at least `least_px` long, of at least `least_contrast` grey levels (1 … 255), in an
  /// order that the image alone decides. Valid until the next call.
  const std::vector<Segment>& find(const ImageView& image, double least_px, int least_contrast,
                                   Workers& workers);

 private:
  /// Where a scan line crosses an edge. Along the line its place is `t`, across it `s`.
  struct Step {
    int s = -1;
    int chain = -1;  ///< that it belongs to, if it is the last one there
    float t = 0.0F;
    float slope = 0.0F;                               ///< of the edge, dt / ds, by the gradient
    std::int16_t twice_before = 0, twice_behind = 0;  ///< the levels of both sides
    // How its edge goes on: from `at` with the slope `lean`, so much of which is to be told anew by
    // the next step's own slope.
    float at = 0.0F, lean = 0.0F, unsure = 0.5F;
  };
  /// Two steps and more that go on straight.
  struct Chain {
    int count = 0;
    int first_s = 0, last_s = 0;
    float first_t = 0.0F;
    // Of all steps, counted from the first one.
    double sum_s = 0.0, sum_t = 0.0, sum_ss = 0.0, sum_st = 0.0, sum_tt = 0.0;
    int sum_before = 0, sum_behind = 0;  ///< of twice the levels
    double slope() const;
    double place_at(int s) const;
    void add(const Step& step);
  };
  /// One of the two ways of scanning, with the memory that it needs.
  struct Scan {
    void start(int places);
    void link(Step& step);
    void read(const ImageView& image, bool rows, int x, int y);

    StepMap steps;
    std::vector<Step> latest;  ///< the last one at each place along scan lines, one ahead
    std::vector<Chain> chains;
  };
  static float beside(const Step& before, const Step& step);
  static void scan(const ImageView& image, bool rows, int even, int least_contrast, Scan& scan);
  void keep(const Scan& scan, bool rows, double least_px);

  std::array<Scan, 2> scans_;
  std::vector<Segment> segments_;
};

}  // namespace harco::detect
