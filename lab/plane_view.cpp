#include "plane_view.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/LU>

namespace harco::lab {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// A curved edge is cut into chords that stay so near to it, in pixels ...
constexpr double kChordError = 0.002;
// ... none of them longer than this, so that an S-shaped edge isn't taken for its chord.
constexpr double kLongestChord = 40.0;
constexpr int kMostHalvings = 24;
constexpr int kBlindHalvings = 5;  // of an edge whose ends and middle the lens can't image
// What is nearer to the camera's plane than this is not imaged, in metres.
constexpr double kNear = 1e-6;
// Sides of the cone that holds all that a distorting lens can show.
constexpr int kConeSides = 24;
// Of the search for the row in which a point is seen.
constexpr int kMostSteps = 12;
constexpr double kSameRow = 1e-4;

}  // namespace

// --- FieldOfView ---------------------------------------------------------------------------------

FieldOfView::FieldOfView(const Camera& camera, int margin_px) : camera_(camera) {
  spaces_.push_back({Vector3d::UnitZ(), kNear});
  if (camera.has_distortion())
    add_cone(margin_px);
  else
    add_pyramid(margin_px);
}

void FieldOfView::add_pyramid(int margin) {
  const double left = (-0.5 - margin - camera_.cx) / camera_.fx;
  const double right = (camera_.width - 0.5 + margin - camera_.cx) / camera_.fx;
  const double top = (-0.5 - margin - camera_.cy) / camera_.fy;
  const double bottom = (camera_.height - 0.5 + margin - camera_.cy) / camera_.fy;
  spaces_.push_back({{1.0, 0.0, -left}});
  spaces_.push_back({{-1.0, 0.0, right}});
  spaces_.push_back({{0.0, 1.0, -top}});
  spaces_.push_back({{0.0, -1.0, bottom}});
}

void FieldOfView::add_cone(int margin) {
  double radius = 0.0;
  const auto see = [&](double x, double y) {
    if (const auto ray = camera_.unproject({x, y})) radius = std::max(radius, ray->norm());
  };
  const double left = -0.5 - margin, right = camera_.width - 0.5 + margin;
  const double top = -0.5 - margin, bottom = camera_.height - 0.5 + margin;
  constexpr int kSteps = 64;
  for (int i = 0; i <= kSteps; ++i) {
    const double x = left + (right - left) * i / kSteps;
    const double y = top + (bottom - top) * i / kSteps;
    see(x, top), see(x, bottom), see(left, y), see(right, y);
  }
  for (int i = 0; i < kConeSides; ++i) {
    const double angle = 2.0 * std::numbers::pi * i / kConeSides;
    spaces_.push_back({{-std::cos(angle), -std::sin(angle), radius}});
  }
}

// --- PlaneView -----------------------------------------------------------------------------------

PlaneView::Axes PlaneView::axes_of(const Eigen::Isometry3d& camera_T_plane) {
  return {camera_T_plane.linear().col(0), camera_T_plane.linear().col(1),
          camera_T_plane.translation()};
}

PlaneView::PlaneView(const FieldOfView& view, const Eigen::Isometry3d& camera_T_plane)
    : camera_(view.camera()),
      view_(view),
      rows_{axes_of(camera_T_plane)},
      middle_(rows_.front()),
      pinhole_(!camera_.has_distortion()),
      straight_(pinhole_) {
  set_bounds();
}

PlaneView::PlaneView(const FieldOfView& view, const std::vector<Eigen::Isometry3d>& camera_T_plane)
    : camera_(view.camera()), view_(view), pinhole_(!camera_.has_distortion()), straight_(false) {
  for (const Eigen::Isometry3d& pose : camera_T_plane) rows_.push_back(axes_of(pose));
  middle_ = axes_at(0.5 * (camera_.height - 1));
  set_bounds();
}

void PlaneView::set_bounds() {
  for (const FieldOfView::HalfSpace& space : view_.spaces())
    bounds_.push_back({{space.normal.dot(middle_.x), space.normal.dot(middle_.y)},
                       space.offset - space.normal.dot(middle_.origin)});
}

PlaneView::Axes PlaneView::axes_at(double row) const {
  const auto last = static_cast<double>(rows_.size() - 1);
  const double place = last * std::clamp(row / (camera_.height - 1), -0.5, 1.5);
  const auto before = static_cast<std::size_t>(std::clamp(std::floor(place), 0.0, last - 1.0));
  const double share = place - static_cast<double>(before);
  const Axes& a = rows_[before];
  const Axes& b = rows_[before + 1];
  return {a.x + share * (b.x - a.x), a.y + share * (b.y - a.y),
          a.origin + share * (b.origin - a.origin)};
}

bool PlaneView::shows_face() const { return middle_.x.cross(middle_.y).dot(middle_.origin) > 0.0; }

PlaneView::Pixel PlaneView::project(const Axes& axes, const Vector2d& point) const {
  const Vector3d seen = axes.at(point);
  if (!(seen.z() > 0.0)) return std::nullopt;
  if (!pinhole_) return camera_.project(seen);
  return Vector2d(camera_.fx * seen.x() / seen.z() + camera_.cx,
                  camera_.fy * seen.y() / seen.z() + camera_.cy);
}

std::optional<Vector2d> PlaneView::pixel(const Vector2d& point) const {
  Pixel seen = project(middle_, point);
  if (rows_.size() == 1) return seen;
  // The row r in which it is seen as it stands when row r is taken: secant steps.
  double row = 0.5 * (camera_.height - 1);
  double slope = -1.0;  // of how far off it is, by row
  for (int i = 0; seen && i < kMostSteps; ++i) {
    const double off = seen->y() - row;
    if (std::abs(off) < kSameRow) break;
    const double step = -off / slope;
    row += step;
    seen = project(axes_at(row), point);
    if (seen) slope = std::min(-0.1, (seen->y() - row - off) / step);
  }
  return seen;
}

std::optional<Vector2d> PlaneView::point(const Vector2d& pixel) const {
  const auto ray = camera_.unproject(pixel);
  if (!ray) return std::nullopt;
  const Axes axes = rows_.size() == 1 ? middle_ : axes_at(pixel.y());
  Eigen::Matrix3d columns;
  columns << axes.x, axes.y, -ray->homogeneous();
  if (std::abs(columns.determinant()) < 1e-12) return std::nullopt;
  const Vector3d solved = columns.inverse() * -axes.origin;
  if (!(solved.z() > 0.0)) return std::nullopt;
  return Vector2d(solved.head<2>());
}

/// The part within a half-plane (Sutherland-Hodgman).
Polygon PlaneView::clipped(const Polygon& polygon, const HalfPlane& within) {
  Polygon inside;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Vector2d& a = polygon[i];
    const Vector2d& b = polygon[(i + 1) % polygon.size()];
    const double ha = within.height(a);
    const double hb = within.height(b);
    if (ha >= 0.0) inside.push_back(a);
    if ((ha >= 0.0) != (hb >= 0.0)) inside.push_back(a + (b - a) * (ha / (ha - hb)));
  }
  return inside;
}

Polygon PlaneView::outline(const Rect& rect) const {
  return outline({{rect.x0, rect.y0}, {rect.x1, rect.y0}, {rect.x1, rect.y1}, {rect.x0, rect.y1}});
}

Polygon PlaneView::outline(const Polygon& polygon) const {
  Polygon rest;
  const Polygon* seen = &polygon;
  for (const HalfPlane& bound : bounds_) {
    const auto within = [&](const Vector2d& p) { return bound.height(p) >= 0.0; };
    if (std::all_of(seen->begin(), seen->end(), within)) continue;
    rest = clipped(*seen, bound);
    if (rest.empty()) return rest;
    seen = &rest;
  }
  std::vector<Pixel> corners;
  corners.reserve(seen->size());
  for (const Vector2d& p : *seen) corners.push_back(pixel(p));
  Polygon pixels;
  pixels.reserve(seen->size());
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const std::size_t next = (i + 1) % corners.size();
    add_edge((*seen)[i], corners[i], (*seen)[next], corners[next], 0, pixels);
  }
  return pixels;
}

/// Appends the edge's image, its end excluded. What the lens can't image lies beyond the image's
/// corners: leaving it out changes no pixel.
void PlaneView::add_edge(const Vector2d& from, const Pixel& a, const Vector2d& to, const Pixel& b,
                         int depth, Polygon& out) const {
  const auto keep = [&] {
    if (a) out.push_back(*a);
  };
  if (straight_ || depth == kMostHalvings) return keep();
  const Vector2d halfway = 0.5 * (from + to);
  const Pixel m = pixel(halfway);
  if (a && b && m) {
    const Vector2d chord = *b - *a;
    const double length = chord.norm();
    const Vector2d half = *m - *a;
    const double off = chord.x() * half.y() - chord.y() * half.x();
    if (length < kLongestChord && std::abs(off) <= kChordError * length) return keep();
  }
  if (!a && !b && !m && depth >= kBlindHalvings) return;
  add_edge(from, a, halfway, m, depth + 1, out);
  add_edge(halfway, m, to, b, depth + 1, out);
}

PixelWindow window_around(const Polygon& outline, const Camera& camera, int reach) {
  if (outline.empty()) return {};
  Eigen::Array2d low = outline.front(), high = low;
  for (const Vector2d& p : outline) {
    low = low.min(p.array());
    high = high.max(p.array());
  }
  const auto bound = [](double v, int limit) {
    return static_cast<int>(std::clamp(v, 0.0, static_cast<double>(limit)));
  };
  PixelWindow window;
  window.x = bound(std::floor(low.x() - reach), camera.width);
  window.y = bound(std::floor(low.y() - reach), camera.height);
  window.width = bound(std::ceil(high.x() + reach) + 1.0, camera.width) - window.x;
  window.height = bound(std::ceil(high.y() + reach) + 1.0, camera.height) - window.y;
  return window;
}

}  // namespace harco::lab
