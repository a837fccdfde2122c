#include "plan_report.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "harco/dictionary.hpp"

namespace harco::cli {
namespace {

using Json = nlohmann::ordered_json;

/// What generate takes unless it is told otherwise.
constexpr int kGenerateCells = 5;

/// What the user runs next: only what differs from generate's own defaults is said.
std::string generate_command(const PlanRequest& request, const Plan& plan) {
  std::string command = fmt::format("harco generate --layers {} --parents 1 --side {} --out marker",
                                    plan.layers.size(), plan.side_m);
  if (plan.cells != kGenerateCells) command += fmt::format(" --cells {}", plan.cells);
  if (plan.layers.size() == 1) return command;
  const LineWidth standard;
  if (request.line.inside != standard.inside)
    command += fmt::format(" --line-inside {}", request.line.inside);
  if (request.line.outside != standard.outside)
    command += fmt::format(" --line-outside {}", request.line.outside);
  if (plan.most_black != default_child_black(plan.cells).most)
    command += fmt::format(" --max-black {}", plan.most_black);
  if (plan.layout != LayoutKind::quincunx)
    command += fmt::format(" --children {}", to_string(plan.layout));
  return command;
}

std::string row(const PlanLayer& layer) {
  const auto text = [](const std::optional<double>& value, double scale, int digits,
                       const char* unit) {
    return value ? significant(scale * *value, digits) + unit : std::string("-");
  };
  return fmt::format("{:>5}  {:>10}  {:>9} to {:>8}  {:>9}  {:>8}  {:>6}  {:>9}\n", layer.layer,
                     significant(layer.side_m, 4) + " m", significant(layer.nearest_m, 3) + " m",
                     significant(layer.farthest_m, 3) + " m", text(layer.overlap, 1.0, 3, " x"),
                     significant(layer.farthest_cell_px, 3) + " px",
                     text(layer.white_share, 100.0, 2, " %"), text(layer.line_mm, 1.0, 3, " mm"));
}

std::string range_text(const DistanceRange& range) {
  return fmt::format("{} m to {} m", significant(range.nearest_m, 3),
                     significant(range.farthest_m, 3));
}

/// From where to where some marker is wholly in view.
std::string view_lines(const PlanRequest& request, const Plan& plan) {
  std::string lines = fmt::format(
      "\nA whole marker is in view, however the camera is turned about its axis,\n"
      "  aimed at the centre:            {}\n",
      range_text(plan.centred));
  if (request.aim > 0.0)
    lines += fmt::format("  up to {:>4} of the side beside:  {}\n",
                         significant(100.0 * request.aim, 2) + "%", range_text(plan.beside));
  return lines;
}

Json range_json(const DistanceRange& range) {
  return {{"nearest_m", range.nearest_m}, {"farthest_m", range.farthest_m}};
}

Json number_or_null(const std::optional<double>& value) {
  return value ? Json(*value) : Json(nullptr);
}

}  // namespace

std::string significant(double value, int digits) {
  const int magnitude = value > 0.0 ? static_cast<int>(std::floor(std::log10(value))) : 0;
  return fmt::format("{:.{}f}", value, std::clamp(digits - 1 - magnitude, 0, 12));
}

std::string plan_table(const PlanRequest& request, const Plan& plan) {
  std::string table = fmt::format(
      "{} of {} x {} cells, side {} m, for {} m to {} m\n",
      plan.layers.size() == 1 ? "1 layer" : fmt::format("{} layers", plan.layers.size()),
      plan.cells, plan.cells, plan.side_m, significant(request.nearest_m, 3),
      significant(request.farthest_m, 3));
  if (plan.layers.size() > 1)
    table += fmt::format("Layout: {}, {} markers\n", to_string(plan.layout), plan.markers);
  table += fmt::format("\n{:>5}  {:>10}  {:>21}  {:>9}  {:>8}  {:>6}  {:>9}\n", "layer", "side",
                       "serves from ... to", "overlap", "cell at", "white", "line");
  table += fmt::format("{:>5}  {:>10}  {:>21}  {:>9}  {:>8}  {:>6}  {:>9}\n", "", "", "",
                       "with next", "farthest", "share", "width");
  for (const PlanLayer& layer : plan.layers) table += row(layer);
  table += view_lines(request, plan);
  if (!plan.warnings.empty()) table += "\n";
  for (const PlanWarning& warning : plan.warnings)
    table += fmt::format("{}: {}\n", to_string(warning.severity), warning.text);
  return table + "\nNext:\n  " + generate_command(request, plan) + "\n";
}

std::string plan_json(const PlanRequest& request, const Plan& plan) {
  Json json;
  json["nearest_m"] = request.nearest_m;
  json["farthest_m"] = request.farthest_m;
  json["side_m"] = plan.side_m;
  json["needed_side_m"] = plan.needed_side_m;
  json["layout"] = to_string(plan.layout);
  json["cells"] = plan.cells;
  json["markers"] = plan.markers;
  json["line"] = {{"inside", request.line.inside}, {"outside", request.line.outside}};
  json["most_black_cells"] = plan.most_black;
  json["aim"] = request.aim;
  json["centred"] = range_json(plan.centred);
  json["beside"] = range_json(plan.beside);
  json["layers"] = Json::array();
  for (const PlanLayer& layer : plan.layers)
    json["layers"].push_back({{"layer", layer.layer},
                              {"cells", layer.cells},
                              {"side_m", layer.side_m},
                              {"nearest_m", layer.nearest_m},
                              {"farthest_m", layer.farthest_m},
                              {"nearest_side_px", layer.nearest_side_px},
                              {"farthest_side_px", layer.farthest_side_px},
                              {"farthest_cell_px", layer.farthest_cell_px},
                              {"overlap", number_or_null(layer.overlap)},
                              {"white_share", number_or_null(layer.white_share)},
                              {"line_mm", number_or_null(layer.line_mm)}});
  json["warnings"] = Json::array();
  for (const PlanWarning& warning : plan.warnings)
    json["warnings"].push_back({{"concern", to_string(warning.concern)},
                                {"severity", to_string(warning.severity)},
                                {"text", warning.text}});
  json["command"] = generate_command(request, plan);
  return json.dump(1) + "\n";
}

}  // namespace harco::cli
