// From a task to layers: the equations of section 3.2 put to use.
#include "harco/plan.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

namespace harco {
namespace {

constexpr double kRounding = 1e-9;
// n, unless a request says otherwise, and of a carpet that has to be finer.
constexpr int kUsualCells = 5;
constexpr int kFinerCells = 6;
// Every marker needs a code of its own.
constexpr int kMostMarkers = 20000;
// More are not recommended: their codes come too near to one another.
constexpr int kManyMarkers = 1000;
// In a child of a carpet, nine of its 9 x 9 cells hold children.
constexpr double kCarpetBeta = 9.0 / 81.0;
// Neighbouring layers that overlap less lose one another by a little tilt or blur.
constexpr double kComfortableOverlap = 1.25;
// A line needs as many dots of the printer, and paper and ink as many millimetres.
constexpr double kLeastLineDots = 4.0;
constexpr double kLeastLine_mm = 0.2;
// Upright A4 without the 10 mm that printers leave blank on both sides.
constexpr double kPageWidth_m = 0.190;
// Lenses of small cameras open some millimetres wide; a greater bound tells their users nothing.
constexpr double kNotableAperture_m = 0.010;

/// Three significant digits without an exponent: 0.0605, 12.3, 1440.
std::string digits(double value) {
  const int magnitude = value > 0.0 ? static_cast<int>(std::floor(std::log10(value))) : 0;
  const int decimals = std::clamp(2 - magnitude, 0, 12);
  char text[400];
  const auto end =
      std::to_chars(text, text + sizeof text, value, std::chars_format::fixed, decimals);
  return {text, end.ptr};
}

std::string metres(double value) { return digits(value) + " m"; }
std::string percent(double share) { return std::to_string(std::lround(100.0 * share)) + " %"; }

/// The least number of three significant digits that is not below `value`.
double rounded_up_to_digits(double value) {
  const double scale = std::pow(10.0, 2.0 - std::floor(std::log10(value)));
  return std::ceil(value * scale - kRounding) / scale;
}

void require_positive(double value, const std::string& name) {
  if (!(value > 0.0) || !std::isfinite(value))
    throw std::invalid_argument(name + " must be positive and finite");
}

void require_share(double value, const std::string& name) {
  if (!(value > 0.0 && value < 1.0))
    throw std::invalid_argument(name + " must lie between 0 and 1");
}

void require_whole(int value, int least, int most, const std::string& name) {
  if (value < least || value > most)
    throw std::invalid_argument(name + " must be " + std::to_string(least) + " … " +
                                std::to_string(most) + ", not " + std::to_string(value));
}

/// The part of the image's smaller dimension that a marker may fill, px.
double usable_px(const PlanRequest& request) {
  return request.usable_share * std::min(request.width_px, request.height_px);
}

/// A marker with the line around it, as a multiple of its side.
double extent(const PlanRequest& request, int layer) {
  return layer == 1 ? 1.0 : 1.0 + 2.0 * request.line.outside;
}

double least_px(const PlanRequest& request, int layer) {
  return layer == 1 ? request.parent_px : request.child_px;
}

void check_image(const PlanRequest& request) {
  require_whole(request.width_px, 1, 1'000'000, "image width");
  require_whole(request.height_px, 1, 1'000'000, "image height");
  require_positive(request.focal_px, "focal length");
  require_positive(request.parent_px, "least side of a parent");
  require_positive(request.child_px, "least side of a child");
  if (!(request.usable_share > 0.0 && request.usable_share <= 1.0))
    throw std::invalid_argument("usable share of the image must be above 0 and at most 1");
  for (const int layer : {1, 2})
    if (usable_px(request) <= least_px(request, layer) * extent(request, layer))
      throw std::invalid_argument("image: too small even for the smallest marker of " +
                                  digits(least_px(request, layer)) + " px that is detected");
}

void check(const PlanRequest& request) {
  require_positive(request.nearest_m, "nearest distance");
  require_positive(request.farthest_m, "farthest distance");
  if (request.nearest_m >= request.farthest_m)
    throw std::invalid_argument("nearest distance must be less than the farthest");
  if (request.side_m) require_positive(*request.side_m, "side");
  if (request.layers) require_whole(*request.layers, 1, kMostLayers, "layers");
  if (request.cells) require_whole(*request.cells, 4, 8, "cells");
  for (const double width : {request.line.inside, request.line.outside})
    if (!(width >= 0.0 && width <= 0.25))
      throw std::invalid_argument("line width: inside and outside must be 0 … 0.25 of the side");
  if (request.line.inside + request.line.outside <= 0.0)
    throw std::invalid_argument("line width: children need a line, inside or outside");
  require_share(request.alpha, "alpha");
  if (!(request.aim >= 0.0 && request.aim <= 0.5))
    throw std::invalid_argument("aim must be 0 … 0.5 of the side");
  require_positive(request.printer_dot_mm, "printer dot");
  check_image(request);
}

/// What a plan may choose.
struct Choice {
  LayoutKind layout;
  int cells;
  int layers;
};

/// n of the markers of one layer, and how many times they go into a cell of the layer above.
int cells_in_layer(const Choice& choice, int layer) {
  return choice.layout == LayoutKind::carpet && layer == 2 ? kCarpetCells : choice.cells;
}

/// Share of a marker's cells that carry children, below layer 1.
double beta_of(const Choice& choice) {
  const double area = (choice.cells + 2) * (choice.cells + 2);
  switch (choice.layout) {
    case LayoutKind::quincunx:
      return static_cast<double>(quincunx(choice.cells).size()) / area;
    case LayoutKind::checkerboard:
      return static_cast<double>(checkerboard(choice.cells).size()) / area;
    case LayoutKind::carpet:
      return kCarpetBeta;
  }
  throw std::invalid_argument("no such layout");
}

/// All but what depends on the number of layers.
PlanLayer plan_layer(const PlanRequest& request, const Choice& choice, double parent_side_m,
                     int layer) {
  PlanLayer planned;
  planned.layer = layer;
  planned.cells = cells_in_layer(choice, layer);
  planned.side_m = parent_side_m;
  for (int above = 1; above < layer; ++above) planned.side_m /= cells_in_layer(choice, above) + 2;
  planned.nearest_side_px = usable_px(request) / extent(request, layer);
  planned.farthest_side_px = least_px(request, layer);
  // Eq. 2, solved for the distance.
  planned.nearest_m = request.focal_px * planned.side_m / planned.nearest_side_px;
  planned.farthest_m = request.focal_px * planned.side_m / planned.farthest_side_px;
  planned.farthest_cell_px = planned.farthest_side_px / (planned.cells + 2);
  if (layer > 1)
    planned.line_mm = 1e3 * planned.side_m * (request.line.inside + request.line.outside);
  return planned;
}

std::vector<PlanLayer> plan_layers(const PlanRequest& request, const Choice& choice,
                                   double parent_side_m) {
  std::vector<PlanLayer> layers;
  for (int layer = 1; layer <= choice.layers; ++layer)
    layers.push_back(plan_layer(request, choice, parent_side_m, layer));
  for (std::size_t i = 0; i + 1 < layers.size(); ++i) {
    const int child_layers = static_cast<int>(layers.size() - i) - 1;
    layers[i].overlap = layers[i + 1].farthest_m / layers[i].nearest_m;
    layers[i].white_share =
        carried_white_share(child_layers, request.alpha, beta_of(choice), request.line);
  }
  return layers;
}

// --- Which layout ----------------------------------------------------------------------------

/// Number of markers on a sheet.
double count(const Choice& choice) {
  const double children = beta_of(choice) * (choice.cells + 2) * (choice.cells + 2);
  if (choice.layout == LayoutKind::carpet)
    return static_cast<double>(place(without_codes(carpet(choice.cells), 1, 1.0)).size());
  double sum = 0.0;
  double in_layer = 1.0;
  for (int layer = 1; layer <= choice.layers; ++layer) {
    sum += in_layer;
    in_layer *= std::round(children);
  }
  return sum;
}

/// The least number of layers that come near enough if the camera looks at the centre.
int layers_for_centre(const PlanRequest& request, Choice choice, double side_m) {
  for (choice.layers = 1; choice.layers < kMostLayers; ++choice.layers) {
    if (plan_layer(request, choice, side_m, choice.layers).nearest_m <=
        request.nearest_m * (1.0 + kRounding))
      break;
    if (count({choice.layout, choice.cells, choice.layers + 1}) > kMostMarkers) break;
  }
  return choice.layers;
}

/// What of one layout may serve, fewer layers first.
void add_choices(const PlanRequest& request, LayoutKind layout, double side_m,
                 std::vector<Choice>& all) {
  const int cells = request.cells.value_or(kUsualCells);
  if (layout == LayoutKind::carpet) {
    if (request.layers.value_or(kCarpetLayers) != kCarpetLayers) return;
    all.push_back({layout, cells, kCarpetLayers});
    if (!request.cells) all.push_back({layout, kFinerCells, kCarpetLayers});
    return;
  }
  if (request.layers) {
    all.push_back({layout, cells, *request.layers});
    return;
  }
  const int for_centre = layers_for_centre(request, {layout, cells, 1}, side_m);
  if (request.aim == 0.0) {
    all.push_back({layout, cells, for_centre});
    return;
  }
  // What lies beside the centre may need a layer more; yet another one helps no further.
  for (int layers = 1; layers <= std::min(for_centre + 1, kMostLayers); ++layers)
    if (layers == 1 || count({layout, cells, layers}) <= kManyMarkers)
      all.push_back({layout, cells, layers});
}

/// All that the request leaves open, by number of markers.
std::vector<Choice> choices(const PlanRequest& request, double side_m) {
  std::vector<Choice> all;
  for (const LayoutKind layout :
       {LayoutKind::quincunx, LayoutKind::checkerboard, LayoutKind::carpet})
    if (request.layout ? layout == *request.layout
                       : request.aim > 0.0 || layout == LayoutKind::quincunx)
      add_choices(request, layout, side_m, all);
  if (all.empty())
    throw std::invalid_argument("layers: a carpet has " + std::to_string(kCarpetLayers));
  std::stable_sort(all.begin(), all.end(),
                   [](const Choice& a, const Choice& b) { return count(a) < count(b); });
  if (count(all.front()) > kMostMarkers)
    throw std::invalid_argument("layers: more than " + std::to_string(kMostMarkers) +
                                " markers a sheet");
  return all;
}

MarkerSet layout_of(const PlanRequest& request, const Plan& plan) {
  const Marker layout = make_layout(plan.layout, plan.cells, static_cast<int>(plan.layers.size()));
  return without_codes(layout, 1, plan.side_m, request.line);
}

DistanceRange in_view(const PlanRequest& request, const Plan& plan, double aim) {
  ViewOptions view;
  view.width_px = request.width_px;
  view.height_px = request.height_px;
  view.focal_px = request.focal_px;
  view.parent_px = request.parent_px;
  view.child_px = request.child_px;
  view.usable_share = request.usable_share;
  view.aim = aim;
  const Marker layout = make_layout(plan.layout, plan.cells, static_cast<int>(plan.layers.size()));
  return range_in_view(without_codes(layout, 1, plan.side_m, request.line), view);
}

/// The plan of one choice, without warnings.
Plan plan_of(const PlanRequest& request, const Choice& choice, double side_m) {
  Plan plan;
  plan.side_m = side_m;
  plan.layout = choice.layout;
  plan.cells = choice.cells;
  plan.markers = static_cast<int>(count(choice));
  plan.most_black = static_cast<int>(
      std::floor(request.alpha * (choice.cells + 2) * (choice.cells + 2) + kRounding));
  if (plan.most_black < 1) throw std::invalid_argument("alpha leaves a child no black cell");
  plan.layers = plan_layers(request, choice, side_m);
  plan.beside = in_view(request, plan, request.aim);
  return plan;
}

bool serves_nearest(const PlanRequest& request, const Plan& plan) {
  return plan.beside.nearest_m <= request.nearest_m * (1.0 + kRounding);
}

/// The request with the line that generate takes if none is asked for.
PlanRequest with_line(PlanRequest request, int cells) {
  const LineWidth standard;
  if (request.line.inside == standard.inside && request.line.outside == standard.outside)
    request.line = default_line(cells);
  return request;
}

/// The first choice that serves, or the one that comes nearest.
Plan best_plan(const PlanRequest& request, double side_m) {
  std::optional<Plan> best;
  for (const Choice& choice : choices(request, side_m)) {
    Plan next = plan_of(with_line(request, choice.cells), choice, side_m);
    const double notable = 0.99;
    if (!best || next.beside.nearest_m < notable * best->beside.nearest_m) best = std::move(next);
    if (serves_nearest(request, *best)) break;
  }
  return *best;
}

// --- What a user should know, concern by concern ---------------------------------------------

using Warnings = std::vector<PlanWarning>;

void warn_of_ends(const PlanRequest& request, const Plan& plan, Warnings& warnings) {
  const PlanLayer& first = plan.layers.front();
  const PlanLayer& last = plan.layers.back();
  if (first.farthest_m < request.farthest_m * (1.0 - kRounding))
    warnings.push_back({PlanConcern::too_far, PlanSeverity::serious,
                        "the parent is detected only up to " + metres(first.farthest_m) + "; " +
                            metres(request.farthest_m) + " need a side of " +
                            metres(plan.needed_side_m)});
  if (last.nearest_m > request.nearest_m * (1.0 + kRounding))
    warnings.push_back({PlanConcern::too_near, PlanSeverity::serious,
                        "layer " + std::to_string(last.layer) +
                            ", the last, fits into the image only from " + metres(last.nearest_m) +
                            " on, not at " + metres(request.nearest_m)});
}

void warn_of_gaps(const PlanRequest& request, const Plan& plan, Warnings& warnings) {
  for (std::size_t i = 0; i + 1 < plan.layers.size(); ++i) {
    const PlanLayer& upper = plan.layers[i];
    const PlanLayer& lower = plan.layers[i + 1];
    const double overlap = *upper.overlap;
    const auto [low, high] = std::minmax(upper.nearest_m, lower.farthest_m);
    const bool wanted = low < request.farthest_m && high > request.nearest_m;
    if (overlap >= kComfortableOverlap || !wanted) continue;
    const std::string pair =
        "layers " + std::to_string(upper.layer) + " and " + std::to_string(lower.layer);
    if (overlap < 1.0 - kRounding)
      warnings.push_back({PlanConcern::gap, PlanSeverity::serious,
                          "gap between " + pair + ": none serves from " + metres(low) + " to " +
                              metres(high) + "; take fewer cells or a finer image"});
    else
      warnings.push_back({PlanConcern::small_overlap, PlanSeverity::warning,
                          pair + " overlap only by a factor of " + digits(overlap) +
                              "; tilt and blur may open a gap at " + metres(low)});
  }
}

/// Side of the smallest marker of the layout; the parent's if it is alone.
double smallest_side_m(const PlanRequest& request, const Plan& plan) {
  double least = plan.side_m;
  for (const PlacedMarker& marker : place(layout_of(request, plan)))
    least = std::min(least, marker.side_m);
  return least;
}

void warn_of_lines(const PlanRequest& request, const Plan& plan, Warnings& warnings) {
  if (plan.layers.size() < 2) return;
  const double line_mm =
      1e3 * smallest_side_m(request, plan) * (request.line.inside + request.line.outside);
  const double least = std::max(kLeastLineDots * request.printer_dot_mm, kLeastLine_mm);
  if (line_mm >= least) return;
  const bool lost = line_mm < request.printer_dot_mm;
  warnings.push_back({PlanConcern::thin_line, lost ? PlanSeverity::serious : PlanSeverity::warning,
                      "lines of the smallest markers are " + digits(line_mm) + " mm wide, " +
                          (lost ? "less than a dot of the printer" : "too thin to print well") +
                          "; " + digits(least) + " mm need a side of " +
                          metres(plan.side_m * least / line_mm)});
}

void warn_of_dark_cells(const PlanRequest&, const Plan& plan, Warnings& warnings) {
  const PlanLayer& parent = plan.layers.front();
  if (!parent.white_share || *parent.white_share >= kWhiteShareLow) return;
  const bool serious = *parent.white_share < kWhiteShareSerious;
  warnings.push_back(
      {PlanConcern::dark_cells, serious ? PlanSeverity::serious : PlanSeverity::warning,
       "white cells of the parent that carry children may be only " + percent(*parent.white_share) +
           " white; take fewer black cells (alpha), fewer children (beta), "
           "a thinner line inside or fewer layers"});
}

void warn_of_page(const PlanRequest&, const Plan& plan, Warnings& warnings) {
  const double sheet_m = plan.side_m * (plan.cells + 4) / (plan.cells + 2);
  if (sheet_m <= kPageWidth_m) return;
  warnings.push_back({PlanConcern::larger_than_page, PlanSeverity::note,
                      "with its white surround the marker is " + metres(sheet_m) +
                          " wide and has to be tiled over several A4 pages or printed on a "
                          "large-format printer"});
}

/// A lens focused at the farthest distance h_max blurs a point at h by f A (1/h - 1/h_max) px, A
/// being the width of its opening. Half a cell of the last layer is f D / (2 (n+2) h) px.
void warn_of_focus(const PlanRequest& request, const Plan& plan, Warnings& warnings) {
  const double half_cell_m = plan.layers.back().side_m / (plan.layers.back().cells + 2) / 2.0;
  const double aperture_m = half_cell_m / (1.0 - request.nearest_m / request.farthest_m);
  if (aperture_m > kNotableAperture_m) return;
  warnings.push_back({PlanConcern::focus, PlanSeverity::note,
                      "with the focus at " + metres(request.farthest_m) + ", layer " +
                          std::to_string(plan.layers.back().layer) + " is sharp enough at " +
                          metres(request.nearest_m) + " if the lens opens at most " +
                          digits(1e3 * aperture_m) + " mm wide"});
}

void warn_of_aim(const PlanRequest& request, const Plan& plan, Warnings& warnings) {
  if (request.aim == 0.0 && plan.layers.size() > 1)
    warnings.push_back({PlanConcern::off_axis, PlanSeverity::note,
                        "the ranges hold for a camera that aims at the marker's centre; beside it, "
                        "denser layouts help more than more layers"});
  if (request.aim > 0.0 && !serves_nearest(request, plan))
    warnings.push_back({PlanConcern::off_axis, PlanSeverity::warning,
                        "nearer than " + metres(plan.beside.nearest_m) +
                            ", a camera that aims up to " + percent(request.aim) +
                            " of the side beside the centre sees no whole marker in some views"});
}

Warnings warnings_of(const PlanRequest& request, const Plan& plan) {
  Warnings warnings;
  for (const auto concern : {warn_of_ends, warn_of_gaps, warn_of_dark_cells, warn_of_lines,
                             warn_of_page, warn_of_focus, warn_of_aim})
    concern(request, plan, warnings);
  std::stable_sort(
      warnings.begin(), warnings.end(),
      [](const PlanWarning& a, const PlanWarning& b) { return a.severity > b.severity; });
  return warnings;
}

}  // namespace

Plan plan(const PlanRequest& request) {
  check(request);
  const double needed_side_m =
      rounded_up_to_digits(request.farthest_m / request.focal_px * request.parent_px);
  const double side_m = request.side_m.value_or(needed_side_m);
  if (!std::isfinite(side_m) || !(side_m > 0.0))
    throw std::invalid_argument("farthest distance: no marker is large enough");
  Plan plan = best_plan(request, side_m);
  plan.needed_side_m = needed_side_m;
  const PlanRequest drawn = with_line(request, plan.cells);
  plan.centred = in_view(drawn, plan, 0.0);
  plan.warnings = warnings_of(drawn, plan);
  return plan;
}

std::string to_string(PlanConcern concern) {
  switch (concern) {
    case PlanConcern::gap:
      return "gap";
    case PlanConcern::small_overlap:
      return "small-overlap";
    case PlanConcern::too_far:
      return "too-far";
    case PlanConcern::too_near:
      return "too-near";
    case PlanConcern::thin_line:
      return "thin-line";
    case PlanConcern::dark_cells:
      return "dark-cells";
    case PlanConcern::larger_than_page:
      return "larger-than-page";
    case PlanConcern::focus:
      return "focus";
    case PlanConcern::off_axis:
      return "off-axis";
  }
  throw std::invalid_argument("no such concern");
}

std::string to_string(PlanSeverity severity) {
  switch (severity) {
    case PlanSeverity::note:
      return "note";
    case PlanSeverity::warning:
      return "warning";
    case PlanSeverity::serious:
      return "serious";
  }
  throw std::invalid_argument("no such severity");
}

}  // namespace harco
