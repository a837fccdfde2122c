#include "pose/ink_outline.hpp"

#include <algorithm>
#include <cstdint>

namespace harco {
namespace {

using Eigen::Vector2d;

// Cells of the index along a side.
constexpr int kCells = 49;
// Coordinates this near to each other, as a share of the side, are one: rounding.
constexpr double kSame = 1e-9;

/// The borders between ink and paper that lie on lines of one direction. A border that two
/// rectangles share vanishes.
class Lines {
 public:
  /// Lengths are told apart by `unit`.
  explicit Lines(double unit) : unit_(unit) {}

  void add(double line, double from, double to, int jump) {
    changes_.push_back({key(line, from), jump});
    changes_.push_back({key(line, to), -jump});
  }

  /// Calls visit(line, from, to, whether ink lies beyond the line).
  template <typename Visit>
  void borders(Visit visit) {
    std::sort(changes_.begin(), changes_.end(),
              [](const Change& a, const Change& b) { return a.key < b.key; });
    int ink = 0;
    std::uint64_t since = 0;
    for (std::size_t i = 0; i < changes_.size();) {
      const std::uint64_t here = changes_[i].key;
      int next = ink;
      for (; i < changes_.size() && changes_[i].key == here; ++i) next += changes_[i].jump;
      if (next == ink) continue;
      if (ink != 0) visit(length(here >> 32U), length(since), length(here), ink > 0);
      ink = next;
      since = here;
    }
  }

 private:
  /// Along a line, the ink beyond it changes by `jump` from here on.
  struct Change {
    std::uint64_t key;  ///< which line, then where on it
    int jump;
  };

  static constexpr std::int64_t kZero = std::int64_t{1} << 30U;  // what a length of zero is kept as
  static constexpr double kZeroAndHalf = static_cast<double>(kZero) + 0.5;

  std::uint64_t key(double line, double at) const {
    const auto whole = [this](double v) {
      return static_cast<std::uint64_t>(v / unit_ + kZeroAndHalf);  // rounds
    };
    return (whole(line) << 32U) | whole(at);
  }
  double length(std::uint64_t half) const {
    return unit_ * static_cast<double>(static_cast<std::int64_t>(half & 0xffffffffU) - kZero);
  }

  double unit_;
  std::vector<Change> changes_;
};

}  // namespace

InkOutline::InkOutline(const InkPlan& plan) : square_(plan.square) {
  const double unit = kSame * square_.width();
  Lines upright(unit), level(unit);
  const auto add = [&](const Rect& r, int ink) {
    upright.add(r.x0, r.y0, r.y1, ink);
    upright.add(r.x1, r.y0, r.y1, -ink);
    level.add(r.y0, r.x0, r.x1, ink);
    level.add(r.y1, r.x0, r.x1, -ink);
  };
  add(plan.square, 1);
  for (const Rect& r : plan.white) add(r, -1);
  for (const Rect& r : plan.black) add(r, 1);
  upright.borders([&](double x, double y0, double y1, bool ink_right) {
    edges_.push_back(ink_right ? InkEdge{{x, y1}, {x, y0}} : InkEdge{{x, y0}, {x, y1}});
  });
  level.borders([&](double y, double x0, double x1, bool ink_below) {
    edges_.push_back(ink_below ? InkEdge{{x0, y}, {x1, y}} : InkEdge{{x1, y}, {x0, y}});
  });
  white_ = index(plan.white);
  black_ = index(plan.black);
}

int InkOutline::cell(double coordinate) const {
  return static_cast<int>(std::clamp(coordinate / square_.width() * kCells, 0.0, kCells - 1.0));
}

InkOutline::Index InkOutline::index(const std::vector<Rect>& rects) const {
  Index result;
  result.first.assign(kCells * kCells + 1, 0);
  const auto for_each_cell = [&](const Rect& r, auto visit) {
    for (int y = cell(r.y0); y <= cell(r.y1); ++y)
      for (int x = cell(r.x0); x <= cell(r.x1); ++x)
        visit(static_cast<std::size_t>(y * kCells + x));
  };
  for (const Rect& r : rects) for_each_cell(r, [&](std::size_t c) { ++result.first[c + 1]; });
  for (std::size_t c = 1; c < result.first.size(); ++c) result.first[c] += result.first[c - 1];
  std::vector<int> next(result.first.begin(), result.first.end() - 1);
  result.rects.resize(static_cast<std::size_t>(result.first.back()));
  for (const Rect& r : rects)
    for_each_cell(r, [&](std::size_t c) { result.rects[static_cast<std::size_t>(next[c]++)] = r; });
  return result;
}

bool InkOutline::covered(const Index& index, const Vector2d& p) const {
  const auto c = static_cast<std::size_t>(cell(p.y()) * kCells + cell(p.x()));
  const auto begin = index.rects.begin() + index.first[c];
  const auto end = index.rects.begin() + index.first[c + 1];
  return std::any_of(begin, end, [&](const Rect& r) {
    return p.x() > r.x0 && p.x() < r.x1 && p.y() > r.y0 && p.y() < r.y1;
  });
}

bool InkOutline::is_black(const Vector2d& p) const {
  if (p.x() < square_.x0 || p.x() > square_.x1 || p.y() < square_.y0 || p.y() > square_.y1)
    return false;
  return !covered(white_, p) || covered(black_, p);
}

}  // namespace harco
