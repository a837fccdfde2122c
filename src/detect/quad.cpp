#include "detect/quad.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace harco::detect {
namespace {

double cross(const Point& a, const Point& b) { return a.x() * b.y() - a.y() * b.x(); }

/// A stretch of a closed contour from one vertex to the next, and its point farthest from the
/// chord.
struct Stretch {
  std::size_t from, to;  // `to` may lie behind the end: indices count on around the contour
  std::size_t farthest = 0;
  double deviation = 0.0;
};

/// Points of a closed contour; indices count on around it once.
const Point& at(const std::vector<Point>& points, std::size_t i) {
  return points[i < points.size() ? i : i - points.size()];
}

Stretch measure(const std::vector<Point>& points, std::size_t from, std::size_t to) {
  Stretch stretch{from, to};
  const Point a = at(points, from);
  const Point chord = at(points, to) - a;
  const double length = chord.norm();
  const bool closed = length <= 1e-9;
  double most = 0.0;
  for (std::size_t i = from + 1; i < to; ++i) {
    const Point offset = at(points, i) - a;
    const double away = closed ? offset.norm() : std::abs(cross(chord, offset));
    if (away > most) {
      most = away;
      stretch.farthest = i;
    }
  }
  stretch.deviation = closed ? most : most / length;
  return stretch;
}

std::size_t farthest_from(const std::vector<Point>& points, const Point& from) {
  std::size_t best = 0;
  double most = -1.0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double squared = (points[i] - from).squaredNorm();
    if (squared > most) {
      most = squared;
      best = i;
    }
  }
  return best;
}

struct Line {
  Point point;
  Point direction;
  double rms;
};

/// Total least squares through the inner part of a stretch.
std::optional<Line> fit_line(const std::vector<Point>& points, std::size_t from, std::size_t to) {
  const std::size_t steps = to - from;
  const std::size_t skip = steps / 10 + 1;
  if (steps < 2 * skip + 3) return std::nullopt;
  Point mean = Point::Zero();
  double count = 0.0;
  for (std::size_t i = from + skip; i <= to - skip; ++i, count += 1.0) mean += at(points, i);
  mean /= count;
  double xx = 0.0;
  double xy = 0.0;
  double yy = 0.0;
  for (std::size_t i = from + skip; i <= to - skip; ++i) {
    const Point d = at(points, i) - mean;
    xx += d.x() * d.x();
    xy += d.x() * d.y();
    yy += d.y() * d.y();
  }
  // Half the angle of (more, both), by the longer of two vectors in that direction.
  const double more = xx - yy;
  const double both = 2.0 * xy;
  const double length = std::sqrt(more * more + both * both);
  const Point way = more > 0.0 ? Point(more + length, both) : Point(both, length - more);
  if (!(way.squaredNorm() > 0.0)) return std::nullopt;
  const double across = std::max(0.0, 0.5 * (xx + yy - length));
  return Line{mean, way.normalized(), std::sqrt(across / count)};
}

/// Vertices that follow a contour most closely with four corners, as indices in rising order.
std::optional<std::array<std::size_t, 4>> find_vertices(const std::vector<Point>& points) {
  const std::size_t n = points.size();
  Point mean = Point::Zero();
  for (const Point& point : points) mean += point;
  mean /= static_cast<double>(n);
  const std::size_t first = farthest_from(points, mean);
  std::size_t second = farthest_from(points, points[first]);
  if (second < first) second += n;
  if (second == first) return std::nullopt;

  std::array<Stretch, 4> stretches{measure(points, first, second),
                                   measure(points, second, first + n)};
  for (std::size_t count = 2; count < 4; ++count) {
    const auto worst = std::max_element(
        stretches.begin(), stretches.begin() + static_cast<std::ptrdiff_t>(count),
        [](const Stretch& a, const Stretch& b) { return a.deviation < b.deviation; });
    if (worst->deviation < 1.0) return std::nullopt;
    const Stretch split = *worst;
    *worst = measure(points, split.from, split.farthest);
    stretches[count] = measure(points, split.farthest, split.to);
  }
  std::array<std::size_t, 4> vertices{};
  for (std::size_t i = 0; i < 4; ++i) vertices[i] = stretches[i].from % n;
  std::sort(vertices.begin(), vertices.end());
  return vertices;
}

}  // namespace

double area(const Quad& quad) { return 0.5 * cross(quad[2] - quad[0], quad[3] - quad[1]); }

double shortest_side(const Quad& quad) {
  double shortest = std::numeric_limits<double>::max();
  for (std::size_t i = 0; i < 4; ++i)
    shortest = std::min(shortest, (quad[(i + 1) % 4] - quad[i]).norm());
  return shortest;
}

double mean_side(const Quad& quad) {
  double sum = 0.0;
  for (std::size_t i = 0; i < 4; ++i) sum += (quad[(i + 1) % 4] - quad[i]).norm();
  return sum / 4.0;
}

Point centre(const Quad& quad) {
  return intersection(quad[0], quad[2], quad[1], quad[3])
      .value_or((quad[0] + quad[1] + quad[2] + quad[3]) / 4.0);
}

bool convex(const Quad& quad) {
  for (std::size_t i = 0; i < 4; ++i) {
    const Point a = quad[(i + 1) % 4] - quad[i];
    const Point b = quad[(i + 2) % 4] - quad[(i + 1) % 4];
    // Corners of less than 10 degrees are no square's, however steep.
    if (cross(a, b) <= 0.17 * a.norm() * b.norm()) return false;
  }
  return true;
}

bool contains(const Quad& quad, const Point& point) {
  for (std::size_t i = 0; i < 4; ++i) {
    const Point side = quad[(i + 1) % 4] - quad[i];
    const Point offset = point - quad[i];
    if (side.x() * offset.y() - side.y() * offset.x() < 0.0) return false;
  }
  return true;
}

bool nearly_same(const Quad& a, const Quad& b, double share) {
  const double most = share * mean_side(a);
  for (std::size_t first = 0; first < 4; ++first) {
    bool same = true;
    for (std::size_t i = 0; i < 4 && same; ++i)
      same = (a[i] - b[(first + i) % 4]).squaredNorm() < most * most;
    if (same) return true;
  }
  return false;
}

std::vector<Quad> different(const std::vector<Quad>& quads, double share) {
  std::vector<Quad> kept;
  for (const Quad& quad : quads)
    if (std::none_of(kept.begin(), kept.end(),
                     [&](const Quad& one) { return nearly_same(one, quad, share); }))
      kept.push_back(quad);
  return kept;
}

std::optional<Point> intersection(const Point& a, const Point& b, const Point& c, const Point& d) {
  const Point u = b - a;
  const Point v = d - c;
  const double turn = cross(u, v);
  if (std::abs(turn) < 1e-9 * u.norm() * v.norm()) return std::nullopt;
  return a + u * (cross(c - a, v) / turn);
}

std::optional<Quad> fit_quad(const Contour& contour) {
  const std::vector<Point>& points = contour.points;
  const auto vertices = find_vertices(points);
  if (!vertices) return std::nullopt;
  const std::size_t n = points.size();

  std::array<Line, 4> lines;
  for (std::size_t i = 0; i < 4; ++i) {
    const std::size_t from = (*vertices)[i];
    const std::size_t to = i == 3 ? (*vertices)[0] + n : (*vertices)[i + 1];
    const Stretch stretch = measure(points, from, to);
    const double chord = (at(points, to) - points[from]).norm();
    // Lenses bend long sides, noise ruffles short ones.
    if (stretch.deviation > 1.2 + 0.04 * chord) return std::nullopt;
    const auto line = fit_line(points, from, to);
    if (!line || line->rms > 0.45 + 0.012 * chord) return std::nullopt;
    lines[i] = *line;
  }
  Quad quad;
  for (std::size_t i = 0; i < 4; ++i) {
    const Line& before = lines[(i + 3) % 4];
    const auto corner = intersection(before.point, before.point + before.direction, lines[i].point,
                                     lines[i].point + lines[i].direction);
    const Point vertex = points[(*vertices)[i]];
    if (!corner) return std::nullopt;
    const double side = (points[(*vertices)[(i + 1) % 4]] - vertex).norm();
    if ((*corner - vertex).norm() > 2.0 + 0.1 * side) return std::nullopt;
    quad[i] = *corner;
  }
  if (contour.hole) std::swap(quad[1], quad[3]);  // holes run the other way round
  if (!convex(quad)) return std::nullopt;
  const double fitted = area(quad);
  if (std::abs(fitted - contour.area) > 0.15 * fitted) return std::nullopt;
  return quad;
}

}  // namespace harco::detect
