#include "detect/edges.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "detect/bands.hpp"
#include "detect/profiles.hpp"
#include "detect/square_homography.hpp"

namespace harco::detect {
namespace {

constexpr int kFewPositions = 32;     // enough to decode by
constexpr int kMaxReach = 22;         // half-pixel steps across it, on one side
constexpr double kMinContrast = 8.0;  // grey levels between dark and bright
// The lens's and the sensor's blur together rarely fall below this (standard deviation, pixels).
constexpr double kBlur = 0.7;

/// Offsets of an edge from the line first assumed, one for each position along it.
struct EdgePoints {
  Positions along;
  Positions across;
};

/// A side as it was measured: it passes `middle`, and its normal displacement at a distance t from
/// there is known with the variance `offset_variance` + t^2 `slope_variance`.
struct FittedLine {
  Point middle;
  Point direction;
  double offset_variance = 0.0;
  double slope_variance = 0.0;

  /// Of the points: weights, 0 for those that don't belong, and sums of products of neighbours'
  /// weighted residuals, by how far they are apart in the list.
  Positions weights;
  std::array<double, 3> products{};
};

int steps(double pixels) { return std::clamp(static_cast<int>(pixels / kStep), 2, kMaxReach); }

/// Where a step from `inside` to `outside` lies so that the grey under it, from the window's inner
/// end to `outward`, is what was seen. It does not depend on the shape of the blur as long as both
/// ends lie beyond it.
Positions step_positions(const Profiles& profiles, int outward, const Positions& inside,
                         const Positions& outside) {
  Positions sum = 0.5F * (profiles.at(-profiles.inward) + profiles.at(outward));
  for (int k = -profiles.inward + 1; k < outward; ++k) sum += profiles.at(k);
  const auto steps = static_cast<float>(profiles.inward + outward);
  return static_cast<float>(kStep) *
         ((sum - steps * outside) / (inside - outside) - static_cast<float>(profiles.inward));
}

/// Those of the points that are `there`.
template <typename There>
EdgePoints select(const Positions& along, const Positions& across, const There& there) {
  EdgePoints points{Positions(along.size()), Positions(along.size())};
  Eigen::Index count = 0;
  for (Eigen::Index i = 0; i < along.size(); ++i)
    if (there(i)) {
      points.along(count) = along(i);
      points.across(count++) = across(i);
    }
  points.along.conservativeResize(count);
  points.across.conservativeResize(count);
  return points;
}

Positions even_levels(const Profiles& profiles, int k) {
  return level_at(profiles, k).at(profiles.along);
}

/// Plain steps: dark inside, bright outside, or the other way round. Inside and outside are the
/// levels at the ends of the profiles' parts from their inner end to `outward`.
EdgePoints locate_steps(const Profiles& profiles, int outward, bool bright_inside,
                        const Positions& inside, const Positions& outside) {
  const Positions steps = bright_inside ? inside - outside : outside - inside;
  return select(profiles.along, step_positions(profiles, outward, inside, outside),
                [&](Eigen::Index i) { return steps(i) >= static_cast<float>(kMinContrast); });
}

EdgePoints locate_steps(const Profiles& profiles, int outward, bool bright_inside) {
  return locate_steps(profiles, outward, bright_inside, even_levels(profiles, -profiles.inward),
                      even_levels(profiles, outward));
}

/// Whether the light on a side's bright part changes more abruptly than a straight line: where its
/// greys and those nearby differ from it by a good part of the step, for a good part of the side.
bool uneven(const Positions& dark, const Positions& bright, const Positions& bright_nearby) {
  constexpr float kStepShare = 0.15F;
  constexpr int kSidePart = 8;
  int away = 0;
  for (Eigen::Index i = 0; i < dark.size(); ++i)
    away += std::abs(bright_nearby(i) - bright(i)) > kStepShare * std::abs(bright(i) - dark(i));
  return kSidePart * away >= dark.size();
}

/// The inner edge of a dark line of known width with bright on both sides, at the centroid of the
/// dark. Blur moves the edges of a thin line apart, but not its middle.
EdgePoints locate_line(const Profiles& profiles, const Linear& width) {
  const Positions inside = even_levels(profiles, -profiles.inward);
  const Positions outside = even_levels(profiles, profiles.outward);
  const Positions rise = (outside - inside) / static_cast<float>(profiles.across() - 1);
  Positions mass = Positions::Zero(profiles.count());
  Positions moment = mass;
  for (int k = -profiles.inward; k <= profiles.outward; ++k) {
    const Positions dark = inside + rise * static_cast<float>(k + profiles.inward) - profiles.at(k);
    mass += dark;
    moment += dark * static_cast<float>(k);
  }
  constexpr auto kPixels = static_cast<float>(kStep);
  return select(
      profiles.along, kPixels * moment / mass - 0.5F * width.at(profiles.along),
      [&](Eigen::Index i) { return mass(i) * kPixels >= static_cast<float>(kMinContrast); });
}

/// The median grey of the darkest step.
float darkest_step(const Profiles& profiles) {
  float darkest = 255.0F;
  for (int k = -profiles.inward; k <= profiles.outward; ++k)
    darkest = std::min(darkest, median_at(profiles, k));
  return darkest;
}

/// The border of a child: bright inside, then a line `width` pixels wide, then a bright or a dark
/// cell `band` pixels wide or wider.
EdgePoints locate_child_edge(const ImageView& image, const Lens& lens, const Point& a,
                             const Point& b, double band, const Linear& width) {
  const double line = width.middle;
  const double reach = std::clamp(0.45 * band, 1.0, 4.0);
  constexpr double kThin =
      4.5;  // pixels; a line this wide is dark in its middle, whatever the blur
  if (line >= kThin) {
    const int steps_in_line = steps(std::min(reach, line - 2.5 * kBlur));
    return locate_steps(
        read_profiles(image, lens, a, b, {steps(reach), steps_in_line}, kFewPositions),
        steps_in_line, true);
  }
  const int inward = steps(std::clamp(0.5 * band, 1.0, 2.5));
  const Profiles profiles =
      read_profiles(image, lens, a, b,
                    {inward, inward + static_cast<int>(std::lround(line / kStep))}, kFewPositions);
  if (profiles.count() < 4) return {};
  const float darkest = darkest_step(profiles);
  const float inside = median_at(profiles, -profiles.inward);
  const float outside = median_at(profiles, profiles.outward);
  if (inside - darkest < static_cast<float>(kMinContrast)) return {};
  // Where the neighbouring cell is black too, the line has merged with it.
  const bool merged = outside - darkest < 0.35F * (inside - darkest);
  return merged ? locate_steps(profiles, profiles.inward, true) : locate_line(profiles, width);
}

/// Robust straight line through edge points (Tukey's weights, at most three rounds of them).
std::optional<FittedLine> fit_points(const EdgePoints& points, const Point& middle,
                                     const Point& direction, double length) {
  constexpr int kRounds = 4;
  constexpr float kSettled = 2e-4F;  // pixels
  const auto& [along, across] = points;
  const auto n = along.size();
  if (n < 4) return std::nullopt;
  Positions weights = Positions::Ones(n);
  Positions residuals(n);
  float sum_w = 0.0F;
  float sum_tt = 0.0F;
  float centre = 0.0F;
  float offset = 0.0F;
  float slope = 0.0F;
  float variance = 0.0F;
  for (int round = 0; round < kRounds; ++round) {
    sum_w = weights.sum();
    if (sum_w < 0.4F * static_cast<float>(n)) return std::nullopt;
    const float earlier = offset - slope * centre;
    const float earlier_slope = slope;
    centre = (weights * along).sum() / sum_w;
    offset = (weights * across).sum() / sum_w;
    const Positions t = along - centre;
    sum_tt = (weights * t * t).sum();
    slope = (weights * t * across).sum() / sum_tt;
    residuals = across - offset - slope * t;
    variance = (weights * residuals * residuals).sum() / std::max(1.0F, sum_w - 2.0F);
    const Positions away = residuals.abs();
    const float cut = std::max(4.7F * 1.48F * middle_size(away), 0.05F);
    for (Eigen::Index i = 0; i < n; ++i) {
      const float x = away(i) / cut;
      weights(i) = x < 1.0F ? (1.0F - x * x) * (1.0F - x * x) : 0.0F;
    }
    const float moved = std::abs(offset - slope * centre - earlier) +
                        std::abs(slope - earlier_slope) * 0.5F * static_cast<float>(length);
    if (round > 0 && moved < kSettled) break;
  }
  if (std::sqrt(static_cast<double>(variance)) > 0.6 + 0.01 * length) return std::nullopt;
  const Point outward(direction.y(), -direction.x());
  FittedLine line;
  line.middle =
      middle + static_cast<double>(centre) * direction + static_cast<double>(offset) * outward;
  line.direction = (direction + static_cast<double>(slope) * outward).normalized();
  line.offset_variance = static_cast<double>(variance / sum_w);
  line.slope_variance = static_cast<double>(variance / sum_tt);
  const Positions weighted = weights * residuals;
  for (std::size_t apart = 0; apart < line.products.size(); ++apart) {
    const auto pairs = n - static_cast<Eigen::Index>(apart);
    line.products[apart] = static_cast<double>((weighted.head(pairs) * weighted.tail(pairs)).sum());
  }
  line.weights = std::move(weights);
  return line;
}

// What plain steps and dips can't see is ink nearby that the blur mixes in: what it moves a side
// by, with small markers in blurred pictures (standard deviation, pixels).
constexpr double kInkNearby = 0.2;

/// Distance in pixels that `share` of the marker's side has across a side, to the inside of it if
/// positive, at the side's point `along` (0 … 1 from its first corner).
double width_across(const Eigen::Matrix3d& image_H_square, std::size_t side, double along,
                    double share) {
  // Of the unit square: where each side starts, its way, and the way to the inside.
  static const std::array<Eigen::Vector2d, 4> starts{{{0, 0}, {1, 0}, {1, 1}, {0, 1}}};
  static const std::array<Eigen::Vector2d, 4> ways{{{1, 0}, {0, 1}, {-1, 0}, {0, -1}}};
  const Eigen::Vector2d& inwards = ways[(side + 1) % 4];
  const auto seen = [&](const Eigen::Vector2d& square) {
    return Eigen::Vector2d((image_H_square * square.homogeneous()).hnormalized());
  };
  const Eigen::Vector2d on = starts[side] + along * ways[side];
  const Eigen::Vector2d way = (seen(starts[side] + ways[side]) - seen(starts[side])).normalized();
  const Eigen::Vector2d across = seen(on + share * inwards) - seen(on);
  return std::abs(way.x() * across.y() - way.y() * across.x());
}

/// Of what lies along a side.
struct Widths {
  double band;
  Linear line;
};

Widths widths_at(const Eigen::Matrix3d& image_H_square, std::size_t side,
                 const SideProfile& profile, double length) {
  const auto at = [&](double along, double share) {
    return width_across(image_H_square, side, along, share);
  };
  const double first = at(0.25, -profile.line_share);
  const double second = at(0.75, -profile.line_share);
  return {at(0.5, profile.cell_share), {0.5 * (first + second), (second - first) / (0.5 * length)}};
}

/// Side `side` of the quad from a to b. The quad runs clockwise, so its outside is on the left of
/// the way. Where the quad is seen steeply, all widths change from side to side and along them.
std::optional<FittedLine> fit_side(const ImageView& image, const Lens& lens, const Point& a,
                                   const Point& b, const Eigen::Matrix3d& image_H_square,
                                   std::size_t side, const SideProfile& profile) {
  const double length = (b - a).norm();
  if (length < 4.0) return std::nullopt;
  const auto [band, width] = widths_at(image_H_square, side, profile, length);
  const auto fit = [&](const EdgePoints& points) {
    return fit_points(points, 0.5 * (a + b), (b - a) / length, length);
  };
  std::optional<FittedLine> fitted;
  if (profile.bright_inside) {
    fitted = fit(locate_child_edge(image, lens, a, b, band, width));
  } else {
    const int reach = steps(std::clamp(0.45 * band, 1.0, 4.0));
    const Profiles profiles = read_profiles(image, lens, a, b, {reach, reach}, kFewPositions);
    if (profiles.count() < 4) return std::nullopt;
    const Positions inside = even_levels(profiles, -reach);
    const Positions outside = even_levels(profiles, reach);
    const Positions outside_nearby = levels_nearby(profiles, reach);
    fitted = fit(locate_steps(profiles, reach, false, inside, outside));
    if (!fitted || uneven(inside, outside, outside_nearby)) {
      const auto nearby = fit(
          locate_steps(profiles, reach, false, levels_nearby(profiles, -reach), outside_nearby));
      if (nearby && (!fitted || nearby->offset_variance < fitted->offset_variance)) fitted = nearby;
    }
  }
  if (!fitted) return std::nullopt;
  fitted->offset_variance += kInkNearby * kInkNearby;
  return fitted;
}

/// Corners where the sides meet, and what they inherit of the sides' errors. A side moves both of
/// its corners, so these are correlated.
std::optional<FittedQuad> meet(const std::array<FittedLine, 4>& lines) {
  FittedQuad quad;
  quad.covariance.setZero();
  std::array<Eigen::Matrix2d, 4> by_offsets;  // of a corner, by those of the sides before and after
  for (std::size_t i = 0; i < 4; ++i) {
    const FittedLine& before = lines[(i + 3) % 4];
    const FittedLine& after = lines[i];
    const auto point = intersection(before.middle, before.middle + before.direction, after.middle,
                                    after.middle + after.direction);
    if (!point) return std::nullopt;
    quad.corners[i] = *point;
    Eigen::Matrix2d normals;
    normals << before.direction.y(), -before.direction.x(), after.direction.y(),
        -after.direction.x();
    by_offsets[i] = normals.inverse();
  }
  for (std::size_t i = 0; i < 4; ++i) {
    const FittedLine& line = lines[i];
    const std::size_t next = (i + 1) % 4;
    Eigen::Matrix<double, 8, 1> by_offset = Eigen::Matrix<double, 8, 1>::Zero();
    by_offset.segment<2>(static_cast<Eigen::Index>(2 * i)) = by_offsets[i].col(1);
    by_offset.segment<2>(static_cast<Eigen::Index>(2 * next)) = by_offsets[next].col(0);
    Eigen::Matrix<double, 8, 1> by_slope = by_offset;
    for (const std::size_t corner : {i, next})
      by_slope.segment<2>(static_cast<Eigen::Index>(2 * corner)) *=
          (quad.corners[corner] - line.middle).dot(line.direction);
    quad.covariance += line.offset_variance * by_offset * by_offset.transpose() +
                       line.slope_variance * by_slope * by_slope.transpose();
  }
  return quad;
}

// Blur may be no Gaussian, and ink no perfect black: what sharpened sides may be wrong by beside
// the noise (standard deviation, pixels).
constexpr double kShape = 0.0015;
constexpr double kNarrow = 0.10;       // besides, with bands of no width
constexpr double kPixelPhase = 0.008;  // besides, along rows or columns of pixels (along_pixels)

/// Whether a side runs along the pixels' rows or columns, so that all of its profiles meet them
/// alike. What interpolation makes of a sharp edge then does not average out.
bool along_pixels(const Point& a, const Point& b) {
  constexpr double kMostSweep = 1.5;  // pixels
  return (b - a).cwiseAbs().minCoeff() < kMostSweep;
}

/// What lies across a side as far as its profiles reach.
Bands bands_of(const Profiles& profiles, const SideProfile& profile, double band, double width,
               double length) {
  // Light may change by so much from one end of a marker to the other.
  constexpr double kLightOverSide = 0.15;
  Bands bands;
  // Lines of grandchildren may reach into the ring.
  bands.light_spread = kLightOverSide / length;
  bands.first_spread = profile.bright_inside ? 0.04 * band : 0.02 * band;
  bands.add(profile.bright_inside ? -0.98 * band : -band);
  bands.add(0.0);
  if (!profile.bright_inside) {
    bands.add(band);  // where the quiet zone may end
    return bands;
  }
  const float darkest = darkest_step(profiles);
  const int ring = std::min(static_cast<int>(std::lround(0.5 * band / kStep)), profiles.inward);
  const float inside = median_at(profiles, -ring);
  const float outside = median_at(profiles, profiles.outward);
  const bool merged = outside - darkest < 0.35F * (inside - darkest);
  if (!merged && width < profiles.outward * kStep) bands.add(width);
  return bands;
}

/// A side as its bands and their blur explain it.
std::optional<FittedLine> sharpen_side(const ImageView& image, const Lens& lens, const Point& a,
                                       const Point& b, const Widths& widths,
                                       const SideProfile& profile) {
  const double length = (b - a).norm();
  if (length < 4.0) return std::nullopt;
  const double inward = std::clamp(1.4 * widths.band, 1.5, 5.0);
  const double outward = profile.bright_inside
                             ? std::min(widths.line.middle + std::min(0.9 * widths.band, 4.0), 8.0)
                             : std::clamp(0.8 * widths.band, 1.0, 5.0);
  const bool aligned = along_pixels(a, b);
  const int more = aligned ? 2 : 0;
  Profiles profiles = read_profiles(image, lens, a, b,
                                    {steps(inward) + more, steps(outward) + more}, kMaxPositions);
  if (profiles.count() < 4) return std::nullopt;
  if (aligned) widen_pixels(profiles);
  const Bands bands = bands_of(profiles, profile, widths.band, widths.line.middle, length);
  const bool line_ends = profile.bright_inside && bands.count == 3;
  Positions weights = Positions::Ones(profiles.count());
  std::optional<FittedLine> line;
  std::optional<EdgeFilter> filter;
  // The first round tells which profiles belong; the second one does without the others.
  for (int round = 0; round < 2; ++round) {
    filter = fit_bands(mean_profile(profiles, weights), -profiles.inward * kStep, kStep, bands,
                       filter ? &*filter : nullptr);
    if (!filter) return std::nullopt;
    const Positions& along = profiles.along;
    Positions across =
        static_cast<float>(filter->constant()) + weighted_sums(profiles, filter->weights);
    if (line_ends) across -= static_cast<float>(filter->by_last * widths.line.slope) * along;
    line = fit_points({along, across}, 0.5 * (a + b), (b - a) / length, length);
    if (!line) return std::nullopt;
    if (line->weights.minCoeff() > 0.0F) break;
    weights = line->weights;
  }
  line->offset_variance += kShape * kShape + (aligned ? kPixelPhase * kPixelPhase : 0.0);
  // The narrower the bands in units of the blur, the more depends on what it is like.
  const double narrow = kNarrow * std::exp(-widths.band / (1.8 * filter->sigma));
  line->offset_variance += narrow * narrow;
  return line;
}

/// By how much the mean of neighbouring points is less well known than that of independent ones:
/// interpolation shares pixels between them. Few points can't tell and count as usual.
double correlation_factor(const std::array<FittedLine, 4>& lines) {
  constexpr std::array<double, 2> kUsual{0.33, 0.05};
  constexpr double kPoints = 10.0;  // that the usual is worth
  // Tukey's weights fall with the residuals, whose scatter about the line they so make small.
  constexpr double kTukeyVariance = 1.16;
  std::array<double, 3> products{};
  double count = 0.0;
  for (const FittedLine& line : lines) {
    for (std::size_t k = 0; k < products.size(); ++k) products[k] += line.products[k];
    count += static_cast<double>(line.weights.sum());
  }
  double factor = kTukeyVariance;
  for (std::size_t k = 0; k < kUsual.size(); ++k)
    factor += 2.0 * kTukeyVariance * (products[k + 1] / products[0] * count + kUsual[k] * kPoints) /
              (count + kPoints);
  return std::clamp(factor, kTukeyVariance, 4.0);
}

}  // namespace

std::optional<FittedQuad> fit_edges(const ImageView& image, const Lens& lens, const Quad& quad,
                                    const SideProfile& profile) {
  constexpr double kNear = 0.1;  // pixels
  FittedQuad fitted{quad, Matrix8d::Zero()};
  // Where the quad was farther off, the second round starts from where the first one found the
  // edges.
  double moved = 0.0;
  for (int round = 0; round == 0 || (round == 1 && moved > kNear); ++round) {
    std::array<FittedLine, 4> lines;
    const Eigen::Matrix3d image_H_square = square_homography(fitted.corners);
    for (std::size_t i = 0; i < 4; ++i) {
      const auto line = fit_side(image, lens, fitted.corners[i], fitted.corners[(i + 1) % 4],
                                 image_H_square, i, profile);
      if (!line) return std::nullopt;
      lines[i] = *line;
    }
    const Quad before = fitted.corners;
    const double tolerance = 1.5 + 0.05 * mean_side(before);
    const auto met = meet(lines);
    if (!met) return std::nullopt;
    fitted = *met;
    moved = 0.0;
    for (std::size_t i = 0; i < 4; ++i)
      moved = std::max(moved, (fitted.corners[i] - before[i]).norm());
    if (moved > tolerance) return std::nullopt;
    if (!convex(fitted.corners)) return std::nullopt;
  }
  return fitted;
}

std::optional<FittedQuad> sharpen_edges(const ImageView& image, const Lens& lens, const Quad& quad,
                                        const SideProfile& profile) {
  const Eigen::Matrix3d image_H_square = square_homography(quad);
  std::array<FittedLine, 4> lines;
  for (std::size_t i = 0; i < 4; ++i) {
    const Point& a = quad[i];
    const Point& b = quad[(i + 1) % 4];
    const Widths widths = widths_at(image_H_square, i, profile, (b - a).norm());
    const auto line = sharpen_side(image, lens, a, b, widths, profile);
    if (!line) return std::nullopt;
    lines[i] = *line;
  }
  const double factor = correlation_factor(lines);
  for (FittedLine& line : lines) {
    line.offset_variance *= factor;
    line.slope_variance *= factor;
  }
  auto sharp = meet(lines);
  if (!sharp || !convex(sharp->corners)) return std::nullopt;
  for (std::size_t i = 0; i < 4; ++i)
    if ((sharp->corners[i] - quad[i]).norm() > 1.0 + 0.01 * mean_side(quad)) return std::nullopt;
  return sharp;
}

}  // namespace harco::detect
