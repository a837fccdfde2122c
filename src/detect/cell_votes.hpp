// What the cells of a marker's children say for and against it: so small a pattern is hardly ever
// there by chance.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "detect/likeness.hpp"

namespace harco::detect {

/// A child's place within its marker, in texels.
struct CellSquare {
  Eigen::Vector2d origin;  ///< upper left corner
  double side = 0.0;
  int cells = 0;  ///< across, border ring included
};

/// Black cells speak, for a child is mostly white; and only those of which most neighbours look as
/// they should, for elsewhere something covers the child.
struct CellVotes {
  int predicted = 0;  ///< black cells that are large enough to be told from white ones
  int confirmed = 0;  ///< of them: those that are seen
  int wrong = 0;      ///< black ones seen where the marker has white ones
};

/// `picture` is as blurred as the image.
CellVotes cell_votes(const Texels& image, const Texels& picture,
                     const std::vector<CellSquare>& children);

}  // namespace harco::detect
