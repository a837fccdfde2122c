#include "detect/registration.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include "detect/cells.hpp"
#include "detect/kernels/bilinear.hpp"
#include "detect/sample.hpp"
#include "detect/square_homography.hpp"

namespace harco::detect {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kStep = 0.5;         // pixels between samples across an edge
constexpr double kSpacing = 2.0;      // pixels between samples along it
constexpr int kMostAlongBorder = 32;  // samples along a side of the square,
constexpr int kMostAlong = 8;         // and along any other edge
constexpr double kLeastBand = 2.0;    // pixels; black and white narrower than that aren't compared
constexpr double kLeastLength = 3.0;  // pixels, of an edge
constexpr double kMostReach = 8.0;    // pixels from where an edge is looked for to where it is
constexpr double kDeep = 2.0;         // pixels beside the edge where its levels are read
constexpr double kPlace = 0.8;        // pixels that a seen edge may lie beside its place
constexpr double kLevelSlack = 0.35;  // of the contrast, that its levels may be off
constexpr double kLeastMatchedShare = 0.6;  // of an edge's samples
constexpr double kLeastBorderSeen = 0.08;   // of the outline's samples,
constexpr double kLeastEdgesSeen = 0.03;    // and of all edges'
constexpr std::size_t kFew = 12;            // samples that make no fit

/// Homography with its derivative at a point.
class Map {
 public:
  explicit Map(const Matrix3d& H) : H_(H) {}
  bool at(const Vector2d& unit, Vector2d& place, Eigen::Matrix2d& by_unit) const {
    const Vector3d h = H_ * unit.homogeneous();
    if (!(h.z() > 1e-9)) return false;
    place = h.hnormalized();
    for (Eigen::Index k = 0; k < 2; ++k)
      by_unit.col(k) = (H_.block<2, 1>(0, k) - place * H_(2, k)) / h.z();
    return true;
  }

 private:
  Matrix3d H_;
};

/// The probes along an edge, at most so many; none if it is too small to be seen.
void append_probes(const Map& map, const TemplateEdge& edge, int most, std::vector<Probe>& probes) {
  Vector2d place;
  Eigen::Matrix2d by_unit;
  const Vector2d middle = 0.5 * (edge.a + edge.b);
  if (!map.at(middle, place, by_unit)) return;
  const double length = (by_unit * (edge.b - edge.a)).norm();
  if (length < kLeastLength) return;
  const auto count = std::clamp(static_cast<int>(length / kSpacing), 2, most);
  for (int i = 0; i < count; ++i) {
    Probe probe;
    probe.unit = edge.a + (i + 0.5) / count * (edge.b - edge.a);
    if (!map.at(probe.unit, probe.place, by_unit)) return;
    const Vector2d along = (by_unit * (edge.b - edge.a)).normalized();
    const Vector2d across = by_unit * edge.to_white;
    probe.to_white = Vector2d(along.y(), -along.x());
    double depth = probe.to_white.dot(across);
    if (depth < 0.0) {
      probe.to_white = -probe.to_white;
      depth = -depth;
    }
    probe.black = edge.black * depth;
    probe.white = edge.white * depth;
    if (std::min(probe.black, probe.white) < kLeastBand) return;
    probes.push_back(probe);
  }
}

/// Grey values across a probe, in steps of kStep from -(reach + below) to reach + above.
class Profile {
 public:
  Profile(const ImageView& image, const Lens& lens, const Probe& probe, double reach)
      : below_(steps(std::min(kDeep, 0.55 * probe.black))),
        above_(steps(std::min(kDeep, 0.55 * probe.white))),
        reach_(steps(std::min(reach, std::max(kPlace, 0.5 * std::min(probe.black, probe.white))))),
        zero_(reach_ + below_),
        count_(2 * reach_ + below_ + above_ + 1) {
    whole_ = lens.bends() ? read_bent(image, lens, probe) : read(image, probe);
  }

  bool whole() const { return whole_; }

  /// The strongest rise.
  std::optional<Step> strongest() const {
    int best = 0;
    double most = kMinContrast;
    for (int k = -reach_; k <= reach_; ++k) {
      const double rise = value(k + above_) - value(k - below_);
      if (rise > most) {
        most = rise;
        best = k;
      }
    }
    if (most <= kMinContrast) return std::nullopt;
    return crossing(best - kNear, best + kNear,
                    0.5 * (value(best - below_) + value(best + above_)));
  }

  /// The rise through `middle` that is nearest to the probe.
  std::optional<Step> crossing(double middle) const { return crossing(-reach_, reach_, middle); }

 private:
  static constexpr int kMost = 1 + static_cast<int>(2.0 * (kMostReach + kDeep) / kStep);  // samples
  static constexpr int kNear = 2;  // steps from the strongest rise to where it crosses the middle

  static int steps(double offset) { return static_cast<int>(std::lround(offset / kStep)); }

  bool read(const ImageView& image, const Probe& probe) {
    const Eigen::Vector2f step = (kStep * probe.to_white).cast<float>();
    const Eigen::Vector2f first = (probe.place - zero_ * kStep * probe.to_white).cast<float>();
    const Eigen::Vector2f last = first + static_cast<float>(count_ - 1) * step;
    // A straight row whose ends are in the image is wholly so, but for rounding.
    constexpr float kRounding = 0.01F;
    const auto inside = [&](const Eigen::Vector2f& at) {
      return among_pixels(image, at.x() - kRounding, at.y() - kRounding) &&
             among_pixels(image, at.x() + kRounding, at.y() + kRounding);
    };
    if (!inside(first) || !inside(last)) return false;
    std::array<std::int32_t, kMost> x;
    std::array<std::int32_t, kMost> y;
    for (int k = 0; k < count_; ++k) {
      const auto along = static_cast<float>(k);
      x[static_cast<std::size_t>(k)] = kernels::place_of(first.x() + along * step.x());
      y[static_cast<std::size_t>(k)] = kernels::place_of(first.y() + along * step.y());
    }
    kernels::bilinear(image, x.data(), y.data(), 0, 0, count_, grey_.data());
    return true;
  }

  bool read_bent(const ImageView& image, const Lens& lens, const Probe& probe) {
    for (int k = 0; k < count_; ++k) {
      const auto pixel = lens.from_ideal(probe.place + (k - zero_) * kStep * probe.to_white);
      const auto value = pixel ? sample(image, pixel->x(), pixel->y()) : std::nullopt;
      if (!value) return false;
      grey_[static_cast<std::size_t>(k)] = static_cast<float>(*value);
    }
    return true;
  }

  std::optional<Step> crossing(int from, int to, double middle) const {
    std::optional<double> nearest;
    for (int k = std::max(-reach_, from); k < std::min(reach_, to); ++k) {
      const double low = value(k);
      const double high = value(k + 1);
      if (!(low < middle && high >= middle)) continue;
      const double offset = k + (middle - low) / (high - low);
      if (!nearest || std::abs(offset) < std::abs(*nearest)) nearest = offset;
    }
    if (!nearest) return std::nullopt;
    return Step{*nearest * kStep, between(*nearest - below_), between(*nearest + above_)};
  }

  /// So many steps from the probe.
  double value(int steps) const {
    return static_cast<double>(grey_[static_cast<std::size_t>(zero_ + steps)]);
  }
  double between(double steps) const {
    const int low = std::clamp(static_cast<int>(std::floor(steps)), -zero_, count_ - zero_ - 2);
    return value(low) + (steps - low) * (value(low + 1) - value(low));
  }

  int below_, above_, reach_;  // steps
  int zero_;                   // the sample at the probe
  int count_;                  // samples
  std::array<float, kMost> grey_;
  bool whole_ = false;
};

/// A step that belongs to the marker's light.
bool fits(const Step& step, const LightLevels& levels, const Vector2d& unit) {
  const double black = levels.black_at(unit);
  const double white = levels.white_at(unit);
  const double slack = kLevelSlack * (white - black);
  return std::abs(step.dark - black) < slack && std::abs(step.bright - white) < slack;
}

using Match = FitMemory::Match;

/// Levels that most matches agree on: medians, then planes through what is near them.
std::optional<LightLevels> fit_levels(FitMemory& memory) {
  const std::vector<Match>& matches = memory.matches;
  std::vector<double>& values = memory.values;
  if (matches.size() < kFew) return std::nullopt;
  const auto fit = [&](auto value_of) {
    values.clear();
    for (const Match& match : matches) values.push_back(value_of(match));
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
  };
  const double black = fit([](const Match& match) { return match.step.dark; });
  const double white = fit([](const Match& match) { return match.step.bright; });
  if (white - black < kMinContrast) return std::nullopt;
  const auto plane = [&](double median, auto value_of) {
    // A weak prior keeps what few places can't tell even.
    Matrix3d normal = Vector3d(1e-6, 4.0, 4.0).asDiagonal();
    Vector3d right = Vector3d::Zero();
    for (const Match& match : matches) {
      const double value = value_of(match) - median;
      if (std::abs(value) > 0.4 * (white - black)) continue;
      const Vector3d row(1.0, match.probe.unit.x(), match.probe.unit.y());
      normal += row * row.transpose();
      right += row * value;
    }
    const Vector3d coefficients = normal.ldlt().solve(right);
    return Vector3d(coefficients + Vector3d(median, 0.0, 0.0));
  };
  return LightLevels{plane(black, [](const Match& match) { return match.step.dark; }),
                     plane(white, [](const Match& match) { return match.step.bright; })};
}

/// One step of Gauss and Newton for the homography, with Tukey's weights that end at `cut` pixels.
/// `variance` gets the weighted residuals', `normal` the equations' matrix.
using Normal8 = Eigen::Matrix<double, 8, 8>;
bool step_homography(const std::vector<Match>& matches, double cut, Matrix3d& image_H_unit,
                     Normal8* normal_out = nullptr, double* variance_out = nullptr) {
  // About the square's middle, where the parameters hardly disturb one another.
  Matrix3d to_corner = Matrix3d::Identity();
  to_corner.topRightCorner<2, 1>() = Vector2d::Constant(0.5);
  const Matrix3d K = image_H_unit * to_corner;
  Normal8 normal = Normal8::Zero();
  Eigen::Matrix<double, 8, 1> right = Eigen::Matrix<double, 8, 1>::Zero();
  double sum_w = 0.0;
  double sum_rr = 0.0;
  for (const Match& match : matches) {
    const double x = match.step.offset / cut;
    if (std::abs(x) >= 1.0) continue;
    const double weight = (1.0 - x * x) * (1.0 - x * x);
    const Vector3d q(match.probe.unit.x() - 0.5, match.probe.unit.y() - 0.5, 1.0);
    const Vector3d h = K * q;
    const Vector2d place = h.hnormalized();
    const Eigen::Matrix<double, 1, 3> by_h =
        match.probe.to_white.transpose() * (K.topRows<2>() - place * K.row(2)) / h.z();
    Eigen::Matrix<double, 9, 1> row;
    for (Eigen::Index i = 0; i < 3; ++i) row.segment<3>(3 * i) = by_h(i) * q;
    normal.selfadjointView<Eigen::Lower>().rankUpdate(row.head<8>(), weight);
    right += weight * match.step.offset * row.head<8>();
    sum_w += weight;
    sum_rr += weight * match.step.offset * match.step.offset;
  }
  if (sum_w < kFew) return false;
  normal = Normal8(normal.selfadjointView<Eigen::Lower>());
  if (normal_out) *normal_out = normal;
  if (variance_out) *variance_out = sum_rr / (sum_w - 8.0 > 1.0 ? sum_w - 8.0 : 1.0);
  // What nothing is seen of stays as it is.
  constexpr double kPrior = 10.0;
  normal.diagonal().array() += kPrior;
  const Eigen::LDLT<Normal8> factored(normal);
  if (!(factored.vectorD().minCoeff() > 1e-9)) return false;
  const Eigen::Matrix<double, 8, 1> move = factored.solve(right);
  if (!move.allFinite()) return false;
  Matrix3d update = Matrix3d::Identity();
  for (Eigen::Index i = 0; i < 8; ++i) update(i / 3, i % 3) += move(i);
  image_H_unit = K * update * to_corner.inverse();
  return image_H_unit.allFinite();
}

/// Covariance of the four corners from the fit's normal equations.
bool corner_covariance(const Matrix3d& image_H_unit, const Normal8& normal, double variance,
                       Matrix8d& covariance) {
  // What no fit of edges sees (see edges.cpp), standard deviation in pixels.
  constexpr double kAllowance = 0.02;
  const Eigen::LDLT<Normal8> factored(normal);
  if (!(factored.vectorD().minCoeff() > 1e-9)) return false;
  Matrix3d to_corner = Matrix3d::Identity();
  to_corner.topRightCorner<2, 1>() = Vector2d::Constant(0.5);
  const Matrix3d K = image_H_unit * to_corner;
  const std::array<Vector3d, 4> corners{
      {{-0.5, -0.5, 1.0}, {0.5, -0.5, 1.0}, {0.5, 0.5, 1.0}, {-0.5, 0.5, 1.0}}};
  Normal8 by_parameters;
  for (std::size_t k = 0; k < 4; ++k) {
    const Vector3d h = K * corners[k];
    const Vector2d place = h.hnormalized();
    const Eigen::Matrix<double, 2, 3> by_h = (K.topRows<2>() - place * K.row(2)) / h.z();
    Eigen::Matrix<double, 2, 9> jacobian;
    for (Eigen::Index i = 0; i < 3; ++i)
      jacobian.middleCols<3>(3 * i) = by_h.col(i) * corners[k].transpose();
    by_parameters.middleRows<2>(static_cast<Eigen::Index>(2 * k)) = jacobian.leftCols<8>();
  }
  const Normal8 parameters = std::max(variance, 1e-4) * factored.solve(Normal8::Identity());
  covariance = by_parameters * parameters * by_parameters.transpose();
  covariance.diagonal().array() += kAllowance * kAllowance;
  return covariance.allFinite();
}

bool sound(const Matrix3d& image_H_unit, const Quad& start, double most_move) {
  const Map map(image_H_unit);
  const std::array<Vector2d, 4> corners{{{0, 0}, {1, 0}, {1, 1}, {0, 1}}};
  Quad quad;
  Eigen::Matrix2d by_unit;
  for (std::size_t i = 0; i < 4; ++i) {
    if (!map.at(corners[i], quad[i], by_unit)) return false;
    if ((quad[i] - start[i]).norm() > most_move) return false;
  }
  return convex(quad);
}

/// The steps near all probes of some edges, of whatever level or of a given one, as matches. None
/// if less than `least` of the probes show one: what chance does needs no fit.
void find_steps(const ImageView& image, const Lens& lens, const Matrix3d& H,
                const std::vector<TemplateEdge>& edges, int most_along, double reach, double least,
                const LightLevels* levels, FitMemory& memory) {
  const Map map(H);
  memory.probes.clear();
  memory.matches.clear();
  for (const TemplateEdge& edge : edges) append_probes(map, edge, most_along, memory.probes);
  for (const Probe& probe : memory.probes) {
    const Profile profile(image, lens, probe, reach);
    if (!profile.whole()) continue;
    const auto step =
        levels
            ? profile.crossing(0.5 * (levels->black_at(probe.unit) + levels->white_at(probe.unit)))
            : profile.strongest();
    if (step && (!levels || fits(*step, *levels, probe.unit)))
      memory.matches.push_back({probe, *step});
  }
  if (static_cast<double>(memory.matches.size()) <
      least * static_cast<double>(memory.probes.size()))
    memory.matches.clear();
}

/// The sides of the unit square as edges that keep within the border ring and the quiet zone.
void outline(int cells, std::vector<TemplateEdge>& sides) {
  sides.clear();
  const std::array<Vector2d, 4> corners{{{0, 0}, {1, 0}, {1, 1}, {0, 1}}};
  for (std::size_t i = 0; i < 4; ++i) {
    TemplateEdge side;
    side.a = corners[i] + 0.01 * (corners[(i + 1) % 4] - corners[i]);
    side.b = corners[(i + 1) % 4] + 0.01 * (corners[i] - corners[(i + 1) % 4]);
    side.to_white = corners[i] - corners[(i + 3) % 4];
    side.black = side.white = 1.0 / cells;
    side.border = true;
    sides.push_back(side);
  }
}

}  // namespace

Quad corners_of(const Matrix3d& image_H_unit) {
  const auto seen = [&](double x, double y) {
    return Point((image_H_unit * Vector3d(x, y, 1.0)).hnormalized());
  };
  return {seen(0, 0), seen(1, 0), seen(1, 1), seen(0, 1)};
}

std::optional<Registration> fit_border(const ImageView& image, const Lens& lens, const Quad& quad,
                                       int cells, FitMemory& memory) {
  outline(cells, memory.sides);
  const double side = mean_side(quad);
  const double first_reach = std::clamp(0.025 * side, 2.0, kMostReach);
  Registration registration;
  registration.image_H_unit = square_homography(quad);
  std::optional<LightLevels> levels;
  Normal8 normal;
  double variance = 0.0;
  for (const double share : {1.0, 0.3}) {
    const double reach = std::max(1.0, share * first_reach);
    find_steps(image, lens, registration.image_H_unit, memory.sides, kMostAlongBorder, reach,
               kLeastBorderSeen, levels ? &*levels : nullptr, memory);
    levels = fit_levels(memory);
    if (!levels) return std::nullopt;
    if (!step_homography(memory.matches, std::max(1.0, reach), registration.image_H_unit, &normal,
                         &variance) ||
        !sound(registration.image_H_unit, quad, 2.0 + 0.12 * side))
      return std::nullopt;
  }
  registration.levels = *levels;
  if (!corner_covariance(registration.image_H_unit, normal, variance,
                         registration.corner_covariance))
    return std::nullopt;
  return registration;
}

bool refine(const ImageView& image, const Lens& lens, const std::vector<TemplateEdge>& edges,
            Registration& registration, FitMemory& memory) {
  Registration refined = registration;
  const Quad start = corners_of(registration.image_H_unit);
  Normal8 normal;
  double variance = 0.0;
  for (const double reach : {4.0, 2.0, 1.2, 0.8}) {
    find_steps(image, lens, refined.image_H_unit, edges, kMostAlong, reach, kLeastEdgesSeen,
               &refined.levels, memory);
    const auto levels = fit_levels(memory);
    if (!levels) return false;
    refined.levels = *levels;
    if (!step_homography(memory.matches, reach, refined.image_H_unit, &normal, &variance) ||
        !sound(refined.image_H_unit, start, 2.0 + 0.05 * mean_side(start)))
      return false;
  }
  if (!corner_covariance(refined.image_H_unit, normal, variance, refined.corner_covariance))
    return false;
  registration = refined;
  return true;
}

Evidence gather(const ImageView& image, const Lens& lens, const std::vector<TemplateEdge>& edges,
                const Registration& registration, FitMemory& memory) {
  const Map map(registration.image_H_unit);
  Evidence evidence;
  std::vector<Probe>& probes = memory.probes;
  for (const TemplateEdge& edge : edges) {
    if (edge.border) continue;
    probes.clear();
    append_probes(map, edge, kMostAlong, probes);
    const auto count = static_cast<int>(probes.size());
    int in_view = 0;
    int matched = 0;
    for (const Probe& probe : probes) {
      // So many aren't there that the others can't make it a seen one.
      if (in_view - matched > (1.0 - kLeastMatchedShare) * count && 2 * in_view >= count) break;
      const Profile profile(image, lens, probe, kPlace);
      if (!profile.whole()) continue;
      ++in_view;
      const double middle = 0.5 * (registration.levels.black_at(probe.unit) +
                                   registration.levels.white_at(probe.unit));
      const auto step = profile.crossing(middle);
      matched +=
          step && std::abs(step->offset) <= kPlace && fits(*step, registration.levels, probe.unit);
    }
    if (in_view < 2 || 2 * in_view < count) continue;
    ++evidence.predicted;
    evidence.seen += matched >= kLeastMatchedShare * in_view;
  }
  return evidence;
}

Registration turned(const Registration& registration, int turns) {
  // Unit squares of the upright marker to the seen one: corner 0 goes to corner `turns`.
  static const std::array<Vector2d, 4> corners{{{0, 0}, {1, 0}, {1, 1}, {0, 1}}};
  const auto at = [&](int i) { return corners[static_cast<std::size_t>((i + turns) % 4)]; };
  Matrix3d seen_T_upright = Matrix3d::Identity();
  seen_T_upright.block<2, 1>(0, 0) = at(1) - at(0);
  seen_T_upright.block<2, 1>(0, 1) = at(3) - at(0);
  seen_T_upright.block<2, 1>(0, 2) = at(0);
  Registration result = registration;
  result.image_H_unit = registration.image_H_unit * seen_T_upright;
  const auto turn = [&](const Vector3d& plane) {
    // plane . (1, seen) as a function of upright.
    const Vector2d slope = seen_T_upright.topLeftCorner<2, 2>().transpose() * plane.tail<2>();
    const double offset = plane(0) + plane.tail<2>().dot(seen_T_upright.block<2, 1>(0, 2));
    return Vector3d(offset, slope.x(), slope.y());
  };
  result.levels.black = turn(registration.levels.black);
  result.levels.white = turn(registration.levels.white);
  for (int i = 0; i < 4; ++i)
    for (int k = 0; k < 4; ++k)
      result.corner_covariance.block<2, 2>(2 * i, 2 * k) =
          registration.corner_covariance.block<2, 2>(2 * ((i + turns) % 4), 2 * ((k + turns) % 4));
  return result;
}

}  // namespace harco::detect
