#include "pose/ambiguity.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include <Eigen/Cholesky>

namespace harco {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Vector6d = Eigen::Matrix<double, 6, 1>;

/// Tukey's loss: z^2 for small z, constant far out.
double tukey_loss(double z) {
  constexpr double kTukey = 4.685;
  const double q = std::max(0.0, 1.0 - z * z / (kTukey * kTukey));
  return kTukey * kTukey / 3.0 * (1.0 - q * q * q);
}

/// Standard deviation that normal values of such a median size have.
double median_size(const std::vector<double>& values) {
  std::vector<double> sizes;
  sizes.reserve(values.size());
  for (const double value : values) sizes.push_back(std::abs(value));
  const auto middle = sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() / 2);
  std::nth_element(sizes.begin(), middle, sizes.end());
  return 1.4826 * *middle;
}

double robust_scale(const std::vector<double>& residuals) {
  constexpr double kRounding = 0.29;  // grey levels
  return std::max(kRounding, median_size(residuals));
}

/// Where a pixel's ray meets the marker's plane; empty if it doesn't meet its front.
std::optional<Vector2d> on_plane(const Camera& camera, const Isometry3d& pose,
                                 const Vector2d& pixel) {
  const auto ray = camera.unproject(pixel);
  if (!ray) return std::nullopt;
  const Vector3d from = -(pose.linear().transpose() * pose.translation());
  const Vector3d way = pose.linear().transpose() * ray->homogeneous();
  if (!(from.z() < 0.0) || !(way.z() > 0.0)) return std::nullopt;
  return Vector2d((from - from.z() / way.z() * way).head<2>());
}

/// The outlines in the image, in pieces that the lens doesn't bend.
struct Piece {
  Vector2d from, to;
};
std::vector<Piece> pieces_of(const InkOutline& outline, const Camera& camera,
                             const Isometry3d& pose) {
  constexpr double kStraightPx = 8.0;
  std::vector<Piece> pieces;
  const auto seen = [&](const Vector2d& point) {
    return camera.project(pose * Vector3d(point.x(), point.y(), 0.0));
  };
  for (const InkEdge& edge : outline.edges()) {
    const auto from = seen(edge.from), to = seen(edge.to);
    if (!from || !to) return {};
    const int parts =
        camera.has_distortion() ? static_cast<int>((*to - *from).norm() / kStraightPx) + 1 : 1;
    Vector2d last = *from;
    for (int i = 1; i < parts; ++i) {
      const auto next = seen(edge.from + (edge.to - edge.from) * (double(i) / parts));
      if (!next) return {};
      pieces.push_back({last, *next});
      last = *next;
    }
    pieces.push_back({last, *to});
  }
  return pieces;
}

/// A rectangle of whole patches.
struct Frame {
  int x = 0, y = 0, columns = 0, rows = 0;
};

/// The patches that hold the square and a little around it.
Frame frame_around(const Rect& square, const ImageView& image, const Camera& camera,
                   const Isometry3d& pose) {
  constexpr double kMarginPx = 3.0;
  Eigen::Array2d low(image.width(), image.height()), high(0.0, 0.0);
  for (const double x : {square.x0, square.x1})
    for (const double y : {square.y0, square.y1})
      if (const auto pixel = camera.project(pose * Vector3d(x, y, 0.0))) {
        low = low.min(pixel->array() - kMarginPx);
        high = high.max(pixel->array() + kMarginPx);
      }
  low = low.max(0.0).floor();
  high = high.min(Eigen::Array2d(image.width(), image.height()));
  const Eigen::Array2i patches = ((high - low) / kPatch).ceil().max(0.0).cast<int>();
  return {static_cast<int>(low.x()), static_cast<int>(low.y()), patches.x(), patches.y()};
}

/// The share of white in every pixel of the frame, row by row; empty if the pose can't be seen.
std::vector<double> whiteness(const InkOutline& outline, const Camera& camera, const Look& look,
                              const Frame& frame) {
  const std::vector<Piece> pieces = pieces_of(outline, camera, look.camera_T_marker);
  if (pieces.empty()) return {};
  const auto is_black = [&](const Vector2d& pixel) {
    const auto point = on_plane(camera, look.camera_T_marker, pixel);
    return point && outline.is_black(*point);
  };
  PatchPainter painter;
  painter.set_blur(look.blur);
  const int width = frame.columns * kPatch;
  std::vector<double> white(static_cast<std::size_t>(width * frame.rows * kPatch));
  PatchPicture picture;
  for (int row = 0; row < frame.rows; ++row)
    for (int column = 0; column < frame.columns; ++column) {
      const int x0 = frame.x + column * kPatch, y0 = frame.y + row * kPatch;
      const double reach = painter.margin() + 1.0;
      painter.begin(x0, y0);
      for (const Piece& piece : pieces)
        if (std::max(piece.from.x(), piece.to.x()) > x0 - reach &&
            std::min(piece.from.x(), piece.to.x()) < x0 + kPatch + reach &&
            std::max(piece.from.y(), piece.to.y()) > y0 - reach &&
            std::min(piece.from.y(), piece.to.y()) < y0 + kPatch + reach)
          painter.add(piece.from, piece.to);
      painter.finish(is_black, picture);
      for (int y = 0; y < kPatch; ++y)
        for (int x = 0; x < kPatch; ++x)
          white[static_cast<std::size_t>((row * kPatch + y) * width + column * kPatch + x)] =
              1.0 - static_cast<double>(picture.ink[static_cast<std::size_t>(y * kPatch + x)]);
    }
  return white;
}

/// One pixel that is compared.
struct Pixel {
  std::size_t index;  ///< in the frame
  double grey;
  Vector3d place;                    ///< (1, u, v): where on the marker, -1 … 1, for the light
  std::array<std::size_t, 4> nodes;  ///< of the grid of lights, around it
  std::array<double, 4> shares;      ///< of their lights
};

std::vector<Pixel> pixels_of(const ImageView& image, const Rect& square, double quiet_m,
                             const Camera& camera, const Isometry3d& pose, const Frame& frame) {
  constexpr int kNodes = 8;  // pixels between nodes of light
  const double margin = 0.6 * quiet_m;
  const int width = frame.columns * kPatch;
  const auto in_row = static_cast<std::size_t>(width / kNodes + 2);
  std::vector<Pixel> pixels;
  for (int y = frame.y; y < std::min(frame.y + frame.rows * kPatch, image.height()); ++y)
    for (int x = frame.x; x < std::min(frame.x + width, image.width()); ++x) {
      const auto point = on_plane(camera, pose, Vector2d(x, y));
      if (!point || point->x() < square.x0 - margin || point->x() > square.x1 + margin ||
          point->y() < square.y0 - margin || point->y() > square.y1 + margin)
        continue;
      const Vector2d place = 2.0 / square.width() * (*point - Vector2d(square.x0, square.y0));
      const int dx = x - frame.x, dy = y - frame.y;
      const std::size_t node =
          static_cast<std::size_t>(dy / kNodes) * in_row + static_cast<std::size_t>(dx / kNodes);
      const double right = double(dx % kNodes) / kNodes, below = double(dy % kNodes) / kNodes;
      pixels.push_back({static_cast<std::size_t>(dy * width + dx),
                        static_cast<double>(image(x, y)),
                        {1.0, place.x() - 1.0, place.y() - 1.0},
                        {node, node + 1, node + in_row, node + in_row + 1},
                        {(1.0 - right) * (1.0 - below), right * (1.0 - below),
                         (1.0 - right) * below, right * below}});
    }
  return pixels;
}

/// A prediction of grey values: levels of black and white, planes over the marker, in a light that
/// may differ from place to place (shadows), up to what the image can hold.
class Levels {
 public:
  Levels(const std::vector<Pixel>& pixels, const std::vector<double>& white)
      : pixels_(pixels),
        white_(white),
        residuals_(pixels.size(), 0.0),
        stride_(pixels.size() / kSome + 1) {
    for (const Pixel& pixel : pixels)
      gains_.resize(std::max(gains_.size(), pixel.nodes[3] + 1), 1.0);
  }

  /// What the best of them (Huber's weights) leaves of the greys.
  const std::vector<double>& residuals() {
    constexpr int kRounds = 4;
    for (int round = 0; round < kRounds; ++round) {
      fit_planes();
      if (round > 0) fit_gains();
      std::vector<double> some;
      for (std::size_t i = 0; i < pixels_.size(); i += stride_) some.push_back(residuals_[i]);
      limit_ = 1.5 * robust_scale(some);
    }
    update(1);
    return residuals_;
  }

 private:
  static constexpr double kBrightest = 255.0, kBurnt = 250.0;
  static constexpr std::size_t kSome = 3000;  // pixels that the levels are fitted to

  double weight(std::size_t i) const {
    // What is burnt tells no level.
    if (pixels_[i].grey >= kBurnt) return 0.0;
    return 1.0 / std::max(1.0, std::abs(residuals_[i]) / limit_);
  }

  Vector6d row(const Pixel& pixel) const {
    Vector6d levels;
    levels << (1.0 - white_[pixel.index]) * pixel.place, white_[pixel.index] * pixel.place;
    return levels;
  }

  double gain(const Pixel& pixel) const {
    double gain = 0.0;
    for (std::size_t n = 0; n < 4; ++n) gain += pixel.shares[n] * gains_[pixel.nodes[n]];
    return gain;
  }

  void fit_planes() {
    Matrix6d normal = 1e-6 * Matrix6d::Identity();
    Vector6d right = Vector6d::Zero();
    for (std::size_t i = 0; i < pixels_.size(); i += stride_) {
      const Vector6d at = gain(pixels_[i]) * row(pixels_[i]);
      const Vector6d weighted = weight(i) * at;
      normal += weighted * at.transpose();
      right += pixels_[i].grey * weighted;
    }
    planes_ = normal.ldlt().solve(right);
    update(stride_);
  }

  /// As far as they differ by more than noise makes them.
  void fit_gains() {
    constexpr double kLeastSpread = 0.003;
    std::vector<double> seen(gains_.size(), 0.0), expected(gains_.size(), 0.0), apart;
    for (std::size_t i = 0; i < pixels_.size(); i += stride_) {
      const double model = row(pixels_[i]).dot(planes_), weighted = weight(i) * model;
      for (std::size_t n = 0; n < 4; ++n) {
        const double share = pixels_[i].shares[n] * weighted;
        seen[pixels_[i].nodes[n]] += share * pixels_[i].grey;
        expected[pixels_[i].nodes[n]] += share * model;
      }
    }
    for (std::size_t b = 0; b < gains_.size(); ++b)
      if (expected[b] > 0.0) apart.push_back(seen[b] / expected[b] - 1.0);
    if (apart.empty()) return;
    const double noise = limit_ / 1.5;
    const double spread = std::max(kLeastSpread, median_size(apart));
    for (std::size_t b = 0; b < gains_.size(); ++b) {
      if (!(expected[b] > 0.0)) continue;
      const double known = noise * noise / (spread * spread);
      gains_[b] = (seen[b] + known) / (expected[b] + known);
    }
    update(stride_);
  }

  void update(std::size_t stride) {
    for (std::size_t i = 0; i < pixels_.size(); i += stride)
      residuals_[i] =
          pixels_[i].grey - std::min(kBrightest, gain(pixels_[i]) * row(pixels_[i]).dot(planes_));
  }

  const std::vector<Pixel>& pixels_;
  const std::vector<double>& white_;
  std::vector<double> residuals_, gains_;
  std::size_t stride_;
  Vector6d planes_ = Vector6d::Zero();
  double limit_ = std::numeric_limits<double>::infinity();
};

double loss(const std::vector<double>& residuals, double scale) {
  double sum = 0.0;
  for (const double r : residuals) sum += tukey_loss(r / scale);
  return sum;
}

/// What has to be added to the pose's estimate to reach another one, as in Pose::covariance.
Vector6d way(const Isometry3d& from, const Isometry3d& to) {
  const Eigen::AngleAxisd turn(from.linear().transpose() * to.linear());
  Vector6d way;
  way << to.translation() - from.translation(), turn.angle() * turn.axis();
  return way;
}

/// Second moment that the other solution adds; it is the same seen from either one.
Matrix6d spread(const Isometry3d& pose, const Isometry3d& other, double ratio) {
  const Vector6d apart = way(pose, other);
  return apart * apart.transpose() / (1.0 + std::exp(std::min(ratio, 700.0)));
}

}  // namespace

double picture_ratio(const ImageView& image, const InkOutline& outline, double quiet_m,
                     const Camera& camera, const Look& a, const Look& b) {
  constexpr std::size_t kEnough = 60;
  const Frame frame = frame_around(outline.square(), image, camera, a.camera_T_marker);
  const std::vector<Pixel> pixels =
      pixels_of(image, outline.square(), quiet_m, camera, a.camera_T_marker, frame);
  const std::vector<double> white_a = whiteness(outline, camera, a, frame);
  const std::vector<double> white_b = whiteness(outline, camera, b, frame);
  if (pixels.size() < kEnough || white_a.empty() || white_b.empty()) return 0.0;
  Levels under_a(pixels, white_a), under_b(pixels, white_b);
  const std::vector<double>&left_a = under_a.residuals(), &left_b = under_b.residuals();
  const double scale = std::min(robust_scale(left_a), robust_scale(left_b));
  return 0.5 * (loss(left_b, scale) - loss(left_a, scale));
}

double gravity_ratio(const GravityPrior& gravity, const Isometry3d& a, const Isometry3d& b) {
  const Vector3d down = gravity.in_camera.normalized();
  const Vector3d on_marker = gravity.in_marker.normalized();
  const auto squared_angle = [&](const Isometry3d& pose) {
    const Vector3d expected = pose.linear() * on_marker;
    const double angle = std::atan2(expected.cross(down).norm(), expected.dot(down));
    return angle * angle;
  };
  return 0.5 * (squared_angle(b) - squared_angle(a)) / (gravity.sigma_rad * gravity.sigma_rad);
}

double angle_between(const Isometry3d& a, const Isometry3d& b) {
  return Eigen::AngleAxisd(a.linear().transpose() * b.linear()).angle();
}

void add_alternative(Pose& pose, const Isometry3d& second, double ratio) {
  pose.alternative = second;
  if (ratio < 0.0) std::swap(pose.camera_T_marker, *pose.alternative);
  ratio = std::abs(ratio);
  if (pose.covariance) *pose.covariance += spread(pose.camera_T_marker, *pose.alternative, ratio);
  pose.log_likelihood_ratio = ratio;
  if (ratio > kDecidedLogRatio) {
    pose.alternative.reset();
    pose.log_likelihood_ratio.reset();
  }
}

void change_ratio(Pose& pose, double ratio) {
  if (pose.covariance)
    *pose.covariance -= spread(pose.camera_T_marker, *pose.alternative, *pose.log_likelihood_ratio);
  const Isometry3d second = *pose.alternative;
  add_alternative(pose, second, ratio);
}

}  // namespace harco
