// Homography from point correspondences: the direct linear transform on normalised coordinates
// (Hartley and Zisserman, section 4.1).
#include <cmath>
#include <stdexcept>

#include <Eigen/LU>
#include <Eigen/QR>

#include "pose/planar.hpp"

namespace harco {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Vector8d = Eigen::Matrix<double, 8, 1>;

constexpr double kDegenerate = 1e-9;  // of coordinates that are of the order of one

[[noreturn]] void refuse() {
  throw std::invalid_argument("homography: the points are degenerate (on a line, or coincident)");
}

/// The similarity that moves points to the centroid 0 and the mean distance sqrt(2) from it.
struct Normalisation {
  explicit Normalisation(const Points& points) : centre(points.rowwise().mean()) {
    const double mean = (points.colwise() - centre).colwise().norm().mean();
    if (!(mean > 0.0)) refuse();
    scale = std::sqrt(2.0) / mean;
  }
  Vector2d operator()(const Vector2d& point) const { return scale * (point - centre); }
  Matrix3d matrix() const {
    Matrix3d m;
    m << scale, 0.0, -scale * centre.x(), 0.0, scale, -scale * centre.y(), 0.0, 0.0, 1.0;
    return m;
  }

  Vector2d centre;
  double scale = 1.0;
};

/// h11 … h32 with h33 = 1. That loses nothing: h33 = 0 would put the points' centre, which lies
/// among them, at infinity. `Rows` is 8 for four points (no allocation) or Eigen::Dynamic.
template <int Rows>
Vector8d solve(const Points& plane, const Points& image, const Normalisation& from,
               const Normalisation& to) {
  Eigen::Matrix<double, Rows, 8> a(2 * plane.cols(), 8);
  Eigen::Matrix<double, Rows, 1> b(2 * plane.cols());
  for (Eigen::Index i = 0; i < plane.cols(); ++i) {
    const Vector2d p = from(plane.col(i));
    const Vector2d q = to(image.col(i));
    a.row(2 * i) << p.x(), p.y(), 1.0, 0.0, 0.0, 0.0, -q.x() * p.x(), -q.x() * p.y();
    a.row(2 * i + 1) << 0.0, 0.0, 0.0, p.x(), p.y(), 1.0, -q.y() * p.x(), -q.y() * p.y();
    b.template segment<2>(2 * i) = q;
  }
  Eigen::ColPivHouseholderQR<Eigen::Matrix<double, Rows, 8>> qr(2 * plane.cols(), 8);
  qr.setThreshold(kDegenerate);
  qr.compute(a);
  if (qr.rank() < 8) refuse();
  return qr.solve(b);
}

}  // namespace

void require_correspondences(const Points& plane, const Points& image) {
  if (plane.cols() != image.cols() || plane.cols() < 4)
    throw std::invalid_argument("a plane's pose needs at least four points and their images");
  if (!plane.allFinite() || !image.allFinite())
    throw std::invalid_argument("a plane's pose needs finite points");
}

Matrix3d homography(const Points& plane, const Points& image) {
  require_correspondences(plane, image);
  const Normalisation from(plane);
  const Normalisation to(image);
  const Vector8d h = plane.cols() == 4 ? solve<8>(plane, image, from, to)
                                       : solve<Eigen::Dynamic>(plane, image, from, to);
  Matrix3d normalised;
  normalised << h[0], h[1], h[2], h[3], h[4], h[5], h[6], h[7], 1.0;
  // The images on a line: the equations can be solved, but the map can't be inverted.
  if (!(std::abs(normalised.determinant()) > kDegenerate)) refuse();

  // x_image = to^-1 (normalised (from x_plane)).
  Matrix3d back;
  back << 1.0 / to.scale, 0.0, to.centre.x(), 0.0, 1.0 / to.scale, to.centre.y(), 0.0, 0.0, 1.0;
  return back * normalised * from.matrix();
}

Matrix3d fit_homography(const std::vector<Vector2d>& plane_points,
                        const std::vector<Vector2d>& image_points) {
  return homography(columns(plane_points), columns(image_points));
}

}  // namespace harco
