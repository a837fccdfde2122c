// What a page shows, in millimetres from its top-left corner, x right, y down, painted in order.
// SVG and PDF are written from the same list.
#pragma once

#include <array>
#include <string>
#include <variant>
#include <vector>

#include <Eigen/Core>

#include "draw/outline.hpp"

namespace harco {

/// Red, green, blue: 0 … 1.
struct Color {
  double r = 0.0, g = 0.0, b = 0.0;
};
inline constexpr Color kBlack{0.0, 0.0, 0.0};
inline constexpr Color kGrey{0.45, 0.45, 0.45};
inline constexpr Color kWhite{1.0, 1.0, 1.0};

/// Filled polygons.
struct Fill {
  std::vector<Loop> loops;
  Color color = kBlack;
};

using Segment = std::array<Eigen::Vector2d, 2>;

/// Straight lines of one width.
struct Strokes {
  std::vector<Segment> segments;
  double width = 0.0;
  Color color = kBlack;
};

/// A circle's rim.
struct Ring {
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();
  double radius = 0.0;
  double width = 0.0;
  Color color = kBlack;
};

enum class Anchor { start, middle, end };

/// One line of text in Helvetica, or what stands in for it.
struct Text {
  Eigen::Vector2d at = Eigen::Vector2d::Zero();  ///< on the base line; what of the text: `anchor`
  double size = 0.0;                             ///< of the font, in millimetres
  std::string text;                              ///< UTF-8
  Anchor anchor = Anchor::start;
  bool bold = false;
  bool upwards = false;  ///< turned to be read from bottom to top
  Color color = kBlack;
};

using Shape = std::variant<Fill, Strokes, Ring, Text>;
using DisplayList = std::vector<Shape>;

}  // namespace harco
