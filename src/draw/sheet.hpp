// One sheet: a marker and, outside its quiet zone, what people need who print and mount it.
#pragma once

#include <string>

#include <Eigen/Core>

#include "draw/display_list.hpp"
#include "harco/draw.hpp"

namespace harco {

struct Sheet {
  std::string title;  ///< names the marker and its side
  double width_mm = 0.0, height_mm = 0.0;
  Eigen::Vector2d marker_mm = Eigen::Vector2d::Zero();  ///< the black square's top-left corner
  DisplayList shapes;
};

Sheet make_sheet(const MarkerSet& markers, int parent_index, const SheetOptions& options);

/// A ruler of 100 mm, or the next round length that fits into `width`, with the sentence that says
/// what it is for. `at` is its top-left corner. Returns the y below which there is room again.
double add_ruler(DisplayList& shapes, const Eigen::Vector2d& at, double width, double font);

/// Lines of text one below the other, broken to `width`, from the top-left corner `at`. Returns the
/// y below them.
double add_paragraph(DisplayList& shapes, const Eigen::Vector2d& at, double width, double font,
                     const std::string& text);

}  // namespace harco
