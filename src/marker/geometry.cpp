#include "harco/geometry.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <string>

namespace harco {
namespace {

// Rectangles thinner than this share of the parent's side are rounding, not ink.
constexpr double kNothing = 1e-9;
// Bins along a side, for finding what lies near a rectangle.
constexpr int kBins = 64;

Rect intersection(const Rect& a, const Rect& b) {
  return {std::max(a.x0, b.x0), std::max(a.y0, b.y0), std::min(a.x1, b.x1), std::min(a.y1, b.y1)};
}

bool has_area(const Rect& r, double epsilon) { return r.width() > epsilon && r.height() > epsilon; }

Rect square_of(const PlacedMarker& marker) {
  return {marker.origin_m.x(), marker.origin_m.y(), marker.origin_m.x() + marker.side_m,
          marker.origin_m.y() + marker.side_m};
}

Rect grown(const Rect& r, double by) { return {r.x0 - by, r.y0 - by, r.x1 + by, r.y1 + by}; }

/// Cell (row, column) of the whole (n+2) x (n+2) grid.
Rect cell_rect(const PlacedMarker& marker, int row, int column) {
  const double c = marker.cell_side_m();
  const double x = marker.origin_m.x() + column * c;
  const double y = marker.origin_m.y() + row * c;
  return {x, y, x + c, y + c};
}

struct BinRange {
  int x0, y0, x1, y1;
};

BinRange bins_of(const Rect& r, double side) {
  const auto bin = [&](double v) {
    return static_cast<int>(std::clamp(std::floor(v / side * kBins), 0.0, kBins - 1.0));
  };
  return {bin(r.x0), bin(r.y0), bin(r.x1), bin(r.y1)};
}

template <typename Visit>
void for_each_bin(const Rect& r, double side, Visit visit) {
  const BinRange range = bins_of(r, side);
  for (int y = range.y0; y <= range.y1; ++y)
    for (int x = range.x0; x <= range.x1; ++x) visit(static_cast<std::size_t>(y * kBins + x));
}

/// What of disjoint rectangles `hole` leaves, in up to four pieces each.
std::vector<Rect> without(const std::vector<Rect>& rects, const Rect& hole, double epsilon) {
  std::vector<Rect> rest;
  for (const Rect& from : rects) {
    const Rect common = intersection(from, hole);
    if (!has_area(common, epsilon)) {
      rest.push_back(from);
      continue;
    }
    for (const Rect& part :
         {Rect{from.x0, from.y0, from.x1, common.y0}, Rect{from.x0, common.y1, from.x1, from.y1},
          Rect{from.x0, common.y0, common.x0, common.y1},
          Rect{common.x1, common.y0, from.x1, common.y1}})
      if (has_area(part, epsilon)) rest.push_back(part);
  }
  return rest;
}

/// Gathers rectangles and keeps them disjoint: of a new one only the part counts that no earlier
/// one covers.
class Coat {
 public:
  explicit Coat(double side) : side_(side), bins_(kBins * kBins) {}

  void add(const Rect& rect) {
    std::vector<Rect> pieces{rect};
    std::vector<int> near;
    for_each_bin(rect, side_, [&](std::size_t bin) {
      near.insert(near.end(), bins_[bin].begin(), bins_[bin].end());
    });
    std::sort(near.begin(), near.end());
    near.erase(std::unique(near.begin(), near.end()), near.end());
    for (const int index : near) {
      pieces = without(pieces, rects_[static_cast<std::size_t>(index)], kNothing * side_);
    }
    for (const Rect& piece : pieces) keep(piece);
  }

  std::vector<Rect> take() { return std::move(rects_); }

 private:
  void keep(const Rect& rect) {
    const int index = static_cast<int>(rects_.size());
    rects_.push_back(rect);
    for_each_bin(rect, side_, [&](std::size_t bin) { bins_[bin].push_back(index); });
  }

  double side_;
  std::vector<Rect> rects_;
  std::vector<std::vector<int>> bins_;
};

std::vector<std::vector<int>> index_bins(const std::vector<Rect>& coat, double side) {
  std::vector<std::vector<int>> bins(kBins * kBins);
  for (std::size_t i = 0; i < coat.size(); ++i)
    for_each_bin(coat[i], side, [&](std::size_t bin) { bins[bin].push_back(static_cast<int>(i)); });
  return bins;
}

/// Whether `child` has a sibling that touches it at the corner that lies in the direction (dx, dy).
bool sibling_at_corner(const std::vector<PlacedMarker>& placed, const PlacedMarker& child, int dx,
                       int dy) {
  const double just_outside = 0.5 + 1e-3;
  const Eigen::Vector2d centre = child.origin_m + 0.5 * child.side_m * Eigen::Vector2d(1.0, 1.0);
  const Eigen::Vector2d point = centre + just_outside * child.side_m * Eigen::Vector2d(dx, dy);
  return std::any_of(placed.begin(), placed.end(), [&](const PlacedMarker& other) {
    const Rect square = square_of(other);
    return other.container == child.container && square.x0 < point.x() && point.x() < square.x1 &&
           square.y0 < point.y() && point.y() < square.y1;
  });
}

/// The line around a child, from `outside` without to `inside` within its square: four strips and
/// the outer corners. A corner is left out where a sibling's cell lies: a notch in its white ring
/// would spoil its outline, and the lines of both still meet in a point.
std::vector<Rect> line_pieces(const std::vector<PlacedMarker>& placed, const PlacedMarker& child,
                              const LineWidth& line) {
  const Rect square = square_of(child);
  const Rect outer = grown(square, line.outside * child.side_m);
  const Rect inner = grown(square, -line.inside * child.side_m);
  std::vector<Rect> pieces{{square.x0, outer.y0, square.x1, inner.y0},
                           {square.x0, inner.y1, square.x1, outer.y1},
                           {outer.x0, square.y0, inner.x0, square.y1},
                           {inner.x1, square.y0, outer.x1, square.y1}};
  for (const int dx : {-1, 1})
    for (const int dy : {-1, 1})
      if (!sibling_at_corner(placed, child, dx, dy))
        pieces.push_back({dx < 0 ? outer.x0 : square.x1, dy < 0 ? outer.y0 : square.y1,
                          dx < 0 ? square.x0 : outer.x1, dy < 0 ? square.y0 : outer.y1});
  return pieces;
}

/// The ink of a black cell: all of it but the squares of children that stand there.
std::vector<Rect> without_children(const std::vector<PlacedMarker>& placed, std::size_t container,
                                   int cell) {
  const PlacedMarker& marker = placed[container];
  const int n = marker.code.cells;
  std::vector<Rect> ink{cell_rect(marker, cell / n + 1, cell % n + 1)};
  for (const PlacedMarker& child : placed)
    if (child.container == static_cast<int>(container) && child.cell == cell)
      ink = without(ink, square_of(child), kNothing * placed.front().side_m);
  return ink;
}

std::vector<PlacedMarker> placed_of_parent(const MarkerSet& markers, int parent_index) {
  if (parent_index < 0 || parent_index >= static_cast<int>(markers.parents.size()))
    throw std::invalid_argument("ink_plan: there is no parent " + std::to_string(parent_index));
  MarkerSet single;
  single.parents = {markers.parents[static_cast<std::size_t>(parent_index)]};
  return place(single);
}

}  // namespace

InkPlan ink_plan(const MarkerSet& markers, int parent_index) {
  const std::vector<PlacedMarker> placed = placed_of_parent(markers, parent_index);
  const PlacedMarker& parent = placed.front();
  const double epsilon = kNothing * parent.side_m;

  InkPlan plan;
  plan.square = square_of(parent);
  const int n = parent.code.cells;
  for (int cell = 0; cell < n * n; ++cell)
    if (parent.code.white(cell))
      plan.white.push_back(cell_rect(parent, cell / n + 1, cell % n + 1));
  for (const PlacedMarker& child : placed)
    if (child.layer == 2 && !parent.code.white(child.cell)) plan.white.push_back(square_of(child));

  Coat black(parent.side_m);
  const auto add_on_white = [&](const Rect& ink) {
    // White cells and squares are disjoint, and so are the clipped pieces.
    for (const Rect& white : plan.white) {
      const Rect clipped = intersection(ink, white);
      if (has_area(clipped, epsilon)) black.add(clipped);
    }
  };
  for (std::size_t index = 1; index < placed.size(); ++index) {
    const PlacedMarker& child = placed[index];
    const int m = child.code.cells;
    for (int cell = 0; cell < m * m; ++cell)
      if (!child.code.white(cell))
        for (const Rect& ink : without_children(placed, index, cell)) add_on_white(ink);
    for (const Rect& piece : line_pieces(placed, child, markers.line))
      if (has_area(piece, epsilon)) add_on_white(piece);
  }
  plan.black = black.take();
  return plan;
}

InkMap::InkMap(const MarkerSet& markers, int parent_index)
    : plan_(ink_plan(markers, parent_index)),
      white_bins_(index_bins(plan_.white, plan_.square.width())),
      black_bins_(index_bins(plan_.black, plan_.square.width())) {}

double InkMap::covered(const std::vector<Rect>& coat, const std::vector<std::vector<int>>& bins,
                       const Rect& area) const {
  std::vector<int> near;
  for_each_bin(area, plan_.square.width(), [&](std::size_t bin) {
    near.insert(near.end(), bins[bin].begin(), bins[bin].end());
  });
  std::sort(near.begin(), near.end());
  near.erase(std::unique(near.begin(), near.end()), near.end());
  double sum = 0.0;
  for (const int index : near) {
    const Rect common = intersection(area, coat[static_cast<std::size_t>(index)]);
    if (common.width() > 0.0 && common.height() > 0.0) sum += common.area();
  }
  return sum;
}

double InkMap::white_share(const Rect& area) const {
  if (!(area.width() > 0.0 && area.height() > 0.0))
    throw std::invalid_argument("white_share: an empty rectangle has no share");
  const Rect inside = intersection(area, plan_.square);
  const double square = std::max(0.0, inside.width()) * std::max(0.0, inside.height());
  const double black =
      square - covered(plan_.white, white_bins_, area) + covered(plan_.black, black_bins_, area);
  return std::clamp(1.0 - black / area.area(), 0.0, 1.0);
}

std::vector<std::vector<double>> predicted_cells(const MarkerSet& markers) {
  std::vector<std::vector<double>> all;
  int parent_index = -1;
  std::optional<InkMap> map;
  for (const PlacedMarker& marker : place(markers)) {
    if (marker.parent_index != parent_index) {
      parent_index = marker.parent_index;
      map.emplace(markers, parent_index);
    }
    const int cells = marker.code.cells + 2;
    std::vector<double>& shares = all.emplace_back();
    shares.reserve(static_cast<std::size_t>(cells * cells));
    for (int row = 0; row < cells; ++row)
      for (int column = 0; column < cells; ++column)
        shares.push_back(map->white_share(cell_rect(marker, row, column)));
  }
  return all;
}

}  // namespace harco
