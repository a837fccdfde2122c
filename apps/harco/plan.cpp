// harco plan: how many layers, how large, for which distances.
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <map>
#include <memory>
#include <numbers>
#include <optional>
#include <stdexcept>
#include <string>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "harco/camera.hpp"
#include "plan_report.hpp"
#include "verbs.hpp"
#include "write_file.hpp"

namespace harco::cli {
namespace {

struct PlanOptions {
  PlanRequest request;
  std::filesystem::path camera;
  std::string size;
  std::optional<double> fov_deg;
  std::optional<double> focal_px;
  double printer_dpi = 600.0;
  bool json = false;
  std::filesystem::path plot;
};

/// WIDTHxHEIGHT.
void parse_size(const std::string& text, PlanRequest& request) {
  char x = 0;
  char rest = 0;
  if (std::sscanf(text.c_str(), "%6d%c%6d%c", &request.width_px, &x, &request.height_px, &rest) !=
          3 ||
      x != 'x')
    throw std::invalid_argument("--size: '" + text + "' is not WIDTHxHEIGHT, such as 750x480");
}

double focal_of(double fov_deg, int width_px) {
  if (!(fov_deg > 0.0 && fov_deg < 180.0))
    throw std::invalid_argument("--fov must lie between 0 and 180 degrees");
  return width_px / 2.0 / std::tan(fov_deg / 2.0 * std::numbers::pi / 180.0);
}

/// The image and the focal length, from a camera file or from the options.
void set_camera(const PlanOptions& options, PlanRequest& request) {
  if (!options.camera.empty()) {
    const Camera camera = load_camera(options.camera);
    request.width_px = camera.width;
    request.height_px = camera.height;
    // The larger one tells how soon a marker outgrows the image, the smaller one how far it is
    // seen; they hardly differ, and the mean serves both.
    request.focal_px = std::sqrt(camera.fx * camera.fy);
    return;
  }
  if (options.size.empty() || options.fov_deg.has_value() == options.focal_px.has_value())
    throw std::invalid_argument(
        "a camera is needed: --camera FILE, or --size WxH with either --fov or --focal");
  parse_size(options.size, request);
  request.focal_px =
      options.fov_deg ? focal_of(*options.fov_deg, request.width_px) : *options.focal_px;
}

void run(const PlanOptions& options) {
  PlanRequest request = options.request;
  set_camera(options, request);
  if (!(options.printer_dpi > 0.0))
    throw std::invalid_argument("--printer-dpi must be a positive number");
  request.printer_dot_mm = 25.4 / options.printer_dpi;
  const Plan planned = plan(request);
  if (!options.plot.empty()) write_file(options.plot, plan_chart(request, planned));
  fmt::print("{}", options.json ? plan_json(request, planned) : plan_table(request, planned));
}

void add_camera_options(CLI::App& verb, PlanOptions& options) {
  CLI::Option* camera = verb.add_option("--camera", options.camera, "Camera file (YAML)");
  CLI::Option* size =
      verb.add_option("--size", options.size, "Image size in place of a camera file, as WxH");
  verb.add_option("--fov", options.fov_deg, "Horizontal field of view in degrees, with --size");
  verb.add_option("--focal", options.focal_px, "Focal length in pixels, with --size");
  camera->excludes(size)->excludes("--fov")->excludes("--focal");
}

std::map<std::string, LayoutKind> layout_names() {
  std::map<std::string, LayoutKind> names;
  for (const LayoutKind kind : {LayoutKind::quincunx, LayoutKind::checkerboard, LayoutKind::carpet})
    names[to_string(kind)] = kind;
  return names;
}

void add_marker_options(CLI::App& verb, PlanRequest& request) {
  verb.add_option("--side", request.side_m,
                  "Side of the parent's black square in metres; if not given, the least needed");
  verb.add_option("--layout", request.layout,
                  "quincunx (5 children a marker), checkerboard (13) or carpet (all over the "
                  "marker); if not given, the one with the fewest markers that serves")
      ->transform(CLI::CheckedTransformer(layout_names()).description(""))
      ->type_name("NAME");
  verb.add_option("--layers", request.layers,
                  "Number of layers, 1-8; if not given, the least needed");
  verb.add_option("--cells", request.cells,
                  "n of n x n cells, 4-8; if not given 5, or 6 where a carpet has to be finer");
  verb.add_option("--line-inside", request.line.inside,
                  "Line around children inside their square, share of their side")
      ->capture_default_str();
  verb.add_option("--line-outside", request.line.outside, "The same outside their square")
      ->capture_default_str();
  verb.add_option("--alpha", request.alpha, "Greatest black share of a child")
      ->capture_default_str();
}

void add_detection_options(CLI::App& verb, PlanOptions& options) {
  verb.add_option("--parent-px", options.request.parent_px,
                  "Least side of a parent in the image, in pixels (found from 12 frontally, from "
                  "14 at 45 degrees)")
      ->capture_default_str();
  verb.add_option("--child-px", options.request.child_px,
                  "The same of a child (found from 14 frontally, from 20 at 45 degrees)")
      ->capture_default_str();
  verb.add_option("--usable", options.request.usable_share,
                  "Share of the image's smaller dimension that a marker may fill")
      ->capture_default_str();
  verb.add_option("--printer-dpi", options.printer_dpi, "Dots per inch of the printer")
      ->capture_default_str();
}

}  // namespace

void add_plan(CLI::App& app) {
  CLI::App* verb = app.add_subcommand(
      "plan", "Find the layers that a range of distances needs: their number, sides and ranges");
  const auto options = std::make_shared<PlanOptions>();
  verb->add_option("--near", options->request.nearest_m, "Nearest distance in metres")->required();
  verb->add_option("--far", options->request.farthest_m, "Farthest distance in metres")->required();
  verb->add_option("--aim", options->request.aim,
                   "How far beside the marker's centre the camera may aim, along both axes, as a "
                   "share of the side; 0 plans for a camera over the centre")
      ->capture_default_str();
  add_camera_options(*verb, *options);
  add_marker_options(*verb, options->request);
  add_detection_options(*verb, *options);
  verb->add_flag("--json", options->json, "Print the plan as JSON");
  verb->add_option("--plot", options->plot, "Write a chart of the ranges to this SVG file");
  verb->callback([options] { run(*options); });
}

}  // namespace harco::cli
