#include "render.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <stdexcept>
#include <string>

namespace harco::lab {
namespace {

// A curved edge is cut into chords that stay so near to it, in pixels ...
constexpr double kChordError = 0.002;
// ... none of them longer than this, so that an S-shaped edge isn't taken for its chord.
constexpr double kLongestChord = 40.0;
// What is nearer to the camera's plane than this is not imaged, in metres.
constexpr double kNear = 1e-6;
// Sides of the cone that holds all that a distorting lens can show.
constexpr int kConeSides = 24;

using Polygon3 = std::vector<Eigen::Vector3d>;
using Polygon2 = std::vector<Eigen::Vector2d>;

/// Points X with normal . X >= offset.
struct HalfSpace {
  Eigen::Vector3d normal;
  double offset = 0.0;
  double height(const Eigen::Vector3d& point) const { return normal.dot(point) - offset; }
};

/// The part of a convex polygon within a half-space (Sutherland-Hodgman).
Polygon3 clipped(const Polygon3& polygon, const HalfSpace& space) {
  Polygon3 inside;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Eigen::Vector3d& a = polygon[i];
    const Eigen::Vector3d& b = polygon[(i + 1) % polygon.size()];
    const double ha = space.height(a);
    const double hb = space.height(b);
    if (ha >= 0.0) inside.push_back(a);
    if ((ha >= 0.0) != (hb >= 0.0)) inside.push_back(a + (b - a) * (ha / (ha - hb)));
  }
  return inside;
}

Eigen::Vector2d normalised(const Eigen::Vector3d& point) { return point.head<2>() / point.z(); }

/// All that can reach a pixel of the image, with `margin_px` around it.
class View {
 public:
  View(const Camera& camera, int margin_px) : camera_(camera) {
    spaces_.push_back({Eigen::Vector3d::UnitZ(), kNear});
    if (camera.has_distortion())
      add_cone(margin_px);
    else
      add_pyramid(margin_px);
  }

  /// Outline in pixels of a convex polygon of the camera frame. Empty if nothing is in view.
  Polygon2 outline(Polygon3 polygon) const {
    for (const HalfSpace& space : spaces_) {
      const auto within = [&](const Eigen::Vector3d& p) { return space.height(p) >= 0.0; };
      if (!std::all_of(polygon.begin(), polygon.end(), within)) polygon = clipped(polygon, space);
    }
    Polygon2 pixels;
    for (std::size_t i = 0; i < polygon.size(); ++i)
      add_edge(normalised(polygon[i]), normalised(polygon[(i + 1) % polygon.size()]), pixels);
    return pixels;
  }

 private:
  Eigen::Vector2d pinhole(const Eigen::Vector2d& point) const {
    return {camera_.fx * point.x() + camera_.cx, camera_.fy * point.y() + camera_.cy};
  }

  void add_pyramid(int margin) {
    const double left = (-0.5 - margin - camera_.cx) / camera_.fx;
    const double right = (camera_.width - 0.5 + margin - camera_.cx) / camera_.fx;
    const double top = (-0.5 - margin - camera_.cy) / camera_.fy;
    const double bottom = (camera_.height - 0.5 + margin - camera_.cy) / camera_.fy;
    spaces_.push_back({{1.0, 0.0, -left}});
    spaces_.push_back({{-1.0, 0.0, right}});
    spaces_.push_back({{0.0, 1.0, -top}});
    spaces_.push_back({{0.0, -1.0, bottom}});
  }

  void add_cone(int margin) {
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

  /// Appends the edge's image, its end excluded.
  void add_edge(const Eigen::Vector2d& from, const Eigen::Vector2d& to, Polygon2& out) const {
    if (!camera_.has_distortion()) {
      out.push_back(pinhole(from));
      return;
    }
    // What the lens can't image lies beyond the image's corners: leaving it out changes no pixel.
    const auto a = camera_.project(from.homogeneous());
    const auto b = camera_.project(to.homogeneous());
    const Eigen::Vector2d halfway = 0.5 * (from + to);
    const auto m = camera_.project(halfway.homogeneous());
    const bool straight = a && b && m && (*b - *a).norm() < kLongestChord &&
                          (*m - 0.5 * (*a + *b)).norm() < kChordError;
    if (straight || (from - to).norm() < 1e-6) {
      if (a) out.push_back(*a);
      return;
    }
    add_edge(from, halfway, out);
    add_edge(halfway, to, out);
  }

  const Camera& camera_;
  std::vector<HalfSpace> spaces_;
};

/// The smallest window of the image that holds an outline and its blur.
PixelWindow window_around(const Polygon2& outline, const Camera& camera, int reach) {
  if (outline.empty()) return {};
  Eigen::Array2d low = outline.front(), high = low;
  for (const Eigen::Vector2d& p : outline) {
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

/// Light along the marker's x axis, seen at a pixel.
class Light {
 public:
  Light(const Scene& scene, const PlacedParent& placed, double side)
      : camera_(scene.camera),
        even_(scene.gain_left == scene.gain_right),
        left_(scene.gain_left),
        rise_((scene.gain_right - scene.gain_left) / side),
        marker_T_camera_(placed.camera_T_marker.inverse()) {}

  double gain(int x, int y) const {
    if (even_) return left_;
    const auto ray = camera_.unproject({x, y});
    if (!ray) return left_;
    // origin + s * direction meets the marker's plane z = 0.
    const Eigen::Vector3d origin = marker_T_camera_.translation();
    const Eigen::Vector3d direction = marker_T_camera_.linear() * ray->homogeneous();
    const double s = -origin.z() / direction.z();
    return left_ + rise_ * (origin.x() + s * direction.x());
  }

 private:
  const Camera& camera_;
  bool even_;
  double left_, rise_;
  Eigen::Isometry3d marker_T_camera_;
};

void paint(const Scene& scene, const Sheet& printed, const PlacedParent& placed, const View& view,
           FloatImage& image) {
  const double camera_height = placed.camera_T_marker.inverse().translation().z();
  if (camera_height >= 0.0) return;  // seen from behind

  const auto outline = [&](const Rect& r) {
    Polygon3 polygon;
    for (const Eigen::Vector3d& corner :
         {Eigen::Vector3d(r.x0, r.y0, 0.0), Eigen::Vector3d(r.x1, r.y0, 0.0),
          Eigen::Vector3d(r.x1, r.y1, 0.0), Eigen::Vector3d(r.x0, r.y1, 0.0)})
      polygon.push_back(placed.camera_T_marker * corner);
    return view.outline(std::move(polygon));
  };

  const InkPlan& plan = printed.ink;
  const Polygon2 sheet_outline = outline(printed.paper);
  const Psf psf{scene.psf_sigma_px, scene.oversampling};
  const PixelWindow window = window_around(sheet_outline, scene.camera, psf.reach_px() + 1);
  if (window.width <= 0 || window.height <= 0) return;

  Coverage sheet(window, psf);
  sheet.add(sheet_outline);
  Coverage ink(window, psf);
  ink.add(outline(plan.square));
  for (const Rect& rect : plan.white) ink.add(outline(rect), -1.0);
  for (const Rect& rect : plan.black) ink.add(outline(rect));

  const FloatImage sheet_share = sheet.blurred();
  const FloatImage ink_share = ink.blurred();
  const Light light(scene, placed, plan.square.width());
  for (int y = 0; y < window.height; ++y) {
    float* to = image.row(window.y + y) + window.x;
    for (int x = 0; x < window.width; ++x) {
      const double covered = static_cast<double>(sheet_share.row(y)[x]);
      if (covered == 0.0) continue;
      const double inked = static_cast<double>(ink_share.row(y)[x]);
      const double paper = scene.white * covered - (scene.white - scene.black) * inked;
      const double behind = static_cast<double>(to[x]) * (1.0 - covered);
      to[x] = static_cast<float>(behind + light.gain(window.x + x, window.y + y) * paper);
    }
  }
}

void check(const Scene& scene) {
  validate(scene.camera);
  for (const double value : {scene.black, scene.white, scene.grey, scene.gain_left,
                             scene.gain_right, scene.quiet_zone_cells, scene.noise_sigma})
    if (!std::isfinite(value)) throw std::invalid_argument("render: a value is not finite");
  if (scene.quiet_zone_cells < 0.0 || scene.noise_sigma < 0.0)
    throw std::invalid_argument("render: quiet zone and noise can't be negative");
  if (scene.background && (scene.background->width != scene.camera.width ||
                           scene.background->height != scene.camera.height))
    throw std::invalid_argument("render: the background has not the camera's size");
}

/// `sheet(i)` is what PlacedParent::parent_index i stands for.
template <typename SheetOfIndex>
FloatImage painted(const Scene& scene, const SheetOfIndex& sheet) {
  check(scene);
  const Camera& camera = scene.camera;
  FloatImage image(camera.width, camera.height, static_cast<float>(scene.grey));
  if (scene.background)
    std::copy(scene.background->pixels.begin(), scene.background->pixels.end(),
              image.pixels.begin());
  const View view(camera, Psf{scene.psf_sigma_px, scene.oversampling}.reach_px() + 2);
  for (const PlacedParent& placed : scene.parents)
    paint(scene, sheet(placed.parent_index), placed, view, image);
  return image;
}

}  // namespace

Sheet sheet_of(const MarkerSet& markers, int parent_index, double quiet_zone_cells) {
  Sheet sheet{ink_plan(markers, parent_index), {}};
  const Parent& parent = markers.parents[static_cast<std::size_t>(parent_index)];
  const double zone = quiet_zone_cells * parent.side_m / (parent.marker.code.cells + 2);
  const Rect& square = sheet.ink.square;
  sheet.paper = {square.x0 - zone, square.y0 - zone, square.x1 + zone, square.y1 + zone};
  return sheet;
}

FloatImage render_exact(const Scene& scene, const MarkerSet& markers) {
  return painted(scene,
                 [&](int index) { return sheet_of(markers, index, scene.quiet_zone_cells); });
}

FloatImage render_exact(const Scene& scene, const std::vector<Sheet>& sheets) {
  return painted(scene, [&](int index) -> const Sheet& {
    if (index < 0 || static_cast<std::size_t>(index) >= sheets.size())
      throw std::invalid_argument("render: no sheet " + std::to_string(index));
    return sheets[static_cast<std::size_t>(index)];
  });
}

Image expose(const FloatImage& exact, double sigma, std::uint64_t seed) {
  Image image(exact.width, exact.height);
  std::mt19937_64 random(seed);
  std::normal_distribution<double> unit;
  for (std::size_t i = 0; i < image.pixels.size(); ++i) {
    double value = static_cast<double>(exact.pixels[i]);
    if (sigma > 0.0) value += sigma * unit(random);
    image.pixels[i] = static_cast<std::uint8_t>(std::lround(std::clamp(value, 0.0, 255.0)));
  }
  return image;
}

Image render(const Scene& scene, const MarkerSet& markers, std::uint64_t noise_seed) {
  return expose(render_exact(scene, markers), scene.noise_sigma, noise_seed);
}

Image render(const Scene& scene, const std::vector<Sheet>& sheets, std::uint64_t noise_seed) {
  return expose(render_exact(scene, sheets), scene.noise_sigma, noise_seed);
}

Eigen::Isometry3d look_at_marker(const Eigen::Vector2d& marker_point_m, double distance_m,
                                 double tilt_rad, double tilt_axis_angle_rad, double roll_rad) {
  const Eigen::Vector3d axis(std::cos(tilt_axis_angle_rad), std::sin(tilt_axis_angle_rad), 0.0);
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() =
      (Eigen::AngleAxisd(roll_rad, Eigen::Vector3d::UnitZ()) * Eigen::AngleAxisd(tilt_rad, axis))
          .toRotationMatrix();
  const Eigen::Vector3d point(marker_point_m.x(), marker_point_m.y(), 0.0);
  pose.translation() = Eigen::Vector3d(0.0, 0.0, distance_m) - pose.linear() * point;
  return pose;
}

}  // namespace harco::lab
