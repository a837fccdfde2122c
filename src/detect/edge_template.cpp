#include "detect/edge_template.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace harco::detect {
namespace {

using Eigen::Vector2d;

/// Collects edges; all lengths are shares of the parent's side.
class Collector {
 public:
  Collector(const InkMap& ink, double farthest)
      : ink_(ink), side_(ink.plan().square.width()), farthest_(farthest) {}

  /// A piece of a grid line from `a` to `b` along x or y; kept if it parts black from white.
  void try_piece(const Vector2d& a, const Vector2d& b, bool border) {
    const bool along_x = std::abs(b.x() - a.x()) > std::abs(b.y() - a.y());
    const Vector2d normal = along_x ? Vector2d(0.0, 1.0) : Vector2d(1.0, 0.0);
    const double thin = 0.004 * farthest_;
    const double after = whiteness(a, b, normal, thin);
    const double before = whiteness(a, b, -normal, thin);
    const bool white_after = after > 0.99 && before < 0.01;
    const bool white_before = before > 0.99 && after < 0.01;
    if (!white_after && !white_before) return;
    TemplateEdge edge;
    edge.a = a;
    edge.b = b;
    edge.to_white = white_after ? normal : Vector2d(-normal);
    edge.border = border;
    edge.white = reach(a, b, edge.to_white, true);
    edge.black = reach(a, b, -edge.to_white, false);
    edges.push_back(edge);
  }

  std::vector<TemplateEdge> edges;

 private:
  /// Mean whiteness of the strip from the piece to `width` beside it.
  double whiteness(const Vector2d& a, const Vector2d& b, const Vector2d& normal,
                   double width) const {
    const Vector2d way = b - a;
    const Vector2d p = a + 0.1 * way;
    const Vector2d q = b - 0.1 * way + width * normal;
    const Vector2d low = p.cwiseMin(q) * side_;
    const Vector2d high = p.cwiseMax(q) * side_;
    return ink_.white_share({low.x(), low.y(), high.x(), high.y()});
  }

  /// How far the strip beside the piece stays of one colour, by halving.
  double reach(const Vector2d& a, const Vector2d& b, const Vector2d& normal, bool white) const {
    const auto even = [&](double width) {
      const double share = whiteness(a, b, normal, width);
      return (white ? 1.0 - share : share) * width < 1e-3 * farthest_;
    };
    if (even(farthest_)) return farthest_;
    double low = 0.0;
    double high = farthest_;
    for (int i = 0; i < 6; ++i) {
      const double middle = 0.5 * (low + high);
      (even(middle) ? low : high) = middle;
    }
    return low;
  }

  const InkMap& ink_;
  double side_;
  double farthest_;
};

}  // namespace

std::vector<TemplateEdge> edge_template(const InkMap& ink, const MarkerSet& markers,
                                        int parent_index) {
  const Parent& root = markers.parents[static_cast<std::size_t>(parent_index)];
  MarkerSet single;
  single.parents = {root};
  const int m = root.marker.code.cells + 2;
  Collector collector(ink, 1.0 / m);
  // The lines from `first` to `last` of a square's grid of k x k cells.
  const auto grid = [&](const Vector2d& origin, double square, int k, int first, int last) {
    const double c = square / k;
    for (int line = first; line <= last; ++line)
      for (int piece = 0; piece < k; ++piece) {
        const bool border = square == 1.0 && (line == 0 || line == k);
        collector.try_piece(origin + Vector2d(piece * c, line * c),
                            origin + Vector2d((piece + 1) * c, line * c), border);
        collector.try_piece(origin + Vector2d(line * c, piece * c),
                            origin + Vector2d(line * c, (piece + 1) * c), border);
      }
  };
  const auto outline = [&](const Vector2d& origin, double square) {
    grid(origin, square, 1, 0, 1);
  };
  grid(Vector2d::Zero(), 1.0, m, 0, m);
  for (const PlacedMarker& child : place(single)) {
    if (child.layer != 2) continue;
    const Vector2d origin = child.origin_m / root.side_m;
    const double square = child.side_m / root.side_m;
    const int k = child.code.cells + 2;
    grid(origin, square, k, 1, k - 1);
    // Where the line begins and ends; on the square itself the parent's own grid has it.
    const double inside = markers.line.inside * square;
    const double outside = markers.line.outside * square;
    if (inside > 0.0) outline(origin + Vector2d::Constant(inside), square - 2.0 * inside);
    if (outside > 0.0) outline(origin - Vector2d::Constant(outside), square + 2.0 * outside);
  }
  return std::move(collector.edges);
}

}  // namespace harco::detect
