// Straight parts of outlines: what is left of a square's sides when something covers the rest.
#pragma once

#include <vector>

#include "detect/contours.hpp"
#include "harco/image.hpp"

namespace harco::detect {

/// A straight stretch of an outline. Walking from `a` to `b`, the dark lies on the right-hand side
/// as seen on the screen.
struct Segment {
  Point a, b;
  double length() const { return (b - a).norm(); }
  Point direction() const { return (b - a).normalized(); }
};

/// Appends the straight stretches of a contour that are at least `least_px` long, in its order.
void append_segments(const Contour& contour, double least_px, std::vector<Segment>& segments);

/// Whether the image is darker on the right-hand side of most of a segment, by `contrast` grey
/// levels or more. Where there is none, a threshold map has outlines of its own making.
bool parts_dark_from_bright(const ImageView& image, const Segment& segment, double contrast);

}  // namespace harco::detect
