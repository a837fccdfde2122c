#include "render.hpp"

#include <algorithm>
#include <cmath>
#include <random>
#include <stdexcept>
#include <string>

#include "plane_view.hpp"

namespace harco::lab {
namespace {

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

void paint(const Scene& scene, const Sheet& printed, const PlacedParent& placed,
           const FieldOfView& field, FloatImage& image) {
  const PlaneView view(field, placed.camera_T_marker);
  if (!view.shows_face()) return;

  const InkPlan& plan = printed.ink;
  const Polygon sheet_outline = view.outline(printed.paper);
  const Psf psf{scene.psf_sigma_px, scene.oversampling};
  const PixelWindow window = window_around(sheet_outline, scene.camera, psf.reach_px() + 1);
  if (window.empty()) return;

  Coverage sheet(window, psf);
  sheet.add(sheet_outline);
  Coverage ink(window, psf);
  ink.add(view.outline(plan.square));
  for (const Rect& rect : plan.white) ink.add(view.outline(rect), -1.0);
  for (const Rect& rect : plan.black) ink.add(view.outline(rect));

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
  const FieldOfView field(camera, Psf{scene.psf_sigma_px, scene.oversampling}.reach_px() + 2);
  for (const PlacedParent& placed : scene.parents)
    paint(scene, sheet(placed.parent_index), placed, field, image);
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
