// From how near to how far a camera sees some marker of a sheet whole, wherever beside the centre
// it looks.
#pragma once

#include "harco/marker.hpp"

namespace harco {

/// A pinhole that looks straight at the sheet, turned about its axis in any way, and what it takes
/// to find a marker in its image.
struct ViewOptions {
  int width_px = 0;         ///< of the image
  int height_px = 0;        ///< of the image
  double focal_px = 0.0;    ///< focal length, px
  double parent_px = 14.0;  ///< least side of a parent that is found, px
  double child_px = 16.0;   ///< of a child

  /// A marker, with its line, has to lie in this share of the image's width and height, (0, 1].
  double usable_share = 0.9;

  /// The camera aims at points of the sheet up to this share of the parent's side beside its
  /// centre, along both axes; 0 … 0.5.
  double aim = 0.35;
};

/// Distances from the sheet, metres.
struct DistanceRange {
  double nearest_m = 0.0;
  double farthest_m = 0.0;
};

/// From where the first parent looks too small, the range towards the sheet in which every view
/// shows some marker of it whole and large enough: nearest_m is at most 2 % above the least such
/// distance, never below. Codes are of no matter: a layout will do. Branch and bound over aim
/// points and turns of the camera: as one moves or turns, a marker's distance from the image's
/// border changes no faster than it lies away. Throws std::invalid_argument for values out of
/// range, or a parent that is too small before it fits into the image.
DistanceRange range_in_view(const MarkerSet& markers, const ViewOptions& view);

}  // namespace harco
