// Plots as SVG: lines, dots, steps and bars over linear or logarithmic axes, to be read at a
// glance.
#pragma once

#include <optional>
#include <string>
#include <vector>

namespace harco::lab {

/// One colour for one thing, in all plots.
namespace palette {
inline constexpr const char* kHarco = "#1f63b4";      ///< ours
inline constexpr const char* kPaper = "#35a3a0";      ///< the paper's fusion, on our detections
inline constexpr const char* kBaseline = "#d1582b";   ///< ArUco, averaged board
inline constexpr const char* kBaseline2 = "#e2a13b";  ///< ArUco, jointly solved board
inline constexpr const char* kTruth = "#666666";      ///< truth, commands, limits
}  // namespace palette

enum class Mark {
  line,
  dashed,
  dots,
  steps,  ///< a value from its x to the next one's
  bars    ///< from zero up, as wide as the points are apart
};

/// A value that is not finite leaves a gap.
struct Series {
  std::string name;  ///< in the legend; none without
  std::string colour;
  Mark mark = Mark::line;
  std::vector<double> x, y;  ///< of the same length
};

/// A stretch of the x axis that is shaded, such as the transition area.
struct Band {
  double from = 0.0, to = 0.0;
  std::string label;
  std::string colour = "#e8eef6";
};

/// A thin line across the plot, at an x or at a y.
struct Rule {
  double at = 0.0;
  std::string label;
  std::string colour = palette::kTruth;
  bool vertical = true;
};

/// From … to on an axis.
struct AxisRange {
  double low = 0.0, high = 1.0;
};

struct Plot {
  std::string title;
  std::string x_label, y_label;
  bool log_x = false, log_y = false;
  std::optional<AxisRange> x_range, y_range;  ///< what the series need, if not given
  std::vector<Series> series;
  std::vector<Band> bands;
  std::vector<Rule> rules;
  int width = 640, height = 300;
};

/// An <svg> element without scripts, styles or fonts of its own. Throws std::invalid_argument for
/// series whose x and y differ in length, and for logarithmic ranges that aren't positive.
std::string draw(const Plot& plot);

/// Several plots below one another or side by side, as one <svg> element.
std::string draw_grid(const std::vector<Plot>& plots, int columns);

}  // namespace harco::lab
