#include "overlay.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include <fmt/format.h>

namespace harco::cli {
namespace {

constexpr Colour kRed{255, 60, 60}, kGreen{60, 220, 60}, kBlue{80, 140, 255}, kWhite{255, 255, 255};
constexpr double kTextHeight = 10.0;
constexpr double kSmallestLabelled = 24.0;  // pixels; smaller markers would drown in their labels

using Corners = std::array<Eigen::Vector2d, 4>;

double side_px(const Corners& corners) {
  double sum = 0.0;
  for (std::size_t i = 0; i < 4; ++i) sum += (corners[(i + 1) % 4] - corners[i]).norm();
  return sum / 4.0;
}

Stroke ring(const Eigen::Vector2d& centre, double radius, const Colour& colour) {
  Stroke stroke;
  stroke.colour = colour;
  stroke.closed = true;
  for (int i = 0; i < 16; ++i) {
    const double angle = 2.0 * std::numbers::pi * i / 16;
    stroke.points.emplace_back(centre + radius * Eigen::Vector2d(std::cos(angle), std::sin(angle)));
  }
  return stroke;
}

void add_detection(const Detection& detection, Overlay& overlay) {
  const Colour colour = colour_of_layer(detection.layer);
  const double side = side_px(detection.corners);
  const int thickness = side > 60.0 ? 2 : 1;
  overlay.strokes.push_back(
      {{detection.corners.begin(), detection.corners.end()}, colour, true, thickness});
  overlay.strokes.push_back(ring(detection.corners[0], std::clamp(side / 20.0, 1.5, 6.0), colour));
  if (side < kSmallestLabelled) return;
  const Eigen::Vector2d inwards = detection.corners[2] - detection.corners[0];
  overlay.labels.push_back(
      {detection.corners[0] + 0.04 * inwards + Eigen::Vector2d(0.0, kTextHeight),
       fmt::format("{}:{}", detection.layer, detection.id), colour, kTextHeight});
}

/// A line in the camera frame, as far as the camera sees it, bent as the lens bends it.
void add_line(const Eigen::Vector3d& from, const Eigen::Vector3d& to, const Colour& colour,
              int thickness, const Camera& camera, Overlay& overlay) {
  constexpr int kSteps = 32;
  Stroke stroke;
  stroke.colour = colour;
  stroke.thickness = thickness;
  for (int i = 0; i <= kSteps; ++i) {
    const Eigen::Vector3d point = from + (to - from) * i / kSteps;
    if (const auto pixel = camera.project(point)) stroke.points.push_back(*pixel);
  }
  if (stroke.points.size() > 1) overlay.strokes.push_back(std::move(stroke));
}

double side_of_parent(const MarkerSet& markers, int id) {
  const auto parent = std::find_if(markers.parents.begin(), markers.parents.end(),
                                   [&](const Parent& p) { return p.marker.id == id; });
  return parent == markers.parents.end() ? 0.0 : parent->side_m;
}

}  // namespace

Colour colour_of_layer(int layer) {
  constexpr std::array<Colour, 5> kLayers{
      {{255, 70, 70}, {60, 220, 90}, {70, 150, 255}, {255, 190, 40}, {220, 90, 255}}};
  return kLayers[static_cast<std::size_t>(std::max(layer, 1) - 1) % kLayers.size()];
}

Colour colour_of(Rejection rejection) {
  switch (rejection) {
    case Rejection::none:
      return {60, 230, 60};
    case Rejection::ring:
      return {150, 150, 150};
    case Rejection::contrast:
      return {90, 90, 200};
    case Rejection::edges:
      return {255, 160, 0};
    case Rejection::shape:
      return {160, 100, 40};
    case Rejection::code:
      return {255, 60, 60};
    case Rejection::quality:
      return {255, 60, 220};
    case Rejection::duplicate:
      return {0, 200, 200};
    case Rejection::inconsistent:
      return {240, 230, 40};
  }
  return kWhite;
}

Overlay overlay_of_detections(const std::vector<Detection>& detections) {
  Overlay overlay;
  for (const Detection& detection : detections) add_detection(detection, overlay);
  return overlay;
}

Overlay overlay_of_poses(const std::vector<Pose>& poses, const MarkerSet& markers,
                         const Camera& camera) {
  Overlay overlay;
  double line = 1.5 * kTextHeight;
  for (const Pose& pose : poses) {
    const double side = side_of_parent(markers, pose.parent);
    const Eigen::Vector3d origin = pose.camera_T_marker.translation();
    const Eigen::Matrix3d axes = pose.camera_T_marker.rotation();
    const Eigen::Vector3d right = side * axes.col(0), down = side * axes.col(1);
    add_line(origin, origin + right, kWhite, 1, camera, overlay);
    add_line(origin + right, origin + right + down, kWhite, 1, camera, overlay);
    add_line(origin + right + down, origin + down, kWhite, 1, camera, overlay);
    add_line(origin + down, origin, kWhite, 1, camera, overlay);
    add_line(origin, origin + 0.5 * right, kRed, 2, camera, overlay);
    add_line(origin, origin + 0.5 * down, kGreen, 2, camera, overlay);
    add_line(origin, origin + 0.5 * side * axes.col(2), kBlue, 2, camera, overlay);
    const double tilt = std::acos(std::clamp(axes(2, 2), -1.0, 1.0)) * 180.0 / std::numbers::pi;
    overlay.labels.push_back(
        {{6.0, line},
         fmt::format("parent {}: x {:.3f}  y {:.3f}  z {:.3f} m, tilt {:.1f} deg, {} markers, "
                     "{:.2f} px",
                     pose.parent, origin.x(), origin.y(), origin.z(), tilt, pose.markers,
                     pose.rms_px),
         kWhite,
         kTextHeight});
    line += 1.8 * kTextHeight;
  }
  return overlay;
}

Overlay overlay_of(const FrameResult& result, const MarkerSet& markers,
                   const std::optional<Camera>& camera) {
  Overlay overlay = overlay_of_detections(result.detections);
  if (!camera) return overlay;
  Overlay poses = overlay_of_poses(result.poses, markers, *camera);
  std::move(poses.strokes.begin(), poses.strokes.end(), std::back_inserter(overlay.strokes));
  std::move(poses.labels.begin(), poses.labels.end(), std::back_inserter(overlay.labels));
  return overlay;
}

Overlay enlarged(Overlay overlay, int factor) {
  // Pixel centres are whole numbers: the old pixel 0 is centred within the new 0 … factor - 1.
  const auto move = [&](Eigen::Vector2d& point) {
    point = ((point.array() + 0.5) * factor - 0.5).matrix();
  };
  for (Stroke& stroke : overlay.strokes)
    std::for_each(stroke.points.begin(), stroke.points.end(), move);
  for (Label& label : overlay.labels) move(label.at);
  return overlay;
}

}  // namespace harco::cli
