// Where a marker's own picture has edges: what should be seen if it is where one thinks it is.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "harco/geometry.hpp"
#include "harco/marker.hpp"

namespace harco::detect {

/// A straight piece of an edge between black and white. Unit: the marker's square is [0, 1]^2.
struct TemplateEdge {
  Eigen::Vector2d a, b;
  Eigen::Vector2d to_white;  ///< unit normal
  double black = 0.0;        ///< how far even black reaches from it, and even white
  double white = 0.0;
  bool border = false;  ///< of the square itself; not what tells it from another
  double length() const { return (b - a).norm(); }
};

/// The edges of a layer-1 marker's cells and of its children's lines and cells.
std::vector<TemplateEdge> edge_template(const InkMap& ink, const MarkerSet& markers,
                                        int parent_index);

}  // namespace harco::detect
