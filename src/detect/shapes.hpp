// The first stages together: the quadrilaterals of a picture, dark or bright.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "detect/convex_regions.hpp"
#include "detect/quad.hpp"
#include "detect/region_quad.hpp"
#include "detect/threshold.hpp"
#include "detect/workers.hpp"
#include "harco/detect.hpp"
#include "harco/image.hpp"

namespace harco::detect {

/// A quadrilateral; seen at several thresholds it counts once.
struct Shape {
  Quad corners;  ///< right to about a pixel
  bool hole;     ///< bright inside dark; otherwise dark inside bright
};

struct ShapeLimits {
  double min_side = 10.0;  ///< pixels
  /// Cells across the smallest dark and the smallest bright one looked for: what has no pixel for
  /// each of them can't be read, however steep. 0 if there are none.
  int island_cells = 5;
  int hole_cells = 5;
};

class ShapeFinder {
 public:
  /// The pixels have to stay where they are for as long as the threshold is used. Makes the image's
  /// half picture, if one has begun, and adds what it went through to `trace`, if there is one.
  void find(const ImageView& image, const ShapeLimits& limits, Workers& workers,
            Pyramid* half = nullptr, DetectionTrace* trace = nullptr);

  /// Of the last picture. At most 300 and one for each 1000 pixels, the largest ones.
  const std::vector<Shape>& shapes() const { return index_.shapes(); }
  std::size_t count() const { return count_; }  ///< before that limit
  const Threshold& threshold() const { return threshold_; }

 private:
  /// The shapes found so far, by where their centres lie.
  class Index {
   public:
    void clear(int width, int height);
    void add(const Shape& shape);  ///< unless it is there already
    void keep_largest(std::size_t most);
    const std::vector<Shape>& shapes() const { return shapes_; }

   private:
    static constexpr int kCell = 16;  // pixels
    int& bucket(int row, int column) {
      return buckets_[static_cast<std::size_t>(row * columns_ + column)];
    }
    int columns_ = 0;
    int rows_ = 0;
    // The last shape of each bucket, and of each shape the one before it there; -1 at the end.
    std::vector<int> buckets_, before_;
    std::vector<Shape> shapes_;
  };

  /// What one of those who work needs of its own.
  struct Scratch {
    ConvexRegions regions;
    RegionQuad quad;
  };
  /// Some rows at one level, and what was found there.
  struct Part {
    std::size_t pass;
    int first_row, end_row;
    std::vector<Shape> shapes;
    std::vector<std::vector<Point>> contours;  // for a trace
  };
  void divide(const ShapeLimits& limits, Workers& workers);
  void look_through(Part& part, Scratch& scratch, double min_side, bool tracing) const;

  Threshold threshold_;
  std::array<ConvexRegions, Threshold::kLevels.size()> passes_;
  std::vector<Scratch> scratch_;
  std::vector<Part> parts_;
  std::size_t count_of_parts_ = 0;  // in use
  Index index_;
  std::size_t count_ = 0;
};

}  // namespace harco::detect
