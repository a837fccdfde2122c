// harco import: markers of another family, as they are or made hierarchical.
#include <cmath>
#include <filesystem>
#include <memory>
#include <numeric>
#include <optional>
#include <stdexcept>
#include <string>
#include <system_error>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <CLI/CLI.hpp>

#include "code_search.hpp"
#include "families.hpp"
#include "hierarchy.hpp"
#include "number_list.hpp"
#include "verbs.hpp"
#include "write_markers.hpp"

namespace harco::cli {
namespace {

// From here on, one wrong bit is noticed and can be put right.
constexpr int kSafeDistance = 3;

struct ImportOptions {
  std::string family;
  double side_m = 0.0;
  std::string out;
  std::optional<std::string> ids;
  int layers = 1;
  HierarchyOptions hierarchy;
  bool no_drawings = false;
  DrawingOptions drawing;
};

/// The markers of a family that are asked for, and their codes.
struct Selection {
  std::vector<int> ids;
  std::vector<Code> codes;
};

void warn(const std::string& what) { fmt::print(stderr, "harco: warning: {}\n", what); }

Selection select(const Family& family, const std::optional<std::string>& ids) {
  const int count = static_cast<int>(family.codes.size());
  std::vector<int> wanted(family.codes.size());
  std::iota(wanted.begin(), wanted.end(), 0);
  if (ids) wanted = parse_list(*ids, count, "--ids");

  Selection selection;
  std::vector<int> undirected;
  for (const int id : wanted) {
    const Code& code = family.codes[static_cast<std::size_t>(id)];
    if (inner_distance(code) == 0) {
      undirected.push_back(id);
    } else {
      selection.ids.push_back(id);
      selection.codes.push_back(code);
    }
  }
  const std::string why = fmt::format("{}: looks the same when turned and so has no pose: {}",
                                      family.name, fmt::join(undirected, ", "));
  if (selection.ids.empty()) throw std::invalid_argument(why);
  if (!undirected.empty()) warn("left out of " + why);
  return selection;
}

MarkerSet plain_parents(const Selection& selection, double side_m, const LineWidth& line) {
  MarkerSet markers;
  markers.cells = selection.codes.front().cells;
  markers.line = line;
  for (std::size_t i = 0; i < selection.ids.size(); ++i)
    markers.parents.push_back({side_m, Marker{selection.ids[i], -1, selection.codes[i], {}}});
  return markers;
}

MarkerSet with_children(const Selection& selection, const ImportOptions& options) {
  HierarchyOptions hierarchy = options.hierarchy;
  hierarchy.layers = options.layers;
  const DictionaryOptions wanted = codes_for_hierarchy(selection.codes, hierarchy);
  const Dictionary dictionary = search_codes(wanted);
  MarkerSet markers =
      build_markers(dictionary, options.side_m, line_width(options.drawing, wanted.cells));

  std::vector<int> childless;
  for (std::size_t i = 0; i < selection.ids.size(); ++i) {
    markers.parents[i].marker.id = selection.ids[i];
    if (markers.parents[i].marker.children.empty()) childless.push_back(selection.ids[i]);
  }
  if (!childless.empty())
    warn(fmt::format("without children, for none of --children {} is white: {}", hierarchy.children,
                     fmt::join(childless, ", ")));
  if (dictionary.cut_short) warn("stopped early, these are the best codes found so far");
  fmt::print("children: tau = {}\n", dictionary.child_distance);
  if (dictionary.child_distance < kSafeDistance)
    warn(
        "a single misread bit can turn one child into another; fewer --ids, fewer --children or "
        "a greater --child-cells give a greater tau");
  return markers;
}

void write_description(const MarkerSet& markers, const std::filesystem::path& folder) {
  std::error_code failed;
  std::filesystem::create_directories(folder, failed);
  save_markers(markers, folder / "markers.json");
  fmt::print("{}: markers.json\n", folder.string());
}

void import_family(const ImportOptions& options) {
  if (!(options.side_m > 0.0) || !std::isfinite(options.side_m))
    throw std::invalid_argument("--side must be a positive number of metres");
  const Selection selection = select(load_family(options.family), options.ids);
  check_writable(options.out);
  const MarkerSet markers =
      options.layers == 1
          ? plain_parents(selection, options.side_m,
                          line_width(options.drawing, options.hierarchy.child_cells))
          : with_children(selection, options);
  if (options.no_drawings)
    write_description(markers, options.out);
  else
    write_markers(markers, options.out, options.drawing);
}

}  // namespace

void add_import(CLI::App& app) {
  CLI::App& verb = *app.add_subcommand(
      "import", "Take markers of ArUco or AprilTag, plain or with children in their white cells");
  // The callback needs the options for as long as the command lives.
  const auto options = std::make_shared<ImportOptions>();
  verb.add_option("family", options->family,
                  "aruco:4x4_50 ... aruco:7x7_1000, aruco:original, aruco:mip_36h12 (where OpenCV "
                  "has it), apriltag:16h5, 25h9, 36h10 or 36h11")
      ->required();
  verb.add_option("--side", options->side_m, "Side of the black square in metres")->required();
  verb.add_option("--out", options->out, "Folder for the files; made if need be")->required();
  verb.add_option("--ids", options->ids, "Which of the family, such as 0-9,23; all if not given");
  verb.add_option("--layers", options->layers,
                  "1 leaves the markers as they are; more puts children into white cells")
      ->check(CLI::Range(1, 8))
      ->capture_default_str();
  verb.add_flag("--no-drawings", options->no_drawings,
                "Only markers.json, for markers that are printed already");

  const std::string children = "Children (--layers 2 and more)";
  verb.add_option("--children", options->hierarchy.children,
                  "Which white cells of a parent hold them: spread (5 far from one another), "
                  "spread:COUNT, quincunx, checkerboard, or a list such as 0,4-6")
      ->capture_default_str()
      ->group(children);
  verb.add_option("--child-cells", options->hierarchy.child_cells,
                  "n of the children's n x n inner cells")
      ->check(CLI::Range(4, 8))
      ->capture_default_str()
      ->group(children);
  verb.add_option("--seed", options->hierarchy.seed, "Same seed, same codes")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str()
      ->group(children);
  add_drawing_options(verb, options->drawing);
  verb.callback([options] { import_family(*options); });
}

}  // namespace harco::cli
