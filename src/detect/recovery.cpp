#include "detect/recovery.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "detect/cells.hpp"
#include "detect/sample.hpp"
#include "harco/geometry.hpp"

namespace harco::detect {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// What bears a reading out. Where its children's cells can be told apart, some black ones of them
// are seen, few are seen that should be white, and the marker's picture looks more like the image
// than the next best reading's; the clearer one, the less of the other will do. In 240 pictures of
// another set's markers one had all of this, in 120 of half covered ones of the set all but one.
constexpr int kManyCells = 12;  // of black ones in all children: else there is too little to tell
constexpr int kFewWrong = 1;
constexpr int kConfirmedPerWrong = 3;
constexpr int kLeastConfirmed = 2;
constexpr double kLeastLead = 16.0;
constexpr double kLeastLeadTimesConfirmed = 110.0;
// A long lead with a pattern in it and nothing of another marker says it all.
constexpr double kLongLead = 75.0;
constexpr int kLongLeadSeen = 4;
constexpr int kLongLeadPatterned = 20;
// Without children it is edges of the picture that have to be seen. Of six thousand squares in a
// thousand pictures without a marker none had all of this.
constexpr int kLeastSeen = 4;
// In 720 pictures of covered tags of others, none led by so much; of covered tags of the set, with
// thirty of them, 49 of 50 do.
constexpr double kLeastLeadByEdges = 45.0;
constexpr double kLeastShare = 0.1;  // of the edges predicted
// For every cell that shows the other colour, so many must show their own, or such a share of the
// edges be seen: parts of a pattern that look like the whole reach a fifth.
constexpr double kLeastShown = 3.0;
constexpr double kTellingShare = 0.28;
// So many edges seen are beyond all chance.
constexpr int kTellingEdges = 18;
// Edges along cells where the marker has none are those of another one. What covers a marker hardly
// ever ends along a cell.
constexpr int kMostForeign = 1;
// The image's edge covers nothing of what is within: of a square that it cuts, so much is seen,
// unless the edges are beyond doubt.
constexpr double kLeastCutShare = 0.5;
// Readings of one square whose picture is held against the image; of these, a glimpse keeps the
// best.
constexpr std::size_t kRanked = 8;
// Blocks with a pattern that the best of them explains before its picture is fitted; those of a
// marker of which seven tenths are covered are thirteen and more, but for squares that are far off.
constexpr int kLeastPatternedAtOnce = 8;
// Of its readings, those that explain less than this share of what the best one does aren't fitted:
// that doesn't bring the one up to the other.
constexpr double kLeastOfBest = 0.5;
// A cell shows its colour if it is off by less than this share of the contrast.
constexpr float kShows = 0.3F;
// Pictures are blurred in steps of not quite a third, and so many are kept.
constexpr double kBlurStep = 1.3;
constexpr std::size_t kMostKept = 128;

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

/// The best ones to the front, the others away.
template <class Value>
void keep_best(std::vector<Reading>& readings, std::size_t most, Value value) {
  const std::size_t count = std::min(most, readings.size());
  std::partial_sort(readings.begin(), readings.begin() + static_cast<std::ptrdiff_t>(count),
                    readings.end(), [&](const Reading& a, const Reading& b) {
                      return std::pair(-value(a), std::pair(a.parent, a.turns)) <
                             std::pair(-value(b), std::pair(b.parent, b.turns));
                    });
  readings.resize(count);
}

}  // namespace

Recovery::Recovery(const MarkerSet& markers, const std::vector<PlacedMarker>& placed,
                   const std::vector<std::vector<double>>& predicted)
    : markers_(markers),
      placed_(placed),
      predicted_(predicted),
      descriptions_(markers.parents.size()),
      pictures_(markers.parents.size()) {
  placed_of_.resize(markers.parents.size());
  for (std::size_t i = 0; i < placed.size(); ++i)
    if (placed[i].layer == 1)
      placed_of_[static_cast<std::size_t>(placed[i].parent_index)] = static_cast<int>(i);
  for (int cells = Code::kMinCells; cells <= Code::kMaxCells; ++cells) {
    Table table;
    table.cells = cells;
    for (std::size_t parent = 0; parent < markers.parents.size(); ++parent)
      if (markers.parents[parent].marker.code.cells == cells)
        for (int turns = 0; turns < 4; ++turns) table.readings.push_back({parent, turns, 0.0F, {}});
    if (table.readings.empty()) continue;
    for (int row = 1; row <= cells; ++row)
      for (int column = 1; column <= cells; ++column)
        for (const Reading& reading : table.readings)
          table.expected.push_back(static_cast<float>(predicted[static_cast<std::size_t>(
              placed_of_[reading.parent])][upright_cell(row, column, reading.turns, cells + 2)]));
    tables_.push_back(std::move(table));
  }
}

const Recovery::Description& Recovery::describe(std::size_t parent) {
  Description& description = descriptions_[parent];
  if (description.edges.empty()) {
    const auto index = static_cast<int>(parent);
    const InkMap ink(markers_, index);
    description.edges = edge_template(ink, markers_, index);
    for (const PlacedMarker& marker : placed_)
      if (marker.parent_index == index && marker.layer == 2) {
        const double texel = markers_.parents[parent].side_m / kTexelsAcross;
        description.children.push_back(
            {marker.origin_m / texel, marker.side_m / texel, marker.code.cells + 2});
      }
    description.blank = blank_borders(predicted_[static_cast<std::size_t>(placed_of_[parent])],
                                      markers_.parents[parent].marker.code.cells + 2);
  }
  return description;
}

const Texels& Recovery::printed(std::size_t parent) {
  Texels& picture = pictures_[parent];
  if (picture.empty()) picture = detect::picture_of(ink_plan(markers_, static_cast<int>(parent)));
  return picture;
}

const BlurredPicture& Recovery::picture_of(std::size_t parent, int cells, double blur) {
  const int step = static_cast<int>(std::lround(std::log(blur) / std::log(kBlurStep)));
  for (const Kept& kept : kept_)
    if (kept.parent == parent && kept.step == step) return kept.picture;
  if (kept_.size() < kMostKept) {
    next_kept_ = kept_.size();
    kept_.emplace_back();
  }
  Kept& kept = kept_[next_kept_];
  next_kept_ = (next_kept_ + 1) % kMostKept;
  kept.parent = parent;
  kept.step = step;
  blur_picture(printed(parent), std::pow(kBlurStep, step), cells + 2, smooth_, kept.picture);
  return kept.picture;
}

/// How white the square's cells look, its border ring's left out.
void Recovery::read_cells(const ImageView& image, const Lens& lens,
                          const Registration& registration, int cells) {
  const int m = cells + 2;
  cells_.clear();
  for (int row = 1; row <= cells; ++row)
    for (int column = 1; column <= cells; ++column) {
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
      cells_.push_back(static_cast<float>(sum));
    }
}

/// The best readings of the square, by how many cells show what the marker has there.
void Recovery::rank(const Table& table) {
  const std::size_t count = table.readings.size();
  scores_.assign(count, 0.0F);
  for (std::size_t cell = 0; cell < cells_.size(); ++cell) {
    const float seen = cells_[cell];
    const float* const expected = &table.expected[cell * count];
    for (std::size_t i = 0; i < count; ++i)
      scores_[i] += std::max(-0.5F, 1.0F - std::abs(seen - expected[i]) / kShows);
  }
  readings_ = table.readings;
  for (std::size_t i = 0; i < count; ++i) readings_[i].score = scores_[i];
  keep_best(readings_, kRanked, [](const Reading& reading) { return reading.score; });
}

/// Every reading of the square that its cells suggest, best first, by the marker's picture.
void Recovery::compare(const Pyramid& image, const Lens& lens, Glimpse& glimpse) {
  unwarp(image, lens, glimpse.border, glimpse.cells + 2, unwarped_);
  cut(unwarped_.texels, glimpse.cells + 2, turned_[0]);
  for (int turns = 1; turns < 4; ++turns)
    turn(turned_[0], turns, turned_[static_cast<std::size_t>(turns)]);
  for (Reading& reading : readings_)
    reading.likeness = likeness(turned_[static_cast<std::size_t>(reading.turns)],
                                picture_of(reading.parent, glimpse.cells, unwarped_.blur));
  keep_best(readings_, glimpse.readings.size(),
            [](const Reading& reading) { return reading.likeness.sum(); });
  glimpse.count = readings_.size();
  std::copy(readings_.begin(), readings_.end(), glimpse.readings.begin());
}

std::optional<Glimpse> Recovery::glimpse(const Pyramid& image, const Lens& lens, const Quad& quad,
                                         std::size_t size) {
  const Table& table = tables_[size];
  const auto border = fit_border(image.level(0), lens, quad, table.cells + 2, memory_);
  if (!border) return std::nullopt;
  Glimpse glimpse;
  glimpse.cells = table.cells;
  glimpse.border = *border;
  read_cells(image.level(0), lens, *border, table.cells);
  rank(table);
  compare(image, lens, glimpse);
  // Where no reading fits to begin with, the finest fit of any finds nothing either.
  if (glimpse.readings.front().likeness.patterned < kLeastPatternedAtOnce) return std::nullopt;
  return glimpse;
}

/// What the cells of the square say to a reading.
void Recovery::count_cells(const Reading& reading, int cells, Recovered& recovered) const {
  const std::vector<double>& predicted =
      predicted_[static_cast<std::size_t>(placed_of_[reading.parent])];
  int shown = 0;
  double sum = 0.0;
  for (int row = 1; row <= cells; ++row)
    for (int column = 1; column <= cells; ++column) {
      const float value = cells_[static_cast<std::size_t>((row - 1) * cells + column - 1)];
      const auto expected =
          static_cast<float>(predicted[upright_cell(row, column, reading.turns, cells + 2)]);
      const float away = std::abs(value - expected);
      const bool opposed = expected > 0.5F ? std::abs(value) < kShows  // black for white
                                           : std::abs(value - 1.0F) < kShows;
      recovered.opposed_cells += opposed;
      if (away < kShows) {
        ++shown;
        sum += static_cast<double>(away);
      }
    }
  recovered.wrong_cells = cells * cells - shown;
  recovered.quality = shown == 0 ? 0.0 : 1.0 - sum / shown;
}

std::optional<Recovered> Recovery::best_reading(const Pyramid& image, const Lens& lens,
                                                const Glimpse& glimpse, double rival) {
  const ImageView whole = image.level(0);
  std::optional<Recovered> best;
  double next = rival;
  read_cells(whole, lens, glimpse.border, glimpse.cells);
  for (std::size_t i = 0; i < glimpse.count; ++i) {
    const Reading& reading = glimpse.readings[i];
    Recovered recovered;
    recovered.placed = placed_of_[reading.parent];
    recovered.registration = turned(glimpse.border, reading.turns);
    if (reading.likeness.sum() < kLeastOfBest * glimpse.sum() ||
        !refine(whole, lens, describe(reading.parent).edges, recovered.registration, memory_) ||
        !well_known(recovered.registration)) {
      next = std::max(next, reading.likeness.sum());
      continue;
    }
    const int m = glimpse.cells + 2;
    unwarp(image, lens, recovered.registration, m, unwarped_);
    cut(unwarped_.texels, m, turned_[0]);
    blur_picture(printed(reading.parent), unwarped_.blur, m, smooth_, blurred_);
    recovered.likeness = likeness(turned_[0], blurred_);
    recovered.votes = cell_votes(unwarped_.texels, smooth_, describe(reading.parent).children);
    count_cells(reading, glimpse.cells, recovered);
    const double sum = recovered.likeness.sum();
    if (!best || sum > best->likeness.sum()) {
      if (best) next = std::max(next, best->likeness.sum());
      best = recovered;
    } else {
      next = std::max(next, sum);
    }
  }
  if (!best) return std::nullopt;
  best->lead = best->likeness.sum() - next;
  const int parent = placed_[static_cast<std::size_t>(best->placed)].parent_index;
  const Description& description = describe(static_cast<std::size_t>(parent));
  best->evidence = gather(whole, lens, description.edges, best->registration, memory_);
  best->foreign = gather(whole, lens, description.blank, best->registration, memory_).seen;
  return best;
}

bool Recovery::borne_out(const ImageView& image, const Lens& lens, const Recovered& reading) const {
  const CellVotes& votes = reading.votes;
  if (reading.foreign > kMostForeign || reading.lead < kLeastLead) return false;
  if (votes.wrong > kFewWrong && kConfirmedPerWrong * votes.wrong > votes.confirmed) return false;
  if (reading.foreign == 0 && votes.wrong == 0 && reading.lead >= kLongLead &&
      reading.evidence.seen >= kLongLeadSeen && reading.likeness.patterned >= kLongLeadPatterned)
    return true;
  if (votes.predicted >= kManyCells)
    return votes.confirmed >= kLeastConfirmed &&
           reading.lead * votes.confirmed >= kLeastLeadTimesConfirmed;
  return borne_out_by_edges(image, lens, reading);
}

bool Recovery::borne_out_by_edges(const ImageView& image, const Lens& lens,
                                  const Recovered& reading) const {
  if (reading.lead < kLeastLeadByEdges) return false;
  const Evidence& evidence = reading.evidence;
  const bool telling = evidence.seen >= kTellingEdges && reading.foreign == 0;
  if (cut(image, lens, reading.registration) && !telling && evidence.share() < kLeastCutShare)
    return false;
  // What covers a marker is rarely just as black and white as it. Where many cells show the other
  // colour, another pattern may stand there, or a part of this one: only its edges can tell.
  const int cells = placed_[static_cast<std::size_t>(reading.placed)].code.size();
  const int shown = cells - reading.wrong_cells;
  if (shown < kLeastShown * reading.opposed_cells && evidence.share() < kTellingShare) return false;
  return evidence.seen >= kTellingEdges ||
         (evidence.seen >= kLeastSeen && evidence.share() >= kLeastShare);
}

std::optional<Recovered> Recovery::at(const Pyramid& image, const Lens& lens,
                                      const Glimpse& glimpse, double rival) {
  auto best = best_reading(image, lens, glimpse, rival);
  if (best && !borne_out(image.level(0), lens, *best)) best.reset();
  return best;
}

}  // namespace harco::detect
