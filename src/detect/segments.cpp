#include "detect/segments.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "detect/sample.hpp"

namespace harco::detect {
namespace {

// No point of a straight stretch lies farther from its chord than this, in pixels, and than this
// share of its length more: noise ruffles it, a lens bends it.
constexpr double kRuffle = 0.7;
constexpr double kBend = 0.008;
// Points at both ends that the rounding of a corner may have moved.
constexpr std::size_t kTrim = 2;
// Root mean square distance from the fitted line, pixels.
constexpr double kStraight = 0.3;

double cross(const Point& u, const Point& v) { return u.x() * v.y() - u.y() * v.x(); }

class Splitter {
 public:
  Splitter(const Contour& contour, double least_px, std::vector<Segment>& segments)
      : points_(contour.points), least_px_(least_px), segments_(segments) {}

  /// Ramer's split of the stretch between two points of the contour, in order.
  void split(std::size_t from, std::size_t to) {
    const double chord_px = (at(to) - at(from)).norm();
    // Too few points can't make a segment, however straight.
    if (static_cast<double>(to - from) + 1.0 < least_px_) return;
    const auto [farthest, away_px] = farthest_from_chord(from, to, chord_px);
    if (away_px <= kRuffle + kBend * chord_px) {
      keep(from, to);
      return;
    }
    split(from, farthest);
    split(farthest, to);
  }

 private:
  /// The outline is closed: one past its last point is its first one.
  const Point& at(std::size_t i) const { return i < points_.size() ? points_[i] : points_[0]; }

  /// The point between two others that is farthest from the line through them, or from both if they
  /// are one, and how far.
  std::pair<std::size_t, double> farthest_from_chord(std::size_t from, std::size_t to,
                                                     double chord_px) const {
    const Point& start = at(from);
    const Point chord = at(to) - start;
    const bool one = chord_px <= 1e-6;
    double worst = 0.0;
    std::size_t farthest = from;
    for (std::size_t i = from + 1; i < to; ++i) {
      const Point offset = points_[i] - start;
      const double away = one ? offset.norm() : std::abs(cross(chord, offset));
      if (away > worst) {
        worst = away;
        farthest = i;
      }
    }
    return {farthest, one ? worst : worst / chord_px};
  }

  void keep(std::size_t from, std::size_t to) {
    from += kTrim;
    if (to < from + kTrim + 3) return;
    to -= kTrim;
    Point mean = Point::Zero();
    const auto count = static_cast<double>(to - from + 1);
    for (std::size_t i = from; i <= to; ++i) mean += at(i);
    mean /= count;
    double xx = 0.0;
    double xy = 0.0;
    double yy = 0.0;
    for (std::size_t i = from; i <= to; ++i) {
      const Point d = at(i) - mean;
      xx += d.x() * d.x();
      xy += d.x() * d.y();
      yy += d.y() * d.y();
    }
    const double across = std::max(0.0, 0.5 * (xx + yy - std::hypot(xx - yy, 2.0 * xy)));
    if (std::sqrt(across / count) > kStraight + 0.3 * kBend * count) return;
    const double angle = 0.5 * std::atan2(2.0 * xy, xx - yy);
    Point way(std::cos(angle), std::sin(angle));
    if (way.dot(at(to) - at(from)) < 0.0) way = -way;
    const Segment segment{mean + way.dot(at(from) - mean) * way,
                          mean + way.dot(at(to) - mean) * way};
    if (segment.length() >= least_px_) segments_.push_back(segment);
  }

  const std::vector<Point>& points_;
  double least_px_;
  std::vector<Segment>& segments_;
};

}  // namespace

void append_segments(const Contour& contour, double least_px, std::vector<Segment>& segments) {
  const std::vector<Point>& points = contour.points;
  if (static_cast<double>(points.size()) < 2.0 * least_px) return;
  // A closed outline has no ends; two points far apart serve.
  std::size_t far = 0;
  double farthest = 0.0;
  for (std::size_t i = 1; i < points.size(); ++i) {
    const double away = (points[i] - points[0]).squaredNorm();
    if (away <= farthest) continue;
    farthest = away;
    far = i;
  }
  Splitter splitter(contour, least_px, segments);
  splitter.split(0, far);
  splitter.split(far, points.size());
}

bool parts_dark_from_bright(const ImageView& image, const Segment& segment, double contrast) {
  constexpr double kBeside = 1.5;  // pixels
  constexpr int kPlaces = 5;
  const Point way = segment.direction();
  const Point to_dark = kBeside * Point(-way.y(), way.x());
  int parted = 0;
  for (int i = 0; i < kPlaces; ++i) {
    const Point at = segment.a + (i + 0.5) / kPlaces * (segment.b - segment.a);
    const auto dark = sample(image, at.x() + to_dark.x(), at.y() + to_dark.y());
    const auto bright = sample(image, at.x() - to_dark.x(), at.y() - to_dark.y());
    parted += dark && bright && *bright - *dark >= contrast;
  }
  return 2 * parted > kPlaces;
}

}  // namespace harco::detect
