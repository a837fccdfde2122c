#include "pose/align.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "pose/blurred_ink.hpp"
#include "pose/edge_band.hpp"
#include "pose/footprint.hpp"
#include "pose/refine.hpp"

namespace harco {
namespace {

using Eigen::Isometry3d;
using Eigen::Matrix2d;
using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

// What is solved for: (dt, w), the logarithm of the blur, and the levels of black and of white,
// each a plane over the marker.
constexpr int kPose = 6, kBlur = 6, kBlack = 7, kWhite = 10, kUnknowns = 13;
using Row = Eigen::Matrix<double, kUnknowns, 1>;
using Normal = Eigen::Matrix<double, kUnknowns, kUnknowns>;
using Levels = Eigen::Matrix<double, 6, 1>;

// The most pixels that are compared; of more, an even choice is.
constexpr std::size_t kMostSamples = 6000;
constexpr std::size_t kLeastSamples = 60;
// So many sigmas of blur around an edge are compared.
constexpr double kBand = 2.2;
// Beyond so many, an edge isn't seen any more.
constexpr double kTail = 3.0;
// Blur at first, pixels; and what it may be.
constexpr double kFirstBlur = 0.75, kLeastBlur = 0.25, kMostBlur = 6.0;
// Tukey's constant: residuals of so many times the noise have no weight.
constexpr double kTukey = 4.685;
// Noise in grey levels that nothing falls short of: that of rounding.
constexpr double kRounding = 0.29;
// White must exceed black by so much, in grey levels and in units of the noise.
constexpr double kLeastContrast = 10.0, kLeastContrastToNoise = 4.0;
// Less than this share of the pixels is no evidence.
constexpr double kLeastShare = 0.4;
// From this share of the pixels on, nothing asks for another light (noise alone leaves 0.91).
constexpr double kPlainShare = 0.88;
// Alignment may move the marker by so many pixels, root mean square.
constexpr double kMostShiftPx = 1.0;

/// One pixel: what it sees, and along which ray.
struct Sample {
  Vector2d ray;           ///< normalised image coordinates
  Matrix2d ray_by_pixel;  ///< their derivative, the lens included
  double grey = 0.0;
  Vector3d place;         ///< (1, u, v): where on the marker, -1 ... 1, for the levels
  Eigen::Index tile = 0;  ///< which of the marker's tiles, for the light
};

/// State of the solution. The pose's frame is moved to the middle of what is seen.
struct State {
  Matrix3d rotation;
  Vector3d translation;
  double log_blur = 0.0;
  Levels levels = Levels::Zero();
  Eigen::VectorXd gains = Eigen::VectorXd::Ones(1);  ///< light of each tile

  State moved_by(const Row& step, const Eigen::VectorXd& gain_step) const {
    State next = *this;
    next.rotation = rotation * rotation_exp(step.segment<3>(3));
    next.translation += step.head<3>();
    next.log_blur += step(kBlur);
    next.levels += step.tail<6>();
    next.gains += gain_step;
    return next;
  }
  double blur() const { return std::exp(log_blur); }
};

std::optional<Footprint> footprint(const Sample& sample, const State& state) {
  return harco::footprint(sample.ray, sample.ray_by_pixel, state.rotation, state.translation);
}

/// All that is compared, linearised at a state.
struct Linearised {
  std::vector<Row> rows;    ///< d prediction / d unknowns
  Eigen::VectorXd by_gain;  ///< d prediction / d gain of the pixel's tile
  Eigen::VectorXd residuals;
  bool valid = false;
};

double tukey_weight(double z) {
  const double q = 1.0 - z * z / (kTukey * kTukey);
  return q > 0.0 ? q * q : 0.0;
}

/// Tukey's loss: z^2 for small z, constant far out.
double tukey_loss(double z) {
  const double q = std::max(0.0, 1.0 - z * z / (kTukey * kTukey));
  return kTukey * kTukey / 3.0 * (1.0 - q * q * q);
}

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// Noise from residuals of which fewer than half are wrong.
double robust_scale(const Eigen::VectorXd& residuals) {
  std::vector<double> sizes(static_cast<std::size_t>(residuals.size()));
  for (std::size_t i = 0; i < sizes.size(); ++i)
    sizes[i] = std::abs(residuals(static_cast<Eigen::Index>(i)));
  return std::max(kRounding, 1.4826 * median(std::move(sizes)));
}

double total_loss(const Eigen::VectorXd& residuals, double scale) {
  double sum = 0.0;
  for (const double r : residuals) sum += tukey_loss(r / scale);
  return sum;
}

/// Sum of factor(z) * row * row^T, z the residual in units of the noise.
template <typename Factor>
Normal weighted_normal(const Linearised& at, double scale, Factor factor) {
  Normal sum = Normal::Zero();
  for (std::size_t i = 0; i < at.rows.size(); ++i) {
    const double f = factor(at.residuals(static_cast<Eigen::Index>(i)) / scale);
    if (f != 0.0) sum.selfadjointView<Eigen::Lower>().rankUpdate(at.rows[i], f);
  }
  return sum.selfadjointView<Eigen::Lower>();
}

/// Even light varies at most linearly over the marker; in uneven light, that of a shadow,
/// each of the marker's tiles has a gain of its own besides.
enum class LightModel { even, uneven };

class Aligner {
 public:
  Aligner(const ImageView& image, const InkPlan& ink, double cell, const Camera& camera,
          LightModel light)
      : image_(image), ink_(ink), cell_(cell), camera_(camera), light_(light) {}

  std::optional<Alignment> run(const Isometry3d& start) {
    double blur = kFirstBlur;
    Isometry3d pose = start;
    // The blur decides how wide the band of pixels must be.
    for (int round = 0; round < 3; ++round) {
      if (!take_samples(pose, blur)) return std::nullopt;
      State state{pose.linear(), pose * centre3(), std::log(blur), Levels::Zero()};
      if (!fit_levels(state) || !iterate(state)) return std::nullopt;
      pose.linear() = Eigen::Quaterniond(state.rotation).normalized().toRotationMatrix();
      pose.translation() = state.translation - pose.linear() * centre3();
      const bool settled = std::abs(state.log_blur - std::log(blur)) < 0.35;
      blur = state.blur();
      if (settled) return finish(state, start, pose);
    }
    return std::nullopt;
  }

 private:
  Vector3d centre3() const { return {centre_.x(), centre_.y(), 0.0}; }

  bool take_samples(const Isometry3d& pose, double blur) {
    const int reach = static_cast<int>(std::lround(kBand * blur));
    const std::vector<Eigen::Vector2i> pixels = edge_band(ink_, camera_, pose, reach);
    const std::size_t count = std::min(pixels.size(), kMostSamples);

    centre_.setZero();
    const State state{pose.linear(), pose.translation(), std::log(blur), Levels::Zero()};
    samples_.clear();
    Vector2d sum = Vector2d::Zero();
    double detail = 0.0;
    for (std::size_t i = 0; i < count; ++i) {
      const Eigen::Vector2i& pixel = pixels[i * pixels.size() / count];
      Sample sample;
      const auto ray = camera_.unproject(pixel.cast<double>(), &sample.ray_by_pixel);
      if (!ray) continue;
      sample.ray = *ray;
      const auto at = footprint(sample, state);
      if (!at) continue;
      // Beyond the quiet zone the description ends.
      const double sigma = blur * at->by_pixel.rowwise().norm().maxCoeff();
      const double margin = std::clamp(cell_ - kTail * sigma, 0.0, kTail * sigma);
      const Rect& s = ink_.square;
      if (at->point.x() < s.x0 - margin || at->point.x() > s.x1 + margin ||
          at->point.y() < s.y0 - margin || at->point.y() > s.y1 + margin)
        continue;
      sample.grey = image_(pixel.x(), pixel.y());
      const double half = 0.5 * s.width();
      sample.place << 1.0, at->point.x() / half - 1.0, at->point.y() / half - 1.0;
      samples_.push_back(sample);
      sum += at->point;
      detail += sigma;
    }
    if (samples_.size() < kLeastSamples) return false;
    centre_ = sum / static_cast<double>(samples_.size());
    assign_tiles();
    blurred_.emplace(ink_, detail / static_cast<double>(samples_.size()));
    return true;
  }

  void assign_tiles() {
    constexpr double kMostTiles = 9.0;         // along a side
    constexpr double kSamplesOfATile = 120.0;  // on average
    tiles_ = 1;
    if (light_ == LightModel::uneven)
      tiles_ = static_cast<Eigen::Index>(std::clamp(
          std::sqrt(static_cast<double>(samples_.size()) / kSamplesOfATile), 2.0, kMostTiles));
    const auto tile = [&](double place) {
      const double along = 0.5 * (place + 1.0) * static_cast<double>(tiles_);
      return std::clamp(static_cast<Eigen::Index>(std::floor(along)), Eigen::Index{0}, tiles_ - 1);
    };
    for (Sample& sample : samples_)
      sample.tile = tile(sample.place.y()) * tiles_ + tile(sample.place.z());
  }

  /// Each tile's gain from the median of what is white there.
  Eigen::VectorXd first_gains(const std::vector<double>& share, double black, double white) const {
    constexpr double kWhitish = 0.6;
    std::vector<std::vector<double>> ratios(static_cast<std::size_t>(tiles_ * tiles_));
    for (std::size_t i = 0; i < share.size(); ++i)
      if (share[i] > kWhitish)
        ratios[static_cast<std::size_t>(samples_[i].tile)].push_back(
            samples_[i].grey / (black + (white - black) * share[i]));
    Eigen::VectorXd gains = Eigen::VectorXd::Ones(tiles_ * tiles_);
    for (std::size_t k = 0; k < ratios.size(); ++k)
      if (!ratios[k].empty())
        gains(static_cast<Eigen::Index>(k)) = std::max(0.05, median(std::move(ratios[k])));
    return gains;
  }

  /// Levels alone, from medians on, the pose and blur being kept.
  bool fit_levels(State& state) {
    std::vector<double> share;
    share.reserve(samples_.size());
    for (const Sample& sample : samples_) {
      const auto at = footprint(sample, state);
      if (!at) return false;
      share.push_back(whiteness(*at, state).share);
    }
    const auto level = [&](auto belongs) {
      std::vector<double> greys;
      for (std::size_t i = 0; i < share.size(); ++i)
        if (belongs(share[i])) greys.push_back(samples_[i].grey);
      return greys.size() < 4 ? std::optional<double>() : median(std::move(greys));
    };
    const double low = *std::min_element(share.begin(), share.end());
    const double high = *std::max_element(share.begin(), share.end());
    const double reach = 0.15 * (high - low);
    const auto black = level([&](double s) { return s <= low + reach; });
    const auto white = level([&](double s) { return s >= high - reach; });
    if (!black || !white || *white - *black < kLeastContrast) return false;
    state.levels << *black, 0, 0, *white, 0, 0;
    if (light_ == LightModel::uneven) {
      state.gains = first_gains(share, *black, *white);
      return true;
    }

    Eigen::VectorXd residuals(static_cast<Eigen::Index>(samples_.size()));
    for (int round = 0; round < 5; ++round) {
      std::vector<Levels> rows(samples_.size());
      for (std::size_t i = 0; i < samples_.size(); ++i) {
        rows[i] << (1.0 - share[i]) * samples_[i].place, share[i] * samples_[i].place;
        residuals(static_cast<Eigen::Index>(i)) = samples_[i].grey - rows[i].dot(state.levels);
      }
      const double scale = robust_scale(residuals);
      Eigen::Matrix<double, 6, 6> normal = 1e-9 * Eigen::Matrix<double, 6, 6>::Identity();
      Levels gradient = Levels::Zero();
      for (std::size_t i = 0; i < samples_.size(); ++i) {
        const double r = residuals(static_cast<Eigen::Index>(i));
        const double weight = 1.0 / std::max(1.0, std::abs(r) / scale);
        normal += weight * rows[i] * rows[i].transpose();
        gradient += weight * r * rows[i];
      }
      state.levels += normal.ldlt().solve(gradient);
    }
    return state.levels.allFinite();
  }

  Whiteness whiteness(const Footprint& at, const State& state) const {
    // An edge through the middle of a foreshortened spot still halves it, farther edges come nearer
    // or go: half of the way that the mean moves is best for edges.
    const double blur2 = state.blur() * state.blur();
    return blurred_->at(at.point + centre_ + 0.25 * blur2 * at.bend,
                        blur2 * at.by_pixel * at.by_pixel.transpose());
  }

  Linearised linearise(const State& state) const {
    Linearised result;
    if (!(state.blur() > kLeastBlur && state.blur() < kMostBlur)) return result;
    result.rows.resize(samples_.size());
    result.residuals.resize(static_cast<Eigen::Index>(samples_.size()));
    result.by_gain.resize(static_cast<Eigen::Index>(samples_.size()));
    for (std::size_t i = 0; i < samples_.size(); ++i) {
      const Sample& sample = samples_[i];
      const auto at = footprint(sample, state);
      if (!at) return result;
      const Whiteness ink = whiteness(*at, state);
      const double black = state.levels.head<3>().dot(sample.place);
      const double white = state.levels.tail<3>().dot(sample.place);
      const double gain = state.gains(sample.tile);
      Row& row = result.rows[i];
      row.head<kPose>() = (white - black) * at->by_pose.transpose() * ink.gradient;
      row(kBlur) = (white - black) * ink.by_log_sigma;
      row.segment<3>(kBlack) = (1.0 - ink.share) * sample.place;
      row.segment<3>(kWhite) = ink.share * sample.place;
      row *= gain;
      if (light_ == LightModel::uneven) row(kWhite) = 0.0;  // the gains take its part
      const auto k = static_cast<Eigen::Index>(i);
      result.by_gain(k) = black + (white - black) * ink.share;
      result.residuals(k) = sample.grey - gain * result.by_gain(k);
    }
    result.valid = true;
    return result;
  }

  /// Levenberg-Marquardt; within a step, Tukey's weights follow the linearised residuals, which
  /// costs far less than asking for the ink once more.
  bool iterate(State& state) {
    constexpr int kIterations = 12;
    constexpr double kConverged = 1e-3;  // squared step in units of the covariance
    at_ = linearise(state);
    if (!at_.valid) return false;
    double damping = 1e-4;
    for (int i = 0; i < kIterations; ++i) {
      const std::optional<Step> step = reweighted_step(damping);
      if (!step) return false;
      if (step->squared_sigmas < kConverged) return true;
      const State next = state.moved_by(step->move, step->gains);
      Linearised there = linearise(next);
      if (there.valid && total_loss(there.residuals, scale_) < total_loss(at_.residuals, scale_)) {
        state = next;
        at_ = std::move(there);
        damping = std::max(1e-7, 0.1 * damping);
      } else {
        if (damping > 1e4) return false;
        damping = std::max(1e-3, 10.0 * damping);
      }
    }
    return false;
  }

  /// The tiles' gains, eliminated from the normal equations: each occurs in its own tile only. In
  /// even light there are none.
  struct Gains {
    Eigen::MatrixXd rows;  ///< kUnknowns x tiles: what the rest shares with each gain
    Eigen::VectorXd pull;  ///< of the residuals on each gain
    double promise = 0.0;  ///< squared residuals that the gains alone will save

    Row without(const Linearised& at, Eigen::Index tile, std::size_t k) const {
      if (rows.cols() == 0) return at.rows[k];
      return at.rows[k] - at.by_gain(static_cast<Eigen::Index>(k)) * rows.col(tile);
    }
    Eigen::VectorXd step(const Row& move) const {
      if (rows.cols() == 0) return Eigen::VectorXd::Zero(1);
      return pull - rows.transpose() * move;
    }
  };

  /// With Tukey's weights for `residuals`.
  Gains eliminate_gains(const Eigen::VectorXd& residuals) const {
    Gains gains;
    if (light_ == LightModel::even) return gains;
    const Eigen::Index tiles = tiles_ * tiles_;
    gains.rows.setZero(kUnknowns, tiles);
    gains.pull.setZero(tiles);
    Eigen::VectorXd information = Eigen::VectorXd::Constant(tiles, 1e-6);
    for (std::size_t k = 0; k < samples_.size(); ++k) {
      const auto i = static_cast<Eigen::Index>(k);
      const Eigen::Index tile = samples_[k].tile;
      const double weighted = tukey_weight(residuals(i) / scale_) * at_.by_gain(i);
      gains.rows.col(tile) += weighted * at_.rows[k];
      gains.pull(tile) += weighted * at_.residuals(i);
      information(tile) += weighted * at_.by_gain(i);
    }
    gains.promise = (gains.pull.array().square() / information.array()).sum();
    gains.pull.array() /= information.array();
    gains.rows.array().rowwise() /= information.transpose().array();
    return gains;
  }

  /// Normal equations of what isn't solved for.
  Normal frozen() const {
    Normal normal = Normal::Zero();
    if (light_ == LightModel::uneven) normal(kWhite, kWhite) = 1.0;
    return normal;
  }

  struct Step {
    Row move = Row::Zero();
    Eigen::VectorXd gains;
    double squared_sigmas = 0.0;  ///< its length in units of the covariance
  };

  /// Iteratively reweighted least squares on the linearised residuals; sets the noise.
  std::optional<Step> reweighted_step(double damping) {
    constexpr int kRounds = 4;
    Step step;
    Eigen::VectorXd residuals = at_.residuals;
    for (int round = 0; round < kRounds; ++round) {
      scale_ = robust_scale(residuals);
      const Gains gains = eliminate_gains(residuals);
      Normal normal = frozen();
      Row gradient = Row::Zero();
      for (std::size_t k = 0; k < at_.rows.size(); ++k) {
        const auto i = static_cast<Eigen::Index>(k);
        const double weight = tukey_weight(residuals(i) / scale_);
        if (weight == 0.0) continue;
        const Row row = gains.without(at_, samples_[k].tile, k);
        gradient += weight * at_.residuals(i) * row;
        normal.selfadjointView<Eigen::Lower>().rankUpdate(row, weight);
      }
      normal.diagonal() *= 1.0 + damping;
      const Eigen::LDLT<Normal> factored(normal);
      if (!(factored.vectorD().minCoeff() > 0.0)) return std::nullopt;
      const Row before = step.move;
      step.move = factored.solve(gradient);
      step.gains = gains.step(step.move);
      if (!step.move.allFinite() || !step.gains.allFinite()) return std::nullopt;
      step.squared_sigmas = (gradient.dot(step.move) + gains.promise) / (scale_ * scale_);
      const Row change = step.move - before;
      const Row pull = normal.selfadjointView<Eigen::Lower>() * change;
      if (round > 0 && change.dot(pull) < 1e-2 * scale_ * scale_) break;
      for (std::size_t k = 0; k < at_.rows.size(); ++k) {
        const auto i = static_cast<Eigen::Index>(k);
        residuals(i) = at_.residuals(i) - at_.rows[k].dot(step.move) -
                       at_.by_gain(i) * step.gains(samples_[k].tile);
      }
    }
    return step;
  }

  /// The result, if the image bears it out.
  std::optional<Alignment> finish(const State& state, const Isometry3d& start,
                                  const Isometry3d& pose) const {
    Alignment result;
    result.camera_T_marker = pose;
    result.camera_T_marker.makeAffine();
    result.blur_px = state.blur();
    result.noise = scale_;
    result.loss = total_loss(at_.residuals, scale_);
    const auto count = static_cast<double>(samples_.size());
    for (const double r : at_.residuals) result.share += tukey_weight(r / scale_) / count;
    if (result.share < kLeastShare) return std::nullopt;
    for (const Sample& sample : samples_) {
      const double contrast = state.gains(sample.tile) *
                              (state.levels.tail<3>() - state.levels.head<3>()).dot(sample.place);
      if (contrast < kLeastContrast || contrast < kLeastContrastToNoise * scale_)
        return std::nullopt;
    }
    if (shift_px(start, state) > kMostShiftPx) return std::nullopt;

    const Gains gains = eliminate_gains(at_.residuals);
    Linearised free = at_;
    for (std::size_t k = 0; k < free.rows.size(); ++k)
      free.rows[k] = gains.without(at_, samples_[k].tile, k);
    // The estimate's covariance under whatever law the residuals follow: H^-1 M H^-1.
    const Normal bend = frozen() + weighted_normal(free, scale_, [](double z) {
                          const double q = z * z / (kTukey * kTukey);
                          return q < 1.0 ? (1.0 - q) * (1.0 - 5.0 * q) : 0.0;
                        });
    const Normal scatter = weighted_normal(free, scale_, [](double z) {
      const double psi = z * tukey_weight(z);
      return psi * psi;
    });
    const Eigen::LDLT<Normal> factored(bend);
    if (!(factored.vectorD().minCoeff() > 0.0)) return std::nullopt;
    const Normal inverse = factored.solve(Normal::Identity());
    const Normal covariance =
        scale_ * scale_ * count / (count - kUnknowns) * inverse * scatter * inverse;
    const Matrix6d own = moved(covariance.topLeftCorner<6, 6>(), pose.linear(), centre3());
    result.covariance = 0.5 * (own + own.transpose());
    if (!result.covariance.allFinite() || !result.camera_T_marker.matrix().allFinite())
      return std::nullopt;
    return result;
  }

  /// How far the pixels' points moved, root mean square.
  double shift_px(const Isometry3d& start, const State& state) const {
    const State before{start.linear(), start * centre3(), 0.0, Levels::Zero()};
    double sum = 0.0;
    for (const Sample& sample : samples_) {
      const auto then = footprint(sample, before);
      const auto now = footprint(sample, state);
      if (!then || !now) return std::numeric_limits<double>::infinity();
      sum += (now->by_pixel.inverse() * (then->point - now->point)).squaredNorm();
    }
    return std::sqrt(sum / static_cast<double>(samples_.size()));
  }

  const ImageView& image_;
  const InkPlan& ink_;
  double cell_;
  const Camera& camera_;
  Vector2d centre_ = Vector2d::Zero();  ///< of the samples, in the parent's plane
  std::vector<Sample> samples_;
  std::optional<BlurredInk> blurred_;
  LightModel light_;
  Eigen::Index tiles_ = 1;  ///< along a side
  Linearised at_;
  double scale_ = 1.0;
};

}  // namespace

std::optional<Alignment> align(const ImageView& image, const InkPlan& ink, double cell_m,
                               const Camera& camera, const Isometry3d& start) {
  const auto with = [&](LightModel light) {
    return Aligner(image, ink, cell_m, camera, light).run(start);
  };
  std::optional<Alignment> even = with(LightModel::even);
  if (even && even->share > kPlainShare) return even;
  std::optional<Alignment> uneven = with(LightModel::uneven);
  if (!even || !uneven) return uneven ? uneven : even;
  return uneven->share / uneven->noise > even->share / even->noise ? uneven : even;
}

}  // namespace harco
