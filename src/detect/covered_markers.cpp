#include "detect/covered_markers.hpp"

#include <algorithm>
#include <utility>

namespace harco::detect {
namespace {

// Squares whose corners lie no farther apart than this share of their side are one.
constexpr double kSameSquare = 0.02;
// The work is bounded by counts, so that it is the same on every machine. So many squares are
// glimpsed at, and one more for every so many pixels, up to a most: twelve everywhere take twice as
// long in textured frames of 750 x 480 and find one or two more of a hundred markers of which seven
// tenths are covered, before grey and before photographs.
constexpr std::size_t kLeastSquares = 4;
constexpr std::size_t kPixelsASquare = 400000;
constexpr std::size_t kMostSquares = 12;
// So many of them are looked at closely.
constexpr std::size_t kMostClosely = 4;

}  // namespace

CoveredMarkers::CoveredMarkers(const MarkerSet& markers, const std::vector<PlacedMarker>& placed,
                               const std::vector<std::vector<double>>& predicted,
                               std::size_t workers) {
  for (std::size_t i = 0; i < workers; ++i) recoveries_.emplace_back(markers, placed, predicted);
}

/// What is known already first, none twice.
void CoveredMarkers::choose_squares(const std::vector<Quad>& quads,
                                    const std::vector<SideQuad>& seen, double least_side_px,
                                    std::size_t most) {
  squares_.clear();
  budget_reached_ = false;
  const auto choose = [&](const Quad& quad) {
    if (mean_side(quad) < least_side_px) return;
    const bool known = std::any_of(squares_.begin(), squares_.end(), [&](const Quad& other) {
      return nearly_same(other, quad, kSameSquare);
    });
    if (known) return;
    if (squares_.size() < most)
      squares_.push_back(quad);
    else
      budget_reached_ = true;
  };
  for (const Quad& quad : quads) choose(quad);
  for (const SideQuad& quad : seen) choose(quad.corners);
}

/// The most promising ones, none twice: squares that began apart often end as one.
void CoveredMarkers::choose_glimpses() {
  chosen_.clear();
  for (std::size_t i = 0; i < glimpses_.size(); ++i)
    if (glimpses_[i]) chosen_.push_back(i);
  std::sort(chosen_.begin(), chosen_.end(), [&](std::size_t a, std::size_t b) {
    return std::pair(-glimpses_[a]->sum(), a) < std::pair(-glimpses_[b]->sum(), b);
  });
  rivals_.assign(chosen_.size(), 0.0);
  std::size_t kept = 0;
  for (const std::size_t next : chosen_) {
    const Glimpse& glimpse = *glimpses_[next];
    const Quad corners = corners_of(glimpse.border.image_H_unit);
    bool known = false;
    double rival = 0.0;
    for (std::size_t k = 0; k < kept && !known; ++k) {
      const Glimpse& better = *glimpses_[chosen_[k]];
      if (!nearly_same(corners_of(better.border.image_H_unit), corners, kSameSquare)) continue;
      known = better.cells == glimpse.cells;
      rival = std::max(rival, better.sum());
      rivals_[k] = std::max(rivals_[k], glimpse.cells == better.cells ? 0.0 : glimpse.sum());
    }
    if (known) continue;
    if (kept == kMostClosely) {
      budget_reached_ = true;
      break;
    }
    rivals_[kept] = rival;
    chosen_[kept++] = next;
  }
  chosen_.resize(kept);
}

Pyramid* CoveredMarkers::begin(const ImageView& image, bool expected) {
  halved_ = expected;
  if (!expected) return nullptr;
  pyramid_.begin(image);
  return &pyramid_;
}

const std::vector<Recovered>& CoveredMarkers::find(const ImageView& image, const Lens& lens,
                                                   const CoveredSearch& search,
                                                   const std::vector<Quad>& quads, Workers& workers,
                                                   DetectionTrace* trace) {
  const auto pixels =
      static_cast<std::size_t>(image.width()) * static_cast<std::size_t>(image.height());
  if (!halved_) pyramid_.build(image, 2);
  const std::size_t most = std::min(kLeastSquares + pixels / kPixelsASquare, kMostSquares);
  // One more tells whether there are more.
  const std::vector<SideQuad>& seen =
      covered_.find(pyramid_, lens, search.least_side_px, search.least_contrast, most + 1,
                    search.calibration, workers, trace);
  choose_squares(quads, seen, search.least_side_px, most);
  if (!squares_.empty()) pyramid_.extend();
  const std::size_t sizes = recoveries_.front().sizes();
  glimpses_.resize(sizes * squares_.size());
  workers.share(glimpses_.size(), [&](std::size_t i, std::size_t worker) {
    glimpses_[i] = recoveries_[worker].glimpse(pyramid_, lens, squares_[i / sizes], i % sizes);
  });
  choose_glimpses();
  looked_at_.resize(chosen_.size());
  workers.share(chosen_.size(), [&](std::size_t i, std::size_t worker) {
    looked_at_[i] = recoveries_[worker].at(pyramid_, lens, *glimpses_[chosen_[i]], rivals_[i]);
  });
  found_.clear();
  for (const auto& one : looked_at_)
    if (one) found_.push_back(*one);
  std::sort(found_.begin(), found_.end(), [](const Recovered& a, const Recovered& b) {
    return a.likeness.sum() > b.likeness.sum();
  });
  return found_;
}

}  // namespace harco::detect
