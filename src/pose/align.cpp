#include "pose/align.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>

#include "pose/refine.hpp"

namespace harco {
namespace {

using Eigen::Isometry3d;
using Eigen::Matrix2d;
using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix26d = Eigen::Matrix<double, 2, 6>;

// What is solved for: (dt, w); the blur's second moments (the first alone where it is round); how
// the camera's response bends; the levels of black and of white, each a plane over the marker.
constexpr int kPose = 6, kBlur = 6, kGamma = 9, kBlack = 10, kWhite = 13, kUnknowns = 16;
using Row = Eigen::Matrix<double, kUnknowns, 1>;
using Normal = Eigen::Matrix<double, kUnknowns, kUnknowns>;
using Levels = Eigen::Matrix<double, 6, 1>;

// The most patches that are looked at; of more, those that tell most.
constexpr std::size_t kMostPatches = 160;
// So many make the first, rough step.
constexpr std::size_t kRoughPatches = 36;
constexpr std::size_t kLeastSamples = 60;
// The blur at first, and what it may be: variances in square pixels.
constexpr double kFirstVariance = 0.4, kLeastVariance = 0.04, kMostVariance = 30.0;
// Where less changes per pixel, in shares of the contrast, one pixel of kFlatStep tells enough.
constexpr float kFlat = 0.03F;
constexpr int kFlatStep = 7;
// A blur whose second moments differ by less in all directions is round, square pixels.
constexpr double kRound = 0.15;
// A step that changes the blur by less than this share of it is the last.
constexpr double kSameBlur = 0.15;
// Beyond so many sigmas of the blur, an edge isn't seen any more.
constexpr double kTail = 3.0;
// About what to expect of the logarithm of the response's exponent, and what it may be.
constexpr double kUsualLogGamma = 0.5, kLeastLogGamma = -0.4, kMostLogGamma = 1.1;
// Tukey's constant: residuals of so many times the noise have no weight.
constexpr float kTukey = 4.685F;
// Noise in grey levels that nothing falls short of: that of rounding.
constexpr double kRounding = 0.29;
// White must exceed black by so much, in grey levels and in units of the noise.
constexpr double kLeastContrast = 10.0, kLeastContrastToNoise = 4.0;
// Less than this share of the pixels is no evidence.
constexpr double kLeastShare = 0.4;
// From this share of the pixels on, nothing asks for another light (noise alone leaves 0.91).
constexpr double kPlainShare = 0.88;
// ... if patches as a whole fit no worse than this, too (noise alone leaves about 1).
constexpr double kEven = 1.6;
// Where the pose puts a pixel no worse than this, its patch can be compared.
constexpr double kTrustedPx = 0.4;
// If nothing is as good as that: patches that are so many times as bad as the best, up to a limit.
constexpr double kNearlyBest = 1.5, kMostTrustedPx = 2.5;
// Alignment may move what it trusts from the start by so many pixels, root mean square.
constexpr double kMostShiftPx = 1.0;
// Steps that move the patches by less are the last.
constexpr double kSettledPx = 0.03;

/// A pixel position: what it sees, and how that moves.
struct Node {
  Vector2d place = Vector2d::Zero();      ///< in the plane, metres
  Matrix26d by_pose = Matrix26d::Zero();  ///< d pixel / d (dt, w)
  bool valid = false;
};

// In uneven light every patch has a brightness of its own, and its slopes.
constexpr int kLight = 3;
using LightRows = Eigen::Matrix<double, kUnknowns, kLight>;

/// A patch's own light, eliminated from the normal equations.
struct Local {
  Eigen::Matrix<double, kLight, kLight> inverse =
      Eigen::Matrix<double, kLight, kLight>::Zero();  ///< of its information
  LightRows shared = LightRows::Zero();               ///< what it shares with the rest
  Eigen::Matrix<double, kLight, 1> pull =
      Eigen::Matrix<double, kLight, 1>::Zero();  ///< of the residuals on it
};

struct Patch {
  int x = 0, y = 0;  ///< its first pixel
  Vector2d place = Vector2d::Zero(), place_by_x = Vector2d::Zero(), place_by_y = Vector2d::Zero();
  Matrix26d by_pose = Matrix26d::Zero();  ///< in the middle
  Matrix26d by_pose_by_x = Matrix26d::Zero(),
            by_pose_by_y = Matrix26d::Zero();  ///< its change per pixel
  double plane_per_px = 0.0;                   ///< metres, the greatest
  std::size_t first = 0, count = 0;            ///< its samples
  int outlines = -1;                           ///< the last of its pieces
  double merit = 0.0;
  bool seen = false;      ///< before the camera, all of it
  double error_px = 0.0;  ///< of the pose, there
  bool trusted = false;   ///< whether that is good enough
  double gain = 1.0;      ///< light, where it is uneven
  Local local;
};

/// State of the solution. The pose's frame is moved to the middle of what is seen.
struct State {
  Matrix3d rotation = Matrix3d::Identity();
  Vector3d translation = Vector3d::Zero();
  Matrix2d blur = kFirstVariance * Matrix2d::Identity();  ///< second moments
  double log_gamma = 0.0;  ///< of the response: grey ~ light^(1/gamma)
  Levels levels = Levels::Zero();
};

/// What a camera whose grey values go with the power 1/gamma of the light makes of a mixture of
/// black and white, as a share of the contrast.
class Response {
 public:
  /// `black` is the grey value of black as a share of white's.
  void set(double log_gamma, double black) {
    constexpr double kDifference = 1e-3;
    Table less{}, more{};
    tabulate(log_gamma, black, seen_);
    tabulate(log_gamma - kDifference, black, less);
    tabulate(log_gamma + kDifference, black, more);
    for (std::size_t i = 0; i <= kCells; ++i) {
      by_log_gamma_[i] = (more[i] - less[i]) / static_cast<float>(2.0 * kDifference);
      const std::size_t before = i > 0 ? i - 1 : 0, after = i < kCells ? i + 1 : kCells;
      slope_[i] = (seen_[after] - seen_[before]) * static_cast<float>(kCells) /
                  static_cast<float>(after - before);
    }
  }

  struct Value {
    float seen, slope, by_log_gamma;
  };
  Value at(float white_share) const {
    const float place = std::clamp(white_share, 0.0F, 1.0F) * static_cast<float>(kCells);
    const auto cell = std::min(static_cast<std::size_t>(place), kCells - 1);
    const float part = place - static_cast<float>(cell);
    const auto between = [&](const Table& table) {
      return table[cell] + part * (table[cell + 1] - table[cell]);
    };
    return {between(seen_), between(slope_), between(by_log_gamma_)};
  }

 private:
  static constexpr std::size_t kCells = 128;
  using Table = std::array<float, kCells + 1>;

  static void tabulate(double log_gamma, double black, Table& table) {
    const double gamma = std::exp(log_gamma);
    const double dark = std::pow(black, gamma);
    for (std::size_t i = 0; i <= kCells; ++i) {
      const double light =
          dark + (1.0 - dark) * static_cast<double>(i) / static_cast<double>(kCells);
      table[i] = static_cast<float>((std::pow(light, 1.0 / gamma) - black) / (1.0 - black));
    }
  }

  Table seen_{}, slope_{}, by_log_gamma_{};
};

float tukey_weight(float z2) {
  const float q = std::max(0.0F, 1.0F - z2 / (kTukey * kTukey));
  return q * q;
}

/// Tukey's loss: z^2 for small z, constant far out.
double tukey_loss(double z2) {
  const double c2 = static_cast<double>(kTukey) * static_cast<double>(kTukey);
  const double q = std::max(0.0, 1.0 - z2 / c2);
  return c2 / 3.0 * (1.0 - q * q * q);
}

/// Sums in a fixed order, eight at a time.
constexpr std::size_t kLanes = 8;
float sum_of(const std::array<float, kLanes>& lanes) {
  return ((lanes[0] + lanes[4]) + (lanes[2] + lanes[6])) +
         ((lanes[1] + lanes[5]) + (lanes[3] + lanes[7]));
}
float dot(const float* a, const float* b, std::size_t count) {
  std::array<float, kLanes> lanes{};
  std::size_t i = 0;
  for (; i + kLanes <= count; i += kLanes)
    for (std::size_t k = 0; k < kLanes; ++k) lanes[k] += a[i + k] * b[i + k];
  for (; i < count; ++i) lanes[0] += a[i] * b[i];
  return sum_of(lanes);
}

float median(std::vector<float>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// Even light varies at most linearly over the marker; in uneven light, that of a shadow,
/// each patch has a gain of its own besides.
enum class LightModel { even, uneven };

/// How much residuals count: all of them, less and less (Huber), or not at all far out (Tukey).
enum class Weights { huber, tukey };

class Aligner {
 public:
  Aligner(const ImageView& image, const InkOutline& outline, double quiet, const Camera& camera,
          LightModel light)
      : image_(image), outline_(outline), quiet_(quiet), camera_(camera), light_(light) {}

  std::optional<Alignment> run(const Isometry3d& start, const std::optional<Matrix6d>& covariance) {
    constexpr int kSteps = 12;
    centre_.setZero();
    state_ = State{start.linear(), start.translation()};
    covariance_ = covariance;
    if (!lay_patches(start)) return std::nullopt;
    move_frame_to_middle();
    if (!lay_patches(start) || trusted_px_ > kMostTrustedPx) return std::nullopt;
    // A pose that is only roughly right is seen better by a blurred eye.
    state_.blur *= std::max(1.0, trusted_px_ * trusted_px_ / kFirstVariance);
    if (trusted_px_ * trusted_px_ > kFirstVariance && !lay_patches(start)) return std::nullopt;
    choose_patches(kRoughPatches);
    if (!linearise() || !first_levels()) return std::nullopt;
    oriented_ = true;
    linearise_levels();
    if (!step(Weights::huber)) return std::nullopt;
    oriented_ = has_direction();
    for (int i = 0; i < kSteps; ++i) {
      const std::size_t before = trusted_;
      if (!lay_patches(pose())) return std::nullopt;
      choose_patches(kMostPatches);
      if (!linearise()) return std::nullopt;
      linearise_levels();
      const std::optional<double> moved = step(Weights::tukey);
      if (!moved) return std::nullopt;
      const bool grown = trusted_ > before;
      if (*moved < kSettledPx && reblurred_ < kSameBlur && !grown) return finish(start, covariance);
    }
    return std::nullopt;
  }

 private:
  Vector3d centre3() const { return {centre_.x(), centre_.y(), 0.0}; }

  Isometry3d pose() const {
    Isometry3d pose = Isometry3d::Identity();
    pose.linear() = state_.rotation;
    pose.translation() = state_.translation - state_.rotation * centre3();
    return pose;
  }

  /// There rotation and translation hardly mix.
  void move_frame_to_middle() {
    const Node middle =
        node(pose(), x0_ + 0.5 * kPatch * columns_, y0_ + 0.5 * kPatch * rows_count_);
    if (!middle.valid) return;
    centre_ = middle.place;
    state_.translation += state_.rotation * centre3();
    if (covariance_) covariance_ = moved(*covariance_, state_.rotation, -centre3());
  }

  // --- where the marker is seen ------------------------------------------------------------------

  struct Piece {
    Vector2d from, to;  ///< pixels
  };

  void add_piece(const Vector3d& a, const std::optional<Vector2d>& pa, const Vector3d& b,
                 const std::optional<Vector2d>& pb, int depth) {
    constexpr int kDeepest = 8;
    constexpr double kFlatEnough = 0.005;  // pixels between an edge and its chord
    if (pa && pb) {
      const double margin = painter_.margin() + 1.0 + (bends_ ? 0.2 * (*pa - *pb).norm() : 0.0);
      if (std::max(pa->x(), pb->x()) < -margin ||
          std::min(pa->x(), pb->x()) > image_.width() + margin ||
          std::max(pa->y(), pb->y()) < -margin ||
          std::min(pa->y(), pb->y()) > image_.height() + margin)
        return;
      if (!bends_ || depth == kDeepest) {
        pieces_.push_back({*pa, *pb});
        return;
      }
    } else if (depth == kDeepest) {
      return;
    }
    const Vector3d middle = 0.5 * (a + b);
    const std::optional<Vector2d> pm = camera_.project(middle);
    if (pa && pb && pm &&
        (*pm - 0.5 * (*pa + *pb)).norm() <
            kFlatEnough * (depth > 0 || (*pa - *pb).norm() < 30.0 ? 1.0 : 0.0)) {
      pieces_.push_back({*pa, *pb});
      return;
    }
    add_piece(a, pa, middle, pm, depth + 1);
    add_piece(middle, pm, b, pb, depth + 1);
  }

  /// The outlines as the image has them.
  void project_outlines(const Isometry3d& pose) {
    bends_ = camera_.has_distortion();
    pieces_.clear();
    const Matrix3d& r = pose.linear();
    const Vector3d& t = pose.translation();
    const auto in_space = [&](const Vector2d& p) -> Vector3d {
      return r.col(0) * p.x() + r.col(1) * p.y() + t;
    };
    for (const InkEdge& edge : outline_.edges()) {
      Vector3d a = in_space(edge.from), b = in_space(edge.to);
      const double near = 1e-3 * std::abs(t.z()) + 1e-9;
      if (a.z() < near && b.z() < near) continue;
      if (a.z() < near) a = b + (a - b) * ((b.z() - near) / (b.z() - a.z()));
      if (b.z() < near) b = a + (b - a) * ((a.z() - near) / (a.z() - b.z()));
      if (!bends_) {
        const Vector2d pa(camera_.fx * a.x() / a.z() + camera_.cx,
                          camera_.fy * a.y() / a.z() + camera_.cy);
        const Vector2d pb(camera_.fx * b.x() / b.z() + camera_.cx,
                          camera_.fy * b.y() / b.z() + camera_.cy);
        add_piece(a, pa, b, pb, 0);
      } else {
        add_piece(a, camera_.project(a), b, camera_.project(b), 0);
      }
    }
  }

  Node node(const Isometry3d& pose, double x, double y) const {
    Node node;
    const auto ray = camera_.unproject({x, y});
    if (!ray) return node;
    const Matrix3d& r = pose.linear();
    const Vector3d direction = ray->homogeneous();
    const double facing = r.col(2).dot(direction);
    const double depth = r.col(2).dot(pose.translation()) / facing;
    if (!(facing > 1e-6 && depth > 0.0)) return node;
    const Vector3d point = depth * direction;
    node.place = (r.transpose() * (point - pose.translation())).head<2>();
    Eigen::Matrix<double, 2, 3> by_point;
    if (!camera_.project(point, &by_point)) return node;
    const Vector3d p(node.place.x() - centre_.x(), node.place.y() - centre_.y(), 0.0);
    node.by_pose.leftCols<3>() = by_point;
    node.by_pose.rightCols<3>() = -by_point * r * skew(p);
    node.valid = true;
    return node;
  }

  /// Covers what is seen of the marker with patches.
  bool lay_patches(const Isometry3d& pose) {
    painted_ = Blur::with_moments(state_.blur);
    if (!oriented_ || painted_.smear.squaredNorm() / 12.0 < kRound)
      painted_ = {0.5 * state_.blur.trace(), Vector2d::Zero()};
    painter_.set_blur(painted_);
    reach_ =
        kTail * std::sqrt(painted_.variance + painted_.smear.squaredNorm() / 12.0 + 1.0 / 12.0);
    project_outlines(pose);
    Eigen::Array2d low(1e9, 1e9), high(-1e9, -1e9);
    for (const Piece& piece : pieces_) {
      low = low.min(piece.from.array()).min(piece.to.array());
      high = high.max(piece.from.array()).max(piece.to.array());
    }
    const auto bound = [](double v, int most) {
      return static_cast<int>(std::clamp(v, 0.0, static_cast<double>(most)));
    };
    const int x0 = bound(std::floor(low.x() - reach_), image_.width());
    const int y0 = bound(std::floor(low.y() - reach_), image_.height());
    const int x1 = bound(std::ceil(high.x() + reach_) + 1.0, image_.width());
    const int y1 = bound(std::ceil(high.y() + reach_) + 1.0, image_.height());
    columns_ = (x1 - x0 + kPatch - 1) / kPatch;
    rows_count_ = (y1 - y0 + kPatch - 1) / kPatch;
    if (columns_ <= 0 || rows_count_ <= 0) return false;
    x0_ = x0;
    y0_ = y0;

    std::vector<double> old_gains;
    nodes_.clear();
    for (int j = 0; j <= rows_count_; ++j)
      for (int i = 0; i <= columns_; ++i)
        nodes_.push_back(node(pose, x0 + kPatch * i - 0.5, y0 + kPatch * j - 0.5));
    patches_.assign(static_cast<std::size_t>(columns_ * rows_count_), Patch{});
    for (int j = 0; j < rows_count_; ++j)
      for (int i = 0; i < columns_; ++i) lay_patch(i, j);
    file_pieces();
    trust_patches();
    weigh_patches();
    return true;
  }

  void lay_patch(int i, int j) {
    Patch& patch = patches_[static_cast<std::size_t>(j * columns_ + i)];
    patch.x = x0_ + kPatch * i;
    patch.y = y0_ + kPatch * j;
    const auto at = [&](int dx, int dy) -> const Node& {
      return nodes_[static_cast<std::size_t>((j + dy) * (columns_ + 1) + i + dx)];
    };
    const Node &a = at(0, 0), &b = at(1, 0), &c = at(0, 1), &d = at(1, 1);
    if (!(a.valid && b.valid && c.valid && d.valid)) return;
    const auto share = [&](auto member, auto& middle, auto& by_x, auto& by_y) {
      middle = 0.25 * (a.*member + b.*member + c.*member + d.*member);
      by_x = (b.*member + d.*member - a.*member - c.*member) / (2.0 * kPatch);
      by_y = (c.*member + d.*member - a.*member - b.*member) / (2.0 * kPatch);
    };
    share(&Node::place, patch.place, patch.place_by_x, patch.place_by_y);
    share(&Node::by_pose, patch.by_pose, patch.by_pose_by_x, patch.by_pose_by_y);
    patch.plane_per_px = std::max(patch.place_by_x.norm(), patch.place_by_y.norm());
    patch.seen = true;
    if (covariance_)
      patch.error_px =
          std::sqrt(0.5 * (patch.by_pose * *covariance_ * patch.by_pose.transpose()).trace());
  }

  /// Where the pose is known well enough; if that is nowhere, where it is known best.
  void trust_patches() {
    double least = std::numeric_limits<double>::infinity();
    for (const Patch& patch : patches_)
      if (patch.seen && patch.outlines >= 0) least = std::min(least, patch.error_px);
    trusted_px_ = std::max(kTrustedPx, kNearlyBest * least);
    for (Patch& patch : patches_)
      patch.trusted = patch.seen && patch.outlines >= 0 && patch.error_px < trusted_px_;
  }

  /// To every patch the pieces that it must know.
  void file_pieces() {
    filed_.clear();
    const double margin = painter_.margin() + 0.5;
    for (std::size_t k = 0; k < pieces_.size(); ++k) {
      const Piece& piece = pieces_[k];
      const Vector2d &a = piece.from, &b = piece.to;
      const auto index = [&](double v, int first, int most) {
        return static_cast<int>(std::clamp(std::floor((v - first) / kPatch), 0.0, most - 1.0));
      };
      const double left = std::min(a.x(), b.x()), right = std::max(a.x(), b.x());
      const double top = std::min(a.y(), b.y()), bottom = std::max(a.y(), b.y());
      const int j1 = index(bottom + margin, y0_, rows_count_);
      for (int j = index(top - margin, y0_, rows_count_); j <= j1; ++j) {
        // The part of the piece in this row of patches.
        double low = left, high = right;
        if (bottom > top) {
          const double slope = (b.x() - a.x()) / (b.y() - a.y());
          const double xt =
              a.x() + slope * (std::clamp(y0_ + kPatch * j - margin, top, bottom) - a.y());
          const double xb =
              a.x() + slope * (std::clamp(y0_ + kPatch * (j + 1) + margin, top, bottom) - a.y());
          low = std::min(xt, xb), high = std::max(xt, xb);
        }
        const int i1 = index(high + margin, x0_, columns_);
        for (int i = index(low - margin, x0_, columns_); i <= i1; ++i) {
          Patch& patch = patches_[static_cast<std::size_t>(j * columns_ + i)];
          filed_.push_back({static_cast<int>(k), patch.outlines});
          patch.outlines = static_cast<int>(filed_.size()) - 1;
        }
      }
    }
  }

  /// How much each patch can tell of what is least known.
  void weigh_patches() {
    const double margin = painter_.margin();
    std::vector<Matrix6d> informations(patches_.size(), Matrix6d::Zero());
    Matrix6d all = Matrix6d::Zero();
    for (std::size_t k = 0; k < patches_.size(); ++k) {
      Patch& patch = patches_[k];
      if (!patch.trusted) continue;
      Matrix2d normals = Matrix2d::Zero();
      for (int at = patch.outlines; at >= 0; at = filed_[static_cast<std::size_t>(at)].before) {
        const Piece& piece =
            pieces_[static_cast<std::size_t>(filed_[static_cast<std::size_t>(at)].piece)];
        // Its length within the patch, near enough.
        const Vector2d along = piece.to - piece.from;
        const double length = along.norm();
        if (!(length > 0.0)) continue;
        const Vector2d d = along / length;
        const Vector2d middle(patch.x + 0.5 * (kPatch - 1), patch.y + 0.5 * (kPatch - 1));
        const double at0 = d.dot(piece.from - middle);
        const double seen = std::min(at0 + length, 0.5 * kPatch) - std::max(at0, -0.5 * kPatch);
        const double off =
            std::abs(d.x() * (piece.from - middle).y() - d.y() * (piece.from - middle).x());
        if (seen <= 0.0 || off > 0.5 * kPatch + margin) continue;
        const Vector2d n(-d.y(), d.x());
        // Short edges blur into each other.
        normals += seen * std::min(1.0, length * length / 4.0) * n * n.transpose();
      }
      informations[k] = patch.by_pose.transpose() * normals * patch.by_pose;
      all += informations[k];
    }
    all.diagonal() *= 1.0 + 1e-6;
    const Matrix6d inverse = all.inverse();
    for (std::size_t k = 0; k < patches_.size(); ++k)
      patches_[k].merit = inverse.allFinite() ? (inverse * informations[k]).trace() : 1.0;
  }

  void choose_patches(std::size_t most) {
    order_.clear();
    for (std::size_t k = 0; k < patches_.size(); ++k)
      if (patches_[k].trusted) order_.push_back(k);
    trusted_ = order_.size();
    if (order_.size() > most) {
      std::stable_sort(order_.begin(), order_.end(), [&](std::size_t a, std::size_t b) {
        return patches_[a].merit > patches_[b].merit;
      });
      order_.resize(most);
      std::sort(order_.begin(), order_.end());
    }
  }

  // --- what is compared --------------------------------------------------------------------------

  bool linearise() {
    count_ = 0;
    const std::size_t most = order_.size() * kPatch * kPatch;
    for (auto& column : columns_of_rows_) column.resize(most);
    for (auto* values :
         {&grey_, &white_share_, &u_, &v_, &residuals_, &weights_, &along_x_, &along_y_})
      values->resize(most);
    for (const std::size_t k : order_) sample(patches_[k]);
    return count_ >= kLeastSamples;
  }

  void sample(Patch& patch) {
    painter_.begin(patch.x, patch.y);
    for (int at = patch.outlines; at >= 0; at = filed_[static_cast<std::size_t>(at)].before) {
      const Piece& piece =
          pieces_[static_cast<std::size_t>(filed_[static_cast<std::size_t>(at)].piece)];
      painter_.add(piece.from, piece.to);
    }
    const Isometry3d now = pose();
    painter_.finish(
        [&](const Vector2d& pixel) {
          const Node seen = node(now, pixel.x(), pixel.y());
          return seen.valid && outline_.is_black(seen.place);
        },
        picture_);

    patch.first = count_;
    const Rect& square = outline_.square();
    const double half = 0.5 * square.width();
    // Beyond the quiet zone the description ends.
    const double tail = reach_ * patch.plane_per_px;
    const double margin = std::clamp(quiet_ - tail, 0.0, tail);
    const double middle = 0.5 * (kPatch - 1);
    const int height = std::min(kPatch, image_.height() - patch.y);
    const int width = std::min(kPatch, image_.width() - patch.x);
    for (int y = 0; y < height; ++y) {
      const std::uint8_t* greys = image_.row(patch.y + y) + patch.x;
      for (int x = 0; x < width; ++x) {
        const auto at = static_cast<std::size_t>(y * kPatch + x);
        const float gx = picture_.by_x[at], gy = picture_.by_y[at];
        if (gx * gx + gy * gy < kFlat * kFlat && (x + 3 * y) % kFlatStep != 0) continue;
        const double dx = x - middle, dy = y - middle;
        const Vector2d place = patch.place + dx * patch.place_by_x + dy * patch.place_by_y;
        if (place.x() < square.x0 - margin || place.x() > square.x1 + margin ||
            place.y() < square.y0 - margin || place.y() > square.y1 + margin)
          continue;
        grey_[count_] = static_cast<float>(greys[x]);
        white_share_[count_] = 1.0F - picture_.ink[at];
        u_[count_] = static_cast<float>((place.x() - square.x0) / half - 1.0);
        v_[count_] = static_cast<float>((place.y() - square.y0) / half - 1.0);
        along_x_[count_] = static_cast<float>(2.0 * dx / kPatch);
        along_y_[count_] = static_cast<float>(2.0 * dy / kPatch);
        for (Eigen::Index k = 0; k < kPose; ++k) {
          const auto fx = static_cast<float>(patch.by_pose(0, k) + dx * patch.by_pose_by_x(0, k) +
                                             dy * patch.by_pose_by_y(0, k));
          const auto fy = static_cast<float>(patch.by_pose(1, k) + dx * patch.by_pose_by_x(1, k) +
                                             dy * patch.by_pose_by_y(1, k));
          column(k)[count_] = gx * fx + gy * fy;
        }
        column(kBlur)[count_] = -0.5F * picture_.by_xx[at];
        column(kBlur + 1)[count_] = -picture_.by_xy[at];
        column(kBlur + 2)[count_] = -0.5F * picture_.by_yy[at];
        ++count_;
      }
    }
    patch.count = count_ - patch.first;
  }

  float* column(Eigen::Index k) { return columns_of_rows_[static_cast<std::size_t>(k)].data(); }
  const float* column(Eigen::Index k) const {
    return columns_of_rows_[static_cast<std::size_t>(k)].data();
  }

  /// Levels from medians.
  bool first_levels() {
    const auto [low, high] = std::minmax_element(
        white_share_.begin(), white_share_.begin() + static_cast<std::ptrdiff_t>(count_));
    const float reach = 0.15F * (*high - *low);
    const float black_below = *low + reach, white_above = *high - reach;
    std::vector<float> black, white;
    for (std::size_t i = 0; i < count_; ++i) {
      if (white_share_[i] <= black_below) black.push_back(grey_[i]);
      if (white_share_[i] >= white_above) white.push_back(grey_[i]);
    }
    if (black.size() < 4 || white.size() < 4) return false;
    const double dark = static_cast<double>(median(black)),
                 bright = static_cast<double>(median(white));
    if (bright - dark < kLeastContrast) return false;
    state_.levels << dark, 0, 0, bright, 0, 0;
    return true;
  }

  /// From the shares to grey values.
  void linearise_levels() {
    if (light_ == LightModel::uneven) find_gains();
    const Eigen::Matrix<float, 6, 1> levels = state_.levels.cast<float>();
    const double dark = std::clamp(state_.levels(0) / std::max(1.0, state_.levels(3)), 0.01, 0.9);
    response_.set(state_.log_gamma, dark);
    for (const std::size_t k : order_) {
      const Patch& patch = patches_[k];
      const auto gain = static_cast<float>(patch.gain);
      for (std::size_t i = patch.first; i < patch.first + patch.count; ++i) {
        const float u = u_[i], v = v_[i], w = white_share_[i];
        const float black = levels(0) + levels(1) * u + levels(2) * v;
        const float contrast = levels(3) + levels(4) * u + levels(5) * v - black;
        const auto [seen, rise, by_log_gamma] = response_.at(w);
        const float slope = gain * contrast * rise;
        for (Eigen::Index c = 0; c < kGamma; ++c) column(c)[i] *= slope;
        column(kGamma)[i] = gain * contrast * by_log_gamma;
        column(kBlack)[i] = gain * (1.0F - seen);
        column(kBlack + 1)[i] = gain * (1.0F - seen) * u;
        column(kBlack + 2)[i] = gain * (1.0F - seen) * v;
        column(kWhite)[i] = gain * seen;
        column(kWhite + 1)[i] = gain * seen * u;
        column(kWhite + 2)[i] = gain * seen * v;
        residuals_[i] = grey_[i] - gain * (black + contrast * seen);
      }
    }
    if (!oriented_)
      for (std::size_t i = 0; i < count_; ++i) column(kBlur)[i] += column(kBlur + 2)[i];
    if (light_ == LightModel::even) return;
    for (auto& values : lights_) values.resize(count_);
    for (std::size_t i = 0; i < count_; ++i) {
      const float seen = grey_[i] - residuals_[i];
      lights_[0][i] = seen;
      lights_[1][i] = seen * along_x_[i];
      lights_[2][i] = seen * along_y_[i];
    }
  }

  /// Each patch's gain from the median of what is white there.
  void find_gains() {
    constexpr float kWhitish = 0.6F;
    const Eigen::Matrix<float, 6, 1> levels = state_.levels.cast<float>();
    std::vector<float> ratios;
    for (const std::size_t k : order_) {
      Patch& patch = patches_[k];
      ratios.clear();
      for (std::size_t i = patch.first; i < patch.first + patch.count; ++i) {
        const float w = white_share_[i];
        if (w < kWhitish) continue;
        const float black = levels(0) + levels(1) * u_[i] + levels(2) * v_[i];
        const float white = levels(3) + levels(4) * u_[i] + levels(5) * v_[i];
        ratios.push_back(grey_[i] / (black + (white - black) * w));
      }
      if (ratios.size() > 3)
        patch.gain = std::clamp(static_cast<double>(median(ratios)), 0.05, 20.0);
    }
  }

  /// Takes what each patch's own light explains out of the normal equations.
  void eliminate_lights(const std::vector<float>& weights, Normal& normal, Row& pull) {
    constexpr double kMostGain = 0.5, kMostSlope = 0.3;  // about what to expect, relative
    for (const std::size_t k : order_) {
      Patch& patch = patches_[k];
      if (patch.count == 0) continue;
      const std::size_t first = patch.first, count = patch.count;
      Eigen::Matrix<double, kLight, kLight> information;
      for (Eigen::Index l = 0; l < kLight; ++l) {
        const float* light = lights_[static_cast<std::size_t>(l)].data() + first;
        for (std::size_t i = 0; i < count; ++i) weighted_[i] = weights[first + i] * light[i];
        for (Eigen::Index a = 0; a < kUnknowns; ++a)
          patch.local.shared(a, l) =
              frozen(a) ? 0.0
                        : static_cast<double>(dot(weighted_.data(), column(a) + first, count));
        for (Eigen::Index m = 0; m < kLight; ++m)
          information(l, m) = static_cast<double>(
              dot(weighted_.data(), lights_[static_cast<std::size_t>(m)].data() + first, count));
        patch.local.pull(l) =
            static_cast<double>(dot(weighted_.data(), residuals_.data() + first, count));
      }
      const double noise2 = scale_ * scale_;
      information.diagonal() +=
          Vector3d(noise2 / (kMostGain * kMostGain), noise2 / (kMostSlope * kMostSlope),
                   noise2 / (kMostSlope * kMostSlope));
      patch.local.inverse = information.inverse();
      normal -= patch.local.shared * patch.local.inverse * patch.local.shared.transpose();
      pull -= patch.local.shared * patch.local.inverse * patch.local.pull;
    }
  }

  /// What a step leaves of the residuals.
  void apply(const Row& move) {
    left_.assign(residuals_.begin(), residuals_.begin() + static_cast<std::ptrdiff_t>(count_));
    for (Eigen::Index k = 0; k < kUnknowns; ++k) {
      const auto by = static_cast<float>(move(k));
      const float* row = column(k);
      if (by != 0.0F)
        for (std::size_t i = 0; i < count_; ++i) left_[i] -= by * row[i];
    }
    if (light_ == LightModel::even) return;
    for (const std::size_t k : order_) {
      const Patch& patch = patches_[k];
      if (patch.count == 0) continue;
      const Eigen::Matrix<float, kLight, 1> own =
          (patch.local.inverse * (patch.local.pull - patch.local.shared.transpose() * move))
              .cast<float>();
      for (std::size_t i = patch.first; i < patch.first + patch.count; ++i)
        left_[i] -= own(0) * lights_[0][i] + own(1) * lights_[1][i] + own(2) * lights_[2][i];
    }
  }

  /// Rows without what each patch's own light could do as well.
  void project_rows() {
    if (light_ == LightModel::even) return;
    for (const std::size_t k : order_) {
      const Patch& patch = patches_[k];
      if (patch.count == 0) continue;
      const LightRows share = patch.local.shared * patch.local.inverse;
      for (Eigen::Index a = 0; a < kUnknowns; ++a) {
        const Eigen::Matrix<float, kLight, 1> by = share.row(a).transpose().cast<float>();
        float* row = column(a);
        for (std::size_t i = patch.first; i < patch.first + patch.count; ++i)
          row[i] -= by(0) * lights_[0][i] + by(1) * lights_[1][i] + by(2) * lights_[2][i];
      }
    }
  }

  // --- least squares -----------------------------------------------------------------------------

  /// What isn't solved for: a round blur has one unknown, and slopes of the light are the patches'
  /// own affair where it is uneven.
  bool frozen(Eigen::Index k) const {
    if (k == kBlur + 1 || k == kBlur + 2) return !oriented_;
    return light_ == LightModel::uneven && k > kBlack && k != kWhite;
  }

  /// Noise from residuals of which fewer than half are wrong.
  double robust_scale(const std::vector<float>& residuals) {
    const std::size_t stride = count_ / 2000 + 1;
    sizes_.clear();
    for (std::size_t i = 0; i < count_; i += stride) sizes_.push_back(std::abs(residuals[i]));
    return std::max(kRounding, 1.4826 * static_cast<double>(median(sizes_)));
  }

  /// What is as bright or as dark as the image can be, and should be more so, tells nothing.
  bool saturated(std::size_t i) const {
    return (grey_[i] >= 255.0F && left_[i] < 0.0F) || (grey_[i] <= 0.0F && left_[i] > 0.0F);
  }

  void weigh(Weights kind) {
    const auto inverse = static_cast<float>(1.0 / (scale_ * scale_));
    if (kind == Weights::tukey) {
      for (std::size_t i = 0; i < count_; ++i)
        weights_[i] = tukey_weight(left_[i] * left_[i] * inverse);
    } else {
      for (std::size_t i = 0; i < count_; ++i)
        weights_[i] = 1.0F / std::sqrt(std::max(1.0F, left_[i] * left_[i] * inverse));
    }
    for (std::size_t i = 0; i < count_; ++i)
      if (saturated(i)) weights_[i] = 0.0F;
  }

  /// Sum of weight * row * row^T, and of weight * row * residual.
  void accumulate(const std::vector<float>& weights, Normal& normal, Row& pull) {
    normal.setZero();
    pull.setZero();
    weighted_.resize(count_);
    for (Eigen::Index a = 0; a < kUnknowns; ++a) {
      if (frozen(a)) continue;
      const float* row = column(a);
      for (std::size_t i = 0; i < count_; ++i) weighted_[i] = weights[i] * row[i];
      for (Eigen::Index b = 0; b <= a; ++b)
        if (!frozen(b))
          normal(a, b) = normal(b, a) =
              static_cast<double>(dot(weighted_.data(), column(b), count_));
      pull(a) = static_cast<double>(dot(weighted_.data(), residuals_.data(), count_));
    }
    for (Eigen::Index a = 0; a < kUnknowns; ++a)
      if (frozen(a)) normal(a, a) = 1.0;
  }

  double own_unknowns() const {
    return kUnknowns +
           (light_ == LightModel::uneven ? kLight * static_cast<double>(order_.size()) : 0.0);
  }

  static std::optional<Normal> inverse_of(const Normal& normal) {
    const Row size = normal.diagonal().cwiseSqrt();
    if (!(size.minCoeff() > 0.0)) return std::nullopt;
    const Normal scaled =
        size.cwiseInverse().asDiagonal() * normal * size.cwiseInverse().asDiagonal();
    const Eigen::LDLT<Normal> factored(scaled);
    if (!(factored.vectorD().minCoeff() > 1e-9)) return std::nullopt;
    Normal inverse = factored.solve(Normal::Identity());
    inverse = size.cwiseInverse().asDiagonal() * inverse * size.cwiseInverse().asDiagonal();
    if (!inverse.allFinite()) return std::nullopt;
    return inverse;
  }

  /// One Gauss-Newton step with weights that follow the linearised residuals. Returns how far it
  /// moved the patches, pixels, root mean square.
  std::optional<double> step(Weights kind) {
    constexpr int kRounds = 3;
    left_.assign(residuals_.begin(), residuals_.begin() + static_cast<std::ptrdiff_t>(count_));
    Row move = Row::Zero();
    Normal normal;
    for (int round = 0; round < kRounds; ++round) {
      scale_ = robust_scale(left_);
      weigh(kind);
      Row pull;
      accumulate(weights_, normal, pull);
      if (light_ == LightModel::uneven) eliminate_lights(weights_, normal, pull);
      // What is known beforehand.
      const double noise2 = scale_ * scale_;
      normal(kGamma, kGamma) += noise2 / (kUsualLogGamma * kUsualLogGamma);
      pull(kGamma) -= noise2 / (kUsualLogGamma * kUsualLogGamma) * state_.log_gamma;
      const auto inverse = inverse_of(normal);
      if (!inverse) return std::nullopt;
      move = *inverse * pull;
      inverse_ = *inverse;
      if (!move.allFinite()) return std::nullopt;
      apply(move);
    }
    scale_ = robust_scale(left_);
    weigh(Weights::tukey);
    normal_ = normal;
    double moved = 0.0;
    for (const std::size_t k : order_)
      moved += (patches_[k].by_pose * move.head<kPose>()).squaredNorm();
    moved = std::sqrt(moved / static_cast<double>(order_.size()));
    if (!(moved < 4.0)) return std::nullopt;

    state_.rotation = state_.rotation * rotation_exp(move.segment<3>(3));
    state_.rotation = Eigen::Quaterniond(state_.rotation).normalized().toRotationMatrix();
    state_.translation += move.head<3>();
    Matrix2d growth;
    growth << move(kBlur), move(kBlur + 1), move(kBlur + 1),
        oriented_ ? move(kBlur + 2) : move(kBlur);
    state_.blur = painted_.moments() + growth;
    reblurred_ = growth.norm() / painted_.moments().norm();
    const Eigen::SelfAdjointEigenSolver<Matrix2d> eigen(state_.blur);
    if (!(eigen.eigenvalues()(1) < kMostVariance)) return std::nullopt;
    state_.blur = eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(kLeastVariance).asDiagonal() *
                  eigen.eigenvectors().transpose();
    state_.log_gamma = std::clamp(state_.log_gamma + move(kGamma), kLeastLogGamma, kMostLogGamma);
    state_.levels += move.tail<6>();
    covariance_ = noise_covariance();
    return moved;
  }

  /// Whether the blur differs between directions, surely and by enough to matter.
  bool has_direction() const {
    constexpr double kSure = 4.0;
    const Eigen::SelfAdjointEigenSolver<Matrix2d> eigen(state_.blur);
    const double differs = eigen.eigenvalues()(1) - eigen.eigenvalues()(0);
    const double sigma = scale_ * std::sqrt(inverse_.diagonal().segment<3>(kBlur).maxCoeff());
    return differs > kRound && differs > kSure * sigma;
  }

  Matrix6d noise_covariance() const {
    return scale_ * scale_ * inverse_.topLeftCorner<kPose, kPose>();
  }

  /// The result, if the image bears it out.
  std::optional<Alignment> finish(const Isometry3d& start,
                                  const std::optional<Matrix6d>& start_covariance) {
    Alignment result;
    result.camera_T_marker = pose();
    result.blur = oriented_ ? Blur::with_moments(state_.blur)
                            : Blur{0.5 * state_.blur.trace(), Vector2d::Zero()};
    result.noise = scale_ * std::sqrt(static_cast<double>(count_) /
                                      std::max(1.0, static_cast<double>(count_) - own_unknowns()));
    result.evenness = evenness();
    result.pixels = static_cast<int>(count_);
    const auto count = static_cast<double>(count_);
    const double inverse_noise2 = 1.0 / (scale_ * scale_);
    // The estimate's covariance under whatever law the residuals follow: H^-1 M H^-1.
    std::vector<float> bends(count_), scatters(count_);
    for (std::size_t i = 0; i < count_; ++i) {
      if (saturated(i)) {
        result.share += 1.0 / count;
        bends[i] = scatters[i] = 0.0F;
        continue;
      }
      const auto z2 =
          static_cast<double>(left_[i]) * static_cast<double>(left_[i]) * inverse_noise2;
      result.loss += tukey_loss(z2);
      const float weight = tukey_weight(static_cast<float>(z2));
      result.share += static_cast<double>(weight) / count;
      const double q = z2 / static_cast<double>(kTukey * kTukey);
      bends[i] = q < 1.0 ? static_cast<float>((1.0 - q) * (1.0 - 5.0 * q)) : 0.0F;
      scatters[i] = static_cast<float>(z2) * weight * weight;
    }
    if (result.share < kLeastShare) return std::nullopt;
    for (const std::size_t k : order_) {
      const Vector2d at =
          2.0 * (patches_[k].place - Vector2d(outline_.square().x0, outline_.square().y0)) /
              outline_.square().width() -
          Vector2d::Ones();
      const double contrast =
          patches_[k].gain *
          (state_.levels.tail<3>() - state_.levels.head<3>()).dot(Vector3d(1.0, at.x(), at.y()));
      if (contrast < kLeastContrast || contrast < kLeastContrastToNoise * scale_)
        return std::nullopt;
    }
    if (shift_px(start, start_covariance) > kMostShiftPx) return std::nullopt;

    Normal bend, scatter;
    Row unused;
    if (light_ == LightModel::uneven) {
      accumulate(bends, bend, unused);
      eliminate_lights(bends, bend, unused);
      project_rows();
    }
    accumulate(bends, bend, unused);
    accumulate(scatters, scatter, unused);
    for (Eigen::Index k = 0; k < kUnknowns; ++k)
      if (frozen(k)) scatter(k, k) = 0.0;
    const double prior = scale_ * scale_ / (kUsualLogGamma * kUsualLogGamma);
    bend(kGamma, kGamma) += prior;
    scatter(kGamma, kGamma) += prior;
    const auto inverse = inverse_of(bend);
    if (!inverse) return std::nullopt;
    const double together = correlation(*inverse);
    const Normal covariance = together * scale_ * scale_ * count /
                              std::max(1.0, count - own_unknowns()) * *inverse * scatter * *inverse;
    const Matrix6d own = moved(covariance.topLeftCorner<6, 6>(), state_.rotation, centre3());
    result.covariance = 0.5 * (own + own.transpose());
    result.camera_T_marker.makeAffine();
    if (!result.covariance.allFinite() || !result.camera_T_marker.matrix().allFinite())
      return std::nullopt;
    return result;
  }

  /// By how much what is left of neighbouring pixels is more alike than noise is, for the pose:
  /// from blocks of pixels, whose parts in the pose's error are added up before they are squared. 1
  /// or more. What the model doesn't know, such as another shape of the blur, shows here.
  double correlation(const Normal& inverse) const {
    constexpr std::size_t kBlocks = 4;  // of a patch
    using Influence = Eigen::Matrix<double, kPose, kUnknowns>;
    const Influence influence = inverse.topRows<kPose>();
    Matrix6d blockwise = Matrix6d::Zero(), alone = Matrix6d::Zero();
    const auto scale = static_cast<float>(1.0 / scale_);
    for (const std::size_t k : order_) {
      const Patch& patch = patches_[k];
      std::array<Row, kBlocks> sums;
      sums.fill(Row::Zero());
      for (std::size_t i = patch.first; i < patch.first + patch.count; ++i) {
        if (weights_[i] == 0.0F) continue;
        Row row;
        for (Eigen::Index a = 0; a < kUnknowns; ++a)
          row(a) = frozen(a) ? 0.0 : static_cast<double>(column(a)[i]);
        row *= static_cast<double>(weights_[i] * left_[i] * scale);
        sums[(along_x_[i] > 0.0F ? 1U : 0U) + (along_y_[i] > 0.0F ? 2U : 0U)] += row;
        const Vector6d own = influence * row;
        alone += own * own.transpose();
      }
      for (const Row& sum : sums) {
        const Vector6d part = influence * sum;
        blockwise += part * part.transpose();
      }
    }
    return std::max(1.0, alone.ldlt().solve(blockwise).trace() / kPose);
  }

  /// Mean square of the patches' mean residuals, in units of what noise would make of them.
  double evenness() const {
    double sum = 0.0;
    for (const std::size_t k : order_) {
      const Patch& patch = patches_[k];
      double mean = 0.0, variance = 0.0;
      for (std::size_t i = patch.first; i < patch.first + patch.count; ++i) {
        const auto weight = static_cast<double>(weights_[i]);
        mean += weight * static_cast<double>(left_[i]);
        variance += weight * weight;
      }
      if (variance > 0.0) sum += mean * mean / (variance * scale_ * scale_);
    }
    return sum / static_cast<double>(order_.size());
  }

  /// How far what the start could be trusted with has moved, root mean square.
  double shift_px(const Isometry3d& start, const std::optional<Matrix6d>& covariance) const {
    double sum = 0.0, count = 0.0;
    for (const std::size_t k : order_) {
      const Vector3d p(patches_[k].place.x(), patches_[k].place.y(), 0.0);
      if (covariance) {
        const auto predicted = predict(start, *covariance, p.head<2>());
        if (!predicted) continue;
        const double error_px = camera_.fx * std::sqrt(0.5 * predicted->covariance.trace());
        if (error_px > kTrustedPx) continue;
      }
      const auto then = camera_.project(start * p), now = camera_.project(pose() * p);
      if (!then || !now) return std::numeric_limits<double>::infinity();
      sum += (*then - *now).squaredNorm();
      count += 1.0;
    }
    return count > 0.0 ? std::sqrt(sum / count) : 0.0;
  }

  const ImageView& image_;
  const InkOutline& outline_;
  double quiet_;
  const Camera& camera_;
  LightModel light_;
  Vector2d centre_ = Vector2d::Zero();  ///< of the samples, in the parent's plane
  State state_;
  Response response_;
  std::optional<Matrix6d> covariance_;  ///< of the state's pose
  bool oriented_ = false;               ///< whether the blur has a direction
  bool bends_ = false;                  ///< whether the lens bends lines
  double reach_ = 0.0;                  ///< of the blur, pixels

  PatchPainter painter_;
  Blur painted_;            ///< with which the patches are drawn
  double reblurred_ = 0.0;  ///< by how much of itself the last step changed the blur
  PatchPicture picture_;
  struct Filed {
    int piece, before;
  };
  std::vector<Piece> pieces_;
  std::vector<Filed> filed_;
  int x0_ = 0, y0_ = 0, columns_ = 0, rows_count_ = 0;
  std::vector<Node> nodes_;
  std::vector<Patch> patches_;
  std::vector<std::size_t> order_;
  std::size_t trusted_ = 0;
  double trusted_px_ = kTrustedPx;

  std::size_t count_ = 0;
  std::array<std::vector<float>, kUnknowns> columns_of_rows_;
  std::vector<float> grey_, white_share_, u_, v_, residuals_, left_, weights_, weighted_, sizes_;
  std::vector<float> along_x_, along_y_;  ///< from a patch's middle, -1 ... 1
  std::array<std::vector<float>, kLight> lights_;
  Normal normal_ = Normal::Zero(), inverse_ = Normal::Zero();
  double scale_ = 1.0;
};

}  // namespace

std::optional<Alignment> align(const ImageView& image, const InkOutline& outline, double quiet_m,
                               const Camera& camera, const Isometry3d& start,
                               const std::optional<Matrix6d>& start_covariance) {
  const auto with = [&](LightModel light) {
    return Aligner(image, outline, quiet_m, camera, light).run(start, start_covariance);
  };
  static const bool force = getenv("FORCE");
  std::optional<Alignment> even;
  if (!force) even = with(LightModel::even);
  if (even && even->share > kPlainShare && even->evenness < kEven) return even;
  std::optional<Alignment> uneven = with(LightModel::uneven);
  if (!even || !uneven) return uneven ? uneven : even;
  return uneven->share / uneven->noise > even->share / even->noise ? uneven : even;
}

}  // namespace harco
