#include "pose/edge_band.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

namespace harco {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector2d;
using Eigen::Vector2i;
using Eigen::Vector3d;

class Band {
 public:
  Band(const Camera& camera, const Isometry3d& pose, int reach)
      : camera_(camera),
        pose_(pose),
        width_(camera.width),
        height_(camera.height),
        reach_(reach),
        marked_(static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_)) {}

  void add_outline(const Rect& r) {
    add_line({r.x0, r.y0}, {r.x1, r.y0});
    add_line({r.x1, r.y0}, {r.x1, r.y1});
    add_line({r.x1, r.y1}, {r.x0, r.y1});
    add_line({r.x0, r.y1}, {r.x0, r.y0});
  }

  std::vector<Vector2i> pixels() const {
    std::vector<Vector2i> all;
    for (int y = 0; y < height_; ++y)
      for (int x = 0; x < width_; ++x)
        if (marked_[index(x, y)]) all.emplace_back(x, y);
    return all;
  }

 private:
  std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) +
           static_cast<std::size_t>(x);
  }

  std::optional<Vector2d> seen(const Vector2d& p) const {
    return camera_.project(pose_ * Vector3d(p.x(), p.y(), 0.0));
  }

  void add_line(const Vector2d& a, const Vector2d& b) { halve(a, seen(a), b, seen(b), 0); }

  /// Halves a line until its parts are no longer than a pixel or out of view.
  void halve(const Vector2d& a, const std::optional<Vector2d>& pa, const Vector2d& b,
             const std::optional<Vector2d>& pb, int depth) {
    constexpr int kDeepest = 16;       // a line of 65 000 pixels
    constexpr int kDeepestUnseen = 6;  // a line that may come into view between its ends
    if (pa && pb) {
      if (beyond(*pa, *pb)) return;
      if ((*pa - *pb).norm() <= 1.5 || depth == kDeepest) {
        mark(0.5 * (*pa + *pb));
        return;
      }
    } else if (depth == kDeepest || (!pa && !pb && depth >= kDeepestUnseen)) {
      return;
    }
    const Vector2d middle = 0.5 * (a + b);
    const std::optional<Vector2d> pm = seen(middle);
    halve(a, pa, middle, pm, depth + 1);
    halve(middle, pm, b, pb, depth + 1);
  }

  /// Both ends off the same side of the image.
  bool beyond(const Vector2d& a, const Vector2d& b) const {
    const double margin = reach_ + 1.0 + 0.1 * (a - b).norm();  // a lens bends lines
    return std::max(a.x(), b.x()) < -margin || std::min(a.x(), b.x()) > width_ + margin ||
           std::max(a.y(), b.y()) < -margin || std::min(a.y(), b.y()) > height_ + margin;
  }

  void mark(const Vector2d& at) {
    const int cx = static_cast<int>(std::lround(at.x())),
              cy = static_cast<int>(std::lround(at.y()));
    for (int y = std::max(0, cy - reach_); y <= std::min(height_ - 1, cy + reach_); ++y)
      for (int x = std::max(0, cx - reach_); x <= std::min(width_ - 1, cx + reach_); ++x)
        marked_[index(x, y)] = true;
  }

  const Camera& camera_;
  const Isometry3d& pose_;
  int width_, height_, reach_;
  std::vector<bool> marked_;
};

}  // namespace

std::vector<Vector2i> edge_band(const InkPlan& ink, const Camera& camera,
                                const Isometry3d& camera_T_marker, int reach) {
  Band band(camera, camera_T_marker, reach);
  band.add_outline(ink.square);
  for (const Rect& r : ink.white) band.add_outline(r);
  for (const Rect& r : ink.black) band.add_outline(r);
  return band.pixels();
}

}  // namespace harco
