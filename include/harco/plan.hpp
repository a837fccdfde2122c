// Choosing the layers (paper, section 3.2, Eq. 2-8): how many layers a task needs, how large they
// are, over which distances each of them serves, and how white the cells stay that carry the
// others.
//
// The equations come first, corrected where the paper slips (docs: errata 1-5), then the planner
// that puts them together. What the paper prints stands in namespace `printed`, to compare with.
//
// Symbols: theta is the side of a marker in one layer over the side in the layer above, 1/(n+2)
// for all layers of a marker with n x n inner cells. alpha is the greatest share of a child's
// area that its black cells cover, beta the greatest share of a marker's area whose cells carry
// children, gamma the width of a child's line inside its square as a share of its side. All
// functions throw std::invalid_argument for values outside the range that they name.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "harco/layout.hpp"
#include "harco/marker.hpp"
#include "harco/view_range.hpp"

namespace harco {

// --- Distances and the number of layers -----------------------------------------------------

/// Eq. 2, s = f D / h: side in the image, px, of a marker of side D seen frontally from distance h
/// (both metres) with focal length f (px). All positive.
double side_in_image(double focal_px, double side_m, double distance_m);

/// Eq. 3 with erratum 1: the distance from which a marker of layer i looks as large as one of layer
/// j <= i does from `distance_j`: h_i = h_j * product of theta_k, k = j+1 … i. `theta[k - 1]`
/// is theta_k, in (0, 1); theta_1 relates the parent to nothing and is never used.
double distance_in_layer(double distance_j, const std::vector<double>& theta, int j, int i);

/// Eq. 4 with erratum 2: the number of layers that cover all distances from h_min to h_max,
/// L = 1 + ceil(log_{1/theta}((h_max / h_min) / (s_max / s_min))), at least 1, where a marker is
/// detected from s_min to s_max pixels of side. 0 < h_min < h_max, theta in (0, 1),
/// 0 < s_min < s_max. Between the layers there is no gap as long as s_max / s_min >= 1 / theta.
int layers_needed(double h_min, double h_max, double theta, double s_min, double s_max);

// --- White cells ----------------------------------------------------------------------------

/// Eq. 5 with erratum 3: white share of a cell whose child carries no children itself,
/// (1 - 2 gamma)^2 - alpha, not below 0. Black cells don't shrink with the line, so the paper's
/// product is no lower bound. alpha in (0, 1), gamma in [0, 0.25].
double child_white_share(double alpha, double gamma);

/// Eq. 6 and 7 with erratum 4: white share of a cell that carries a child with `child_layers` - 1
/// layers of children in it: w_1 = (1 - 2 gamma)^2 - alpha, w_{k+1} = w_1 - beta (1 - w_k), here
/// with gamma = line.inside. Ink outside a child falls into its neighbour cells; a marker in
/// which all of it falls on white has w_{k+1} = w_1 - beta (1 - w_k + (1 + 2 line.outside)^2 - 1).
/// That is exact for a line inside and a least value for one outside, provided that children share
/// no edge. child_layers >= 1; alpha, beta in (0, 1); widths in [0, 0.25].
double carried_white_share(int child_layers, double alpha, double beta, const LineWidth& line);

/// What carried_white_share tends to with ever more layers (erratum 4), not below 0:
/// (w_1 - beta) / (1 - beta) for a line inside.
double carried_white_limit(double alpha, double beta, const LineWidth& line);

/// Eq. 8 with errata 4 and 5: the greatest number of child layers with which a cell keeps more than
/// `least_white` in (0, 1); 0 if not even one does, empty if there is no limit.
std::optional<int> most_child_layers(double alpha, double beta, const LineWidth& line,
                                     double least_white);

/// The equations as the paper prints them.
namespace printed {

/// Eq. 3: the product runs from k = j and so takes one theta too many (erratum 1).
double distance_in_layer(double distance_j, const std::vector<double>& theta, int j, int i);

/// Eq. 4: L = ceil(log_theta(h_min / h_max)). One layer's own range is left out (erratum 2).
int layers_needed(double h_min, double h_max, double theta);

/// Eq. 5: b = (1 - alpha) (1 - 2 gamma)^2 (erratum 3).
double child_white_share(double alpha, double gamma);

/// Eq. 6, one step: a_L = (1 - beta (1 - b_L)) a_{L-1} (erratum 4).
double carried_white_step(double a_before, double beta, double b);

/// Eq. 7: a_L = (1 - beta + beta b)^(L-1) b, with b of Eq. 5. L counts layers of children, since
/// a_1 = b_1 is the share in a child.
double carried_white_share(int child_layers, double alpha, double beta, double gamma);

/// Eq. 8 with its two numbers given: 1 + floor(log_base(least_white / first)). All in (0, 1);
/// 0 if first <= least_white.
int most_child_layers(double base, double first, double least_white);

/// Eq. 8. The paper's example, alpha = 6/49, beta = 5/49, gamma = 1/32 with 0.7 left, gives 5 and
/// not 8 (erratum 5).
int most_child_layers(double alpha, double beta, double gamma, double least_white);

}  // namespace printed

// --- The planner ----------------------------------------------------------------------------

/// White shares below the first call for a warning, below the second the layer above is at risk.
inline constexpr double kWhiteShareLow = 0.7;
inline constexpr double kWhiteShareSerious = 0.6;

/// What a marker is wanted for. The camera is a pinhole that looks straight at the marker; for a
/// wide lens, whose picture covers more, a plan is on the safe side.
struct PlanRequest {
  double nearest_m = 0.0;   ///< least distance, > 0
  double farthest_m = 0.0;  ///< greatest distance, > nearest_m

  int width_px = 0;       ///< of the image
  int height_px = 0;      ///< of the image
  double focal_px = 0.0;  ///< focal length, px

  /// The camera aims at points up to this share of the side beside the marker's centre, along both
  /// axes, 0 … 0.5. Nearby it then sees less of the layers above, or nothing but a few cells.
  double aim = 0.35;

  std::optional<double> side_m;  ///< side of the parent; if absent, the least that is needed

  /// What is absent of these three is chosen such that the least number of markers serves all
  /// distances and aims.
  std::optional<LayoutKind> layout;
  std::optional<int> layers;  ///< 1 … 8
  std::optional<int> cells;   ///< n, 4 … 8; if absent 5, or 6 for a carpet that has to be finer

  LineWidth line;  ///< around children; unless changed, default_line of their n

  double alpha = 6.0 / 49.0;  ///< greatest black share of a child, in (0, 1)

  /// Least side at which a marker is detected, px. Parents were found from 12 px, from 14 px at
  /// 45 degrees, children from 14 and 20 px (line outside); noise and steeper views ask for more.
  double parent_px = 14.0;
  double child_px = 16.0;

  /// Share of the image's smaller dimension that a marker with its line may fill, in (0, 1].
  double usable_share = 0.9;

  double printer_dot_mm = 25.4 / 600.0;  ///< of the printer, > 0
};

/// One layer of a plan. Of a carpet, the sizes between its layers are left out.
struct PlanLayer {
  int layer = 1;
  int cells = 5;            ///< n of its markers
  double side_m = 0.0;      ///< of its markers
  double nearest_m = 0.0;   ///< the marker, its line included, just fits into the image
  double farthest_m = 0.0;  ///< it has the least side that is detected
  double nearest_side_px = 0.0;
  double farthest_side_px = 0.0;
  double farthest_cell_px = 0.0;  ///< side of its cells at its farthest distance

  /// How far the next layer reaches beyond the point where this one no longer fits into the image:
  /// farthest distance of the next over nearest of this one. Below 1 there is a gap. Absent in the
  /// last layer.
  std::optional<double> overlap;

  /// Least white share of its cells that carry children (carried_white_share); absent in the last.
  std::optional<double> white_share;

  /// Width of the line around one of its markers; absent in layer 1.
  std::optional<double> line_mm;
};

enum class PlanConcern {
  gap,               ///< distances at which no layer serves
  small_overlap,     ///< two layers meet, but hardly
  too_far,           ///< the parent is too small for the farthest distance
  too_near,          ///< even the last layer doesn't fit into the image at the nearest distance
  thin_line,         ///< lines that a printer may lose
  dark_cells,        ///< white cells that carry children have too much ink in them
  larger_than_page,  ///< the sheet exceeds A4
  focus,             ///< near and far can hardly both be sharp
  off_axis           ///< beside the centre the camera sees no whole marker nearby
};

enum class PlanSeverity { note, warning, serious };

/// Something that a user should know, in plain words.
struct PlanWarning {
  PlanConcern concern;
  PlanSeverity severity;
  std::string text;  ///< one line, without a full stop at its end
};

struct Plan {
  double side_m = 0.0;         ///< of the parent
  double needed_side_m = 0.0;  ///< the least that serves from the farthest distance
  LayoutKind layout = LayoutKind::quincunx;
  int cells = 5;       ///< n
  int markers = 1;     ///< number of markers on the sheet, each with a code of its own
  int most_black = 0;  ///< black cells that a child of n x n may have: alpha (n+2)^2

  /// Where some marker is wholly in view, however the camera is turned about its axis: if it aims
  /// at the centre, and at any point within PlanRequest::aim (range_in_view).
  DistanceRange centred;
  DistanceRange beside;

  std::vector<PlanLayer> layers;      ///< from the parent down
  std::vector<PlanWarning> warnings;  ///< the gravest first
};

/// Plans a marker. If the side is to be found, it is the needed one rounded up to three digits.
/// Where no layout serves all distances, it takes the one that comes nearest, and warns.
/// Throws std::invalid_argument, naming the field, if a value is outside its range or not finite.
Plan plan(const PlanRequest& request);

/// For messages about a concern: gap, small-overlap, too-far, …
std::string to_string(PlanConcern concern);
std::string to_string(PlanSeverity severity);

}  // namespace harco
