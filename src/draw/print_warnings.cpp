#include <algorithm>
#include <cstdlib>
#include <string>

#include "draw/text.hpp"
#include "harco/draw.hpp"

namespace harco {
namespace {

bool share_edge(int a, int b, int cells) {
  return std::abs(a / cells - b / cells) + std::abs(a % cells - b % cells) == 1;
}

bool children_share_edge(const Marker& marker) {
  for (const Marker& a : marker.children) {
    if (children_share_edge(a)) return true;
    for (const Marker& b : marker.children)
      if (share_edge(a.cell, b.cell, marker.code.cells)) return true;
  }
  return false;
}

}  // namespace

std::vector<std::string> print_warnings(const MarkerSet& markers) {
  std::vector<std::string> warnings;
  double thinnest = kThinnestPrintedLine_m;
  for (const PlacedMarker& marker : place(markers))
    if (marker.layer > 1)
      thinnest = std::min(thinnest, marker.side_m * (markers.line.inside + markers.line.outside));
  if (thinnest < kThinnestPrintedLine_m)
    warnings.push_back("the thinnest lines are " + number(thinnest * 1e3, 3) +
                       " mm wide, which many printers don't draw well (less than " +
                       number(kThinnestPrintedLine_m * 1e3) +
                       " mm): take a larger side or fewer layers");
  if (std::any_of(markers.parents.begin(), markers.parents.end(),
                  [](const Parent& parent) { return children_share_edge(parent.marker); }))
    warnings.emplace_back(
        "children share an edge, so the line of each runs into the other or is shared: they are "
        "found less well than children that touch at corners only");
  return warnings;
}

}  // namespace harco
