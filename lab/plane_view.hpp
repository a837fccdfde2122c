// Where what lies in a plane appears in an image: lenses, cameras close by, and shutters that take
// one row after the other.
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "harco/camera.hpp"
#include "harco/geometry.hpp"

namespace harco::lab {

using Polygon = std::vector<Eigen::Vector2d>;

/// All that can reach a pixel of an image, with a margin around it.
class FieldOfView {
 public:
  /// Points X of the camera frame with normal . X >= offset.
  struct HalfSpace {
    Eigen::Vector3d normal;
    double offset = 0.0;
  };

  FieldOfView(const Camera& camera, int margin_px);

  const Camera& camera() const { return camera_; }
  /// What is seen lies in all of them.
  const std::vector<HalfSpace>& spaces() const { return spaces_; }

 private:
  void add_pyramid(int margin);
  void add_cone(int margin);

  Camera camera_;
  std::vector<HalfSpace> spaces_;
};

/// One plane before a camera, at one instant of the exposure. Points of the plane are metres in its
/// own frame, z = 0.
class PlaneView {
 public:
  /// All rows are taken at once. The field of view must outlive this.
  PlaneView(const FieldOfView& view, const Eigen::Isometry3d& camera_T_plane);

  /// Rolling shutter: poses at equally spaced times, the first as the top row is taken, the last as
  /// the bottom row is; at least two.
  PlaneView(const FieldOfView& view, const std::vector<Eigen::Isometry3d>& camera_T_plane);

  /// Whether the camera sees the plane's face, from which its z axis points away.
  bool shows_face() const;

  /// Where a point is seen; empty if the lens can't image it.
  std::optional<Eigen::Vector2d> pixel(const Eigen::Vector2d& point) const;

  /// What of the plane a pixel sees; empty if none of it.
  std::optional<Eigen::Vector2d> point(const Eigen::Vector2d& pixel) const;

  /// Outline in pixels of a convex polygon, clipped to the field of view; chords of curved edges
  /// stay within 0.002 pixels. Empty if nothing is in view.
  Polygon outline(const Polygon& polygon) const;
  Polygon outline(const Rect& rect) const;

 private:
  /// Columns of camera_T_plane.
  struct Axes {
    Eigen::Vector3d x, y, origin;
    Eigen::Vector3d at(const Eigen::Vector2d& p) const { return x * p.x() + y * p.y() + origin; }
  };
  /// Points p of the plane with normal . p >= offset.
  struct HalfPlane {
    Eigen::Vector2d normal;
    double offset = 0.0;
    double height(const Eigen::Vector2d& p) const { return normal.dot(p) - offset; }
  };
  using Pixel = std::optional<Eigen::Vector2d>;

  static Axes axes_of(const Eigen::Isometry3d& camera_T_plane);
  static Polygon clipped(const Polygon& polygon, const HalfPlane& within);
  void set_bounds();
  Axes axes_at(double row) const;
  Pixel project(const Axes& axes, const Eigen::Vector2d& point) const;
  void add_edge(const Eigen::Vector2d& from, const Pixel& a, const Eigen::Vector2d& to,
                const Pixel& b, int depth, Polygon& out) const;

  const Camera& camera_;
  const FieldOfView& view_;
  std::vector<Axes> rows_;  ///< one where all rows are taken at once
  Axes middle_;             ///< of the middle row
  std::vector<HalfPlane> bounds_;
  bool pinhole_;   ///< whether the lens is free of distortion
  bool straight_;  ///< whether straight edges look straight
};

/// A block of whole pixels: columns x … x + width - 1, rows y … y + height - 1.
struct PixelWindow {
  int x = 0, y = 0, width = 0, height = 0;
  bool empty() const { return width <= 0 || height <= 0; }
};

/// The smallest window of the image that holds an outline and `reach` pixels around it.
PixelWindow window_around(const Polygon& outline, const Camera& camera, int reach);

}  // namespace harco::lab
