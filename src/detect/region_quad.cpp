#include "detect/region_quad.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <span>

namespace harco::detect {
namespace {

// Of a longer border every second, third ... step is measured: sides are fitted again, to the grey
// across them, once the quad is known.
constexpr int kMostPoints = 96;

double cross(const Point& a, const Point& b) { return a.x() * b.y() - a.y() * b.x(); }

struct Line {
  Point point;
  Point direction;
};

/// Total least squares through the inner part of a side; empty if some of it keeps away from the
/// line.
std::optional<Line> fit_line(std::span<const Point> points) {
  const std::size_t skip = points.size() / 10 + 1;
  if (points.size() < 2 * skip + 3) return std::nullopt;
  const double length = (points.back() - points.front()).norm();
  points = points.subspan(skip, points.size() - 2 * skip);
  const auto count = static_cast<double>(points.size());
  // From the first one on: squares of what is far from there would be too large.
  const Point first = points.front();
  Point sum = Point::Zero();
  double xx = 0.0;
  double xy = 0.0;
  double yy = 0.0;
  for (const Point& point : points) {
    const Point d = point - first;
    sum += d;
    xx += d.x() * d.x();
    xy += d.x() * d.y();
    yy += d.y() * d.y();
  }
  const Point mean = sum / count;
  xx -= mean.x() * sum.x();
  xy -= mean.x() * sum.y();
  yy -= mean.y() * sum.y();
  // Half the angle of (more, both), by the longer of two vectors in that direction.
  const double more = xx - yy;
  const double both = 2.0 * xy;
  const double spread = std::sqrt(more * more + both * both);
  const Point way = more > 0.0 ? Point(more + spread, both) : Point(both, spread - more);
  if (!(way.squaredNorm() > 0.0)) return std::nullopt;
  // Lenses bend long sides, noise ruffles short ones.
  const double across = std::max(0.0, 0.5 * (xx + yy - spread));
  const double most = 0.45 + 0.012 * length;
  if (across > count * most * most) return std::nullopt;
  const Line line{first + mean, way.normalized()};
  const double farthest = 1.2 + 0.04 * length;
  for (const Point& point : points)
    if (std::abs(cross(line.direction, point - line.point)) > farthest) return std::nullopt;
  return line;
}

}  // namespace

/// The ends of a region's rows, clockwise: on the right downwards, on the left upwards.
class RegionQuad::Ends {
 public:
  explicit Ends(const Region& region) : region_(region) {}

  int next(int end) const { return end + 1 < 2 * region_.rows ? end + 1 : 0; }
  bool on_right(int end) const { return end < region_.rows; }
  int x(int end) const { return on_right(end) ? region_.right[end] : region_.left[row(end)]; }
  int y(int end) const { return region_.y + row(end) * region_.row_step; }

  /// The one at a corner of the outline, which is one of a row.
  int at(const kernels::OutlineCorner& corner) const {
    for (const int y : {corner.y, corner.y - 1}) {
      const int row = y / region_.row_step;
      if (y < 0 || y % region_.row_step != 0 || row >= region_.rows) continue;
      if (region_.right[row] + 1 == corner.x) return row;
      if (region_.left[row] == corner.x) return 2 * region_.rows - 1 - row;
    }
    return 0;
  }

 private:
  int row(int end) const { return on_right(end) ? end : 2 * region_.rows - 1 - end; }
  const Region& region_;
};

void RegionQuad::start(const Threshold& threshold, std::size_t level) {
  threshold_ = &threshold;
  map_ = &threshold.map(level);
  level_ = level;
  dark_ = Threshold::kLevels[level].dark;
}

/// The row up to which a column of the region's pixels goes on outwards from a row: there are rows
/// that weren't looked at, and bumps of a row or two.
inline int RegionQuad::outermost(int x, int y, int out) const {
  constexpr int kMost = 3;
  const int end = y + kMost * out;
  while (y != end && y + out > 0 && y + out < map_->height() && map_->dark(x, y + out) == dark_)
    y += out;
  return y;
}

/// Where the grey passes the threshold between a pixel of the region and the one beside it. False
/// if they aren't on both sides of it.
inline bool RegionQuad::measure(int x, int y, int out_x, int out_y) {
  const int inside = threshold_->distance_inside(level_, x, y);
  const int outside = threshold_->distance(level_, x + out_x, y + out_y);
  if ((inside < 0) == (outside < 0)) return false;
  const double share = static_cast<double>(inside) / static_cast<double>(inside - outside);
  border_.emplace_back(x + share * out_x, y + share * out_y);
  return true;
}

/// Reads one side along the edges of pixels, of which every so many are measured.
class RegionQuad::SideReader {
 public:
  SideReader(RegionQuad& quad, int row_step, int apart)
      : quad_(quad), row_step_(row_step), apart_(apart) {}

  /// Past the end of a row, beside which (out: 1 or -1) there is the other kind of pixels.
  void pass_end(int x, int y, int out) {
    if (due_ < row_step_) {
      count(quad_.measure(x, y, out, 0));
      due_ += std::max(apart_, row_step_);
    }
    due_ -= row_step_;
  }

  /// Along pixels of a row, from one column to before another, above (-1) or below (1) which there
  /// is the other kind.
  void go_along(int from, int to, int y, int out) {
    const int steps = std::abs(to - from);
    const int ahead = to > from ? 1 : -1;
    for (; due_ < steps; due_ += apart_) {
      const int x = from + ahead * due_;
      count(quad_.measure(x, quad_.outermost(x, y, out), 0, out));
    }
    due_ -= steps;
  }

  /// Most of what was looked at is part of the border.
  bool is_good() const { return 2 * missed_ <= all_; }

 private:
  void count(bool seen) {
    ++all_;
    missed_ += seen ? 0 : 1;
  }

  RegionQuad& quad_;
  int row_step_;
  int apart_;
  int due_ = 0;  // so many steps ahead
  int all_ = 0;
  int missed_ = 0;
};

/// From one corner of the outline to the next. False if there are bays.
bool RegionQuad::read_side(const Region& region, std::size_t side) {
  const Ends ends(region);
  const int from = ends.at(region.corners[side]);
  const int to = ends.at(region.corners[(side + 1) % 4]);
  const int apart = (2 * (region.height() + region.columns) + kMostPoints - 1) / kMostPoints;
  SideReader reader(*this, region.row_step, apart);
  for (int end = from, next = 0; end != to; end = next) {
    next = ends.next(end);
    const int x = ends.x(end);
    const int y = ends.y(end);
    const int next_x = ends.x(next);
    const int next_y = ends.y(next);
    reader.pass_end(x, y, ends.on_right(end) ? 1 : -1);
    if (ends.on_right(end) && ends.on_right(next)) {
      if (next_x > x)
        reader.go_along(x + 1, next_x + 1, next_y, -1);
      else
        reader.go_along(x, next_x, y, 1);
    } else if (ends.on_right(end)) {
      reader.go_along(x, next_x - 1, y, 1);
    } else if (ends.on_right(next)) {
      reader.go_along(x, next_x + 1, y, -1);
    } else {
      if (next_x > x)
        reader.go_along(x, next_x, y, -1);
      else
        reader.go_along(x - 1, next_x - 1, next_y, 1);
    }
  }
  return reader.is_good();
}

const std::vector<Point>& RegionQuad::border_of(const Region& region) {
  border_.clear();
  for (std::size_t side = 0; side < 4; ++side) read_side(region, side);
  return border_;
}

std::optional<Quad> RegionQuad::fit(const Region& region, double least_area) {
  border_.clear();
  std::array<Line, 4> lines;
  for (std::size_t i = 0; i < 4; ++i) {
    const std::size_t first = border_.size();
    if (!read_side(region, i)) return std::nullopt;
    const auto line = fit_line(std::span(border_).subspan(first));
    if (!line) return std::nullopt;
    lines[i] = *line;
  }
  Quad quad;
  for (std::size_t i = 0; i < 4; ++i) {
    const Line& before = lines[(i + 3) % 4];
    const auto corner = intersection(before.point, before.point + before.direction, lines[i].point,
                                     lines[i].point + lines[i].direction);
    if (!corner) return std::nullopt;
    quad[i] = *corner;
  }
  if (!convex(quad)) return std::nullopt;
  for (std::size_t i = 0; i < 4; ++i) {
    const Point vertex(region.corners[i].x - 0.5, region.y + region.corners[i].y - 0.5);
    const double side = (quad[(i + 1) % 4] - quad[i]).norm();
    if ((quad[i] - vertex).norm() > 2.0 + 0.1 * side) return std::nullopt;
  }
  double twice = 0.0;
  const Point* before = &border_.back();
  for (const Point& point : border_) {
    twice += cross(*before, point);
    before = &point;
  }
  const double fitted = area(quad);
  const double seen = 0.5 * twice;
  if (seen < least_area || std::abs(fitted - seen) > 0.15 * fitted) return std::nullopt;
  return quad;
}

}  // namespace harco::detect
