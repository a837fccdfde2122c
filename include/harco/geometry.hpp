// Where the ink is: the one geometry from which every picture of a marker is drawn and every
// prediction of what a camera sees is made.
#pragma once

#include <vector>

#include "harco/marker.hpp"

namespace harco {

/// An axis-parallel rectangle in a marker's plane.
struct Rect {
  double x0 = 0.0, y0 = 0.0, x1 = 0.0, y1 = 0.0;
  double width() const { return x1 - x0; }
  double height() const { return y1 - y0; }
  double area() const { return width() * height(); }
};

/// The picture of one parent in metres of its own frame, as three coats of paint: the black square,
/// white cells on it, black ink on those. Later coats cover earlier ones; within a coat
/// rectangles are disjoint. Around the square, the paper is white.
struct InkPlan {
  Rect square;              ///< the layer-1 black square
  std::vector<Rect> white;  ///< white cells of the layer-1 marker
  std::vector<Rect> black;  ///< inside the white cells: black cells and lines of all descendants
};

/// The ink of parent `parent_index`.
InkPlan ink_plan(const MarkerSet& markers, int parent_index);

/// Answers how white any part of one parent's picture is.
class InkMap {
 public:
  InkMap(const MarkerSet& markers, int parent_index);

  const InkPlan& plan() const { return plan_; }

  /// Mean whiteness, 0 black … 1 white, over a rectangle of the parent's plane that is not empty.
  double white_share(const Rect& area) const;

 private:
  double covered(const std::vector<Rect>& coat, const std::vector<std::vector<int>>& bins,
                 const Rect& area) const;

  InkPlan plan_;
  std::vector<std::vector<int>> white_bins_;
  std::vector<std::vector<int>> black_bins_;
};

/// For every marker of place(markers), in that order: the mean whiteness of each of its
/// (n+2) x (n+2) cells, row-first from its top-left, border ring included, with all that its
/// descendants, its siblings' lines and its own line put into them.
std::vector<std::vector<double>> predicted_cells(const MarkerSet& markers);

}  // namespace harco
