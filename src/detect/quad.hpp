// Quadrilaterals in the image.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include <Eigen/Core>

namespace harco::detect {

using Point = Eigen::Vector2d;  ///< pixels

/// Four corners, clockwise on the screen.
using Quad = std::array<Point, 4>;

double area(const Quad& quad);
double shortest_side(const Quad& quad);
double mean_side(const Quad& quad);
Point centre(const Quad& quad);
bool convex(const Quad& quad);
bool contains(const Quad& quad, const Point& point);

/// Whether no corner of `b` lies farther from one of `a`, in order but from wherever it begins,
/// than `share` of the side of `a`.
bool nearly_same(const Quad& a, const Quad& b, double share);

/// The quads without those that are nearly the same as an earlier one.
std::vector<Quad> different(const std::vector<Quad>& quads, double share);

/// Where the line through a, b meets the one through c, d; empty if they are parallel.
std::optional<Point> intersection(const Point& a, const Point& b, const Point& c, const Point& d);

}  // namespace harco::detect
