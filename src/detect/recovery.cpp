#include "detect/recovery.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "detect/sample.hpp"
#include "harco/geometry.hpp"

namespace harco::detect {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// What bears a reading out: edges of its picture that are seen, and how much more it looks like the
// image than the next best reading of the same square. Of six thousand squares in a thousand
// pictures without a marker none had all of this; half of the markers of 120 pixels with seven
// tenths covered have.
constexpr int kLeastSeenAtOnce = 3;  // before the fit to all edges; nine in ten readings have none
constexpr int kLeastSeen = 4;
constexpr double kLeastLead = 8.0;
constexpr double kLeastSum = 32.0;   // of the lead and twice the edges seen
constexpr double kLeastShare = 0.1;  // of the edges predicted
// The marker's picture is compared with the image at kAcross x kAcross points, in blocks.
constexpr int kAcross = 56;
constexpr int kBlock = 4;
// For every cell that shows the other colour, so many must show their own, or such a share of the
// edges be seen: parts of a pattern that look like the whole reach a fifth.
constexpr double kLeastShown = 3.0;
constexpr double kTellingShare = 0.28;
// So many edges seen are beyond all chance; then only another reading can be in the way.
constexpr int kTellingEdges = 18;
constexpr double kLeastTellingLead = 5.0;
// Edges along cells where the marker has none are those of another one. What covers a marker hardly
// ever ends along a cell.
constexpr int kMostForeign = 1;
// The image's edge covers nothing of what is within: of a square that it cuts, so much is seen,
// unless the edges are beyond doubt.
constexpr double kLeastCutShare = 0.5;
// Readings of one square that are held against the image.
constexpr std::size_t kReadings = 4;
// A cell shows its colour if it is off by less than this share of the contrast.
constexpr double kShows = 0.3;

/// Gaussian blur of `sigma` texels, the border's values going on beyond it.
void smooth(std::vector<float>& picture, double sigma) {
  if (sigma < 0.2) return;
  const int reach = static_cast<int>(std::ceil(2.5 * sigma));
  std::vector<float> kernel;
  float sum = 0.0F;
  for (int k = -reach; k <= reach; ++k) {
    kernel.push_back(static_cast<float>(std::exp(-0.5 * k * k / (sigma * sigma))));
    sum += kernel.back();
  }
  for (float& weight : kernel) weight /= sum;
  std::vector<float> once(picture.size());
  const auto at = [](int row, int column) {
    return static_cast<std::size_t>(std::clamp(row, 0, kAcross - 1) * kAcross +
                                    std::clamp(column, 0, kAcross - 1));
  };
  const auto pass = [&](const std::vector<float>& from, std::vector<float>& to, int dx, int dy) {
    for (int row = 0; row < kAcross; ++row)
      for (int column = 0; column < kAcross; ++column) {
        float value = 0.0F;
        for (int k = -reach; k <= reach; ++k)
          value +=
              kernel[static_cast<std::size_t>(k + reach)] * from[at(row + k * dy, column + k * dx)];
        to[at(row, column)] = value;
      }
  };
  pass(picture, once, 1, 0);
  pass(once, picture, 0, 1);
}

/// Whether what is seen leaves no corner open, not even one that is covered or out of view.
bool well_known(const Registration& registration) {
  constexpr double kMostPx = 0.7;
  constexpr double kMostShare = 0.004;  // of the side
  const double side = mean_side(corners_of(registration.image_H_unit));
  const double most = std::max(kMostPx, kMostShare * side);
  return registration.corner_covariance.diagonal().maxCoeff() < most * most;
}

/// Whether part of the square lies beyond the image.
bool cut(const ImageView& image, const Lens& lens, const Registration& registration) {
  for (const Point& corner : corners_of(registration.image_H_unit)) {
    const auto pixel = lens.from_ideal(corner);
    if (!pixel || !sample(image, pixel->x(), pixel->y())) return true;
  }
  return false;
}

/// Where two black cells of m x m meet, either of them an inner one: there the marker has no edge,
/// but another one of the same n does that has white on one side. Each border counts both ways.
std::vector<TemplateEdge> blank_borders(const std::vector<double>& whiteness, int m) {
  std::vector<TemplateEdge> borders;
  const auto black = [&](int row, int column) {
    return whiteness[static_cast<std::size_t>(row * m + column)] < 0.01;
  };
  const auto add = [&](const Vector2d& a, const Vector2d& b, const Vector2d& normal) {
    for (const double sign : {1.0, -1.0}) {
      TemplateEdge border;
      border.a = (a + 0.1 * (b - a)) / m;
      border.b = (b + 0.1 * (a - b)) / m;
      border.to_white = sign * normal;
      border.black = border.white = 1.0 / m;
      borders.push_back(border);
    }
  };
  const Vector2d x = Vector2d::UnitX();
  const Vector2d y = Vector2d::UnitY();
  for (int row = 1; row < m; ++row)
    for (int column = 1; column < m; ++column) {
      if (!black(row, column)) continue;
      const Vector2d corner(column, row);
      if (row < m - 1 && black(row, column - 1)) add(corner, corner + y, x);
      if (column < m - 1 && black(row - 1, column)) add(corner, corner + x, y);
    }
  return borders;
}

}  // namespace

Recovery::Recovery(const MarkerSet& markers, const std::vector<PlacedMarker>& placed,
                   const std::vector<std::vector<double>>& predicted)
    : markers_(markers),
      placed_(placed),
      predicted_(predicted),
      descriptions_(markers.parents.size()) {
  placed_of_.resize(markers.parents.size());
  for (std::size_t i = 0; i < placed.size(); ++i)
    if (placed[i].layer == 1)
      placed_of_[static_cast<std::size_t>(placed[i].parent_index)] = static_cast<int>(i);
  for (const Parent& parent : markers.parents) sizes_.push_back(parent.marker.code.cells);
  std::sort(sizes_.begin(), sizes_.end());
  sizes_.erase(std::unique(sizes_.begin(), sizes_.end()), sizes_.end());
}

const Recovery::Description& Recovery::describe(std::size_t parent) {
  Description& description = descriptions_[parent];
  if (description.edges.empty()) {
    const auto index = static_cast<int>(parent);
    const InkMap ink(markers_, index);
    description.edges = edge_template(ink, markers_, index);
    const double texel = markers_.parents[parent].side_m / kAcross;
    for (int row = 0; row < kAcross; ++row)
      for (int column = 0; column < kAcross; ++column)
        description.picture.push_back(static_cast<float>(ink.white_share(
            {column * texel, row * texel, (column + 1) * texel, (row + 1) * texel})));
    description.blank = blank_borders(predicted_[static_cast<std::size_t>(placed_of_[parent])],
                                      markers_.parents[parent].marker.code.cells + 2);
  }
  return description;
}

/// Every reading of the square, best first, by how many cells show what the marker has there.
void Recovery::rank(const ImageView& image, const Lens& lens, const Registration& registration,
                    int cells) {
  const int m = cells + 2;
  std::vector<double> values;
  for (int row = 0; row < m; ++row)
    for (int column = 0; column < m; ++column) {
      double sum = 0.0;
      for (const double dy : {-0.2, 0.2})
        for (const double dx : {-0.2, 0.2}) {
          const Vector2d unit((column + 0.5 + dx) / m, (row + 0.5 + dy) / m);
          const Vector3d h = registration.image_H_unit * unit.homogeneous();
          const auto pixel = lens.from_ideal(h.hnormalized());
          const auto grey = pixel ? sample(image, pixel->x(), pixel->y()) : std::nullopt;
          const double black = registration.levels.black_at(unit);
          const double white = registration.levels.white_at(unit);
          sum += grey ? 0.25 * (*grey - black) / (white - black) : -10.0;
        }
      values.push_back(sum);
    }
  for (std::size_t p = 0; p < markers_.parents.size(); ++p) {
    if (markers_.parents[p].marker.code.cells != cells) continue;
    const std::vector<double>& predicted = predicted_[static_cast<std::size_t>(placed_of_[p])];
    for (int turns = 0; turns < 4; ++turns) {
      Reading reading{p, turns, 0.0, 0, 0, 0.0};
      int shown = 0;
      double sum = 0.0;
      for (int row = 1; row <= cells; ++row)
        for (int column = 1; column <= cells; ++column) {
          // Cell (row, column) as seen is this cell of the upright marker.
          int r = row;
          int c = column;
          for (int k = 0; k < turns; ++k) {
            const int upright_r = m - 1 - c;
            c = r;
            r = upright_r;
          }
          const double value = values[static_cast<std::size_t>(row * m + column)];
          const double expected = predicted[static_cast<std::size_t>(r * m + c)];
          const double away = std::abs(value - expected);
          const bool opposed = expected > 0.5 ? std::abs(value) < kShows  // black for white
                                              : std::abs(value - 1.0) < kShows;
          reading.opposed += opposed;
          reading.score += std::max(-0.5, 1.0 - away / kShows);
          if (away < kShows) {
            ++shown;
            sum += away;
          }
        }
      reading.wrong = cells * cells - shown;
      reading.quality = shown == 0 ? 0.0 : 1.0 - sum / shown;
      readings_.push_back(reading);
    }
  }
}

/// The logarithm of how much more likely the image is with the marker there than with anything:
/// block by block, what is covered counts for nothing.
double Recovery::likeness(const ImageView& image, const Lens& lens,
                          const Registration& registration, const Description& description,
                          int cells) {
  // A block is explained if it is off by no more than this, root mean square; one with a pattern
  // in it hardly ever by chance, an even one easily.
  constexpr float kExplained = 0.16F;
  constexpr float kPattern = 0.15F;
  constexpr double kPatternWorth = 4.0;
  constexpr double kEvenWorth = 0.5;
  constexpr double kBlur = 0.8;  // pixels
  smooth_ = description.picture;
  smooth(smooth_, kBlur * kAcross / mean_side(corners_of(registration.image_H_unit)));
  double total = 0.0;
  // The border ring is the same for all.
  const int ring = kAcross / cells;
  for (int top = ring; top < kAcross - ring; top += kBlock)
    for (int left = ring; left < kAcross - ring; left += kBlock) {
      float off = 0.0F;
      float sum = 0.0F;
      float squares = 0.0F;
      bool in_view = true;
      for (int k = 0; k < kBlock * kBlock && in_view; ++k) {
        const int row = top + k / kBlock;
        const int column = left + k % kBlock;
        const Vector2d unit((column + 0.5) / kAcross, (row + 0.5) / kAcross);
        const Vector3d h = registration.image_H_unit * unit.homogeneous();
        const auto pixel = lens.from_ideal(h.hnormalized());
        const auto grey = pixel ? sample(image, pixel->x(), pixel->y()) : std::nullopt;
        in_view = grey.has_value();
        if (!in_view) break;
        const double black = registration.levels.black_at(unit);
        const double white = registration.levels.white_at(unit);
        const float predicted = smooth_[static_cast<std::size_t>(row * kAcross + column)];
        const float away = static_cast<float>((*grey - black) / (white - black)) - predicted;
        off += away * away;
        sum += predicted;
        squares += predicted * predicted;
      }
      constexpr float kCount = kBlock * kBlock;
      if (!in_view || off > kCount * kExplained * kExplained) continue;
      const bool pattern = squares / kCount - sum * sum / (kCount * kCount) > kPattern * kPattern;
      total += pattern ? kPatternWorth : kEvenWorth;
    }
  return total;
}

std::optional<Recovered> Recovery::at(const ImageView& image, const Lens& lens, const Quad& quad) {
  std::optional<Recovered> best;
  double best_likeness = 0.0;
  double next_likeness = 0.0;
  for (const int cells : sizes_) {
    const auto border = fit_border(image, lens, quad, cells + 2);
    if (!border) continue;
    readings_.clear();
    rank(image, lens, *border, cells);
    const std::size_t count = std::min(kReadings, readings_.size());
    std::partial_sort(readings_.begin(), readings_.begin() + static_cast<std::ptrdiff_t>(count),
                      readings_.end(),
                      [](const Reading& a, const Reading& b) { return a.score > b.score; });
    readings_.resize(count);
    // Where no reading fits to begin with, the finest fit of any finds nothing either.
    const bool promising =
        std::any_of(readings_.begin(), readings_.end(), [&](const Reading& reading) {
          return gather(image, lens, describe(reading.parent).edges, turned(*border, reading.turns))
                     .seen >= kLeastSeenAtOnce;
        });
    if (!promising) continue;
    for (const Reading& reading : readings_) {
      const Description& description = describe(reading.parent);
      Recovered recovered;
      recovered.placed = placed_of_[reading.parent];
      recovered.registration = turned(*border, reading.turns);
      recovered.wrong_cells = reading.wrong;
      recovered.quality = reading.quality;
      recovered.opposed_cells = reading.opposed;
      if (!refine(image, lens, description.edges, recovered.registration) ||
          !well_known(recovered.registration))
        continue;
      recovered.evidence = gather(image, lens, description.edges, recovered.registration);
      const double like = likeness(image, lens, recovered.registration, description, cells + 2);
      if (!best || like > best_likeness) {
        next_likeness = best_likeness;
        best_likeness = like;
        best = recovered;
      } else {
        next_likeness = std::max(next_likeness, like);
      }
    }
  }
  if (!best) return std::nullopt;
  const double lead = best_likeness - next_likeness;
  const int parent = placed_[static_cast<std::size_t>(best->placed)].parent_index;
  const int foreign =
      gather(image, lens, describe(static_cast<std::size_t>(parent)).blank, best->registration)
          .seen;
  if (foreign > kMostForeign) return std::nullopt;
  const bool telling = best->evidence.seen >= kTellingEdges && foreign == 0 && lead >= kLeastLead;
  if (cut(image, lens, best->registration) && !telling && best->evidence.share() < kLeastCutShare)
    return std::nullopt;
  // What covers a marker is rarely just as black and white as it. Where many cells show the other
  // colour, another pattern may stand there, or a part of this one: only its edges can tell.
  const PlacedMarker& marker = placed_[static_cast<std::size_t>(best->placed)];
  const int shown = marker.code.size() - best->wrong_cells;
  if (shown < kLeastShown * best->opposed_cells && best->evidence.share() < kTellingShare)
    return std::nullopt;
  if (best->evidence.seen >= kTellingEdges) {
    if (lead < kLeastTellingLead) return std::nullopt;
    return best;
  }
  if (best->evidence.seen < kLeastSeen || best->evidence.share() < kLeastShare ||
      lead < kLeastLead || lead + 2.0 * best->evidence.seen < kLeastSum)
    return std::nullopt;
  return best;
}

}  // namespace harco::detect
