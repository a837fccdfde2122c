#include "detect/edges.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "detect/bands.hpp"
#include "detect/sample.hpp"
#include "detect/square_homography.hpp"

namespace harco::detect {
namespace {

constexpr int kMaxPositions = 96;     // along a side
constexpr int kFewPositions = 32;     // enough to decode by
constexpr int kMaxReach = 22;         // half-pixel steps across it, on one side
constexpr double kStep = 0.5;         // pixels, across
constexpr double kMinContrast = 8.0;  // grey levels between dark and bright
// The lens's and the sensor's blur together rarely fall below this (standard deviation, pixels).
constexpr double kBlur = 0.7;

/// Offsets of an edge from the line first assumed, one for each position along it.
struct EdgePoints {
  std::array<double, kMaxPositions> along;
  std::array<double, kMaxPositions> across;
  int count = 0;

  void add(double at, double offset) {
    along[static_cast<std::size_t>(count)] = at;
    across[static_cast<std::size_t>(count++)] = offset;
  }
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
  std::array<double, kMaxPositions> weights{};
  std::array<double, 3> products{};
};

/// Grey values across one side: `count` positions times the steps from `-inward` to `outward`.
struct Profiles {
  std::array<std::array<double, kMaxAcross>, kMaxPositions> grey;
  std::array<double, kMaxPositions> along;
  int count = 0;
  int inward = 0;
  int outward = 0;

  int across() const { return inward + outward + 1; }

  /// One of them, from the inside out.
  Eigen::Map<const Eigen::VectorXd> at(int i) const {
    return {grey[static_cast<std::size_t>(i)].data(), across()};
  }
};

/// What changes evenly along a side: a grey level with the light, a width with the perspective.
struct Linear {
  double middle = 0.0;
  double slope = 0.0;  // a pixel
  double at(double along) const { return middle + slope * along; }
};

/// How far to look across a side, in steps.
struct Window {
  int inward;
  int outward;
};

int steps(double pixels) { return std::clamp(static_cast<int>(pixels / kStep), 2, kMaxReach); }

/// The greys of one profile; false if it isn't all in the image.
bool read_profile(const ImageView& image, const Lens& lens, const Point& middle,
                  const Point& outward, const Window& window,
                  std::array<double, kMaxAcross>& grey) {
  const auto place = [&](int k) -> Point { return middle + (k * kStep) * outward; };
  const auto inside = [&](const Point& at) { return between_pixels(image, at.x(), at.y()); };
  if (!lens.bends()) {
    if (!inside(place(-window.inward)) || !inside(place(window.outward))) return false;
    for (int k = -window.inward; k <= window.outward; ++k) {
      const Point at = place(k);
      grey[static_cast<std::size_t>(k + window.inward)] = sample_inside(image, at.x(), at.y());
    }
    return true;
  }
  for (int k = -window.inward; k <= window.outward; ++k) {
    const auto pixel = lens.from_ideal(place(k));
    if (!pixel || !inside(*pixel)) return false;
    grey[static_cast<std::size_t>(k + window.inward)] =
        sample_inside(image, pixel->x(), pixel->y());
  }
  return true;
}

Profiles read_profiles(const ImageView& image, const Lens& lens, const Point& a, const Point& b,
                       const Window& window, int most) {
  Profiles profiles;
  profiles.inward = window.inward;
  profiles.outward = window.outward;
  const double length = (b - a).norm();
  const Point direction = (b - a) / length;
  const Point outward(direction.y(), -direction.x());
  // Near the corners the other side's edge would be seen as well.
  const double margin = std::min(0.25 * length, 0.06 * length + 1.5);
  const double usable = length - 2.0 * margin;
  const int positions = std::clamp(static_cast<int>(usable), 4, most);
  for (int i = 0; i < positions; ++i) {
    const double t = margin + usable * (i + 0.5) / positions;
    const Point middle = a + t * direction;
    const bool whole = read_profile(image, lens, middle, outward, window,
                                    profiles.grey[static_cast<std::size_t>(profiles.count)]);
    if (whole) profiles.along[static_cast<std::size_t>(profiles.count++)] = t - 0.5 * length;
  }
  return profiles;
}

/// Median of the grey at one step, over the positions from `first` to before `last`.
double median_at(const Profiles& profiles, int k, int first, int last) {
  if (first >= last) return 0.0;
  std::array<double, kMaxPositions> values;
  for (int i = first; i < last; ++i)
    values[static_cast<std::size_t>(i - first)] =
        profiles.grey[static_cast<std::size_t>(i)][static_cast<std::size_t>(k + profiles.inward)];
  const auto middle = values.begin() + (last - first) / 2;
  std::nth_element(values.begin(), middle, values.begin() + (last - first));
  return *middle;
}

double median_at(const Profiles& profiles, int k) {
  return median_at(profiles, k, 0, profiles.count);
}

/// The level at one step: a straight line through the greys along the side, without those that
/// something hides. It is even unless its slope stands out of the noise; short sides can't tell.
Linear level_at(const Profiles& profiles, int k) {
  constexpr int kEnough = 16;
  const int count = profiles.count;
  if (count < kEnough) return {median_at(profiles, k), 0.0};
  const auto along = [&](int i) { return profiles.along[static_cast<std::size_t>(i)]; };
  const auto grey = [&](int i) {
    return profiles
        .grey[static_cast<std::size_t>(i)][static_cast<std::size_t>(k + profiles.inward)];
  };
  // A first line through the medians of both halves says which greys belong.
  const int half = count / 2;
  const double first = median_at(profiles, k, 0, half);
  const double second = median_at(profiles, k, half, count);
  const double first_along = 0.5 * (along(0) + along(half - 1));
  const double second_along = 0.5 * (along(half) + along(count - 1));
  const double rough = (second - first) / (second_along - first_along);
  std::array<double, kMaxPositions> away;
  for (int i = 0; i < count; ++i)
    away[static_cast<std::size_t>(i)] =
        std::abs(grey(i) - first - rough * (along(i) - first_along));
  std::array<double, kMaxPositions> sorted = away;
  std::nth_element(sorted.begin(), sorted.begin() + half, sorted.begin() + count);
  const double limit = 1.0 + 4.5 * sorted[static_cast<std::size_t>(half)];  // three deviations

  double n = 0.0;
  double t = 0.0;
  double g = 0.0;
  for (int i = 0; i < count; ++i)
    if (away[static_cast<std::size_t>(i)] < limit) {
      n += 1.0;
      t += along(i);
      g += grey(i);
    }
  t /= n;
  g /= n;
  double tt = 0.0;
  double tg = 0.0;
  double gg = 0.0;
  for (int i = 0; i < count; ++i)
    if (away[static_cast<std::size_t>(i)] < limit) {
      tt += (along(i) - t) * (along(i) - t);
      tg += (along(i) - t) * (grey(i) - g);
      gg += (grey(i) - g) * (grey(i) - g);
    }
  const double slope = tg / tt;
  const double slope_variance = std::max(0.0, gg - slope * tg) / (n - 2.0) / tt;
  if (slope * slope < 6.0 * slope_variance) return {g, 0.0};
  return {g - slope * t, slope};
}

/// Where a step from `inside` to `outside` lies so that the grey under it, from the window's inner
/// end to `outward`, is what was seen. It does not depend on the shape of the blur as long as both
/// ends lie beyond it.
double step_position(const Profiles& profiles, int i, int outward, double inside, double outside) {
  const auto& grey = profiles.grey[static_cast<std::size_t>(i)];
  double sum = 0.0;
  for (int k = -profiles.inward; k <= outward; ++k) {
    const bool end = k == -profiles.inward || k == outward;
    sum += (end ? 0.5 : 1.0) * (grey[static_cast<std::size_t>(k + profiles.inward)] - outside);
  }
  return -profiles.inward * kStep + sum * kStep / (inside - outside);
}

/// Centroid of the dark between two bright sides; empty where there is none.
std::optional<double> dip_position(const Profiles& profiles, int i, double inside, double outside) {
  const auto& grey = profiles.grey[static_cast<std::size_t>(i)];
  double mass = 0.0;
  double moment = 0.0;
  const int last = profiles.inward + profiles.outward;
  for (int k = 0; k <= last; ++k) {
    const double bright = inside + (outside - inside) * k / last;
    const double dark = bright - grey[static_cast<std::size_t>(k)];
    mass += dark;
    moment += dark * (k - profiles.inward) * kStep;
  }
  if (mass * kStep < kMinContrast) return std::nullopt;
  return moment / mass;
}

/// Grey levels at one step, position by position.
using Levels = std::array<double, kMaxPositions>;

Levels even_levels(const Profiles& profiles, int k) {
  const Linear level = level_at(profiles, k);
  Levels levels;
  for (int i = 0; i < profiles.count; ++i)
    levels[static_cast<std::size_t>(i)] = level.at(profiles.along[static_cast<std::size_t>(i)]);
  return levels;
}

/// Of the neighbours alone: where a shadow begins somewhere along the side.
Levels levels_nearby(const Profiles& profiles, int k) {
  constexpr int kReach = 2;
  Levels levels;
  for (int i = 0; i < profiles.count; ++i)
    levels[static_cast<std::size_t>(i)] =
        median_at(profiles, k, std::max(0, i - kReach), std::min(profiles.count, i + kReach + 1));
  return levels;
}

/// Plain steps: dark inside, bright outside, or the other way round. Inside and outside are the
/// levels at the ends of the profiles' parts from their inner end to `outward`.
EdgePoints locate_steps(const Profiles& profiles, int outward, bool bright_inside,
                        const Levels& inside, const Levels& outside) {
  EdgePoints points;
  for (int i = 0; i < profiles.count; ++i) {
    const auto at = static_cast<std::size_t>(i);
    const double step = inside[at] - outside[at];
    if ((bright_inside ? step : -step) < kMinContrast) continue;
    points.add(profiles.along[at], step_position(profiles, i, outward, inside[at], outside[at]));
  }
  return points;
}

EdgePoints locate_steps(const Profiles& profiles, int outward, bool bright_inside) {
  return locate_steps(profiles, outward, bright_inside, even_levels(profiles, -profiles.inward),
                      even_levels(profiles, outward));
}

/// Whether the light on a side's bright part changes more abruptly than a straight line: where its
/// greys and those nearby differ from it by a good part of the step, for a good part of the side.
bool uneven(const Profiles& profiles, const Levels& dark, const Levels& bright,
            const Levels& bright_nearby) {
  constexpr double kStepShare = 0.15;
  constexpr int kSidePart = 8;
  int away = 0;
  for (std::size_t i = 0; i < static_cast<std::size_t>(profiles.count); ++i)
    away += std::abs(bright_nearby[i] - bright[i]) > kStepShare * std::abs(bright[i] - dark[i]);
  return kSidePart * away >= profiles.count;
}

/// The inner edge of a dark line of known width with bright on both sides. Blur moves the edges of
/// a thin line apart, but not its middle.
EdgePoints locate_line(const Profiles& profiles, const Linear& width) {
  const Linear inside = level_at(profiles, -profiles.inward);
  const Linear outside = level_at(profiles, profiles.outward);
  EdgePoints points;
  for (int i = 0; i < profiles.count; ++i) {
    const double along = profiles.along[static_cast<std::size_t>(i)];
    if (const auto middle = dip_position(profiles, i, inside.at(along), outside.at(along)))
      points.add(along, *middle - 0.5 * width.at(along));
  }
  return points;
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
  if (profiles.count < 4) return {};
  double darkest = 255.0;
  for (int k = -profiles.inward; k <= profiles.outward; ++k)
    darkest = std::min(darkest, median_at(profiles, k));
  const double inside = median_at(profiles, -profiles.inward);
  const double outside = median_at(profiles, profiles.outward);
  if (inside - darkest < kMinContrast) return {};
  // Where the neighbouring cell is black too, the line has merged with it.
  const bool merged = outside - darkest < 0.35 * (inside - darkest);
  return merged ? locate_steps(profiles, profiles.inward, true) : locate_line(profiles, width);
}

/// Robust straight line through edge points (Tukey's weights, three rounds).
std::optional<FittedLine> fit_points(const EdgePoints& points, const Point& middle,
                                     const Point& direction, double length) {
  if (points.count < 4) return std::nullopt;
  const auto n = static_cast<std::size_t>(points.count);
  std::array<double, kMaxPositions> weights;
  std::array<double, kMaxPositions> residuals;
  weights.fill(1.0);
  double offset = 0.0;
  double slope = 0.0;
  double centre = 0.0;
  double sum_w = 0.0;
  double sum_tt = 0.0;
  double variance = 0.0;
  for (int round = 0; round < 4; ++round) {
    sum_w = 0.0;
    double sum_t = 0.0;
    double sum_u = 0.0;
    for (std::size_t i = 0; i < n; ++i) {
      sum_w += weights[i];
      sum_t += weights[i] * points.along[i];
      sum_u += weights[i] * points.across[i];
    }
    if (sum_w < 0.4 * points.count) return std::nullopt;
    centre = sum_t / sum_w;
    sum_tt = 0.0;
    double sum_tu = 0.0;
    for (std::size_t i = 0; i < n; ++i) {
      const double t = points.along[i] - centre;
      sum_tt += weights[i] * t * t;
      sum_tu += weights[i] * t * points.across[i];
    }
    offset = sum_u / sum_w;
    slope = sum_tu / sum_tt;
    double sum_rr = 0.0;
    for (std::size_t i = 0; i < n; ++i) {
      const double r = points.across[i] - offset - slope * (points.along[i] - centre);
      residuals[i] = r;
      sum_rr += weights[i] * r * r;
    }
    variance = sum_rr / std::max(1.0, sum_w - 2.0);
    std::array<double, kMaxPositions> sorted;
    for (std::size_t i = 0; i < n; ++i) sorted[i] = std::abs(residuals[i]);
    const auto half = sorted.begin() + points.count / 2;
    std::nth_element(sorted.begin(), half, sorted.begin() + points.count);
    const double cut = std::max(4.7 * 1.48 * *half, 0.05);
    for (std::size_t i = 0; i < n; ++i) {
      const double x = std::abs(residuals[i]) / cut;
      weights[i] = x < 1.0 ? (1.0 - x * x) * (1.0 - x * x) : 0.0;
    }
  }
  if (std::sqrt(variance) > 0.6 + 0.01 * length) return std::nullopt;
  const Point outward(direction.y(), -direction.x());
  FittedLine line;
  line.middle = middle + centre * direction + offset * outward;
  line.direction = (direction + slope * outward).normalized();
  line.offset_variance = variance / sum_w;
  line.slope_variance = variance / sum_tt;
  line.weights = weights;
  for (std::size_t apart = 0; apart < line.products.size(); ++apart)
    for (std::size_t i = apart; i < n; ++i)
      line.products[apart] += weights[i] * residuals[i] * weights[i - apart] * residuals[i - apart];
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
    const Levels inside = even_levels(profiles, -reach);
    const Levels outside = even_levels(profiles, reach);
    const Levels outside_nearby = levels_nearby(profiles, reach);
    fitted = fit(locate_steps(profiles, reach, false, inside, outside));
    if (!fitted || uneven(profiles, inside, outside, outside_nearby)) {
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

/// Profiles as wider pixels would see them: means over two pixels across the side.
void widen_pixels(Profiles& profiles) {
  for (int i = 0; i < profiles.count; ++i) {
    auto& grey = profiles.grey[static_cast<std::size_t>(i)];
    const auto sharp = grey;
    for (std::size_t k = 2; k + 2 < static_cast<std::size_t>(profiles.across()); ++k)
      grey[k - 2] =
          0.125 * (sharp[k - 2] + sharp[k + 2]) + 0.25 * (sharp[k - 1] + sharp[k] + sharp[k + 1]);
  }
  profiles.inward -= 2;
  profiles.outward -= 2;
}

/// Mean of the profiles, each with its weight.
Profile mean_profile(const Profiles& profiles, const std::array<double, kMaxPositions>& weights) {
  Profile sum = Profile::Zero(profiles.across());
  double count = 0.0;
  for (int i = 0; i < profiles.count; ++i) {
    const double weight = weights[static_cast<std::size_t>(i)];
    count += weight;
    sum += weight * profiles.at(i);
  }
  return sum / std::max(count, 1e-9);
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
  double darkest = 255.0;
  for (int k = -profiles.inward; k <= profiles.outward; ++k)
    darkest = std::min(darkest, median_at(profiles, k));
  const int ring = std::min(static_cast<int>(std::lround(0.5 * band / kStep)), profiles.inward);
  const double inside = median_at(profiles, -ring);
  const double outside = median_at(profiles, profiles.outward);
  const bool merged = outside - darkest < 0.35 * (inside - darkest);
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
  if (profiles.count < 4) return std::nullopt;
  if (aligned) widen_pixels(profiles);
  const Bands bands = bands_of(profiles, profile, widths.band, widths.line.middle, length);
  const bool line_ends = profile.bright_inside && bands.count == 3;
  std::array<double, kMaxPositions> weights;
  weights.fill(1.0);
  std::optional<FittedLine> line;
  std::optional<EdgeFilter> filter;
  // The first round tells which profiles belong.
  for (int round = 0; round < 2; ++round) {
    filter = fit_bands(mean_profile(profiles, weights), -profiles.inward * kStep, kStep, bands,
                       filter ? &*filter : nullptr);
    if (!filter) return std::nullopt;
    EdgePoints points;
    for (int i = 0; i < profiles.count; ++i) {
      const double along = profiles.along[static_cast<std::size_t>(i)];
      const double wider = line_ends ? widths.line.at(along) - widths.line.middle : 0.0;
      points.add(along, filter->position(profiles.at(i)) - filter->by_last * wider);
    }
    line = fit_points(points, 0.5 * (a + b), (b - a) / length, length);
    if (!line) return std::nullopt;
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
  constexpr double kPoints = 30.0;  // that the usual is worth
  // Tukey's weights fall with the residuals, whose scatter about the line they so make small.
  constexpr double kTukeyVariance = 1.16;
  std::array<double, 3> products{};
  double count = 0.0;
  for (const FittedLine& line : lines) {
    for (std::size_t k = 0; k < products.size(); ++k) products[k] += line.products[k];
    for (const double weight : line.weights) count += weight;
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
  FittedQuad fitted{quad, Matrix8d::Zero()};
  // The second round starts from where the first one found the edges.
  for (int round = 0; round < 2; ++round) {
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
    for (std::size_t i = 0; i < 4; ++i)
      if ((fitted.corners[i] - before[i]).norm() > tolerance) return std::nullopt;
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
