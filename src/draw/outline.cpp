#include "draw/outline.hpp"

#include <algorithm>
#include <cstdint>

namespace harco {
namespace {

// Edges nearer to each other than this share of the side are the same edge, apart by rounding.
constexpr double kSameEdge = 1e-9;

/// Coordinates at which any edge lies, ascending.
class Axis {
 public:
  Axis(std::vector<double> edges, double tolerance) : tolerance_(tolerance) {
    std::sort(edges.begin(), edges.end());
    for (const double edge : edges)
      if (values_.empty() || edge - values_.back() > tolerance_) values_.push_back(edge);
  }

  int cells() const { return static_cast<int>(values_.size()) - 1; }
  double operator[](int index) const { return values_[static_cast<std::size_t>(index)]; }
  int index(double edge) const {
    return static_cast<int>(std::lower_bound(values_.begin(), values_.end(), edge - tolerance_) -
                            values_.begin());
  }

 private:
  double tolerance_;
  std::vector<double> values_;
};

enum Direction { kEast, kSouth, kWest, kNorth };

Direction turned(Direction direction, int quarters) {
  return static_cast<Direction>((direction + quarters + 4) % 4);
}

/// The picture on the grid of all its edges.
class Mosaic {
 public:
  explicit Mosaic(const InkPlan& plan)
      : x_(edges(plan, &Rect::x0, &Rect::x1), kSameEdge * plan.square.width()),
        y_(edges(plan, &Rect::y0, &Rect::y1), kSameEdge * plan.square.width()),
        black_(cell_count()),
        traced_(cell_count()) {
    paint(plan.square, true);
    for (const Rect& white : plan.white) paint(white, false);
    for (const Rect& black : plan.black) paint(black, true);
  }

  std::vector<Loop> trace() {
    std::vector<Loop> loops;
    // Every loop has a piece that leads east, along the top of a black cell.
    for (int row = 0; row < y_.cells(); ++row)
      for (int column = 0; column < x_.cells(); ++column)
        if (leads(column, row, kEast) && !traced_[at(column, row)])
          loops.push_back(trace_from(column, row));
    return loops;
  }

 private:
  static std::vector<double> edges(const InkPlan& plan, double Rect::*low, double Rect::*high) {
    std::vector<double> all{plan.square.*low, plan.square.*high};
    for (const auto* coat : {&plan.white, &plan.black})
      for (const Rect& rect : *coat) all.insert(all.end(), {rect.*low, rect.*high});
    return all;
  }

  std::size_t cell_count() const {
    return static_cast<std::size_t>(x_.cells()) * static_cast<std::size_t>(y_.cells());
  }

  std::size_t at(int column, int row) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(x_.cells()) +
           static_cast<std::size_t>(column);
  }

  void paint(const Rect& rect, bool black) {
    const int left = x_.index(rect.x0);
    const int width = x_.index(rect.x1) - left;
    for (int row = y_.index(rect.y0); row < y_.index(rect.y1); ++row)
      std::fill_n(black_.begin() + static_cast<std::ptrdiff_t>(at(left, row)), width, black);
  }

  bool black(int column, int row) const {
    return column >= 0 && row >= 0 && column < x_.cells() && row < y_.cells() &&
           black_[at(column, row)] != 0;
  }

  /// Whether the border leads from the top-left corner of cell (column, row) in this direction.
  bool leads(int column, int row, Direction direction) const {
    switch (direction) {
      case kEast:
        return black(column, row) && !black(column, row - 1);
      case kSouth:
        return black(column - 1, row) && !black(column, row);
      case kWest:
        return black(column - 1, row - 1) && !black(column - 1, row);
      case kNorth:
        return black(column, row - 1) && !black(column - 1, row - 1);
    }
    return false;
  }

  Loop trace_from(int first_column, int first_row) {
    Loop loop;
    int column = first_column;
    int row = first_row;
    Direction direction = kEast;
    do {
      if (direction == kEast) traced_[at(column, row)] = true;
      column += direction == kEast ? 1 : direction == kWest ? -1 : 0;
      row += direction == kSouth ? 1 : direction == kNorth ? -1 : 0;
      // To the right first: around the black cell, not across to one that touches its corner.
      for (const int quarters : {1, 0, -1}) {
        const Direction next = turned(direction, quarters);
        if (!leads(column, row, next)) continue;
        if (quarters != 0) loop.emplace_back(x_[column], y_[row]);
        direction = next;
        break;
      }
    } while (column != first_column || row != first_row || direction != kEast);
    return loop;
  }

  Axis x_;
  Axis y_;
  std::vector<std::uint8_t> black_;
  std::vector<std::uint8_t> traced_;  ///< cells along whose top a loop has gone
};

}  // namespace

std::vector<Loop> black_outline(const InkPlan& plan) { return Mosaic(plan).trace(); }

}  // namespace harco
