#include "detect/kernels/outline.hpp"

#include <cstddef>
#include <limits>

// Highway compiles this file once for every instruction set.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "detect/kernels/outline.cpp"
#include <hwy/foreach_target.h>
// After foreach_target.
#include <hwy/highway.h>

#ifndef HARCO_OUTLINE_ONCE
#define HARCO_OUTLINE_ONCE
namespace harco::detect::kernels {

// Of larger ones, products don't fit into 32 bits.
constexpr int kMostPixels = 8192;
inline bool fits(const Outline& outline) {
  return outline.columns < kMostPixels && outline.rows < kMostPixels / outline.row_step;
}

/// In the middle row, half way down.
inline OutlineCorner middle_of(const Outline& outline) {
  const int row = outline.rows / 2;
  return {(outline.left[row] + outline.right[row]) / 2, outline.rows * outline.row_step / 2};
}

/// The corner of a row's pixels that is farthest from a point.
inline OutlineCorner corner_of(const Outline& outline, int row, const OutlineCorner& from) {
  const int right = outline.right[row] + 1;
  const bool to_left = from.x - outline.left[row] >= right - from.x;
  const int y = row * outline.row_step;
  return {to_left ? outline.left[row] : right, y + (y < from.y ? 0 : 1)};
}

/// Those corners of a row's pixels that are farthest to the right and to the left of the way from
/// a to c.
struct BesideWay {
  BesideWay(const OutlineCorner& a, const OutlineCorner& c)
      : dx(c.x - a.x),
        dy(c.y - a.y),
        left_is_right(dy > 0),
        right_y(dx > 0 ? 1 : 0),
        left_y(dx > 0 ? 0 : 1) {}
  OutlineCorner on_right(const Outline& outline, int row) const {
    return {left_is_right ? outline.left[row] : outline.right[row] + 1,
            row * outline.row_step + right_y};
  }
  OutlineCorner on_left(const Outline& outline, int row) const {
    return {left_is_right ? outline.right[row] + 1 : outline.left[row],
            row * outline.row_step + left_y};
  }
  int dx, dy;
  bool left_is_right;  // whether the left end of a row lies on the right of the way
  int right_y, left_y;
};

}  // namespace harco::detect::kernels
#endif

HWY_BEFORE_NAMESPACE();
namespace harco::detect::kernels::HWY_NAMESPACE {

#if HWY_TARGET == HWY_SCALAR

OutlineCorners corners_simd(const Outline& outline) { return outline_corners_scalar(outline); }

bool keeps_to_simd(const Outline& outline, const OutlineCorners& corners,
                   const OutlineSlack& slack) {
  return outline_keeps_to_scalar(outline, corners, slack);
}

#else

namespace hn = hwy::HWY_NAMESPACE;
using Lanes = hn::ScalableTag<std::int32_t>;
using Lane = hn::Vec<Lanes>;
using Mask = hn::Mask<Lanes>;
constexpr Lanes kLanes;

HWY_INLINE std::int32_t largest(Lane values) { return hn::GetLane(hn::MaxOfLanes(kLanes, values)); }

/// The first row with the largest value, if that is in `most`; they are the largest ones of every
/// so many rows, and `rows` the first ones that have them.
HWY_INLINE int first_row(Lane most, std::int32_t value, Lane rows) {
  const auto none = hn::Set(kLanes, std::numeric_limits<std::int32_t>::max());
  const auto have = hn::Eq(most, hn::Set(kLanes, value));
  return hn::GetLane(hn::MinOfLanes(kLanes, hn::IfThenElse(have, rows, none)));
}

OutlineCorner farthest_from(const Outline& outline, const OutlineCorner& from) {
  const int lanes = static_cast<int>(hn::Lanes(kLanes));
  const auto x = hn::Set(kLanes, from.x);
  const auto y = hn::Set(kLanes, from.y);
  const auto one = hn::Set(kLanes, 1);
  const auto step = hn::Set(kLanes, outline.row_step);
  auto most = hn::Set(kLanes, -1);
  auto best = hn::Zero(kLanes);
  for (int row = 0; row < outline.rows; row += lanes) {
    const auto rows = hn::Iota(kLanes, row);
    const auto to_left = hn::Sub(x, hn::LoadU(kLanes, outline.left + row));
    const auto to_right = hn::Sub(hn::Add(hn::LoadU(kLanes, outline.right + row), one), x);
    const auto dx = hn::Max(to_left, to_right);
    const auto top = hn::Mul(rows, step);
    const auto dy = hn::Sub(hn::Add(top, hn::IfThenZeroElse(hn::Lt(top, y), one)), y);
    const auto squared = hn::Add(hn::Mul(dx, dx), hn::Mul(dy, dy));
    const auto real = hn::Lt(rows, hn::Set(kLanes, outline.rows));
    const auto better = hn::And(real, hn::Gt(squared, most));
    most = hn::IfThenElse(better, squared, most);
    best = hn::IfThenElse(better, rows, best);
  }
  return corner_of(outline, first_row(most, largest(most), best), from);
}

OutlineCorners corners_simd(const Outline& outline) {
  if (!fits(outline)) return outline_corners_scalar(outline);
  const OutlineCorner a = farthest_from(outline, middle_of(outline));
  const OutlineCorner c = farthest_from(outline, a);
  const BesideWay way(a, c);
  const int lanes = static_cast<int>(hn::Lanes(kLanes));
  const auto one = hn::Set(kLanes, 1);
  const auto step = hn::Set(kLanes, outline.row_step);
  const auto dx = hn::Set(kLanes, way.dx);
  const auto dy = hn::Set(kLanes, way.dy);
  const auto x = hn::Set(kLanes, a.x);
  const auto y_on_right = hn::Set(kLanes, way.right_y - a.y);
  const auto y_on_left = hn::Set(kLanes, way.left_y - a.y);
  auto right = hn::Zero(kLanes);
  auto left = hn::Zero(kLanes);
  auto right_row = hn::Zero(kLanes);
  auto left_row = hn::Zero(kLanes);
  for (int row = 0; row < outline.rows; row += lanes) {
    const auto rows = hn::Iota(kLanes, row);
    const auto left_x = hn::Sub(hn::LoadU(kLanes, outline.left + row), x);
    const auto right_x = hn::Sub(hn::Add(hn::LoadU(kLanes, outline.right + row), one), x);
    const auto x_on_right = way.left_is_right ? left_x : right_x;
    const auto x_on_left = way.left_is_right ? right_x : left_x;
    const auto top = hn::Mul(rows, step);
    const auto to_right = hn::Sub(hn::Mul(dx, hn::Add(top, y_on_right)), hn::Mul(dy, x_on_right));
    const auto to_left = hn::Sub(hn::Mul(dy, x_on_left), hn::Mul(dx, hn::Add(top, y_on_left)));
    const auto real = hn::Lt(rows, hn::Set(kLanes, outline.rows));
    const auto more_right = hn::And(real, hn::Gt(to_right, right));
    right = hn::IfThenElse(more_right, to_right, right);
    right_row = hn::IfThenElse(more_right, rows, right_row);
    const auto more_left = hn::And(real, hn::Gt(to_left, left));
    left = hn::IfThenElse(more_left, to_left, left);
    left_row = hn::IfThenElse(more_left, rows, left_row);
  }
  const std::int32_t most_right = largest(right);
  const std::int32_t most_left = largest(left);
  OutlineCorner b = a;
  OutlineCorner d = a;
  if (most_right > 0) b = way.on_right(outline, first_row(right, most_right, right_row));
  if (most_left > 0) d = way.on_left(outline, first_row(left, most_left, left_row));
  return {a, d, c, b};
}

bool keeps_to_simd(const Outline& outline, const OutlineCorners& corners,
                   const OutlineSlack& slack) {
  if (!fits(outline)) return outline_keeps_to_scalar(outline, corners, slack);
  const int lanes = static_cast<int>(hn::Lanes(kLanes));
  const auto one = hn::Set(kLanes, 1);
  const auto two = hn::Set(kLanes, 2);
  for (int row = 0; row < outline.rows; row += lanes) {
    const auto rows = hn::Iota(kLanes, row);
    const auto left = hn::LoadU(kLanes, outline.left + row);
    const auto right = hn::Add(hn::LoadU(kLanes, outline.right + row), one);
    const auto y = hn::Add(hn::Mul(rows, hn::Set(kLanes, 2 * outline.row_step)), one);
    const auto real = hn::Lt(rows, hn::Set(kLanes, outline.rows));
    auto strays = hn::Lt(one, hn::Zero(kLanes));
    auto left_near = strays;
    auto right_near = strays;
    for (std::size_t i = 0; i < 4; ++i) {
      const OutlineCorner& from = corners[i];
      const OutlineCorner& to = corners[(i + 1) % 4];
      const auto from_x = hn::Set(kLanes, from.x);
      const auto along_y = hn::Set(kLanes, to.y - from.y);
      const auto across =
          hn::Mul(hn::Set(kLanes, to.x - from.x), hn::Sub(y, hn::Set(kLanes, 2 * from.y)));
      const auto left_out = hn::Sub(hn::Mul(along_y, hn::Mul(two, hn::Sub(left, from_x))), across);
      const auto right_out =
          hn::Sub(hn::Mul(along_y, hn::Mul(two, hn::Sub(right, from_x))), across);
      const auto most = hn::Set(kLanes, slack[i]);
      const auto least = hn::Set(kLanes, -slack[i]);
      strays = hn::Or(strays, hn::Gt(hn::Max(left_out, right_out), most));
      left_near = hn::Or(left_near, hn::Not(hn::Lt(left_out, least)));
      right_near = hn::Or(right_near, hn::Not(hn::Lt(right_out, least)));
    }
    const auto fine = hn::AndNot(strays, hn::And(left_near, right_near));
    if (!hn::AllFalse(kLanes, hn::AndNot(fine, real))) return false;
  }
  return true;
}

#endif

}  // namespace harco::detect::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace harco::detect::kernels {
namespace {

OutlineCorner farthest_from_scalar(const Outline& outline, const OutlineCorner& from) {
  OutlineCorner best = from;
  std::int64_t most = -1;
  for (int row = 0; row < outline.rows; ++row) {
    const OutlineCorner corner = corner_of(outline, row, from);
    const std::int64_t dx = corner.x - from.x;
    const std::int64_t dy = corner.y - from.y;
    if (dx * dx + dy * dy <= most) continue;
    most = dx * dx + dy * dy;
    best = corner;
  }
  return best;
}

}  // namespace

HWY_EXPORT(corners_simd);
HWY_EXPORT(keeps_to_simd);

OutlineCorners outline_corners(const Outline& outline) {
  return HWY_DYNAMIC_DISPATCH(corners_simd)(outline);
}

bool outline_keeps_to(const Outline& outline, const OutlineCorners& corners,
                      const OutlineSlack& slack) {
  return HWY_DYNAMIC_DISPATCH(keeps_to_simd)(outline, corners, slack);
}

OutlineCorners outline_corners_scalar(const Outline& outline) {
  const OutlineCorner a = farthest_from_scalar(outline, middle_of(outline));
  const OutlineCorner c = farthest_from_scalar(outline, a);
  const BesideWay way(a, c);
  const auto to_right = [&](const OutlineCorner& corner) {
    return std::int64_t{way.dx} * (corner.y - a.y) - std::int64_t{way.dy} * (corner.x - a.x);
  };
  OutlineCorner b = a;
  OutlineCorner d = a;
  for (int row = 0; row < outline.rows; ++row) {
    const OutlineCorner right = way.on_right(outline, row);
    const OutlineCorner left = way.on_left(outline, row);
    if (to_right(right) > to_right(b)) b = right;
    if (to_right(left) < to_right(d)) d = left;
  }
  return {a, d, c, b};
}

bool outline_keeps_to_scalar(const Outline& outline, const OutlineCorners& corners,
                             const OutlineSlack& slack) {
  for (int row = 0; row < outline.rows; ++row)
    for (const int x : {outline.left[row], outline.right[row] + 1}) {
      bool near = false;
      for (std::size_t i = 0; i < 4; ++i) {
        const OutlineCorner& from = corners[i];
        const OutlineCorner& to = corners[(i + 1) % 4];
        // Twice, from the middle of the row's height.
        const std::int64_t out =
            std::int64_t{to.y - from.y} * 2 * (x - from.x) -
            std::int64_t{to.x - from.x} * (2 * row * outline.row_step + 1 - 2 * from.y);
        if (out > slack[i]) return false;
        near = near || out >= -slack[i];
      }
      if (!near) return false;
    }
  return true;
}

}  // namespace harco::detect::kernels
#endif
