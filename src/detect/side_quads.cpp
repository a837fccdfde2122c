#include "detect/side_quads.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <utility>

#include <Eigen/Geometry>
#include <Eigen/LU>

namespace harco::detect {
namespace {

// Lines that take part; the search for quads grows with their fourth power at worst.
constexpr std::size_t kMostSegments = 400;
constexpr std::size_t kMostLines = 72;
// Segments are parts of one line if their directions differ by less than this (radians) and their
// ends lie no farther from it than this (pixels, and share of the distance).
constexpr double kSameDirection = 0.12;
constexpr double kSameLine = 1.0;
constexpr double kSameLineShare = 0.015;
// Squares whose corners lie no farther apart than this share of their side are one.
constexpr double kSameSquare = 0.02;
// Levels of one square's sides may differ by this share of the contrast.
constexpr double kSameLevel = 0.35;
// Sine of the least angle between neighbouring sides, 20 degrees.
constexpr double kLeastSine = 0.342;
// A segment may reach so far beyond a corner, pixels.
constexpr double kOver = 3.0;
// Of the outline, at least this share must be seen, and of each side this.
constexpr double kLeastSeen = 0.18, kLeastSideSeen = 0.04;
// Of what is seen of a side, so much may be seen with the dark outside.
constexpr double kMostOpposed = 0.1;

double cross(const Point& u, const Point& v) { return u.x() * v.y() - u.y() * v.x(); }

/// Whether two edges may lie between the same black and the same white.
template <typename A, typename B>
bool same_light(const A& a, const B& b) {
  const double slack = kSameLevel * std::min(a.bright - a.dark, b.bright - b.dark);
  return std::abs(a.dark - b.dark) < slack && std::abs(a.bright - b.bright) < slack;
}

/// How much of some pieces lies between two places.
double within(const std::vector<std::pair<double, double>>& pieces, double from, double to) {
  double sum = 0.0;
  for (const auto& [a, b] : pieces) sum += std::max(0.0, std::min(b, to) - std::max(a, from));
  return sum;
}

/// Segments along one straight line, the dark on its right.
struct Line {
  Point point;
  Point direction;
  double dark = 0.0, bright = 0.0;                 ///< mean levels
  std::vector<std::pair<double, double>> pieces;   ///< from, to: distances from `point`
  std::vector<std::pair<double, double>> opposed;  ///< likewise, the dark on the left
  double length = 0.0;                             ///< of all pieces

  double first() const { return pieces.front().first; }
  double last() const { return pieces.back().second; }
  double seen_between(double from, double to) const { return within(pieces, from, to); }
  double opposed_between(double from, double to) const { return within(opposed, from, to); }
  /// Whether most of it lies before `at`, and after it.
  bool ends_by(double at) const { return seen_between(first(), at + kOver) > 0.7 * length; }
  bool begins_at(double at) const { return seen_between(at - kOver, last()) > 0.7 * length; }
};

/// A direction in 256ths of a turn: told apart many times as fast.
using Heading = std::uint8_t;
Heading heading_of(const Point& direction) {
  const double turns = std::atan2(direction.y(), direction.x()) / (2.0 * std::numbers::pi);
  return static_cast<Heading>(std::lround(256.0 * turns) & 255);
}
/// Whether two directions may differ by less than kSameDirection, even if one of them changes by as
/// much as that while segments are put together.
bool near(Heading a, Heading b) {
  constexpr int kMost = 12;
  return static_cast<Heading>(a - b + kMost) <= 2 * kMost;
}

/// A segment with what is asked of it often.
struct Part {
  Segment segment;
  Point direction;
  double length = 0.0;
  double dark = 0.0, bright = 0.0;
};

/// Whether a segment lies along a line, whichever way.
bool along(const Line& line, const Part& part) {
  if (std::abs(cross(line.direction, part.direction)) > kSameDirection) return false;
  const double reach = std::min(std::abs(line.direction.dot(part.segment.a - line.point)),
                                std::abs(line.direction.dot(part.segment.b - line.point)));
  const double limit = kSameLine + kSameLineShare * reach;
  return std::abs(cross(line.direction, part.segment.a - line.point)) < limit &&
         std::abs(cross(line.direction, part.segment.b - line.point)) < limit;
}

bool joins(const Line& line, const Part& part) {
  return line.direction.dot(part.direction) > 0.0 && same_light(line, part) && along(line, part);
}

/// With the dark on the other side: as on a chessboard, and never on what covers a side.
bool opposes(const Line& line, const Part& part) {
  return line.direction.dot(part.direction) < 0.0 && along(line, part);
}

/// Total least squares through the ends of all pieces, each end weighing as much as its piece.
class LineFit {
 public:
  void add(const Part& part) {
    for (const Point& p : {part.segment.a, part.segment.b}) {
      weight_ += part.length;
      sum_ += part.length * p;
      squares_ += part.length * p * p.transpose();
    }
    levels_ += part.length * Point(part.dark, part.bright);
  }
  void solve(Line& line) const {
    const Point mean = sum_ / weight_;
    const Eigen::Matrix2d spread = squares_ / weight_ - mean * mean.transpose();
    const double angle = 0.5 * std::atan2(2.0 * spread(0, 1), spread(0, 0) - spread(1, 1));
    Point way(std::cos(angle), std::sin(angle));
    if (way.dot(line.direction) < 0.0) way = -way;
    line.point = mean;
    line.direction = way;
    line.length = 0.5 * weight_;
    line.dark = levels_.x() / line.length;
    line.bright = levels_.y() / line.length;
  }

 private:
  double weight_ = 0.0;
  Point sum_ = Point::Zero();
  Point levels_ = Point::Zero();
  Eigen::Matrix2d squares_ = Eigen::Matrix2d::Zero();
};

/// The longest segments, the longest one first.
std::vector<Part> longest(const std::vector<Segment>& segments) {
  std::vector<std::pair<double, std::size_t>> by_length;
  by_length.reserve(segments.size());
  for (std::size_t i = 0; i < segments.size(); ++i)
    by_length.emplace_back(-(segments[i].b - segments[i].a).squaredNorm(), i);
  const std::size_t count = std::min(by_length.size(), kMostSegments);
  std::partial_sort(by_length.begin(), by_length.begin() + static_cast<std::ptrdiff_t>(count),
                    by_length.end());
  std::vector<Part> parts;
  parts.reserve(count);
  for (std::size_t i = 0; i < count; ++i) {
    const Segment& segment = segments[by_length[i].second];
    parts.push_back({segment, segment.direction(), segment.length(), segment.dark, segment.bright});
  }
  return parts;
}

/// Longest first, every segment in one line.
std::vector<Line> merge(const std::vector<Part>& parts) {
  std::vector<Line> lines;
  std::vector<Heading> headings;
  headings.reserve(parts.size());
  for (const Part& part : parts) headings.push_back(heading_of(part.direction));
  std::vector<bool> taken(parts.size());
  for (std::size_t seed = 0; seed < parts.size(); ++seed) {
    if (taken[seed]) continue;
    Line line;
    line.point = 0.5 * (parts[seed].segment.a + parts[seed].segment.b);
    line.direction = parts[seed].direction;
    line.dark = parts[seed].dark;
    line.bright = parts[seed].bright;
    LineFit fit;
    std::vector<const Segment*> members;
    for (std::size_t i = seed; i < parts.size(); ++i)
      if (near(headings[i], headings[seed]) && !taken[i] && joins(line, parts[i])) {
        taken[i] = true;
        members.push_back(&parts[i].segment);
        fit.add(parts[i]);
        fit.solve(line);
      }
    for (const Segment* member : members)
      line.pieces.emplace_back(line.direction.dot(member->a - line.point),
                               line.direction.dot(member->b - line.point));
    std::sort(line.pieces.begin(), line.pieces.end());
    lines.push_back(std::move(line));
  }
  std::stable_sort(lines.begin(), lines.end(),
                   [](const Line& a, const Line& b) { return a.length > b.length; });
  if (lines.size() > kMostLines) lines.resize(kMostLines);
  for (Line& line : lines) {
    const Heading back = heading_of(-line.direction);
    for (std::size_t i = 0; i < parts.size(); ++i) {
      const Segment& segment = parts[i].segment;
      if (near(headings[i], back) && opposes(line, parts[i]))
        line.opposed.emplace_back(line.direction.dot(segment.b - line.point),
                                  line.direction.dot(segment.a - line.point));
    }
  }
  return lines;
}

/// Where line `a` turns right into line `b`.
struct Turn {
  std::uint8_t to = 0;
  Point corner;
  double on_from = 0.0, on_to = 0.0;  ///< where the corner lies along both lines
};

std::vector<std::vector<Turn>> right_turns(const std::vector<Line>& lines) {
  std::vector<std::vector<Turn>> turns(lines.size());
  for (std::size_t a = 0; a < lines.size(); ++a)
    for (std::size_t b = 0; b < lines.size(); ++b) {
      if (a == b) continue;
      const double sine = cross(lines[a].direction, lines[b].direction);
      if (sine < kLeastSine || !same_light(lines[a], lines[b])) continue;
      Turn turn;
      turn.to = static_cast<std::uint8_t>(b);
      turn.on_from = cross(lines[b].point - lines[a].point, lines[b].direction) / sine;
      turn.corner = lines[a].point + turn.on_from * lines[a].direction;
      turn.on_to = lines[b].direction.dot(turn.corner - lines[b].point);
      if (lines[a].ends_by(turn.on_from) && lines[b].begins_at(turn.on_to))
        turns[a].push_back(turn);
    }
  return turns;
}

/// All that the search for quads needs of the lines.
class Search {
 public:
  Search(std::vector<Line> lines, double least_side_px,
         const std::optional<Eigen::Matrix3d>& calibration)
      : lines_(std::move(lines)),
        turns_(right_turns(lines_)),
        least_side_px_(least_side_px),
        calibration_(calibration) {}

  std::vector<SideQuad> quads() {
    for (std::size_t a = 0; a < lines_.size(); ++a)
      for (const Turn& ab : turns_[a])
        for (const Turn& bc : turns_[ab.to]) {
          if (bc.to == a || bc.on_from < ab.on_to + 0.3 * least_side_px_) continue;
          const double seen_b = seen(ab.to, ab.on_to, bc.on_from);
          if (seen_b == 0.0) continue;
          if (calibration_) complete(a, ab, bc, seen_b);
          // Every cycle once, from its first line.
          if (ab.to > a && bc.to > a) close(a, ab, bc, seen_b);
        }
    return std::move(quads_);
  }

 private:
  /// Length of a side that is seen, zero if too little of it is, or too much with the dark outside.
  double seen(std::size_t line, double from, double to) const {
    const double sum = lines_[line].seen_between(from, to);
    if (lines_[line].opposed_between(from, to) > kMostOpposed * sum) return 0.0;
    return sum < kLeastSideSeen * (to - from) ? 0.0 : sum;
  }

  void add(const Quad& corners, double seen_px) {
    const double side = mean_side(corners);
    if (!convex(corners) || side < least_side_px_) return;
    const SideQuad quad{corners, seen_px / (4.0 * side)};
    if (quad.seen >= kLeastSeen) quads_.push_back(quad);
  }

  /// Fourth sides to a, b, c.
  void close(std::size_t a, const Turn& ab, const Turn& bc, double seen_b) {
    for (const Turn& cd : turns_[bc.to]) {
      if (cd.to <= a || cd.on_from < bc.on_to + 0.3 * least_side_px_) continue;
      const double seen_c = seen(bc.to, bc.on_to, cd.on_from);
      if (seen_c == 0.0) continue;
      const auto da = std::find_if(turns_[cd.to].begin(), turns_[cd.to].end(),
                                   [&](const Turn& turn) { return turn.to == a; });
      if (da == turns_[cd.to].end()) continue;
      const double seen_d = seen(cd.to, cd.on_to, da->on_from);
      const double seen_a = seen(a, da->on_to, ab.on_from);
      if (seen_a == 0.0 || seen_d == 0.0) continue;
      add({da->corner, ab.corner, bc.corner, cd.corner}, seen_a + seen_b + seen_c + seen_d);
    }
  }

  /// The square with sides on a, b and c; b is whole between its corners.
  void complete(std::size_t a, const Turn& ab, const Turn& bc, double seen_b) {
    using Eigen::Vector3d;
    const Eigen::Matrix3d& K = *calibration_;
    const auto ray = [&](const Point& p) -> Vector3d { return K.inverse() * p.homogeneous(); };
    const auto plane = [&](const Line& line) -> Vector3d {
      return ray(line.point).cross(ray(line.point + line.direction));
    };
    // Away from b along a and c, and along b.
    Vector3d sideways = plane(lines_[a]).cross(plane(lines_[bc.to])).normalized();
    const Vector3d first = ray(ab.corner);
    const Vector3d last = ray(bc.corner);
    const Vector3d along = plane(lines_[ab.to]).cross(sideways).normalized();
    if (!sideways.allFinite() || !along.allFinite()) return;
    // last * depth - first is parallel to `along`.
    const Vector3d across = along.cross(plane(lines_[ab.to])).normalized();
    const double depth = across.dot(first) / across.dot(last);
    if (!(depth > 0.1 && depth < 10.0)) return;
    const Vector3d& corner_ab = first;
    const Vector3d corner_bc = depth * last;
    const double side = (corner_bc - corner_ab).norm();
    const auto seen_at = [&](const Vector3d& point) { return Point((K * point).hnormalized()); };
    // Clockwise from a to b to c, so a runs towards b: the square lies against a's direction.
    const Point towards = seen_at(corner_ab + 0.1 * side * sideways) - ab.corner;
    if (towards.dot(lines_[a].direction) > 0.0) sideways = -sideways;
    const Vector3d corner_da = corner_ab + side * sideways;
    const Vector3d corner_cd = corner_bc + side * sideways;
    if (corner_da.z() < 0.05 || corner_cd.z() < 0.05) return;
    const Quad corners{seen_at(corner_da), ab.corner, bc.corner, seen_at(corner_cd)};
    const double from_a = lines_[a].direction.dot(corners[0] - lines_[a].point);
    const double to_c = lines_[bc.to].direction.dot(corners[3] - lines_[bc.to].point);
    const double seen_a = seen(a, from_a, ab.on_from);
    const double seen_c = seen(bc.to, bc.on_to, to_c);
    if (seen_a > 0.0 && seen_c > 0.0) add(corners, seen_a + seen_b + seen_c);
  }

  std::vector<Line> lines_;
  std::vector<std::vector<Turn>> turns_;
  double least_side_px_;
  const std::optional<Eigen::Matrix3d>& calibration_;
  std::vector<SideQuad> quads_;
};

}  // namespace

std::vector<SideQuad> side_quads(const std::vector<Segment>& segments, double least_side_px,
                                 std::size_t most,
                                 const std::optional<Eigen::Matrix3d>& calibration) {
  std::vector<SideQuad> quads =
      Search(merge(longest(segments)), least_side_px, calibration).quads();
  // The longest outline that is seen speaks for itself: inner squares are shorter.
  const auto promise = [](const SideQuad& quad) { return quad.seen * mean_side(quad.corners); };
  std::stable_sort(quads.begin(), quads.end(),
                   [&](const SideQuad& x, const SideQuad& y) { return promise(x) > promise(y); });
  std::vector<SideQuad> best;
  for (const SideQuad& quad : quads) {
    if (best.size() == most) break;
    const bool known = std::any_of(best.begin(), best.end(), [&](const SideQuad& other) {
      return nearly_same(other.corners, quad.corners, kSameSquare);
    });
    if (!known) best.push_back(quad);
  }
  return best;
}

}  // namespace harco::detect
