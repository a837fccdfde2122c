#include "mount_check.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <utility>

#include <fmt/format.h>

namespace harco::cli {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kDegrees = 180.0 / std::numbers::pi;
constexpr Colour kNose{255, 60, 60}, kRight{60, 220, 60}, kDown{80, 140, 255};
constexpr Colour kHorizon{255, 210, 60}, kWhite{255, 255, 255};

const char* name_of_axis(Eigen::Index axis, bool positive) {
  constexpr std::array<std::array<const char*, 2>, 3> kNames{
      {{"tail", "nose"}, {"left", "right"}, {"up", "down"}}};
  return kNames[static_cast<std::size_t>(axis)][positive ? 1 : 0];
}

/// "the nose", but "down": what one looks towards.
std::string towards(const std::string& name) {
  return name == "down" || name == "up" ? name : "the " + name;
}

Vector3d to_body(const Mount& mount, const Vector3d& camera_direction) {
  return mount.body_T_camera.linear() * camera_direction;
}

Vector3d to_camera(const Mount& mount, const Vector3d& body_direction) {
  return mount.body_T_camera.linear().transpose() * body_direction;
}

/// "0.12 m ahead", or nothing for what is less than a centimetre.
void add_length(double length, const char* positive, const char* negative,
                std::vector<std::string>& parts) {
  constexpr double kLeast_m = 0.005;
  if (std::abs(length) < kLeast_m) return;
  parts.push_back(fmt::format("{:.2f} m {}", std::abs(length), length > 0.0 ? positive : negative));
}

/// "0.12 m ahead and 0.05 m below", or `none`.
std::string offset_text(const Vector3d& body, const std::string& none) {
  std::vector<std::string> parts;
  add_length(body.z(), "below", "above", parts);
  add_length(body.x(), "ahead", "behind", parts);
  add_length(body.y(), "to the right", "to the left", parts);
  if (parts.empty()) return none;
  std::string text = parts.front();
  for (std::size_t i = 1; i < parts.size(); ++i)
    text += (i + 1 == parts.size() ? " and " : ", ") + parts[i];
  return text;
}

/// An arrow in the image; its head is as long as a fifth of it.
void add_arrow(const Vector2d& from, const Vector2d& to, const Colour& colour, int thickness,
               Overlay& overlay) {
  const Vector2d along = to - from, across(-along.y(), along.x());
  overlay.strokes.push_back({{from, to}, colour, false, thickness});
  overlay.strokes.push_back({{to - 0.2 * along + 0.1 * across, to, to - 0.2 * along - 0.1 * across},
                             colour,
                             false,
                             thickness});
}

/// Where a direction is seen, if it is seen in the image.
std::optional<Vector2d> seen(const Camera& camera, const Vector3d& direction) {
  const auto pixel = camera.project(direction);
  const bool inside = pixel && pixel->x() >= 0.0 && pixel->y() >= 0.0 &&
                      pixel->x() <= camera.width - 1.0 && pixel->y() <= camera.height - 1.0;
  return inside ? pixel : std::nullopt;
}

}  // namespace

std::string name_of_direction(const Vector3d& body_direction) {
  constexpr double kExact_deg = 0.5;
  const Vector3d unit = body_direction.normalized();
  Eigen::Index main = 0, next = 0;
  unit.cwiseAbs().maxCoeff(&main);
  Vector3d rest = unit;
  rest[main] = 0.0;
  rest.cwiseAbs().maxCoeff(&next);
  const std::string name = name_of_axis(main, unit[main] > 0.0);
  const double angle = kDegrees * std::atan2(rest.norm(), std::abs(unit[main]));
  if (angle < kExact_deg) return name;
  return fmt::format("{}, {:.0f} degrees towards {}", name, angle,
                     towards(name_of_axis(next, unit[next] > 0.0)));
}

std::string mount_text(const Mount& mount) {
  const auto side = [&](const Vector3d& camera_direction) {
    return name_of_direction(to_body(mount, camera_direction));
  };
  std::string text;
  text += fmt::format("the camera looks:              {}\n", side(Vector3d::UnitZ()));
  text += fmt::format("image top is the vehicle's:    {}\n", side(-Vector3d::UnitY()));
  text += fmt::format("image right is the vehicle's:  {}\n", side(Vector3d::UnitX()));
  text += fmt::format("the camera sits:               {}\n",
                      offset_text(mount.body_T_camera.translation(), "at the vehicle's origin"));
  return text;
}

std::string place_text(const Pose& pose, const MarkerSet& markers, const Mount& mount) {
  double side = 0.0;
  for (const Parent& parent : markers.parents)
    if (parent.marker.id == pose.parent) side = parent.side_m;
  const Vector3d middle =
      mount.body_T_camera * pose.camera_T_marker * Vector3d(0.5 * side, 0.5 * side, 0.0);
  return fmt::format("parent {} is {} of the vehicle", pose.parent,
                     offset_text(middle, "at the origin"));
}

Overlay mount_overlay(const Mount& mount, const Camera& camera) {
  const double size = std::min(camera.width, camera.height);
  const double text = std::max(10.0, size / 45.0);
  const int thick = std::max(2, static_cast<int>(std::lround(size / 240.0)));
  const Vector2d middle(0.5 * (camera.width - 1.0), 0.5 * (camera.height - 1.0));
  Overlay overlay;

  // The horizon: all that lies level with the vehicle.
  constexpr int kSteps = 720;
  Stroke horizon{{}, kHorizon, false, std::max(1, thick / 2)};
  const auto finish = [&] {
    if (horizon.points.size() > 1) overlay.strokes.push_back(horizon);
    horizon.points.clear();
  };
  for (int i = 0; i <= kSteps; ++i) {
    const double angle = 2.0 * std::numbers::pi * i / kSteps;
    const auto pixel = seen(camera, to_camera(mount, {std::cos(angle), std::sin(angle), 0.0}));
    if (!pixel) {
      finish();
      continue;
    }
    if (horizon.points.empty())
      overlay.labels.push_back(
          {*pixel - Vector2d(0.0, text), i == 0 ? "horizon (nose)" : "horizon", kHorizon, text});
    horizon.points.push_back(*pixel);
  }
  finish();
  if (const auto below = seen(camera, to_camera(mount, Vector3d::UnitZ()))) {
    const double arm = 0.03 * size;
    overlay.strokes.push_back(
        {{*below - Vector2d(arm, 0.0), *below + Vector2d(arm, 0.0)}, kDown, false, thick});
    overlay.strokes.push_back(
        {{*below - Vector2d(0.0, arm), *below + Vector2d(0.0, arm)}, kDown, false, thick});
    overlay.labels.push_back({*below + Vector2d(0.5 * text, -text), "straight below", kDown, text});
  }

  // The axes as they would look, drawn parallel: what points away from the viewer is short.
  const std::array<std::pair<Vector3d, Colour>, 3> axes{
      {{Vector3d::UnitX(), kNose}, {Vector3d::UnitY(), kRight}, {Vector3d::UnitZ(), kDown}}};
  const std::array<const char*, 3> names{"nose", "right", "down"};
  for (std::size_t i = 0; i < axes.size(); ++i) {
    const Vector3d direction = to_camera(mount, axes[i].first);
    constexpr double kShort = 0.1;
    if (direction.head<2>().norm() < kShort) continue;  // the words below tell
    const Vector2d tip = middle + (i == 0 ? 0.35 : 0.2) * size * direction.head<2>();
    add_arrow(middle, tip, axes[i].second, i == 0 ? 2 * thick : thick, overlay);
    overlay.labels.push_back(
        {tip + 0.04 * size * direction.head<2>().normalized(), names[i], axes[i].second, text});
  }

  // What the image's sides point to.
  const auto side = [&](const Vector3d& direction) {
    return name_of_direction(to_body(mount, direction));
  };
  const double margin = 0.6 * text;
  overlay.labels.push_back({{margin, margin + text},
                            "image top is the vehicle's " + side(-Vector3d::UnitY()) +
                                "; the camera looks " + side(Vector3d::UnitZ()),
                            kWhite,
                            text});
  overlay.labels.push_back({{margin, camera.height - 1.0 - margin},
                            "image right is the vehicle's " + side(Vector3d::UnitX()),
                            kWhite,
                            text});
  return overlay;
}

}  // namespace harco::cli
