#include <algorithm>
#include <cstdlib>
#include <string>

#include "draw/text.hpp"
#include "harco/draw.hpp"

namespace harco {
namespace {

/// Whether two children of one marker have a piece of a side in common.
bool share_edge(const PlacedMarker& a, const PlacedMarker& b) {
  if (a.container != b.container || a.parent_index != b.parent_index) return false;
  const double rounding = 1e-6 * std::min(a.side_m, b.side_m);
  const Eigen::Vector2d apart =
      ((a.origin_m - b.origin_m) + 0.5 * Eigen::Vector2d::Constant(a.side_m - b.side_m))
          .cwiseAbs() -
      0.5 * Eigen::Vector2d::Constant(a.side_m + b.side_m);
  return std::abs(apart.maxCoeff()) < rounding && apart.minCoeff() < -rounding;
}

bool children_share_edge(const std::vector<PlacedMarker>& placed) {
  for (std::size_t i = 0; i < placed.size(); ++i)
    for (std::size_t j = 0; j < i; ++j)
      if (placed[i].layer > 1 && share_edge(placed[i], placed[j])) return true;
  return false;
}

}  // namespace

std::vector<std::string> print_warnings(const MarkerSet& markers) {
  std::vector<std::string> warnings;
  double thinnest = kThinnestPrintedLine_m;
  const std::vector<PlacedMarker> placed = place(markers);
  for (const PlacedMarker& marker : placed)
    if (marker.layer > 1)
      thinnest = std::min(thinnest, marker.side_m * (markers.line.inside + markers.line.outside));
  if (thinnest < kThinnestPrintedLine_m)
    warnings.push_back("the thinnest lines are " + number(thinnest * 1e3, 3) +
                       " mm wide, which many printers don't draw well (less than " +
                       number(kThinnestPrintedLine_m * 1e3) +
                       " mm): take a larger side or fewer layers");
  if (children_share_edge(placed))
    warnings.emplace_back(
        "children share an edge, so the line of each runs into the other or is shared: they are "
        "found less well than children that touch at corners only");
  return warnings;
}

}  // namespace harco
