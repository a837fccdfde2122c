// The outlines of one parent's ink: what a prediction of its picture is drawn from.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "harco/geometry.hpp"

namespace harco {

/// A piece of an outline, in metres of the parent's plane. Whoever goes along it sees ink (x right,
/// y down) on the right-hand side.
struct InkEdge {
  Eigen::Vector2d from, to;
};

/// All outlines, each piece once, and where ink is.
class InkOutline {
 public:
  explicit InkOutline(const InkPlan& plan);

  const Rect& square() const { return square_; }
  const std::vector<InkEdge>& edges() const { return edges_; }

  /// Whether a point that isn't on an outline is black.
  bool is_black(const Eigen::Vector2d& point) const;

 private:
  /// Cells of a grid over the square, each with the rectangles that reach into it.
  struct Index {
    std::vector<int> first;  ///< one more than there are cells
    std::vector<Rect> rects;
  };

  Index index(const std::vector<Rect>& rects) const;
  int cell(double coordinate) const;
  bool covered(const Index& index, const Eigen::Vector2d& point) const;

  Rect square_;
  std::vector<InkEdge> edges_;
  Index white_, black_;
};

}  // namespace harco
