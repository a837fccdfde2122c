#include "blobs.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include <Eigen/LU>

namespace harco::lab {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

/// Which part of a square is covered, on a grid of points.
class CoveredShare {
 public:
  explicit CoveredShare(double side) : side_(side) {}

  void add(const Blob& blob) {
    for (std::size_t i = 0; i < covered_.size(); ++i) {
      const std::size_t row = i / kAcross;
      const std::size_t column = i % kAcross;
      const Vector2d point((static_cast<double>(column) + 0.5) * side_ / kAcross,
                           (static_cast<double>(row) + 0.5) * side_ / kAcross);
      if ((point - blob.centre).squaredNorm() < blob.radius * blob.radius) covered_[i] = true;
    }
  }
  double share() const {
    const auto count = std::count(covered_.begin(), covered_.end(), true);
    return static_cast<double>(count) / static_cast<double>(covered_.size());
  }

 private:
  static constexpr std::size_t kAcross = 80;
  double side_;
  std::array<bool, kAcross * kAcross> covered_{};
};

}  // namespace

std::vector<Blob> cover(double side_m, double share, int most, std::mt19937_64& random) {
  if (!(share >= 0.0 && share < 1.0))
    throw std::invalid_argument("cover: the share must be from 0 to below 1");
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  std::vector<Blob> blobs;
  if (share == 0.0) return blobs;
  if (most == 1) {
    const double radius = side_m * std::sqrt(share / std::numbers::pi);
    const double play = std::max(0.0, side_m - 2.0 * radius);
    const Vector2d corner(unit(random), unit(random));
    blobs.push_back(
        {play * corner + Vector2d::Constant(0.5 * (side_m - play)), radius, 255.0 * unit(random)});
    return blobs;
  }
  CoveredShare covered(side_m);
  while (covered.share() < share && static_cast<int>(blobs.size()) < most) {
    const Vector2d centre(unit(random), unit(random));
    blobs.push_back({side_m * centre, side_m * (0.06 + 0.14 * unit(random)), 255.0 * unit(random)});
    covered.add(blobs.back());
  }
  return blobs;
}

void draw_blobs(FloatImage& picture, const std::vector<Blob>& blobs, const Camera& camera,
                const Eigen::Isometry3d& camera_T_marker, double psf_sigma_px) {
  const Eigen::Isometry3d marker_T_camera = camera_T_marker.inverse();
  const Vector3d eye = marker_T_camera.translation();
  const double softness = std::sqrt(2.0 * (psf_sigma_px * psf_sigma_px + 1.0 / 12.0));
  const auto on_plane = [&](double x, double y) -> std::optional<Vector2d> {
    const auto ray = camera.unproject({x, y});
    if (!ray) return std::nullopt;
    const Vector3d direction = marker_T_camera.linear() * Vector3d(ray->x(), ray->y(), 1.0);
    const double reach = -eye.z() / direction.z();
    if (!(reach > 0.0)) return std::nullopt;
    return Vector2d((eye + reach * direction).head<2>());
  };
  for (int y = 0; y < picture.height; ++y)
    for (int x = 0; x < picture.width; ++x) {
      const auto at = on_plane(x, y);
      const auto right = on_plane(x + 0.5, y);
      const auto below = on_plane(x, y + 0.5);
      if (!at || !right || !below) continue;
      Eigen::Matrix2d by_pixel;
      by_pixel << 2.0 * (*right - *at), 2.0 * (*below - *at);
      for (const Blob& blob : blobs) {
        const Vector2d away = *at - blob.centre;
        const double distance = away.norm();
        if (distance < 1e-12) continue;
        const double metres_a_pixel = (by_pixel.transpose() * away / distance).norm();
        const double inside_px = (blob.radius - distance) / metres_a_pixel;
        const double covered = 0.5 * std::erfc(-inside_px / softness);
        float& grey = picture.row(y)[x];
        grey += static_cast<float>(covered * (blob.grey - static_cast<double>(grey)));
      }
    }
}

}  // namespace harco::lab
