#include "detect/side_quads.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>

#include <Eigen/Geometry>
#include <Eigen/LU>

namespace harco::detect {
namespace {

// Lines that take part; the search for quads grows with their fourth power at worst.
constexpr int kMostLines = 72;
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

}  // namespace

/// By a parabola for the arc tangent, not off by as much as a quarter.
SideQuadFinder::Heading SideQuadFinder::heading_of(const Point& direction) {
  const double x = std::abs(direction.x());
  const double y = std::abs(direction.y());
  const double ratio = std::min(x, y) / std::max(x, y);
  double turned = ratio * (32.0 + 11.12 * (1.0 - ratio));
  if (y > x) turned = 64.0 - turned;
  if (direction.x() < 0.0) turned = 128.0 - turned;
  if (direction.y() < 0.0) turned = -turned;
  return static_cast<Heading>(static_cast<int>(turned + 256.5) & 255);
}

/// Calls `visit` for each of `among` whose direction may differ from `heading` by less than
/// kSameDirection, even if one of both changes by as much as that while segments are put together;
/// in their order.
template <typename Visit>
void SideQuadFinder::for_each_near(Heading heading, const Members& among,
                                   const Visit& visit) const {
  constexpr int kMost = 12;
  for (std::size_t word = 0; 64 * word < parts_.size(); ++word) {
    std::uint64_t near = 0;
    for (int turn = -kMost; turn <= kMost; ++turn)
      near |= by_heading_[static_cast<Heading>(heading + turn)][word];
    for (near &= among[word]; near != 0; near &= near - 1)
      visit(64 * word + static_cast<std::size_t>(std::countr_zero(near)));
  }
}

/// Whether a segment lies along a line, whichever way. (What is done for each pair is inline:
/// shared libraries wouldn't let compilers do it otherwise.)
inline bool SideQuadFinder::along(const Line& line, const Part& part) {
  if (std::abs(cross(line.direction, part.direction)) > kSameDirection) return false;
  const double reach = std::min(std::abs(line.direction.dot(part.segment.a - line.point)),
                                std::abs(line.direction.dot(part.segment.b - line.point)));
  const double limit = kSameLine + kSameLineShare * reach;
  return std::abs(cross(line.direction, part.segment.a - line.point)) < limit &&
         std::abs(cross(line.direction, part.segment.b - line.point)) < limit;
}

inline bool SideQuadFinder::joins(const Line& line, const Part& part) {
  return line.direction.dot(part.direction) > 0.0 && same_light(line, part) && along(line, part);
}

/// With the dark on the other side: as on a chessboard, and never on what covers a side.
inline bool SideQuadFinder::opposes(const Line& line, const Part& part) {
  return line.direction.dot(part.direction) < 0.0 && along(line, part);
}

/// Total least squares through the ends of all pieces, each end weighing as much as its piece.
class SideQuadFinder::LineFit {
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
    // Half the angle of (across, both), by the longer of two vectors in that direction.
    const double across = spread(0, 0) - spread(1, 1);
    const double both = 2.0 * spread(0, 1);
    const double length = std::sqrt(across * across + both * both);
    Point way = across > 0.0 ? Point(across + length, both) : Point(both, length - across);
    way = length > 0.0 ? Point(way.normalized()) : line.direction;
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
void SideQuadFinder::take_longest(const std::vector<Segment>& segments) {
  by_length_.clear();
  for (std::size_t i = 0; i < segments.size(); ++i)
    by_length_.emplace_back(-(segments[i].b - segments[i].a).squaredNorm(), i);
  if (by_length_.size() > kMostSegments) {
    const auto end = by_length_.begin() + static_cast<std::ptrdiff_t>(kMostSegments);
    std::nth_element(by_length_.begin(), end, by_length_.end());
    by_length_.erase(end, by_length_.end());
  }
  std::sort(by_length_.begin(), by_length_.end());
  parts_.clear();
  by_heading_.fill({});
  all_.fill(0);
  for (const auto& [length, i] : by_length_) {
    const Segment& segment = segments[i];
    const Point direction = segment.direction();
    const std::size_t word = parts_.size() / 64;
    const std::uint64_t bit = std::uint64_t{1} << parts_.size() % 64;
    by_heading_[heading_of(direction)][word] |= bit;
    all_[word] |= bit;
    parts_.push_back({segment, direction, segment.length(), segment.dark, segment.bright});
  }
}

/// The line of a segment, the longest one that is left, and of all others that lie along it.
void SideQuadFinder::join_to(std::size_t seed) {
  const Part& first = parts_[seed];
  Line line;
  line.point = 0.5 * (first.segment.a + first.segment.b);
  line.direction = first.direction;
  line.dark = first.dark;
  line.bright = first.bright;
  line.pieces = {stretches_.size(), stretches_.size()};
  LineFit fit;
  for_each_near(heading_of(first.direction), left_, [&](std::size_t i) {
    if (i != seed && !joins(line, parts_[i])) return;
    members_.push_back(i);
    left_[i / 64] &= ~(std::uint64_t{1} << i % 64);
    fit.add(parts_[i]);
    fit.solve(line);
  });
  for (const std::size_t member : members_) {
    const Segment& segment = parts_[member].segment;
    stretches_.push_back(
        {line.direction.dot(segment.a - line.point), line.direction.dot(segment.b - line.point)});
  }
  members_.clear();
  line.pieces.end = stretches_.size();
  std::sort(stretches_.begin() + static_cast<std::ptrdiff_t>(line.pieces.begin), stretches_.end(),
            [](const Stretch& a, const Stretch& b) { return a.from < b.from; });
  lines_.push_back(line);
}

void SideQuadFinder::find_opposed(Line& line) {
  line.opposed.begin = stretches_.size();
  for_each_near(heading_of(-line.direction), all_, [&](std::size_t i) {
    if (!opposes(line, parts_[i])) return;
    const Segment& segment = parts_[i].segment;
    stretches_.push_back(
        {line.direction.dot(segment.b - line.point), line.direction.dot(segment.a - line.point)});
  });
  line.opposed.end = stretches_.size();
}

/// Lines, longest first, every segment in one of them.
void SideQuadFinder::merge() {
  lines_.clear();
  stretches_.clear();
  left_ = all_;
  for (std::size_t word = 0; word < left_.size(); ++word)
    while (left_[word] != 0)
      join_to(64 * word + static_cast<std::size_t>(std::countr_zero(left_[word])));
  std::sort(lines_.begin(), lines_.end(), [](const Line& a, const Line& b) {
    return std::pair(-a.length, a.pieces.begin) < std::pair(-b.length, b.pieces.begin);
  });
  if (lines_.size() > kMostLines) lines_.resize(kMostLines);
  for (Line& line : lines_) find_opposed(line);
}

/// How much of some stretches lies between two places.
inline double SideQuadFinder::within(const Range& stretches, double from, double to) const {
  double sum = 0.0;
  for (std::size_t i = stretches.begin; i < stretches.end; ++i)
    sum += std::max(0.0, std::min(stretches_[i].to, to) - std::max(stretches_[i].from, from));
  return sum;
}

/// Whether most of a line lies before `at`, and after it.
bool SideQuadFinder::ends_by(const Line& line, double at) const {
  return within(line.pieces, stretches_[line.pieces.begin].from, at + kOver) > 0.7 * line.length;
}
bool SideQuadFinder::begins_at(const Line& line, double at) const {
  return within(line.pieces, at - kOver, stretches_[line.pieces.end - 1].to) > 0.7 * line.length;
}

void SideQuadFinder::find_turns() {
  turns_.clear();
  turns_from_.clear();
  // All lines at once; where there is no line, nothing turns.
  using Values = Eigen::Array<float, kMostLines, 1>;
  std::array<Values, 4> values;
  for (Values& of_lines : values) of_lines.setZero();
  auto& [x, y, dark, bright] = values;
  for (std::size_t i = 0; i < lines_.size(); ++i) {
    const auto at = static_cast<Eigen::Index>(i);
    x(at) = static_cast<float>(lines_[i].direction.x());
    y(at) = static_cast<float>(lines_[i].direction.y());
    dark(at) = static_cast<float>(lines_[i].dark);
    bright(at) = static_cast<float>(lines_[i].bright);
  }
  const Values slack = static_cast<float>(kSameLevel) * (bright - dark);
  for (std::size_t from = 0; from < lines_.size(); ++from) {
    const auto at = static_cast<Eigen::Index>(from);
    const Line& a = lines_[from];
    // The sine of the angle between both, and whether they are in one light (see same_light()).
    const Values sine = x(at) * y - y(at) * x;
    const Values off = (dark - dark(at)).abs().max((bright - bright(at)).abs());
    const Values most = slack.min(slack(at));
    const Values margin = (sine - static_cast<float>(kLeastSine)).min(most - off);
    Range range{turns_.size(), turns_.size()};
    for (std::size_t to = 0; to < lines_.size(); ++to) {
      if (!(margin(static_cast<Eigen::Index>(to)) > 0.0F)) continue;
      const Line& b = lines_[to];
      Turn turn;
      turn.to = to;
      turn.on_from = cross(b.point - a.point, b.direction) / cross(a.direction, b.direction);
      turn.corner = a.point + turn.on_from * a.direction;
      turn.on_to = b.direction.dot(turn.corner - b.point);
      if (ends_by(a, turn.on_from) && begins_at(b, turn.on_to)) turns_.push_back(turn);
    }
    range.end = turns_.size();
    turns_from_.push_back(range);
  }
}

/// Length of a side that is seen, zero if too little of it is, or too much with the dark outside.
double SideQuadFinder::seen(std::size_t line, double from, double to) const {
  const double sum = within(lines_[line].pieces, from, to);
  if (within(lines_[line].opposed, from, to) > kMostOpposed * sum) return 0.0;
  return sum < kLeastSideSeen * (to - from) ? 0.0 : sum;
}

void SideQuadFinder::find_quads() {
  quads_.clear();
  for (std::size_t a = 0; a < lines_.size(); ++a)
    for (std::size_t i = turns_from_[a].begin; i < turns_from_[a].end; ++i) {
      const Turn& ab = turns_[i];
      for (std::size_t k = turns_from_[ab.to].begin; k < turns_from_[ab.to].end; ++k) {
        const Turn& bc = turns_[k];
        if (bc.to == a || bc.on_from < ab.on_to + 0.3 * least_side_px_) continue;
        const double seen_b = seen(ab.to, ab.on_to, bc.on_from);
        if (seen_b == 0.0) continue;
        if (calibration_) complete(a, ab, bc, seen_b);
        // Every cycle once, from its first line.
        if (ab.to > a && bc.to > a) close(a, ab, bc, seen_b);
      }
    }
}

void SideQuadFinder::add(const Quad& corners, double seen_px) {
  const double side = mean_side(corners);
  if (!convex(corners) || side < least_side_px_) return;
  const SideQuad quad{corners, seen_px / (4.0 * side)};
  if (quad.seen >= kLeastSeen) quads_.push_back(quad);
}

/// Fourth sides to a, b, c.
void SideQuadFinder::close(std::size_t a, const Turn& ab, const Turn& bc, double seen_b) {
  for (std::size_t i = turns_from_[bc.to].begin; i < turns_from_[bc.to].end; ++i) {
    const Turn& cd = turns_[i];
    if (cd.to <= a || cd.on_from < bc.on_to + 0.3 * least_side_px_) continue;
    const double seen_c = seen(bc.to, bc.on_to, cd.on_from);
    if (seen_c == 0.0) continue;
    const Range& from_d = turns_from_[cd.to];
    const auto end = turns_.begin() + static_cast<std::ptrdiff_t>(from_d.end);
    const auto da = std::find_if(turns_.begin() + static_cast<std::ptrdiff_t>(from_d.begin), end,
                                 [&](const Turn& turn) { return turn.to == a; });
    if (da == end) continue;
    const double seen_d = seen(cd.to, cd.on_to, da->on_from);
    const double seen_a = seen(a, da->on_to, ab.on_from);
    if (seen_a == 0.0 || seen_d == 0.0) continue;
    add({da->corner, ab.corner, bc.corner, cd.corner}, seen_a + seen_b + seen_c + seen_d);
  }
}

/// The square with sides on a, b and c; b is whole between its corners.
void SideQuadFinder::complete(std::size_t a, const Turn& ab, const Turn& bc, double seen_b) {
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

void SideQuadFinder::keep_best(std::size_t most) {
  // The longest outline that is seen speaks for itself: inner squares are shorter.
  by_length_.clear();
  for (std::size_t i = 0; i < quads_.size(); ++i)
    by_length_.emplace_back(-quads_[i].seen * mean_side(quads_[i].corners), i);
  std::sort(by_length_.begin(), by_length_.end());
  best_.clear();
  for (const auto& [length, i] : by_length_) {
    if (best_.size() == most) break;
    const SideQuad& quad = quads_[i];
    const bool known = std::any_of(best_.begin(), best_.end(), [&](const SideQuad& other) {
      return nearly_same(other.corners, quad.corners, kSameSquare);
    });
    if (!known) best_.push_back(quad);
  }
}

const std::vector<SideQuad>& SideQuadFinder::find(
    const std::vector<Segment>& segments, double least_side_px, std::size_t most,
    const std::optional<Eigen::Matrix3d>& calibration) {
  least_side_px_ = least_side_px;
  calibration_ = calibration;
  take_longest(segments);
  merge();
  find_turns();
  find_quads();
  keep_best(most);
  return best_;
}

}  // namespace harco::detect
