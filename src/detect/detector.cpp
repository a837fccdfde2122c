#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <stdexcept>
#include <tuple>
#include <utility>

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "detect/cells.hpp"
#include "detect/codebook.hpp"
#include "detect/covered_markers.hpp"
#include "detect/edges.hpp"
#include "detect/lens.hpp"
#include "detect/prediction.hpp"
#include "detect/quad.hpp"
#include "detect/relations.hpp"
#include "detect/shapes.hpp"
#include "detect/square_homography.hpp"
#include "detect/workers.hpp"
#include "harco/detect.hpp"
#include "harco/geometry.hpp"

namespace harco {
namespace {

using detect::Codebook;
using detect::Match;
using detect::Quad;
using detect::Shape;

// From this share of the span between black and white a cell counts as white: cells that hold
// children are darker than paper.
constexpr double kWhiteLevel = 0.42;
// Blur of lens, pixel and interpolation together (standard deviation in pixels): of a sharp camera,
// and of one slightly out of focus. The second is tried where the first reads nothing and cells are
// so small that it matters.
constexpr double kSharp = 0.78;
constexpr double kSoft = 1.15;
constexpr double kSmallCell = 5.0;
// Ring cells that glare, dirt or blur may have turned, as a share of the ring.
constexpr double kWrongRingShare = 0.1;

// The smallest side of a parent that is read in spite of a shadow's edge, in pixels.
constexpr double kLeastShadedSide = 28.0;

// The smallest side of a partly covered marker, in pixels.
constexpr double kLeastCoveredSide = 80.0;

const DetectorOptions& checked(const DetectorOptions& options) {
  if (!(options.min_side_px >= 4.0) || !std::isfinite(options.min_side_px))
    throw std::invalid_argument("min_side_px: must be at least 4 pixels");
  if (options.max_bit_errors < 0)
    throw std::invalid_argument("max_bit_errors: must not be negative");
  if (options.tentative_bit_errors < 0)
    throw std::invalid_argument("tentative_bit_errors: must not be negative");
  if (!(options.min_quality >= 0.0 && options.min_quality <= 1.0))
    throw std::invalid_argument("min_quality: must be 0 … 1");
  if (!(options.threads >= 1 && options.threads <= DetectorOptions::kMostThreads))
    throw std::invalid_argument("threads: must be 1 … " +
                                std::to_string(DetectorOptions::kMostThreads));
  if (options.camera) validate(*options.camera);
  return options;
}

/// Of the smallest marker of some books, its ring included; 0 without any. They are in the order of
/// their cells.
int cells_across(const std::vector<Codebook>& books) {
  return books.empty() ? 0 : books.front().cells() + 2;
}

/// How many of a parent's cells a glance has to show bright: a part of those that are white all
/// over. The others are for what light, dirt and rough corners do.
int bright_at_a_glance(const Marker& parent) {
  int white = parent.code.size() - parent.code.black_count();
  for (const Marker& child : parent.children) white -= child.part == 0;
  return std::max(1, white / 2);
}

/// In the order of the set; of a marker that is there twice, the upper one first.
void sort_by_place(std::vector<Detection>& detections) {
  std::sort(detections.begin(), detections.end(), [](const Detection& a, const Detection& b) {
    const auto key = [](const Detection& detection) {
      return std::tuple(detection.placed, detection.corners[0].y(), detection.corners[0].x());
    };
    return key(a) < key(b);
  });
}

/// How sure a detection is by itself.
enum class Standing { sure, needs_relatives, needs_memory };

struct Found {
  Detection detection;
  Standing standing;
  std::size_t candidate;  // index into the candidates of this frame
};

/// A marker of the set that the cells of a quad are like.
struct Reading {
  Match match;
  double quality = -1.0;
};

/// Where the cells of a quad lie.
struct CellPlaces {
  Eigen::Matrix3d image_H_cells;  // (0, 0) ... (n+2, n+2) to ideal pixels
  double cell_px;                 // the least side
};

/// What one of those who work needs of its own.
struct Scratch {
  std::vector<Match> matches;
  Reading reading;
  std::vector<Found> found;
};

}  // namespace

const char* to_string(Rejection rejection) {
  switch (rejection) {
    case Rejection::none:
      return "none";
    case Rejection::ring:
      return "ring";
    case Rejection::contrast:
      return "contrast";
    case Rejection::edges:
      return "edges";
    case Rejection::shape:
      return "shape";
    case Rejection::code:
      return "code";
    case Rejection::quality:
      return "quality";
    case Rejection::duplicate:
      return "duplicate";
    case Rejection::inconsistent:
      return "inconsistent";
  }
  return "unknown";
}

struct Detector::Impl {
  Impl(MarkerSet set, const DetectorOptions& chosen)
      : markers(std::move(set)),
        options(checked(chosen)),
        workers(static_cast<std::size_t>(options.threads)) {
    validate(markers);
    placed = place(markers);
    predicted = predicted_cells(markers);
    lens = detect::Lens(options.camera);
    scratch.resize(workers.count());
    covered.emplace(markers, placed, predicted, workers.count());
    for (const bool children : {false, true})
      for (int n = Code::kMinCells; n <= Code::kMaxCells; ++n) {
        Codebook book(n, placed, children);
        if (!book.empty()) (children ? child_books : parent_books).push_back(std::move(book));
      }
    for (const PlacedMarker& marker : placed) {
      int& least = least_black[{marker.layer > 1, marker.code.cells}];
      least = least == 0 ? marker.code.black_count() : std::min(least, marker.code.black_count());
    }
    for (const Parent& parent : markers.parents) {
      const auto [least, first] =
          least_bright.emplace(parent.marker.code.cells, bright_at_a_glance(parent.marker));
      if (!first) least->second = std::min(least->second, bright_at_a_glance(parent.marker));
    }
  }

  void detect(const ImageView& image, std::vector<Detection>& detections, DetectionTrace* trace);
  void detect(const ImageView& image, const Region& region, std::vector<Detection>& detections,
              DetectionTrace* trace);
  void check_size(const ImageView& image) const;
  void find_shapes(const ImageView& image, DetectionTrace* trace);
  void examine_all(const ImageView& image);
  void examine(const ImageView& image, const Shape& shape, std::size_t index, Scratch& own);
  double required_quality(int errors) const;
  template <typename Agreement>
  Rejection look_up(Candidate& candidate, const Codebook& book, std::uint64_t bits,
                    const Agreement& agreement, Scratch& own) const;
  Rejection read(Candidate& candidate, const Codebook& book, const detect::CellGreys& seen,
                 double blur_px, Scratch& own) const;
  Rejection read_shaded(Candidate& candidate, const Codebook& book, const detect::CellGreys& seen,
                        double blur_px, Scratch& own) const;
  Rejection decode(const ImageView& image, Candidate& candidate, const Codebook& book,
                   const detect::FittedQuad& fitted, std::size_t index, Scratch& own) const;
  Rejection identify(Candidate& candidate, const Codebook& book, const detect::FittedQuad& fitted,
                     const CellPlaces& places, std::size_t index, Scratch& own) const;
  void recover(const ImageView& image, DetectionTrace* trace);
  bool add_recovered(const detect::Recovered& recovered);
  void settle(std::vector<Detection>& detections);
  void infer(const ImageView& image, std::vector<Detection>& detections);
  bool confirm(const ImageView& image, const detect::PredictedQuad& quad, Detection& detection);
  void reject(const Found& what, Rejection why);
  void note(Candidate& candidate, const char* words) const;
  detect::SideProfile side_profile(bool child, int cells) const;
  void sharpen(const ImageView& image, Detection& detection) const;
  bool set_corners(const Quad& ideal, const Matrix8d& covariance, Detection& detection) const;

  MarkerSet markers;
  DetectorOptions options;
  std::vector<PlacedMarker> placed;
  std::vector<std::vector<double>> predicted;
  std::vector<Codebook> parent_books, child_books;
  std::map<std::pair<bool, int>, int> least_black;
  std::map<int, int> least_bright;  // by cells: of a parent, that a glance has to show
  detect::Lens lens;
  Eigen::Vector2d origin = Eigen::Vector2d::Zero();  // of the part of the image looked at

  // Scratch, kept from frame to frame.
  detect::Workers workers;
  std::vector<Scratch> scratch;  // of each of them
  detect::ShapeFinder shapes;
  std::vector<Candidate> candidates;
  std::vector<Found> found;
  std::vector<Found> kept;
  std::vector<Detection> inferred;
  std::vector<std::size_t> by_size;
  std::vector<bool> explained, present;
  bool explaining = false;  // somebody wants to know what was seen
  DetectorStatistics statistics;
  std::optional<detect::CoveredMarkers> covered;
  bool searched_covered = false;  // in the last frame
  std::vector<Quad> squares, taken;
};

void Detector::Impl::find_shapes(const ImageView& image, DetectionTrace* trace) {
  // The next frame is mostly like the last one.
  detect::Pyramid* const half = covered->begin(image, searched_covered);
  shapes.find(image, {options.min_side_px, cells_across(parent_books), cells_across(child_books)},
              workers, half, trace);
  statistics.noise = shapes.threshold().noise();
  statistics.quads = shapes.count();
  statistics.budget_reached = shapes.shapes().size() < shapes.count();
}

/// Only for those who look on: words take memory.
void Detector::Impl::note(Candidate& candidate, const char* words) const {
  if (explaining) candidate.note = words;
}

/// A code that had to be corrected needs a better picture: each bit takes away three fifths of what
/// the quality may lack. Texture that comes near a code by chance looks like it less than a marker
/// does whose cells were misread.
double Detector::Impl::required_quality(int errors) const {
  return 1.0 - (1.0 - options.min_quality) * std::pow(0.4, errors);
}

/// The marker of the book that is most like a quad's cells, of those whose code is near enough.
template <typename Agreement>
Rejection Detector::Impl::look_up(Candidate& candidate, const Codebook& book, std::uint64_t bits,
                                  const Agreement& agreement, Scratch& own) const {
  const int with_relatives = std::min(options.max_bit_errors + 1, book.safe_errors());
  own.matches.clear();
  book.find(bits, std::max(with_relatives, options.tentative_bit_errors), own.matches);
  if (own.matches.empty()) {
    if (explaining) candidate.note = "read " + to_string(Code{book.cells(), bits});
    return Rejection::code;
  }
  Reading& best = own.reading;
  best.quality = -1.0;
  for (const Match& match : own.matches) {
    const double quality =
        agreement(predicted[static_cast<std::size_t>(match.placed)], match.turns);
    if (quality > best.quality) best = {match, quality};
  }
  char words[96];
  std::snprintf(words, sizeof words, "%d bit errors, quality %.3f", best.match.errors,
                best.quality);
  note(candidate, words);
  candidate.placed = best.match.placed;
  return Rejection::none;
}

Rejection Detector::Impl::read(Candidate& candidate, const Codebook& book,
                               const detect::CellGreys& seen, double blur_px, Scratch& own) const {
  const int n = book.cells();
  const bool child = candidate.hole;
  const auto grid = detect::read_cells(seen, blur_px, child, least_black.at({child, n}));
  char words[96];
  if (!grid) {
    note(candidate, "the paper around it is not in the image");
    return Rejection::shape;
  }
  if (grid->contrast < detect::kMinContrast) {
    std::snprintf(words, sizeof words, "contrast %.1f grey levels", grid->contrast);
    note(candidate, words);
    return Rejection::contrast;
  }
  const int wrong = detect::wrong_ring_cells(*grid, child);
  if (wrong > kWrongRingShare * 4 * (n + 1)) {
    std::snprintf(words, sizeof words, "%d of %d ring cells are not %s", wrong, 4 * (n + 1),
                  child ? "white" : "black");
    note(candidate, words);
    return Rejection::ring;
  }
  const auto agreement = [&](const std::vector<double>& cells, int turns) {
    return detect::agreement(*grid, cells, turns);
  };
  const Rejection why =
      look_up(candidate, book, detect::read_bits(*grid, kWhiteLevel), agreement, own);
  if (why != Rejection::none) return why;
  return own.reading.quality < required_quality(own.reading.match.errors) ? Rejection::quality
                                                                          : Rejection::none;
}

/// Where a shadow's edge runs across a parent.
Rejection Detector::Impl::read_shaded(Candidate& candidate, const Codebook& book,
                                      const detect::CellGreys& seen, double blur_px,
                                      Scratch& own) const {
  const auto shaded = detect::read_shaded_cells(seen, blur_px);
  if (!shaded) return Rejection::contrast;
  const auto agreement = [&](const std::vector<double>& cells, int turns) {
    return detect::agreement(detect::in_even_light(*shaded, cells, turns), cells, turns);
  };
  const Rejection why = look_up(
      candidate, book, detect::read_bits(shaded->seen.greys, shaded->threshold), agreement, own);
  if (why != Rejection::none) return why;
  // Light of any kind explains more: as much as a corrected bit.
  return own.reading.quality < required_quality(own.reading.match.errors + 1) ? Rejection::quality
                                                                              : Rejection::none;
}

/// Decodes a fitted quad against one book. On success the detection is added to what was found by
/// one of those who work.
Rejection Detector::Impl::decode(const ImageView& image, Candidate& candidate, const Codebook& book,
                                 const detect::FittedQuad& fitted, std::size_t index,
                                 Scratch& own) const {
  const int m = book.cells() + 2;
  const bool child = candidate.hole;
  // The quad found is the inner border of a child's line; its full square is larger if the line
  // has a part inside.
  const double inset = child ? markers.line.inside * m : 0.0;
  Eigen::Matrix3d unit_of_cells;
  unit_of_cells << 1.0, 0.0, -inset, 0.0, 1.0, -inset, 0.0, 0.0, m - 2.0 * inset;
  const CellPlaces places{detect::square_homography(fitted.corners) * unit_of_cells,
                          detect::shortest_side(fitted.corners) / (m - 2.0 * inset)};
  const auto seen =
      detect::sample_cells(image, lens, places.image_H_cells, book.cells(), places.cell_px);
  if (!seen) {
    note(candidate, "its cells are not all in the image");
    return Rejection::shape;
  }
  const double side = detect::mean_side(fitted.corners);
  Rejection why = read(candidate, book, *seen, kSharp, own);
  if (why != Rejection::none && !child && side >= kLeastShadedSide)
    if (read_shaded(candidate, book, *seen, kSharp, own) == Rejection::none) why = Rejection::none;
  if (why != Rejection::none && side < kSmallCell * m)
    why = read(candidate, book, *seen, kSoft, own);
  if (why != Rejection::none) return why;
  return identify(candidate, book, fitted, places, index, own);
}

/// The detection of what was read.
Rejection Detector::Impl::identify(Candidate& candidate, const Codebook& book,
                                   const detect::FittedQuad& fitted, const CellPlaces& places,
                                   std::size_t index, Scratch& own) const {
  const int m = book.cells() + 2;
  const auto& [match, quality] = own.reading;
  const int sure = std::min(options.max_bit_errors, book.safe_errors());
  const int with_relatives = std::min(options.max_bit_errors + 1, book.safe_errors());
  const PlacedMarker& marker = placed[static_cast<std::size_t>(match.placed)];
  Detection detection;
  detection.parent = markers.parents[static_cast<std::size_t>(marker.parent_index)].marker.id;
  detection.layer = marker.layer;
  detection.id = marker.id;
  detection.placed = match.placed;
  detection.bit_errors = match.errors;
  detection.quality = quality;
  detection.tentative = match.errors > with_relatives;
  const std::array<Eigen::Vector2d, 4> cell_corners{
      {{0.0, 0.0}, {double(m), 0.0}, {double(m), double(m)}, {0.0, double(m)}}};
  Matrix8d turned_and_distorted = Matrix8d::Zero();
  for (std::size_t i = 0; i < 4; ++i) {
    const std::size_t seen = (i + static_cast<std::size_t>(match.turns)) % 4;
    const Eigen::Vector2d ideal =
        (places.image_H_cells * cell_corners[seen].homogeneous()).hnormalized();
    const auto pixel = lens.from_ideal(ideal);
    if (!pixel) return Rejection::shape;
    detection.corners[i] = *pixel;
    turned_and_distorted.block<2, 2>(static_cast<Eigen::Index>(2 * i),
                                     static_cast<Eigen::Index>(2 * seen)) =
        lens.from_ideal_jacobian(ideal);
  }
  detection.corner_covariance =
      turned_and_distorted * fitted.covariance * turned_and_distorted.transpose();
  candidate.corners = detection.corners;
  const Standing standing = match.errors <= sure             ? Standing::sure
                            : match.errors <= with_relatives ? Standing::needs_relatives
                                                             : Standing::needs_memory;
  own.found.push_back({detection, standing, index});
  return Rejection::none;
}

/// Every shape becomes a candidate, in their order.
void Detector::Impl::examine_all(const ImageView& image) {
  const std::vector<Shape>& all = shapes.shapes();
  candidates.resize(all.size());
  for (Scratch& own : scratch) own.found.clear();
  workers.share(all.size(), [&](std::size_t index, std::size_t worker) {
    examine(image, all[index], index, scratch[worker]);
  });
  found.clear();
  for (const Scratch& own : scratch) found.insert(found.end(), own.found.begin(), own.found.end());
}

void Detector::Impl::examine(const ImageView& image, const Shape& shape, std::size_t index,
                             Scratch& own) {
  Candidate& candidate = candidates[index];
  candidate = {};
  candidate.corners = shape.corners;
  candidate.hole = shape.hole;
  candidate.rejection = Rejection::shape;
  note(candidate, "beyond what the lens model can image");
  Quad ideal;
  bool whole = true;
  for (std::size_t i = 0; i < 4 && whole; ++i) {
    const auto corner = lens.to_ideal(shape.corners[i]);
    whole = corner.has_value();
    if (whole) ideal[i] = *corner;
  }
  if (whole)
    for (const Codebook& book : shape.hole ? child_books : parent_books) {
      if (!shape.hole && !detect::has_bright_cells(image, shape.corners, book.cells(),
                                                   least_bright.at(book.cells()))) {
        candidate.rejection = Rejection::code;
        note(candidate, "too few cells stand out from the ring");
        continue;
      }
      const auto fitted =
          detect::fit_edges(image, lens, ideal, side_profile(shape.hole, book.cells()));
      if (!fitted) {
        candidate.rejection = Rejection::edges;
        note(candidate, shape.hole
                            ? "some side has no straight edge, bright inside and dark outside"
                            : "some side has no straight edge, dark inside and bright outside");
        continue;
      }
      if (detect::mean_side(fitted->corners) < options.min_side_px) {
        candidate.rejection = Rejection::shape;
        note(candidate, "smaller than the smallest side looked for");
        continue;
      }
      candidate.rejection = decode(image, candidate, book, *fitted, index, own);
      if (candidate.rejection == Rejection::none) break;
    }
}

/// What the fit of a marker's sides has to know.
detect::SideProfile Detector::Impl::side_profile(bool child, int cells) const {
  const double inside = child ? markers.line.inside : 0.0;
  const double hole = 1.0 - 2.0 * inside;
  detect::SideProfile profile;
  profile.bright_inside = child;
  profile.cell_share = (1.0 / (cells + 2) - inside) / hole;
  profile.line_share = child ? (inside + markers.line.outside) / hole : 0.0;
  return profile;
}

/// Corners in the image from those of the ideal camera. False where the lens can't image them.
bool Detector::Impl::set_corners(const Quad& ideal, const Matrix8d& covariance,
                                 Detection& detection) const {
  Matrix8d distorted = Matrix8d::Zero();
  std::array<Eigen::Vector2d, 4> corners;
  for (std::size_t i = 0; i < 4; ++i) {
    const auto pixel = lens.from_ideal(ideal[i]);
    if (!pixel) return false;
    corners[i] = *pixel;
    const auto at = static_cast<Eigen::Index>(2 * i);
    distorted.block<2, 2>(at, at) = lens.from_ideal_jacobian(ideal[i]);
  }
  detection.corners = corners;
  detection.corner_covariance = distorted * covariance * distorted.transpose();
  // Pictures without noise know corners perfectly, which no solver takes well.
  constexpr double kLeastError = 0.001;  // pixels
  detection.corner_covariance.diagonal().array() += kLeastError * kLeastError;
  return true;
}

/// The final corners, and how well they are known. Those that decoding was content with stay where
/// nothing better is found.
void Detector::Impl::sharpen(const ImageView& image, Detection& detection) const {
  const PlacedMarker& marker = placed[static_cast<std::size_t>(detection.placed)];
  const bool child = marker.layer > 1;
  Quad square;
  for (std::size_t i = 0; i < 4; ++i) {
    const auto corner = lens.to_ideal(detection.corners[i]);
    if (!corner) return;
    square[i] = *corner;
  }
  // The sides that show lie within the full square if the line has a part inside.
  const double inside = child ? markers.line.inside : 0.0;
  const auto sharp = detect::sharpen_edges(image, lens, detect::grown(square, -inside),
                                           side_profile(child, marker.code.cells));
  if (!sharp) return;
  square = detect::grown(sharp->corners, inside / (1.0 - 2.0 * inside));
  set_corners(square, sharp->covariance, detection);
}

/// False where the lens can't image it.
bool Detector::Impl::add_recovered(const detect::Recovered& recovered) {
  const PlacedMarker& marker = placed[static_cast<std::size_t>(recovered.placed)];
  Detection detection;
  detection.parent = marker.id;
  detection.layer = marker.layer;
  detection.id = marker.id;
  detection.placed = recovered.placed;
  detection.bit_errors = recovered.wrong_cells;
  detection.quality = recovered.quality;
  detection.visible = recovered.evidence.share();
  if (!set_corners(detect::corners_of(recovered.registration.image_H_unit),
                   recovered.registration.corner_covariance, detection))
    return false;
  Candidate candidate;
  candidate.corners = detection.corners;
  candidate.placed = recovered.placed;
  char words[96];
  std::snprintf(words, sizeof words, "partly covered: %d of %d edges seen", recovered.evidence.seen,
                recovered.evidence.predicted);
  note(candidate, words);
  found.push_back({detection, Standing::sure, candidates.size()});
  candidates.push_back(std::move(candidate));
  return true;
}

/// Looks for layer-1 markers that were not found whole.
void Detector::Impl::recover(const ImageView& image, DetectionTrace* trace) {
  squares.clear();
  for (const Candidate& candidate : candidates) {
    const bool legible = candidate.rejection == Rejection::none ||
                         candidate.rejection == Rejection::shape ||
                         candidate.rejection == Rejection::edges;
    if (!candidate.hole && !legible) squares.push_back(candidate.corners);
  }
  detect::CoveredSearch search;
  search.least_side_px = std::max(kLeastCoveredSide, options.min_side_px);
  search.least_contrast = detect::contrast_above_noise(statistics.noise);
  if (options.camera) {
    search.calibration = options.camera->matrix();
    search.calibration->topRightCorner<2, 1>() -= origin;
  }
  const auto& recovered = covered->find(image, lens, search, squares, workers, trace);
  statistics.budget_reached |= covered->budget_reached();
  // Of those that overlap, the one stands that explains most of the image.
  taken.clear();
  for (const detect::Recovered& one : recovered) {
    const Quad corners = detect::corners_of(one.registration.image_H_unit);
    const bool overlaps = std::any_of(taken.begin(), taken.end(), [&](const Quad& other) {
      return detect::contains(other, detect::centre(corners)) ||
             detect::contains(corners, detect::centre(other));
    });
    if (overlaps || one.quality < options.min_quality) continue;
    if (add_recovered(one)) taken.push_back(corners);
  }
}

void Detector::Impl::reject(const Found& what, Rejection why) {
  candidates[what.candidate].rejection = why;
}

void Detector::Impl::settle(std::vector<Detection>& detections) {
  const detect::Relations relations(placed, lens);
  // The best first, so that what comes later has to agree with it.
  std::sort(found.begin(), found.end(), [](const Found& a, const Found& b) {
    if (a.standing != b.standing) return a.standing < b.standing;
    if (a.detection.quality != b.detection.quality)
      return a.detection.quality > b.detection.quality;
    return a.candidate < b.candidate;
  });
  kept.clear();
  for (const Found& next : found) {
    const Detection& detection = next.detection;
    Rejection why = Rejection::none;
    bool supported = next.standing != Standing::needs_relatives;
    for (const Found& earlier : kept) {
      const double apart =
          (detect::centre(earlier.detection.corners) - detect::centre(detection.corners)).norm();
      if (earlier.detection.placed == detection.placed &&
          apart < 0.5 * detect::mean_side(earlier.detection.corners))
        why = Rejection::duplicate;
      else if (relations.contradict(earlier.detection, detection))
        why = Rejection::inconsistent;
      else if (relations.agree(earlier.detection, detection))
        supported = true;
      if (why != Rejection::none) break;
    }
    if (why == Rejection::none && !supported) why = Rejection::code;
    if (why == Rejection::none && next.standing == Standing::needs_memory &&
        options.tentative_bit_errors == 0)
      why = Rejection::code;
    if (why != Rejection::none)
      reject(next, why);
    else
      kept.push_back(next);
  }
  for (const Found& one : kept) detections.push_back(one.detection);
  sort_by_place(detections);
}

/// Whether the marker is seen where it was predicted; fills in the rest of the detection.
bool Detector::Impl::confirm(const ImageView& image, const detect::PredictedQuad& quad,
                             Detection& detection) {
  // Below, blur leaves nothing of the cells; and their places must be known to a part of a cell.
  constexpr double kLeastCell = 1.4;
  constexpr double kPlaceShare = 0.2;
  constexpr double kLeastAgreement = 0.8;
  const PlacedMarker& marker = placed[static_cast<std::size_t>(detection.placed)];
  const int n = marker.code.cells;
  const double cell_px = detect::shortest_side(quad.corners) / (n + 2);
  if (!detect::convex(quad.corners) || cell_px < kLeastCell) return false;
  if (quad.covariance.diagonal().maxCoeff() > std::pow(kPlaceShare * cell_px, 2)) return false;

  Eigen::Matrix3d image_H_cells = detect::square_homography(quad.corners);
  image_H_cells.leftCols<2>() /= n + 2;
  const bool child = marker.layer > 1;
  const auto seen = detect::sample_cells(image, lens, image_H_cells, n, cell_px);
  if (!seen) return false;
  for (const double blur : {kSharp, kSoft}) {
    const auto grid = detect::read_cells(*seen, blur, child, least_black.at({child, n}));
    if (!grid || grid->contrast < detect::kMinContrast) continue;
    detection.quality = std::max(
        detection.quality,
        detect::agreement(*grid, predicted[static_cast<std::size_t>(detection.placed)], 0));
  }
  if (detection.quality < std::max(kLeastAgreement, options.min_quality)) return false;
  return set_corners(quad.corners, quad.covariance, detection);
}

/// From the largest marker of every sheet, the others that weren't found by themselves.
void Detector::Impl::infer(const ImageView& image, std::vector<Detection>& detections) {
  const detect::Relations relations(placed, lens);
  by_size.resize(detections.size());
  for (std::size_t i = 0; i < by_size.size(); ++i) by_size[i] = i;
  std::sort(by_size.begin(), by_size.end(), [&](std::size_t a, std::size_t b) {
    const double area_a = detect::area(detections[a].corners);
    const double area_b = detect::area(detections[b].corners);
    return area_a != area_b ? area_a > area_b : a < b;
  });
  explained.assign(detections.size(), false);
  inferred.clear();
  for (const std::size_t base : by_size) {
    const Detection seen = detections[base];
    if (explained[base] || seen.tentative) continue;
    present.assign(placed.size(), false);
    for (const std::size_t other : by_size)
      if (other == base || relations.agree(seen, detections[other])) {
        explained[other] = true;
        present[static_cast<std::size_t>(detections[other].placed)] = true;
      }
    const PlacedMarker& from = placed[static_cast<std::size_t>(seen.placed)];
    const auto prediction = detect::Prediction::from(seen, from, lens);
    if (!prediction) continue;
    for (std::size_t i = 0; i < placed.size(); ++i) {
      if (present[i] || placed[i].parent_index != from.parent_index) continue;
      const auto quad = prediction->of(placed[i]);
      if (!quad) continue;
      Detection detection;
      detection.parent = seen.parent;
      detection.layer = placed[i].layer;
      detection.id = placed[i].id;
      detection.placed = static_cast<int>(i);
      detection.inferred = true;
      if (confirm(image, *quad, detection)) inferred.push_back(detection);
    }
  }
  detections.insert(detections.end(), inferred.begin(), inferred.end());
  sort_by_place(detections);
}

void Detector::Impl::check_size(const ImageView& image) const {
  if (image.empty()) throw std::invalid_argument("detect: the image is empty");
  if (options.camera &&
      (options.camera->width != image.width() || options.camera->height != image.height()))
    throw std::invalid_argument("detect: the image has " + std::to_string(image.width()) + " x " +
                                std::to_string(image.height()) + " pixels, the camera " +
                                std::to_string(options.camera->width) + " x " +
                                std::to_string(options.camera->height));
}

/// In a part of the image, which is an image by itself but for where its pixels are counted from.
void Detector::Impl::detect(const ImageView& image, const Region& region,
                            std::vector<Detection>& detections, DetectionTrace* trace) {
  const bool within = region.x >= 0 && region.y >= 0 && region.width > 0 && region.height > 0 &&
                      region.width <= image.width() - region.x &&
                      region.height <= image.height() - region.y;
  if (!within) throw std::invalid_argument("detect: the region is not within the image");
  const double least = options.min_side_px;
  options.min_side_px = std::max(least, region.min_side_px);
  origin = {region.x, region.y};
  lens.count_from(origin);
  const ImageView part(image.row(region.y) + region.x, region.width, region.height, image.stride());
  detect(part, detections, trace);
  for (Detection& detection : detections)
    for (Eigen::Vector2d& corner : detection.corners) corner += origin;
  options.min_side_px = least;
  origin.setZero();
  lens.count_from(origin);
}

void Detector::Impl::detect(const ImageView& image, std::vector<Detection>& detections,
                            DetectionTrace* trace) {
  detections.clear();
  explaining = trace != nullptr;
  if (trace) *trace = {};
  find_shapes(image, trace);
  examine_all(image);
  const bool whole_parent = std::any_of(found.begin(), found.end(), [](const Found& one) {
    return one.detection.layer == 1 && one.standing == Standing::sure;
  });
  searched_covered = options.covered && !whole_parent;
  if (searched_covered) recover(image, trace);
  settle(detections);
  workers.share(detections.size(), [&](std::size_t i, std::size_t) {
    if (detections[i].visible == 1.0) sharpen(image, detections[i]);
  });
  if (options.infer) infer(image, detections);
  if (trace) trace->candidates = candidates;
}

Detector::Detector(MarkerSet markers, const DetectorOptions& options)
    : impl_(std::make_unique<Impl>(std::move(markers), options)) {}
Detector::Detector(MarkerSet markers, const Camera& camera)
    : Detector(std::move(markers), [&] {
        DetectorOptions options;
        options.camera = camera;
        return options;
      }()) {}
Detector::~Detector() = default;
Detector::Detector(Detector&&) noexcept = default;
Detector& Detector::operator=(Detector&&) noexcept = default;

std::vector<Detection> Detector::detect(const ImageView& image, DetectionTrace* trace) {
  impl_->check_size(image);
  std::vector<Detection> detections;
  impl_->detect(image, detections, trace);
  return detections;
}

void Detector::detect(const ImageView& image, std::vector<Detection>& detections) {
  impl_->check_size(image);
  impl_->detect(image, detections, nullptr);
}

std::vector<Detection> Detector::detect(const ImageView& image, const Region& region,
                                        DetectionTrace* trace) {
  impl_->check_size(image);
  std::vector<Detection> detections;
  impl_->detect(image, region, detections, trace);
  return detections;
}

const DetectorStatistics& Detector::statistics() const { return impl_->statistics; }
const MarkerSet& Detector::markers() const { return impl_->markers; }
const std::vector<PlacedMarker>& Detector::placed() const { return impl_->placed; }
const DetectorOptions& Detector::options() const { return impl_->options; }

}  // namespace harco
