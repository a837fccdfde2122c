#include "pose/align.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>

#include "pose/kernels/patch_loops.hpp"
#include "pose/light_fit.hpp"
#include "pose/refine.hpp"
#include "pose/response.hpp"
#include "pose/shade.hpp"

namespace harco {
namespace {

using Eigen::Isometry3d;
using Eigen::Matrix2d;
using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix26d = Eigen::Matrix<double, 2, 6>;

// What is solved for: (dt, w); the blur's second moments (the first alone where it is round) and
// its peak, how it differs from a Gaussian's; how the camera's response bends; the levels of black,
// a plane over the marker, and of white, a parabola; in a shadow, what is left of white's and of
// black's light.
constexpr int kPose = 6, kBlur = 6, kPeak = 9, kGamma = 10, kBlack = 11, kWhite = 14, kShade = 20,
              kUnknowns = 22;
using Row = Eigen::Matrix<double, kUnknowns, 1>;
using Normal = Eigen::Matrix<double, kUnknowns, kUnknowns>;
static_assert(kShade - kBlack == Light::kLevels);

// Of more patches than plenty, those that tell most are looked at, until they tell this share of
// what all of them do; never more than the most.
constexpr std::size_t kPlenty = 96, kMostPatches = 192;
constexpr double kEnough = 0.85;
// So many make the first, rough step, and so many the next ones, until they hardly move.
constexpr std::size_t kRoughPatches = 16, kSomePatches = 48;
// Between refills, alignments may look at so many samples, each as often as it is looked at.
constexpr std::size_t kMostLooks = 100000;
// A look of the light's alone costs this part of one.
constexpr std::size_t kLightLooks = 4;
constexpr double kMiddle = 0.5 * (kPatch - 1);  // of a patch
constexpr std::size_t kLeastSamples = 60;
// The blur at first, and what it may be: variances in square pixels.
constexpr double kFirstVariance = 0.4, kLeastVariance = 0.04, kMostVariance = 30.0;
// Where less changes per pixel, in shares of the contrast, one pixel of kFlatStep tells enough.
constexpr float kFlat = 0.1F;
constexpr int kFlatStep = 5;
// A blur whose second moments differ by less in all directions is round, square pixels.
constexpr double kRound = 0.15;
// From this variance on, square pixels, a lens is out of focus: a disc's fourth cumulants are those
// of a Gaussian plus the biharmonic operator times -1/24 of the squared variance. On few patches
// the tilt could pass for it.
constexpr std::size_t kFewForPeak = 14;
constexpr double kOutOfFocus = 0.8, kUsualPeak = 1.0 / 24.0;
// A step that changes the blur by less than this share of it is the last.
constexpr double kSameBlur = 0.15;
// ... and that of white.
constexpr double kSameLight = 0.02;
// Beyond so many sigmas of the blur, an edge isn't seen any more.
constexpr double kTail = 3.0;
// About what to expect of the logarithm of the response's exponent, and what it may be.
constexpr double kUsualNoise = 2.0;  // grey levels, before it is known
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
// ... if patches as a whole fit no worse than this, too, for many patches and by chance for few.
constexpr double kEven = 0.65, kEvenByChance = 2.5, kMostEven = 1.3;
// ... and far from even if they fit worse than this.
constexpr double kFarFromEven = 8.0;
// Where the pose puts a pixel no worse than this, its patch can be compared.
constexpr double kTrustedPx = 0.4;
// If nothing is as good as that: patches that are so many times as bad as the best, up to a limit.
constexpr double kNearlyBest = 1.5, kMostTrustedPx = 2.5;
// Alignment may move what it trusts from the start by so many pixels, root mean square.
constexpr double kMostShiftPx = 1.0;
// Steps that move the patches by less are the last.
constexpr double kSettledPx = 0.05;

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
  std::size_t cell = 0;                        ///< of the grid
  std::size_t first = 0, count = 0;            ///< its samples
  Matrix2d normals = Matrix2d::Zero();         ///< of its edges, by their length
  double merit = 0.0;
  double error_px = 0.0;  ///< of the pose, there
  bool trusted = false;   ///< whether that is good enough
  double gain = 1.0;      ///< light, where it is uneven
  double gain_noise = 0.0;
  Local local;
};

/// State of the solution. The pose's frame is moved to the middle of what is seen.
struct State {
  Matrix3d rotation = Matrix3d::Identity();
  Vector3d translation = Vector3d::Zero();
  std::optional<Matrix6d> covariance;                     ///< of the pose
  Vector2d centre = Vector2d::Zero();                     ///< the middle, in the parent's plane
  bool oriented = false;                                  ///< whether the blur has a direction
  bool peaked = false;                                    ///< whether it may differ from a Gaussian
  bool shaded = false;                                    ///< whether a shadow is part of the model
  Matrix2d blur = kFirstVariance * Matrix2d::Identity();  ///< second moments
  double peak = 0.0;       ///< of the blur, times the picture's biharmonic, pixels^4
  double log_gamma = 0.0;  ///< of the response: grey ~ light^(1/gamma)
  Light light;
};

constexpr float kBrightest = 255.0F;
bool clipped(float grey) { return grey >= kBrightest || grey <= 0.0F; }

/// Density of the normal distribution at z over what lies beyond z: the mean of that, too.
double normal_hazard(double z) {
  if (z > 6.0) return z + 1.0 / z;
  if (z < -8.0) return 0.0;
  constexpr double kDensity = std::numbers::inv_sqrtpi / std::numbers::sqrt2;
  return kDensity * std::exp(-0.5 * z * z) / (0.5 * std::erfc(z / std::numbers::sqrt2));
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

float sum_of(const float* values, std::size_t count) {
  std::array<float, kLanes> lanes{};
  std::size_t i = 0;
  for (; i + kLanes <= count; i += kLanes)
    for (std::size_t k = 0; k < kLanes; ++k) lanes[k] += values[i + k];
  for (; i < count; ++i) lanes[0] += values[i];
  return sum_of(lanes);
}

float median(std::vector<float>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// How much residuals count: all of them, less and less (Huber), or not at all far out (Tukey).
enum class Weights { huber, tukey };

}  // namespace

/// One alignment after the other; what it keeps is memory.
class Aligner::Impl {
 public:
  std::optional<Alignment> align(const ImageView& image, const InkOutline& outline, double quiet,
                                 const Camera& camera, const Isometry3d& start,
                                 const std::optional<Matrix6d>& start_covariance,
                                 const std::optional<Alignment>& rival,
                                 std::optional<LightModel> light) {
    image_ = image;
    outline_ = &outline;
    quiet_ = quiet;
    camera_ = camera;
    start_ = start;
    start_covariance_ = start_covariance;
    if (light) return described(run(*light), false);
    // Where the first step shows light to be far from even, even light is the last resort.
    const bool shadow = !rival || rival->shaded;
    std::optional<Settled> best = run(LightModel::even, shadow);
    const bool put_off = far_from_even_;
    // If all fits but for a little unevenness, it's no shadow.
    const bool plain = is_lit(best) && best->alignment.evenness < kMostEven;
    if (shadow && !is_lit(best)) prefer(best, run(LightModel::shadow));
    if (!fits(best) && !spent()) {
      if (best && (is_lit(best) || rival || best->state.shaded))
        prefer(best, unevenly(*best, !plain && !rival && !best->state.shaded));
      else if (!rival)
        prefer(best, run(LightModel::uneven));
    }
    if (!best && put_off && !rival) best = run(LightModel::even);
    return described(best, plain);
  }

  void refill(double share) {
    looks_ = 0;
    most_looks_ = static_cast<std::size_t>(share * static_cast<double>(kMostLooks));
  }

  bool spent() const { return looks_ > most_looks_; }

 private:
  double even_enough() const {
    const double chance = kEvenByChance / std::sqrt(static_cast<double>(order_.size()));
    return std::min(kMostEven, kEven + chance);
  }

  struct Settled {
    Alignment alignment;
    State state;
  };

  static std::optional<Alignment> described(const std::optional<Settled>& best, bool plain) {
    if (!best) return std::nullopt;
    Alignment found = best->alignment;
    found.plain = plain;
    found.fits = found.share > kPlainShare && found.evenness < kMostEven;
    found.shaded = best->state.shaded;
    return found;
  }

  static bool is_lit(const std::optional<Settled>& found) {
    return found && found->alignment.share > kPlainShare;
  }

  bool fits(const std::optional<Settled>& found) const {
    return is_lit(found) && found->alignment.evenness < even_enough();
  }

  static void prefer(std::optional<Settled>& best, const std::optional<Settled>& next) {
    if (next && (!best || goodness(next->alignment) > goodness(best->alignment))) best = next;
  }

  static double goodness(const Alignment& found) {
    return found.share / (found.noise * std::sqrt(std::max(1.0, found.evenness)));
  }

  /// From what settled in another light: patches have lights of their own besides; perhaps there is
  /// a shadow, too.
  std::optional<Settled> unevenly(const Settled& from, bool look_for_shadow) {
    light_ = LightModel::uneven;
    state_ = from.state;
    reblurred_ = 0.0;
    if (!lay_patches()) return std::nullopt;
    choose_patches(kMostPatches, kEnough);
    if (!linearise()) return std::nullopt;
    if (look_for_shadow) take_shadow();
    return settles(0.0, true) ? finish() : std::nullopt;
  }

  /// If it `may_be_put_off`, it ends where the first step shows light to be far from even.
  std::optional<Settled> run(LightModel light, bool may_be_put_off = false) {
    light_ = light;
    far_from_even_ = false;
    spread_ = own_lights_ = 0.0;
    scale_ = kUsualNoise;
    framed_ = false;
    trusted_px_ = kTrustedPx;
    state_ = State();
    state_.rotation = start_.linear();
    state_.translation = start_.translation();
    state_.covariance = start_covariance_;
    if (!lay_patches() || trusted_px_ > kMostTrustedPx) return std::nullopt;
    if (trusted_px_ * trusted_px_ > kFirstVariance) {
      // A pose that is only roughly right is seen better by a blurred eye.
      state_.blur *= trusted_px_ * trusted_px_ / kFirstVariance;
      if (!lay_patches()) return std::nullopt;
    }
    choose_patches(first_patches(light), 1.0);
    if (!linearise() || !first_levels()) return std::nullopt;
    if (light != LightModel::even) {
      take_shadow();
      if (!state_.shaded && light == LightModel::shadow) return std::nullopt;
    }
    state_.oriented = true;
    if (state_.shaded) fit_light();
    linearise_levels();
    const std::optional<double> moved = step(Weights::huber);
    if (!moved) return std::nullopt;
    far_from_even_ = may_be_put_off && evenness() > kFarFromEven;
    if (far_from_even_) return std::nullopt;
    state_.oriented = has_direction();
    state_.peaked = 0.5 * state_.blur.trace() > kOutOfFocus && patches_.size() > kFewForPeak;
    return settles(*moved) ? finish() : std::nullopt;
  }

  /// How many are looked at first: the more unknowns, the more.
  static std::size_t first_patches(LightModel light) {
    return light == LightModel::even     ? kRoughPatches
           : light == LightModel::shadow ? kPlenty
                                         : kMostPatches;
  }

  /// Steps until they hardly move, with some of the patches first, with all that are wanted at
  /// last. `moved` is by how much the first one did, pixels; what has been `seen` needs no look at
  /// where it stays.
  bool settles(double moved, bool seen = false) {
    constexpr int kSteps = 8;
    constexpr double kSamePlace = 0.3;  // pixels: patches may stay where they are
    constexpr double kNearPx = 0.15;    // steps that move less call for all patches
    constexpr int kMostFar = 2;         // so many steps may lead anywhere; then each has to be
    constexpr double kNearer = 0.7;     // that much shorter than the one before it, unless short
    const bool even = light_ == LightModel::even;
    const std::size_t few = even ? kSomePatches : first_patches(light_);
    bool finely = false;
    for (int i = 0; i < kSteps && (even || !spent()); ++i) {
      const bool all = trusted_ == patches_.size();
      const std::size_t before = trusted_;
      const bool more = !finely && all && moved < kNearPx;
      finely |= more;
      const bool stay = all && moved < kSamePlace && reblurred_ < kSameBlur;
      if (!stay && !lay_patches()) return false;
      if (!stay || more) {
        choose_patches(finely ? kMostPatches : few, kEnough);
        finely |= order_.size() == patches_.size();
      }
      if (stay && !seen) look_again();
      if (!(stay && seen) && !linearise()) return false;
      seen = false;
      if (state_.shaded) fit_light();
      linearise_levels();
      const std::optional<double> next = step(Weights::tukey);
      if (!next) return false;
      const bool grown = trusted_ > before;
      if (i >= kMostFar && !grown && *next > kSamePlace && *next > kNearer * moved) return false;
      moved = *next;
      // A shadow's light is fitted anew before each step, and soft ones leave levels open.
      const bool same_light = relit_ < kSameLight || state_.shaded;
      if (finely && moved < kSettledPx && reblurred_ < kSameBlur && same_light && !grown)
        return true;
    }
    return false;
  }

  Vector3d centre3() const { return {state_.centre.x(), state_.centre.y(), 0.0}; }

  Isometry3d pose() const {
    Isometry3d pose = Isometry3d::Identity();
    pose.linear() = state_.rotation;
    pose.translation() = state_.translation - state_.rotation * centre3();
    return pose;
  }

  /// There rotation and translation hardly mix.
  void move_frame_to_middle() {
    framed_ = true;
    const Node middle = node(x0_ + 0.5 * kPatch * grid_columns_, y0_ + 0.5 * kPatch * grid_rows_);
    if (!middle.valid) return;
    state_.centre = middle.place;
    state_.translation += state_.rotation * centre3();
    if (state_.covariance)
      state_.covariance = moved(*state_.covariance, state_.rotation, -centre3());
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
    for (const InkEdge& edge : outline_->edges()) {
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

  Node node(double x, double y) const {
    Node node;
    const auto ray = camera_.unproject({x, y});
    if (!ray) return node;
    const Matrix3d& r = state_.rotation;
    const Vector3d direction = ray->homogeneous();
    const double facing = r.col(2).dot(direction);
    const double depth = r.col(2).dot(state_.translation) / facing;
    if (!(facing > 1e-6 && depth > 0.0)) return node;
    const Vector3d point = depth * direction;
    const Vector2d from_centre = (r.transpose() * (point - state_.translation)).head<2>();
    node.place = state_.centre + from_centre;
    Eigen::Matrix<double, 2, 3> by_point;
    if (!camera_.project(point, &by_point)) return node;
    node.by_pose.leftCols<3>() = by_point;
    node.by_pose.rightCols<3>() = -by_point * r * skew({from_centre.x(), from_centre.y(), 0.0});
    node.valid = true;
    return node;
  }

  /// The blur with which patches are drawn next.
  void set_blur() {
    painted_ = Blur::with_moments(state_.blur);
    if (!state_.oriented || painted_.smear.squaredNorm() / 12.0 < kRound)
      painted_ = {0.5 * state_.blur.trace(), Vector2d::Zero()};
    painter_.set_blur(painted_);
    reach_ =
        kTail * std::sqrt(painted_.variance + painted_.smear.squaredNorm() / 12.0 + 1.0 / 12.0);
  }

  /// Covers what is seen of the marker's outlines with patches.
  bool lay_patches() {
    set_blur();
    project_outlines(pose());
    Eigen::Array2d low(1e9, 1e9), high(-1e9, -1e9);
    for (const Piece& piece : pieces_) {
      low = low.min(piece.from.array()).min(piece.to.array());
      high = high.max(piece.from.array()).max(piece.to.array());
    }
    const auto bound = [](double v, int most) {
      return static_cast<int>(std::clamp(v, 0.0, static_cast<double>(most)));
    };
    const int x1 = bound(std::ceil(high.x() + reach_) + 1.0, image_.width());
    const int y1 = bound(std::ceil(high.y() + reach_) + 1.0, image_.height());
    x0_ = bound(std::floor(low.x() - reach_), image_.width());
    y0_ = bound(std::floor(low.y() - reach_), image_.height());
    grid_columns_ = (x1 - x0_ + kPatch - 1) / kPatch;
    grid_rows_ = (y1 - y0_ + kPatch - 1) / kPatch;
    if (grid_columns_ <= 0 || grid_rows_ <= 0) return false;
    if (!framed_) move_frame_to_middle();

    outlines_.assign(static_cast<std::size_t>(grid_columns_ * grid_rows_), kNone);
    file_pieces();
    node_at_.assign(static_cast<std::size_t>((grid_columns_ + 1) * (grid_rows_ + 1)), kNone);
    nodes_.clear();
    patches_.clear();
    for (int j = 0; j < grid_rows_; ++j)
      for (int i = 0; i < grid_columns_; ++i)
        if (outlines_[static_cast<std::size_t>(j * grid_columns_ + i)] != kNone) lay_patch(i, j);
    trust_patches();
    weigh_patches();
    return true;
  }

  /// The chosen patches, seen with a pose and a blur that have hardly changed.
  void look_again() {
    set_blur();
    project_outlines(pose());
    std::fill(outlines_.begin(), outlines_.end(), kUnwanted);
    for (const std::size_t k : order_) outlines_[patches_[k].cell] = kNone;
    file_pieces();
  }

  const Node& node_at(int i, int j) {
    int& index = node_at_[static_cast<std::size_t>(j * (grid_columns_ + 1) + i)];
    if (index == kNone) {
      index = static_cast<int>(nodes_.size());
      nodes_.push_back(node(x0_ + kPatch * i - 0.5, y0_ + kPatch * j - 0.5));
    }
    return nodes_[static_cast<std::size_t>(index)];
  }

  void lay_patch(int i, int j) {
    // Copies: the list may grow.
    const Node a = node_at(i, j), b = node_at(i + 1, j), c = node_at(i, j + 1),
               d = node_at(i + 1, j + 1);
    if (!(a.valid && b.valid && c.valid && d.valid)) return;
    Patch& patch = patches_.emplace_back();
    patch.cell = static_cast<std::size_t>(j * grid_columns_ + i);
    patch.x = x0_ + kPatch * i;
    patch.y = y0_ + kPatch * j;
    const auto share = [&](auto member, auto& middle, auto& by_x, auto& by_y) {
      middle = 0.25 * (a.*member + b.*member + c.*member + d.*member);
      by_x = (b.*member + d.*member - a.*member - c.*member) / (2.0 * kPatch);
      by_y = (c.*member + d.*member - a.*member - b.*member) / (2.0 * kPatch);
    };
    share(&Node::place, patch.place, patch.place_by_x, patch.place_by_y);
    share(&Node::by_pose, patch.by_pose, patch.by_pose_by_x, patch.by_pose_by_y);
    if (state_.covariance)
      patch.error_px =
          std::sqrt(0.5 * (patch.by_pose * *state_.covariance * patch.by_pose.transpose()).trace());
  }

  /// Where the pose is known well enough; if that is nowhere, where it is known best.
  void trust_patches() {
    double least = std::numeric_limits<double>::infinity();
    for (const Patch& patch : patches_) least = std::min(least, patch.error_px);
    trusted_px_ = std::max(kTrustedPx, kNearlyBest * least);
    trusted_ = 0;
    for (Patch& patch : patches_) {
      patch.trusted = patch.error_px < trusted_px_;
      trusted_ += patch.trusted ? 1 : 0;
    }
  }

  /// To every patch that is wanted the pieces that it must know.
  void file_pieces() {
    filed_.clear();
    const double margin = painter_.margin() + 0.5;
    constexpr double kShare = 1.0 / kPatch;
    const auto index = [](double v, int first, int most) {
      const double place = (v - first) * kShare;
      return place <= 0.0 ? 0 : static_cast<int>(std::min(place, most - 1.0));
    };
    for (std::size_t k = 0; k < pieces_.size(); ++k) {
      const Vector2d &a = pieces_[k].from, &b = pieces_[k].to;
      const double left = std::min(a.x(), b.x()), right = std::max(a.x(), b.x());
      const double top = std::min(a.y(), b.y()), bottom = std::max(a.y(), b.y());
      const int j0 = index(top - margin, y0_, grid_rows_);
      const int j1 = index(bottom + margin, y0_, grid_rows_);
      const bool steep = j1 > j0 && bottom > top;
      const double slope = steep ? (b.x() - a.x()) / (b.y() - a.y()) : 0.0;
      for (int j = j0; j <= j1; ++j) {
        // The part of the piece in this row of patches.
        double low = left, high = right;
        if (steep) {
          const auto x_at = [&](double y) {
            return a.x() + slope * (std::clamp(y, top, bottom) - a.y());
          };
          const double xt = x_at(y0_ + kPatch * j - margin);
          const double xb = x_at(y0_ + kPatch * (j + 1) + margin);
          low = std::min(xt, xb), high = std::max(xt, xb);
        }
        const int i1 = index(high + margin, x0_, grid_columns_);
        for (int i = index(low - margin, x0_, grid_columns_); i <= i1; ++i) {
          int& last = outlines_[static_cast<std::size_t>(j * grid_columns_ + i)];
          if (last == kUnwanted) continue;
          filed_.push_back({static_cast<int>(k), last});
          last = static_cast<int>(filed_.size()) - 1;
        }
      }
    }
  }

  template <typename Visit>
  void for_each_piece(const Patch& patch, Visit visit) const {
    for (int at = outlines_[patch.cell]; at >= 0; at = filed_[static_cast<std::size_t>(at)].before)
      visit(pieces_[static_cast<std::size_t>(filed_[static_cast<std::size_t>(at)].piece)]);
  }

  /// How much each patch can tell of what is least known: its share of the pose's information, if
  /// its edges' lengths are what counts.
  void weigh_patches() {
    if (trusted_ <= kRoughPatches) return;
    Matrix6d all = Matrix6d::Zero();
    for (Patch& patch : patches_) {
      if (!patch.trusted) continue;
      const Vector2d middle(patch.x + 0.5 * (kPatch - 1), patch.y + 0.5 * (kPatch - 1));
      for_each_piece(patch, [&](const Piece& piece) {
        constexpr double kHalf = 0.5 * kPatch + 1.0;
        const Vector2d middle_of = 0.5 * (piece.from + piece.to);
        const Vector2d along = piece.to - piece.from;
        if (std::abs(middle_of.x() - middle.x()) > kHalf + 0.5 * std::abs(along.x()) ||
            std::abs(middle_of.y() - middle.y()) > kHalf + 0.5 * std::abs(along.y()))
          return;
        // Its length within the patch, near enough; short edges blur into each other.
        const double length2 = along.squaredNorm();
        if (!(length2 > 0.01)) return;
        const double length = std::sqrt(length2);
        const Vector2d d = along / length;
        const Vector2d to_start = piece.from - middle;
        const double at0 = d.dot(to_start);
        const double seen = std::min(at0 + length, 0.5 * kPatch) - std::max(at0, -0.5 * kPatch);
        const double off = std::abs(d.x() * to_start.y() - d.y() * to_start.x());
        if (seen <= 0.0 || off > 0.5 * kPatch + 1.0) return;
        const Vector2d n(-d.y(), d.x());
        patch.normals += seen * std::min(1.0, length2 / 4.0) * n * n.transpose();
      });
      all += patch.by_pose.transpose() * patch.normals * patch.by_pose;
    }
    all.diagonal() *= 1.0 + 1e-6;
    const Matrix6d inverse = all.inverse();
    const bool usable = inverse.allFinite();
    for (Patch& patch : patches_)
      patch.merit =
          usable ? (patch.by_pose * inverse * patch.by_pose.transpose() * patch.normals).trace()
                 : 1.0;
  }

  /// The fewest of the trusted patches that tell `enough` of what all do, or the `most` best.
  void choose_patches(std::size_t most, double enough) {
    order_.clear();
    double all = 0.0;
    for (std::size_t k = 0; k < patches_.size(); ++k)
      if (patches_[k].trusted) {
        order_.push_back(k);
        all += patches_[k].merit;
      }
    if (order_.size() <= kRoughPatches) return;
    most = std::min(most, order_.size());
    std::partial_sort(order_.begin(), order_.begin() + static_cast<std::ptrdiff_t>(most),
                      order_.end(), [&](std::size_t a, std::size_t b) {
                        const double more = patches_[a].merit, less = patches_[b].merit;
                        return more > less || (more == less && a < b);
                      });
    std::size_t count = 0;
    for (double told = 0.0; count < most; ++count) {
      if (count >= kPlenty && told >= enough * all) break;
      told += patches_[order_[count]].merit;
    }
    order_.resize(count);
    std::sort(order_.begin(), order_.end());
  }

  // --- what is compared --------------------------------------------------------------------------

  bool linearise() {
    count_ = 0;
    clipped_.clear();
    for (const std::size_t k : order_) sample(patches_[k]);
    looks_ += count_ * (3 + painter_.places()) / 4;
    return count_ >= kLeastSamples;
  }

  void sample(Patch& patch) {
    painter_.begin(patch.x, patch.y);
    for_each_piece(patch, [&](const Piece& piece) { painter_.add(piece.from, piece.to); });
    painter_.finish(
        [&](const Vector2d& pixel) {
          const Node seen = node(pixel.x(), pixel.y());
          return seen.valid && outline_->is_black(seen.place);
        },
        picture_);
    make_room();
    take_pixels(patch);
  }

  /// A bit a pixel, a word a row.
  using PixelBits = std::array<std::uint16_t, kPatch>;

  /// Those of a row whose places, from `start` on by `step` a pixel, are between low and high.
  static std::uint16_t bits_between(const Eigen::Array2d& start, const Vector2d& step,
                                    const Eigen::Array2d& low, const Eigen::Array2d& high) {
    double first = 0.0, end = kPatch;
    for (Eigen::Index k = 0; k < 2; ++k) {
      if (step(k) == 0.0) {
        if (!(start(k) > low(k) && start(k) < high(k))) return 0;
        continue;
      }
      const double a = (low(k) - start(k)) / step(k), b = (high(k) - start(k)) / step(k);
      first = std::max(first, std::floor(std::min(a, b)) + 1.0);
      end = std::min(end, std::ceil(std::max(a, b)));
    }
    if (!(first < end)) return 0;
    return static_cast<std::uint16_t>((1U << static_cast<unsigned>(end)) -
                                      (1U << static_cast<unsigned>(first)));
  }

  /// The pixels of a patch that its picture describes.
  PixelBits described_pixels(const Patch& patch) const {
    const int rim = state_.peaked ? 1 : 0;  // where the biharmonic isn't known
    const int height = std::min(kPatch - rim, image_.height() - patch.y);
    const int width = std::min(kPatch - rim, image_.width() - patch.x);
    PixelBits bits{};
    for (int y = rim; y < height; ++y)
      bits[static_cast<std::size_t>(y)] =
          static_cast<std::uint16_t>((1U << static_cast<unsigned>(width)) - (1U << unsigned(rim)));

    // Beyond the quiet zone the description ends.
    const Rect& square = outline_->square();
    const double tail = reach_ * std::max(patch.place_by_x.norm(), patch.place_by_y.norm());
    const double margin = std::clamp(quiet_ - tail, 0.0, tail);
    const Eigen::Array2d low(square.x0 - margin, square.y0 - margin);
    const Eigen::Array2d high(square.x1 + margin, square.y1 + margin);
    const Eigen::Array2d spread =
        kMiddle * (patch.place_by_x.cwiseAbs() + patch.place_by_y.cwiseAbs()).array();
    if ((patch.place.array() - spread > low).all() && (patch.place.array() + spread < high).all())
      return bits;
    for (int y = 0; y < kPatch; ++y) {
      const Eigen::Array2d start =
          (patch.place - kMiddle * patch.place_by_x + (y - kMiddle) * patch.place_by_y).array();
      bits[static_cast<std::size_t>(y)] &= bits_between(start, patch.place_by_x, low, high);
    }
    return bits;
  }

  /// Memory for one more patch.
  void make_room() {
    const std::size_t needed = count_ + kPatch * kPatch + kernels::kSide;
    if (grey_.size() >= needed) return;
    const std::size_t size = std::max<std::size_t>(1024, 2 * needed);
    for (auto& column : columns_of_rows_) column.resize(size);
    for (auto& light : lights_) light.resize(size);
    for (auto* values : {&grey_, &white_share_, &u_, &v_, &along_x_, &along_y_, &residuals_,
                         &pulled_, &left_, &weights_, &weighted_, &depth_})
      values->resize(size);
  }

  /// The Laplacian's Laplacian of the picture, at the patch's border that of its neighbours.
  void take_biharmonic() {
    PatchPicture::Channel laplacian = picture_.by_xx;
    for (std::size_t at = 0; at < laplacian.size(); ++at) laplacian[at] += picture_.by_yy[at];
    constexpr std::size_t kSide = kPatch;
    for (std::size_t y = 0; y < kSide; ++y)
      for (std::size_t x = 0; x < kSide; ++x) {
        const std::size_t at = std::clamp<std::size_t>(y, 1, kSide - 2) * kSide +
                               std::clamp<std::size_t>(x, 1, kSide - 2);
        biharmonic_[y * kSide + x] = laplacian[at - 1] + laplacian[at + 1] + laplacian[at - kSide] +
                                     laplacian[at + kSide] - 4.0F * laplacian[at];
      }
  }

  /// What the pixels that tell something see, and some of the others for the light, and how that
  /// depends on the pose and the blur.
  void take_pixels(Patch& patch) {
    static const PixelBits kSomeOfAll = [] {
      PixelBits some{};
      for (unsigned y = 0; y < kPatch; ++y)
        for (unsigned x = 0; x < kPatch; ++x)
          if ((x + 5 * y) % kFlatStep == 0) some[y] |= static_cast<std::uint16_t>(1U << x);
      return some;
    }();
    const PixelBits allowed = described_pixels(patch);
    take_grey(patch);
    if (state_.peaked) take_biharmonic();
    std::array<kernels::Flow, kPose> flows{};
    std::array<float*, kPose> rows{};
    for (std::size_t k = 0; k < kPose; ++k) {
      const auto unknown = static_cast<Eigen::Index>(k);
      const auto told = [&](Eigen::Index coordinate) {
        return slope(patch.by_pose(coordinate, unknown), patch.by_pose_by_x(coordinate, unknown),
                     patch.by_pose_by_y(coordinate, unknown));
      };
      flows[k] = {told(0), told(1)};
      rows[k] = column(unknown) + count_;
    }
    const Rect& square = outline_->square();
    const double scale = 2.0 / square.width();
    const Vector2d uv = scale * (patch.place - Vector2d(square.x0, square.y0)) - Vector2d::Ones();
    const Vector2d by_x = scale * patch.place_by_x, by_y = scale * patch.place_by_y;
    const kernels::SeenPatch seen{
        patch_grey_.data(),
        {picture_.ink.data(), picture_.by_x.data(), picture_.by_y.data(), picture_.by_xx.data(),
         picture_.by_xy.data(), picture_.by_yy.data()},
        state_.peaked ? biharmonic_.data() : nullptr,
        static_cast<float>(state_.peak),
        flows.data(),
        kPose,
        slope(uv.x(), by_x.x(), by_y.x()),
        slope(uv.y(), by_x.y(), by_y.y())};
    const auto end_of = [&](std::vector<float>& values) { return values.data() + count_; };
    patch.first = count_;
    patch.count = kernels::take_pixels(
        seen, kFlat, kSomeOfAll.data(), allowed.data(),
        {end_of(grey_), end_of(white_share_), end_of(u_), end_of(v_), end_of(along_x_),
         end_of(along_y_), rows.data(), column(kBlur) + count_, column(kBlur + 1) + count_,
         column(kBlur + 2) + count_, column(kPeak) + count_});
    count_ += patch.count;
    for (std::size_t i = patch.first; i < count_; ++i)
      if (clipped(grey_[i])) clipped_.push_back(i);
  }

  static kernels::Slope slope(double middle, double by_x, double by_y) {
    return {static_cast<float>(middle), static_cast<float>(by_x), static_cast<float>(by_y)};
  }

  /// The camera's pixels of a patch, as far as there are any.
  void take_grey(const Patch& patch) {
    const int height = std::min(kPatch, image_.height() - patch.y);
    const int width = std::min(kPatch, image_.width() - patch.x);
    for (int y = 0; y < height; ++y) {
      const std::uint8_t* row = image_.row(patch.y + y) + patch.x;
      std::copy(row, row + width, &patch_grey_[static_cast<std::size_t>(y * kPatch)]);
    }
  }

  float* column(Eigen::Index k) { return columns_of_rows_[static_cast<std::size_t>(k)].data(); }
  const float* column(Eigen::Index k) const {
    return columns_of_rows_[static_cast<std::size_t>(k)].data();
  }

  /// Levels from medians.
  bool first_levels() {
    constexpr std::size_t kSome = 800;
    float low = white_share_.front(), high = low;
    for (std::size_t i = 0; i < count_; ++i) {
      low = std::min(low, white_share_[i]);
      high = std::max(high, white_share_[i]);
    }
    const float reach = 0.15F * (high - low);
    const float black_below = low + reach, white_above = high - reach;
    std::vector<float> black, white;
    const std::size_t stride = count_ / kSome + 1;
    for (std::size_t i = 0; i < count_; i += stride) {
      if (white_share_[i] <= black_below) black.push_back(grey_[i]);
      if (white_share_[i] >= white_above) white.push_back(grey_[i]);
    }
    if (black.size() < 4 || white.size() < 4) return false;
    const double dark = static_cast<double>(median(black)),
                 bright = static_cast<double>(median(white));
    if (bright - dark < kLeastContrast) return false;
    // If many are clipped, the level is somewhere beyond; noise may have brought others back.
    constexpr double kBeyond = 0.5, kMany = 0.2;
    const auto many_at = [](const std::vector<float>& greys, float limit) {
      return static_cast<double>(std::count(greys.begin(), greys.end(), limit)) >
             kMany * static_cast<double>(greys.size());
    };
    const double beyond = kBeyond * (bright - dark);
    state_.light.levels.setZero();
    state_.light.levels(0) = dark - (many_at(black, 0.0F) ? beyond : 0.0);
    state_.light.levels(kWhite - kBlack) = bright + (many_at(white, kBrightest) ? beyond : 0.0);
    return true;
  }

  void take_shadow() {
    state_.shaded = first_shadow();
    if (state_.shaded) steepen_shadow();
  }

  /// The shadow that paper shows, if there is one.
  bool first_shadow() {
    constexpr float kPaper = 0.9F;
    std::vector<float> grey, u, v;
    const std::size_t stride = count_ / 2500 + 1;
    for (std::size_t i = 0; i < count_; i += stride)
      if (white_share_[i] > kPaper) {
        grey.push_back(grey_[i]);
        u.push_back(u_[i]);
        v.push_back(v_[i]);
      }
    const auto shadow = find_shadow(grey, u, v);
    if (!shadow) return false;
    state_.light.levels(0) *= shadow->lit / state_.light.levels(kWhite - kBlack);
    state_.light.levels(kWhite - kBlack) = shadow->lit;
    state_.light.shaded_white = state_.light.shaded_black = shadow->shaded / shadow->lit;
    state_.light.shape = shadow->shape;
    return true;
  }

  /// Some of the samples, for the light alone.
  void gather_light() {
    constexpr std::size_t kSome = 1200;
    light_fit_.clear();
    response_.set(state_.log_gamma, state_.light.black_part());
    const std::size_t stride = count_ / kSome + 1;
    for (std::size_t i = 0; i < count_; i += stride)
      light_fit_.add(grey_[i], response_.seen(white_share_[i]), u_[i], v_[i]);
  }

  void steepen_shadow() {
    gather_light();
    state_.light.shape *= light_fit_.best_steepness(state_.light);
  }

  /// Levels and shadow alone, where the pose is good enough to tell black from white.
  void fit_light() {
    gather_light();
    looks_ += light_fit_.fit(state_.light, steepest()) * light_fit_.size() / kLightLooks;
  }

  /// No shadow's edge is steeper than pixels can show.
  double steepest() const {
    constexpr double kSteepest = 2.0;  // per pixel
    const Patch& patch = patches_[order_.front()];
    return kSteepest * 0.5 * outline_->square().width() /
           std::max(patch.place_by_x.norm(), patch.place_by_y.norm());
  }

  /// Grey levels at a place of the marker.
  struct LevelsAt {
    double black, white;
  };
  LevelsAt levels_at(double u, double v) const {
    const Light::Levels& l = state_.light.levels;
    const double bow = u * (l(6) * u + l(7) * v) + v * v * l(8);
    LevelsAt at{l(0) + l(1) * u + l(2) * v + state_.light.black_part() * bow,
                l(3) + l(4) * u + l(5) * v + bow};
    if (!state_.shaded) return at;
    const auto depth = static_cast<double>(depth_at(static_cast<float>(u), static_cast<float>(v)));
    at.black *= 1.0 - depth * (1.0 - state_.light.shaded_black);
    at.white *= 1.0 - depth * (1.0 - state_.light.shaded_white);
    return at;
  }

  float depth_at(float u, float v) const {
    return ShadowShape::depth(state_.light.shape.cast<float>().dot(ShadowShape::terms(u, v))).share;
  }

  /// From the shares to grey values.
  void linearise_levels() {
    response_.set(state_.log_gamma, state_.light.black_part());
    if (light_ == LightModel::uneven) find_gains();
    kernels::LightTerms terms{};
    response_.tell(terms);
    for (std::size_t k = 0; k < Light::kLevels; ++k)
      terms.levels[k] = static_cast<float>(state_.light.levels(static_cast<Eigen::Index>(k)));
    terms.dark_part = static_cast<float>(state_.light.black_part());
    terms.less_white = 1.0F - static_cast<float>(state_.light.shaded_white);
    terms.less_black = 1.0F - static_cast<float>(state_.light.shaded_black);
    terms.pictured = kGamma;
    if (state_.shaded)
      for (std::size_t i = 0; i < count_; ++i) depth_[i] = depth_at(u_[i], v_[i]);
    std::array<float*, kUnknowns> columns{};
    for (std::size_t k = 0; k < kUnknowns; ++k) columns[k] = columns_of_rows_[k].data();
    const kernels::LitSamples samples{grey_.data(),
                                      white_share_.data(),
                                      u_.data(),
                                      v_.data(),
                                      state_.shaded ? depth_.data() : nullptr,
                                      columns.data(),
                                      residuals_.data()};
    for (const std::size_t k : order_)
      kernels::light_rows(samples, terms, static_cast<float>(patches_[k].gain), patches_[k].first,
                          patches_[k].count);
    if (!state_.oriented)
      for (std::size_t i = 0; i < count_; ++i) column(kBlur)[i] += column(kBlur + 2)[i];
    if (spread_ == 0.0) return;
    for (std::size_t i = 0; i < count_; ++i) {
      float seen = grey_[i] - residuals_[i];
      if (seen >= kBrightest) seen = 0.0F;  // more light changes nothing
      lights_[0][i] = seen;
      lights_[1][i] = seen * along_x_[i];
      lights_[2][i] = seen * along_y_[i];
    }
  }

  /// Each patch's gain from the median of what is white there, as far as gains differ by more than
  /// noise makes them.
  void find_gains() {
    constexpr float kWhitish = 0.6F;
    constexpr std::size_t kLeast = 4;
    constexpr double kLeastSpread = 0.003;
    const double paper = std::max(1.0, state_.light.levels(kWhite - kBlack));
    std::vector<float> ratios, apart;
    for (const std::size_t k : order_) {
      Patch& patch = patches_[k];
      patch.gain = 1.0;
      patch.gain_noise = 0.0;
      ratios.clear();
      for (std::size_t i = patch.first; i < patch.first + patch.count; ++i) {
        const float w = white_share_[i];
        if (w < kWhitish) continue;
        const LevelsAt at = levels_at(static_cast<double>(u_[i]), static_cast<double>(v_[i]));
        const auto black = static_cast<float>(at.black), white = static_cast<float>(at.white);
        const float value = black + (white - black) * response_.seen(w);
        if (value < kBrightest) ratios.push_back(grey_[i] / value);
      }
      if (ratios.size() < kLeast) continue;
      patch.gain = std::clamp(static_cast<double>(median(ratios)), 0.05, 20.0);
      patch.gain_noise = 1.25 * scale_ / (paper * std::sqrt(double(ratios.size())));
      apart.push_back(static_cast<float>(std::abs(patch.gain - 1.0)));
    }
    const double usual = apart.empty() ? 0.0 : 1.4826 * static_cast<double>(median(apart));
    spread_ = std::max(kLeastSpread, usual);
    for (const std::size_t k : order_) {
      Patch& patch = patches_[k];
      const double known = spread_ * spread_;
      patch.gain = 1.0 + (patch.gain - 1.0) * known / (known + patch.gain_noise * patch.gain_noise);
    }
  }

  /// What is solved for, and the columns of that.
  struct Solved {
    std::array<Eigen::Index, kUnknowns> which{};
    std::array<const float*, kUnknowns + kLight + 1> columns{};  // there is room for some more
    std::size_t count = 0;
  };
  Solved solved_for() const {
    Solved solved;
    for (Eigen::Index k = 0; k < kUnknowns; ++k) {
      if (frozen(k)) continue;
      solved.which[solved.count] = k;
      solved.columns[solved.count++] = column(k);
    }
    return solved;
  }

  /// Takes what each patch's own light explains out of the normal equations.
  void eliminate_lights(const std::vector<float>& weights, Normal& normal, Row& pull) {
    Solved solved = solved_for();
    const std::size_t n = solved.count;
    for (std::size_t l = 0; l < kLight; ++l) solved.columns[n + l] = lights_[l].data();
    solved.columns[n + kLight] = pull_from();
    std::array<float, kUnknowns + kLight + 1> sums{};
    own_lights_ = 0.0;
    for (const std::size_t k : order_) {
      Patch& patch = patches_[k];
      if (patch.count == 0) continue;
      Local& local = patch.local;
      local.shared.setZero();
      Eigen::Matrix<double, kLight, kLight> information;
      for (Eigen::Index l = 0; l < kLight; ++l) {
        const float* light = lights_[static_cast<std::size_t>(l)].data();
        for (std::size_t i = patch.first; i < patch.first + patch.count; ++i)
          weighted_[i] = weights[i] * light[i];
        kernels::column_sums(weighted_.data(), solved.columns.data(), n + kLight + 1, patch.first,
                             patch.count, sums.data());
        for (std::size_t a = 0; a < n; ++a)
          local.shared(solved.which[a], l) = static_cast<double>(sums[a]);
        for (Eigen::Index m = 0; m < kLight; ++m)
          information(l, m) = static_cast<double>(sums[n + static_cast<std::size_t>(m)]);
        local.pull(l) = static_cast<double>(sums[n + kLight]);
      }
      const double known = scale_ * scale_ / (spread_ * spread_);
      information.diagonal().array() += known;
      local.inverse = information.inverse();
      // Light of its own is expected to be none.
      local.pull(0) += known * (1.0 - patch.gain) / patch.gain;
      own_lights_ += kLight - known * local.inverse.trace();
      const LightRows taken = local.shared * local.inverse;
      normal.noalias() -= taken.lazyProduct(local.shared.transpose());
      pull -= taken * local.pull;
    }
  }

  /// What a step leaves of the residuals.
  void apply(const Row& move) {
    std::array<const float*, kUnknowns> rows{};
    std::array<float, kUnknowns> by{};
    std::size_t n = 0;
    for (Eigen::Index k = 0; k < kUnknowns; ++k) {
      if (move(k) == 0.0) continue;
      rows[n] = column(k);
      by[n++] = static_cast<float>(move(k));
    }
    kernels::subtract_rows(residuals_.data(), rows.data(), by.data(), n, count_, left_.data());
    if (spread_ == 0.0) return;
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

  // --- least squares -----------------------------------------------------------------------------

  /// What isn't solved for: a round blur has one unknown; a shadow's shape bears no steps that
  /// nothing checks.
  bool frozen(Eigen::Index k) const {
    if (k == kPeak && !state_.peaked) return true;
    if (k == kBlur + 1 || k == kBlur + 2) return !state_.oriented;
    return k >= kShade && !state_.shaded;
  }

  /// Noise from residuals of which fewer than half are wrong.
  double robust_scale(const std::vector<float>& residuals) {
    const std::size_t stride = count_ / 600 + 1;
    sizes_.clear();
    for (std::size_t i = 0; i < count_; i += stride)
      if (!clipped(grey_[i])) sizes_.push_back(residuals[i]);
    const float size = kernels::median_size(sizes_.data(), sizes_.size());
    return std::max(kRounding, 1.4826 * static_cast<double>(size));
  }

  /// Of what is as bright or as dark as the image can be, only that is known. It counts by what
  /// noise beyond the limit would be on average (Tobin 1958): much, where the model falls short of
  /// the limit, and nothing, where it exceeds it by far.
  void weigh_clipped() {
    if (clipped_.empty()) return;
    std::copy_n(residuals_.begin(), count_, pulled_.begin());
    for (const std::size_t i : clipped_) {
      if (left_[i] == 0.0F) continue;  // the model has it burnt out
      const bool bright = grey_[i] > 128.0F;
      const double sign = bright ? 1.0 : -1.0;
      const double limit = bright ? 254.5 : 0.5;
      const double seen = static_cast<double>(grey_[i] - left_[i]);
      const double beyond = sign * (limit - seen) / scale_;  // by how much the model falls short
      const double hazard = normal_hazard(beyond);
      const double weight = hazard * (hazard - beyond);
      const double expected = weight > 1e-4 ? sign * scale_ * hazard / weight : 0.0;
      weights_[i] *= static_cast<float>(weight > 1e-4 ? weight : 0.0);
      pulled_[i] = residuals_[i] + static_cast<float>(expected) - left_[i];
      left_[i] = static_cast<float>(expected);
    }
  }

  void weigh(Weights kind) {
    const auto inverse = static_cast<float>(1.0 / (scale_ * scale_));
    if (kind == Weights::tukey)
      kernels::tukey_weights(left_.data(), inverse, 1.0F / (kTukey * kTukey), count_,
                             weights_.data());
    else
      kernels::huber_weights(left_.data(), inverse, count_, weights_.data());
    weigh_clipped();
  }

  /// The residuals, those of clipped pixels as they would be on average.
  const float* pull_from() const { return clipped_.empty() ? residuals_.data() : pulled_.data(); }

  /// Sum of weight * row * row^T, and of weight * row * residual.
  void accumulate(const std::vector<float>& weights, Normal& normal, Row& pull) {
    normal.setZero();
    pull.setZero();
    Solved solved = solved_for();
    const std::size_t n = solved.count;
    solved.columns[n] = pull_from();
    std::array<float, (kUnknowns + 1) * (kUnknowns + 1)> sums{};
    kernels::normal_products(weights.data(), solved.columns.data(), n + 1, count_, sums.data());
    for (std::size_t a = 0; a < n; ++a) {
      const Eigen::Index row = solved.which[a];
      pull(row) = static_cast<double>(sums[n * (n + 1) + a]);
      for (std::size_t b = 0; b <= a; ++b)
        normal(row, solved.which[b]) = normal(solved.which[b], row) =
            static_cast<double>(sums[a * (n + 1) + b]);
    }
    for (Eigen::Index a = 0; a < kUnknowns; ++a)
      if (frozen(a)) normal(a, a) = 1.0;
  }

  double own_unknowns() const {
    double count = own_lights_;
    for (Eigen::Index k = 0; k < kUnknowns; ++k) count += frozen(k) ? 0.0 : 1.0;
    return count;
  }

  /// Of what is solved for; zero elsewhere.
  std::optional<Normal> inverse_of(const Normal& normal) const {
    constexpr double kLeastPivot = 1e-9;  // of what is scaled to ones on the diagonal
    if (!(normal.diagonal().array() > 0.0).all()) return std::nullopt;
    const Row size = normal.diagonal().cwiseSqrt().cwiseInverse();
    const Eigen::LLT<Normal> factored(size.asDiagonal() * normal * size.asDiagonal());
    if (factored.info() != Eigen::Success ||
        !(factored.matrixLLT().diagonal().minCoeff() > std::sqrt(kLeastPivot)))
      return std::nullopt;
    Normal inverse = size.asDiagonal() * factored.solve(Normal::Identity()) * size.asDiagonal();
    for (Eigen::Index k = 0; k < kUnknowns; ++k)
      if (frozen(k)) inverse.row(k).setZero(), inverse.col(k).setZero();
    if (!inverse.allFinite()) return std::nullopt;
    return inverse;
  }

  /// What is known beforehand.
  void add_priors(Normal& normal, Row& pull) const {
    const double noise2 = scale_ * scale_;
    if (state_.peaked) {
      const double usual = kUsualPeak * std::pow(0.5 * painted_.moments().trace(), 2.0);
      normal(kPeak, kPeak) += noise2 / (usual * usual);
      pull(kPeak) -= noise2 / (usual * usual) * state_.peak;
    }
    normal(kGamma, kGamma) += noise2 / (kUsualLogGamma * kUsualLogGamma);
    pull(kGamma) -= noise2 / (kUsualLogGamma * kUsualLogGamma) * state_.log_gamma;
    for (Eigen::Index k = kWhite + 3; k < kShade; ++k) {
      const double usual =
          LightPrior::kUsualBow * std::max(1.0, state_.light.levels(kWhite - kBlack));
      normal(k, k) += noise2 / (usual * usual);
      pull(k) -= noise2 / (usual * usual) * state_.light.levels(k - kBlack);
    }
    if (!state_.shaded) return;
    const double alike = noise2 / (LightPrior::kUsualTint * LightPrior::kUsualTint);
    const double apart = state_.light.shaded_white - state_.light.shaded_black;
    normal.block<2, 2>(kShade, kShade) +=
        alike * (Eigen::Matrix2d() << 1.0, -1.0, -1.0, 1.0).finished();
    pull(kShade) -= alike * apart;
    pull(kShade + 1) += alike * apart;
  }

  /// Weighted least squares go a part of the way only to where Tukey's loss is least, as the mean
  /// of psi' is less than that of the weights: by how much their steps have to be longer.
  double step_length(Weights kind) const {
    constexpr double kLongest = 1.5;
    if (kind != Weights::tukey) return 1.0;
    const kernels::TukeySums sums =
        kernels::tukey_sums(left_.data(), static_cast<float>(1.0 / (scale_ * scale_)),
                            1.0F / (kTukey * kTukey), count_);
    const auto slope = static_cast<double>(sums.slope), weight = static_cast<double>(sums.weight);
    return slope * kLongest > weight ? weight / slope : kLongest;
  }

  /// A Gauss-Newton step with weights that follow the linearised residuals.
  std::optional<Row> solve(Weights kind) {
    // Residuals that change by less than this share of the noise keep their weights.
    constexpr double kSameWeights = 0.3;
    const int rounds = kind == Weights::huber ? 3 : 2;
    std::copy_n(residuals_.begin(), count_, left_.begin());
    Row move = Row::Zero();
    Normal normal;
    for (int round = 0; round < rounds; ++round) {
      scale_ = robust_scale(left_);
      weigh(kind);
      Row pull;
      accumulate(weights_, normal, pull);
      if (spread_ > 0.0) eliminate_lights(weights_, normal, pull);
      add_priors(normal, pull);
      const auto inverse = inverse_of(normal);
      if (!inverse) return std::nullopt;
      const Row before = move;
      const Row change = step_length(kind) * (*inverse * pull - before);
      inverse_ = *inverse;
      if (!change.allFinite()) return std::nullopt;
      move = before + change;
      apply(move);
      const double changed2 = change.dot(normal * change) / static_cast<double>(count_);
      if (changed2 < kSameWeights * kSameWeights * scale_ * scale_) break;
    }
    scale_ = robust_scale(left_);
    return move;
  }

  /// One step of everything. Returns how far it moved the patches, pixels, root mean square.
  std::optional<double> step(Weights kind) {
    const std::optional<Row> solved = solve(kind);
    if (!solved) return std::nullopt;
    const Row& move = *solved;
    weigh(Weights::tukey);
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
        state_.oriented ? move(kBlur + 2) : move(kBlur);
    state_.blur = painted_.moments() + growth;
    const Eigen::SelfAdjointEigenSolver<Matrix2d> eigen(state_.blur);
    if (!(eigen.eigenvalues()(1) < kMostVariance)) return std::nullopt;
    state_.blur = eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(kLeastVariance).asDiagonal() *
                  eigen.eigenvectors().transpose();
    reblurred_ = (state_.blur - painted_.moments()).norm() / painted_.moments().norm();
    state_.peak += move(kPeak);
    state_.log_gamma = std::clamp(state_.log_gamma + move(kGamma), kLeastLogGamma, kMostLogGamma);
    take_light(move);
    relit_ = std::abs(move(kWhite)) / std::max(1.0, state_.light.levels(kWhite - kBlack));
    state_.covariance = noise_covariance();
    return moved;
  }

  void take_light(const Row& move) {
    state_.light.levels += move.segment<Light::kLevels>(kBlack);
    if (!state_.shaded) return;
    state_.light.shaded_white = std::clamp(state_.light.shaded_white + move(kShade), 0.02, 5.0);
    state_.light.shaded_black = std::clamp(state_.light.shaded_black + move(kShade + 1), 0.02, 5.0);
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
  std::optional<Settled> finish() {
    Alignment result;
    result.camera_T_marker = pose();
    result.blur = state_.oriented ? Blur::with_moments(state_.blur)
                                  : Blur{0.5 * state_.blur.trace(), Vector2d::Zero()};
    result.light = light_;
    result.noise = scale_ * std::sqrt(static_cast<double>(count_) /
                                      std::max(1.0, static_cast<double>(count_) - own_unknowns()));
    result.evenness = evenness();
    result.pixels = static_cast<int>(count_);
    const auto count = static_cast<double>(count_);
    const auto inverse = static_cast<float>(1.0 / (scale_ * scale_));
    constexpr float kLimit = kTukey * kTukey;
    const kernels::TukeySums all =
        kernels::tukey_sums(left_.data(), inverse, 1.0F / kLimit, count_);
    // Tukey's loss: z^2 for small z, constant far out.
    result.loss = static_cast<double>(kLimit) / 3.0 * (count - static_cast<double>(all.cubed));
    result.share = static_cast<double>(all.weight) / count;
    // Sums of w, psi' and psi^2; what is clipped is no sample of the noise.
    sizes_.clear();
    for (const std::size_t i : clipped_) sizes_.push_back(left_[i]);
    const kernels::TukeySums none =
        kernels::tukey_sums(sizes_.data(), inverse, 1.0F / kLimit, sizes_.size());
    const auto weight = static_cast<double>(all.weight - none.weight);
    const auto slope = static_cast<double>(all.slope - none.slope);
    const auto square = static_cast<double>(all.square - none.square);
    if (result.share < kLeastShare) return std::nullopt;
    for (const std::size_t k : order_) {
      const Vector2d at =
          2.0 * (patches_[k].place - Vector2d(outline_->square().x0, outline_->square().y0)) /
              outline_->square().width() -
          Vector2d::Ones();
      const LevelsAt levels = levels_at(at.x(), at.y());
      const double contrast = patches_[k].gain * (levels.white - levels.black);
      if (contrast < kLeastContrast || contrast < kLeastContrastToNoise * scale_)
        return std::nullopt;
    }
    if (shift_px() > kMostShiftPx) return std::nullopt;

    if (!(slope > 0.0)) return std::nullopt;
    // The estimate's variance is E psi^2 / (E psi')^2 times that of least squares.
    const double spread = square * weight / (slope * slope);
    const double freedom = count / std::max(1.0, count - own_unknowns());
    const Matrix6d covariance =
        correlation() * spread * freedom * scale_ * scale_ * inverse_.topLeftCorner<kPose, kPose>();
    const Matrix6d own = moved(covariance, state_.rotation, centre3());
    result.covariance = 0.5 * (own + own.transpose());
    result.camera_T_marker.makeAffine();
    if (!result.covariance.allFinite() || !result.camera_T_marker.matrix().allFinite())
      return std::nullopt;
    return Settled{result, state_};
  }

  /// By how much what is left of neighbouring pixels is more alike than noise is, for the pose:
  /// from blocks of pixels, whose parts in the pose's error are added up before they are squared. 1
  /// or more. What the model doesn't know, such as another shape of the blur, shows here.
  double correlation() {
    const std::size_t blocks = order_.size() < 32 ? 4 : 1;  // of a patch
    for (std::size_t i = 0; i < count_; ++i) weighted_[i] = weights_[i] * left_[i];
    const auto alone = static_cast<double>(dot(weighted_.data(), weighted_.data(), count_));
    const auto weight = static_cast<double>(sum_of(weights_.data(), count_));
    Solved solved = solved_for();
    const std::size_t n = solved.count;
    const std::size_t lights = spread_ > 0.0 ? kLight : 0;
    for (std::size_t l = 0; l < lights; ++l) solved.columns[n + l] = lights_[l].data();
    std::array<float, kUnknowns + kLight> sums{};
    // How the pose follows what pulls on the unknowns.
    const Eigen::Matrix<double, kPose, kUnknowns> influence = inverse_.topRows<kPose>();
    // Independent residuals would make this E psi^2 / E w times the inverse.
    Matrix6d together = Matrix6d::Zero();
    Eigen::Matrix<double, kPose, kLight> own = Eigen::Matrix<double, kPose, kLight>::Zero();
    for (const std::size_t k : order_) {
      const Patch& patch = patches_[k];
      if (patch.count == 0) continue;
      if (lights > 0) own = influence * (patch.local.shared * patch.local.inverse);
      for (std::size_t b = 0; b < blocks; ++b) {
        const std::size_t first = patch.first + patch.count * b / blocks;
        const std::size_t last = patch.first + patch.count * (b + 1) / blocks;
        kernels::column_sums(weighted_.data(), solved.columns.data(), n + lights, first,
                             last - first, sums.data());
        Vector6d pulled = Vector6d::Zero();
        for (std::size_t u = 0; u < n; ++u)
          pulled += static_cast<double>(sums[u]) * influence.col(solved.which[u]);
        // Without what the patch's own light could do as well.
        for (std::size_t l = 0; l < lights; ++l)
          pulled -= static_cast<double>(sums[n + l]) * own.col(static_cast<Eigen::Index>(l));
        together += pulled * pulled.transpose();
      }
    }
    const Matrix6d expected = alone / weight * inverse_.topLeftCorner<kPose, kPose>();
    return std::max(1.0, expected.ldlt().solve(together).trace() / kPose);
  }

  /// Mean square of the patches' mean residuals, in units of what noise would make of them.
  double evenness() const {
    double sum = 0.0;
    for (const std::size_t k : order_) {
      const Patch& patch = patches_[k];
      const float *weights = &weights_[patch.first], *left = &left_[patch.first];
      const auto mean = static_cast<double>(dot(weights, left, patch.count));
      const auto variance = static_cast<double>(dot(weights, weights, patch.count));
      if (variance > 0.0) sum += mean * mean / (variance * scale_ * scale_);
    }
    return sum / static_cast<double>(order_.size());
  }

  /// How far what the start could be trusted with has moved, root mean square.
  double shift_px() const {
    constexpr std::size_t kSome = 24;
    double sum = 0.0, count = 0.0;
    for (std::size_t at = 0; at < order_.size(); at += order_.size() / kSome + 1) {
      const Vector2d& place = patches_[order_[at]].place;
      const Vector3d p(place.x(), place.y(), 0.0);
      if (start_covariance_) {
        const auto predicted = predict(start_, *start_covariance_, p.head<2>());
        if (!predicted) continue;
        const double error_px = camera_.fx * std::sqrt(0.5 * predicted->covariance.trace());
        if (error_px > kTrustedPx) continue;
      }
      const auto then = camera_.project(start_ * p), now = camera_.project(pose() * p);
      if (!then || !now) return std::numeric_limits<double>::infinity();
      sum += (*then - *now).squaredNorm();
      count += 1.0;
    }
    return count > 0.0 ? std::sqrt(sum / count) : 0.0;
  }

  ImageView image_;
  const InkOutline* outline_ = nullptr;
  double quiet_ = 0.0;
  Camera camera_;
  Isometry3d start_ = Isometry3d::Identity();
  std::optional<Matrix6d> start_covariance_;
  LightModel light_ = LightModel::even;
  bool far_from_even_ = false;
  State state_;
  Response response_;
  LightFit light_fit_;
  bool bends_ = false;       ///< whether the lens bends lines
  double reach_ = 0.0;       ///< of the blur, pixels
  double spread_ = 0.0;      ///< of the patches' own lights, relative; zero if they have none
  double own_lights_ = 0.0;  ///< how many unknowns they are worth

  PatchPainter painter_;
  Blur painted_;            ///< with which the patches are drawn
  double reblurred_ = 0.0;  ///< by how much of itself the last step changed the blur
  double relit_ = 0.0;      ///< by how much of itself it changed the level of white
  PatchPicture picture_;
  alignas(64) PatchPicture::Channel biharmonic_{}, patch_grey_{};
  struct Filed {
    int piece, before;
  };
  std::vector<Piece> pieces_;
  std::vector<Filed> filed_;
  int x0_ = 0, y0_ = 0, grid_columns_ = 0, grid_rows_ = 0;
  bool framed_ = false;
  static constexpr int kNone = -1, kUnwanted = -2;
  std::vector<int> outlines_;  ///< for each cell of the grid the last of its pieces, in filed_
  std::vector<int> node_at_;   ///< for each corner of the grid, in nodes_
  std::vector<Node> nodes_;
  std::vector<Patch> patches_;
  std::vector<std::size_t> order_;
  std::size_t trusted_ = 0;
  double trusted_px_ = kTrustedPx;

  std::size_t most_looks_ = kMostLooks;
  std::size_t looks_ = 0;  ///< samples looked at since the last refill
  std::size_t count_ = 0;
  std::array<std::vector<float>, kUnknowns> columns_of_rows_;
  std::vector<float> grey_, white_share_, u_, v_, residuals_, pulled_, left_, weights_, weighted_,
      depth_, sizes_;
  std::vector<std::size_t> clipped_;      ///< samples as bright or as dark as can be
  std::vector<float> along_x_, along_y_;  ///< from a patch's middle, -1 ... 1
  std::array<std::vector<float>, kLight> lights_;
  Normal inverse_ = Normal::Zero();
  double scale_ = 1.0;
};

Aligner::Aligner() : impl_(std::make_unique<Impl>()) {}
Aligner::~Aligner() = default;
Aligner::Aligner(Aligner&&) noexcept = default;
Aligner& Aligner::operator=(Aligner&&) noexcept = default;

void Aligner::refill(double share) { impl_->refill(share); }
bool Aligner::spent() const { return impl_->spent(); }

std::optional<Alignment> Aligner::align(const ImageView& image, const InkOutline& outline,
                                        double quiet_m, const Camera& camera,
                                        const Isometry3d& start,
                                        const std::optional<Matrix6d>& start_covariance,
                                        const std::optional<Alignment>& rival,
                                        std::optional<LightModel> light) {
  return impl_->align(image, outline, quiet_m, camera, start, start_covariance, rival, light);
}

}  // namespace harco
