// The chart of `harco plan --plot`.
#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <string>

#include <fmt/format.h>

#include "plan_report.hpp"

namespace harco::cli {
namespace {

// All lengths are units of the SVG's view box.
constexpr double kWidth = 960.0;
constexpr double kLeft = 40.0;
constexpr double kRight = 40.0;
constexpr double kTop = 92.0;
constexpr double kRowHeight = 76.0;
constexpr double kBarHeight = 34.0;
constexpr double kAxisHeight = 62.0;

constexpr std::array<const char*, 4> kColours{"#1b6ca8", "#2a9d8f", "#c77d0a", "#8a4fa3"};

/// Where distances and layers come to lie.
struct Frame {
  double nearest;
  double farthest;
  double bottom;

  double x(double distance) const {
    return kLeft +
           (kWidth - kLeft - kRight) * std::log(distance / nearest) / std::log(farthest / nearest);
  }
  static double bar_top(std::size_t row) { return kTop + kRowHeight * static_cast<double>(row); }
};

/// The axis runs a little beyond all that is shown.
Frame frame_of(const PlanRequest& request, const Plan& plan) {
  double nearest = request.nearest_m;
  double farthest = request.farthest_m;
  for (const PlanLayer& layer : plan.layers) {
    nearest = std::min(nearest, layer.nearest_m);
    farthest = std::max(farthest, layer.farthest_m);
  }
  return {nearest / 1.2, farthest * 1.2,
          kTop + kRowHeight * static_cast<double>(plan.layers.size())};
}

void text(std::string& svg, double x, double y, const char* style, const std::string& content) {
  fmt::format_to(std::back_inserter(svg),
                 "<text x=\"{:.1f}\" y=\"{:.1f}\" class=\"{}\">{}</text>\n", x, y, style, content);
}

void rectangle(std::string& svg, double x0, double y0, double x1, double y1,
               const std::string& attributes) {
  fmt::format_to(std::back_inserter(svg),
                 "<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" {}/>\n", x0,
                 y0, x1 - x0, y1 - y0, attributes);
}

void vertical(std::string& svg, double x, double y0, double y1, const char* style) {
  fmt::format_to(std::back_inserter(svg), "<path d=\"M{:.1f} {:.1f}V{:.1f}\" class=\"{}\"/>\n", x,
                 y0, y1, style);
}

void draw_axis(std::string& svg, const Frame& frame) {
  const double decades = std::log10(frame.farthest / frame.nearest);
  const int first = static_cast<int>(std::floor(std::log10(frame.nearest)));
  const int last = static_cast<int>(std::ceil(std::log10(frame.farthest)));
  for (int power = first; power <= last; ++power)
    for (int digit = 1; digit <= 9; ++digit) {
      const double distance = digit * std::pow(10.0, power);
      if (distance < frame.nearest || distance > frame.farthest) continue;
      const double x = frame.x(distance);
      const bool labelled = digit == 1 || (decades < 4.5 && (digit == 2 || digit == 5));
      vertical(svg, x, kTop - 12.0, frame.bottom, digit == 1 ? "decade" : "grid");
      if (labelled) text(svg, x, frame.bottom + 18.0, "tick", significant(distance, 1));
    }
  text(svg, kWidth / 2.0, frame.bottom + 42.0, "tick", "distance in metres (logarithmic)");
}

void draw_wanted_range(std::string& svg, const Frame& frame, const PlanRequest& request) {
  const double x0 = frame.x(request.nearest_m);
  const double x1 = frame.x(request.farthest_m);
  rectangle(svg, x0, kTop - 26.0, x1, frame.bottom, R"(fill="#eef3f7")");
  vertical(svg, x0, kTop - 26.0, frame.bottom, "wanted");
  vertical(svg, x1, kTop - 26.0, frame.bottom, "wanted");
  text(svg, x0 + 6.0, kTop - 14.0, "label", significant(request.nearest_m, 3) + " m wanted");
  text(svg, x1 - 6.0, kTop - 14.0, "label end", significant(request.farthest_m, 3) + " m");
}

/// Where the next layer already serves while this one still does, or where neither does.
void draw_meeting(std::string& svg, const Frame& frame, const Plan& plan, std::size_t upper) {
  const double from = plan.layers[upper].nearest_m;
  const double to = plan.layers[upper + 1].farthest_m;
  const bool gap = to < from;
  const double x0 = frame.x(std::min(from, to));
  const double x1 = frame.x(std::max(from, to));
  const double y0 = Frame::bar_top(upper) + kBarHeight;
  rectangle(svg, x0, y0, x1, Frame::bar_top(upper + 1),
            gap ? R"-(fill="url(#hatch)")-" : R"(fill="#9fb4c3" fill-opacity="0.35")");
  if (gap)
    text(svg, x1 + 8.0, y0 + 26.0, "gap",
         fmt::format("gap: {} m to {} m", significant(to, 3), significant(from, 3)));
  else
    text(svg, (x0 + x1) / 2.0, y0 + 26.0, "middle",
         significant(*plan.layers[upper].overlap, 2) + " x");
}

void draw_layer(std::string& svg, const Frame& frame, const PlanLayer& layer, std::size_t row) {
  const double x0 = frame.x(layer.nearest_m);
  const double x1 = frame.x(layer.farthest_m);
  const double top = Frame::bar_top(row);
  rectangle(svg, x0, top, x1, top + kBarHeight,
            fmt::format(R"(rx="5" fill="{}")", kColours[row % kColours.size()]));
  const double baseline = top + kBarHeight / 2.0 + 4.5;
  text(svg, x0 + 8.0, baseline, "pixels", significant(layer.nearest_side_px, 3) + " px");
  text(svg, x1 - 8.0, baseline, "pixels end", significant(layer.farthest_side_px, 2) + " px");
  // Above the bar the text would meet the overlap's figure; beside it there is room on one side.
  const std::string name = fmt::format("layer {}: {} m", layer.layer, significant(layer.side_m, 3));
  const bool room_left = x0 - kLeft > kWidth - kRight - x1;
  if (x1 - x0 > 270.0)
    text(svg, (x0 + x1) / 2.0, baseline, "name", name);
  else
    text(svg, room_left ? x0 - 8.0 : x1 + 8.0, baseline, room_left ? "label end" : "label", name);
}

constexpr const char* kHead =
    R"svg(<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {0} {1}" width="{0}" height="{1}">
<style>
text {{ font-family: "DejaVu Sans", Verdana, sans-serif; font-size: 13px; fill: #22303a; }}
.title {{ font-size: 18px; font-weight: bold; }}
.tick, .name, .middle {{ text-anchor: middle; }}
.label {{ font-size: 12px; }}
.pixels, .name {{ fill: #ffffff; }}
.pixels {{ font-size: 12px; }}
.end {{ text-anchor: end; }}
.gap {{ fill: #b3261e; font-size: 12px; }}
.grid {{ stroke: #dfe5ea; fill: none; }}
.decade {{ stroke: #b8c4cd; fill: none; }}
.wanted {{ stroke: #22303a; stroke-width: 1.5; stroke-dasharray: 5 4; fill: none; }}
</style>
<defs><pattern id="hatch" width="8" height="8" patternUnits="userSpaceOnUse" patternTransform="rotate(45)"><rect width="3" height="8" fill="#b3261e" fill-opacity="0.55"/></pattern></defs>
<rect width="{0}" height="{1}" fill="#ffffff"/>
)svg";

}  // namespace

std::string plan_chart(const PlanRequest& request, const Plan& plan) {
  const Frame frame = frame_of(request, plan);
  std::string svg = fmt::format(kHead, kWidth, frame.bottom + kAxisHeight);
  text(svg, kLeft, 36.0, "title",
       fmt::format("Distances that each layer serves: side {} m, {} x {} cells, f = {} px",
                   plan.side_m, plan.cells, plan.cells, significant(request.focal_px, 3)));
  draw_wanted_range(svg, frame, request);
  draw_axis(svg, frame);
  for (std::size_t row = 0; row + 1 < plan.layers.size(); ++row)
    draw_meeting(svg, frame, plan, row);
  for (std::size_t row = 0; row < plan.layers.size(); ++row)
    draw_layer(svg, frame, plan.layers[row], row);
  return svg + "</svg>\n";
}

}  // namespace harco::cli
