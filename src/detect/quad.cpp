#include "detect/quad.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace harco::detect {
namespace {

double cross(const Point& a, const Point& b) { return a.x() * b.y() - a.y() * b.x(); }

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

}  // namespace harco::detect
