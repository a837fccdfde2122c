// harco generate: a set of new markers, ready to print.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "code_search.hpp"
#include "harco/dictionary.hpp"
#include "harco/layout.hpp"
#include "number_list.hpp"
#include "verbs.hpp"
#include "write_markers.hpp"

namespace harco::cli {
namespace {

struct GenerateOptions {
  int layers = 0;
  int parents = 1;
  int cells = 5;
  double side_m = 0.0;
  std::string out;
  std::vector<std::string> children{"quincunx"};
  std::string method = "search";
  std::optional<int> tau;
  std::optional<int> min_black;
  std::optional<int> max_black;
  CodeSearch codes;
  DrawingOptions drawing;
};

/// One choice holds for all layers that carry children; otherwise there is one for each.
Marker layout_of(const GenerateOptions& options) {
  const std::string carpet_name = "carpet";
  if (options.children == std::vector{carpet_name}) {
    if (options.layers != kCarpetLayers)
      throw std::invalid_argument(
          fmt::format("--children carpet has {} layers, not {}", kCarpetLayers, options.layers));
    return carpet(options.cells);
  }
  const auto carrying = static_cast<std::size_t>(options.layers - 1);
  if (options.children.size() != 1 && options.children.size() != carrying)
    throw std::invalid_argument(
        fmt::format("--children: {} are given, but {} layers carry children (the last does not)",
                    options.children.size(), carrying));
  std::vector<std::vector<int>> tree;
  for (std::size_t layer = 0; layer < carrying; ++layer) {
    const std::string& choice = options.children[options.children.size() == 1 ? 0 : layer];
    tree.push_back(parse_cells(choice, options.cells, "--children"));
  }
  return uniform_layout(options.cells, tree);
}

CodeSearch search_of(const GenerateOptions& options) {
  CodeSearch search = options.codes;
  search.method =
      options.method == "mutation" ? DictionaryMethod::mutation : DictionaryMethod::search;
  (options.layers == 1 ? search.parent_distance : search.child_distance) = options.tau;
  if (options.min_black || options.max_black) {
    BlackRange black = default_child_black(options.cells);
    // A limit given alone takes the other along if they would cross.
    if (options.min_black) black.least = *options.min_black;
    if (options.max_black) black.most = *options.max_black;
    if (!options.max_black) black.most = std::max(black.most, black.least);
    if (!options.min_black) black.least = std::min(black.least, black.most);
    search.child_black = black;
  }
  return search;
}

void print_reached(const DictionaryReached& reached, int set_cells) {
  fmt::print("{:9} {} code{}{}, tau = {} (at most {}: {})\n",
             reached.children ? "children:" : "parents:", reached.count,
             reached.count == 1 ? "" : "s",
             reached.cells == set_cells ? "" : fmt::format(" of {0} x {0}", reached.cells),
             reached.distance, reached.bound.distance, reached.bound.reason);
}

void warn_if_missed(const DictionaryReached& reached, const CodeSearch& search) {
  const std::optional<int>& wanted =
      reached.children ? search.child_distance : search.parent_distance;
  if (wanted && reached.distance < *wanted)
    fmt::print(stderr, "harco: warning: tau = {} was asked for the {}, {} was reached\n", *wanted,
               reached.children ? "children" : "parents", reached.distance);
}

/// A marker with one child a layer, found at once: all that drawing may refuse shows in it already.
MarkerSet sample_of(MarkerSet without_codes, CodeSearch search) {
  without_codes.parents.resize(1);
  for (Marker* marker = &without_codes.parents[0].marker; !marker->children.empty();
       marker = &marker->children.front())
    marker->children.resize(1);
  search.parent_distance = search.child_distance = 1;
  return generate_codes(std::move(without_codes), search).markers;
}

void generate(const GenerateOptions& options) {
  if (!(options.side_m > 0.0) || !std::isfinite(options.side_m))
    throw std::invalid_argument("--side must be a positive number of metres");
  const CodeSearch search = search_of(options);
  const MarkerSet wanted = without_codes(layout_of(options), options.parents, options.side_m,
                                         line_width(options.drawing, options.cells));
  check_writable(options.out);
  check_drawing(sample_of(wanted, search), options.drawing);

  const CodedMarkers made = search_codes(wanted, search);
  write_markers(made.markers, options.out, options.drawing);
  for (const DictionaryReached& reached : made.dictionaries) {
    print_reached(reached, options.cells);
    warn_if_missed(reached, search);
  }
  if (made.cut_short)
    fmt::print(stderr, "harco: warning: stopped early, these are the best codes found so far\n");
}

}  // namespace

void add_generate(CLI::App& app) {
  CLI::App& verb = *app.add_subcommand("generate", "Make new markers, ready to print");
  // The callback needs the options for as long as the command lives.
  const auto options = std::make_shared<GenerateOptions>();
  CodeSearch& search = options->codes;
  verb.add_option("--layers", options->layers, "Layers of every marker; 1 has no children")
      ->required()
      ->check(CLI::Range(1, 8));
  verb.add_option("--parents", options->parents, "How many markers")
      ->required()
      ->check(CLI::Range(1, 1000000));
  verb.add_option("--side", options->side_m, "Side of the black square in metres")->required();
  verb.add_option("--out", options->out, "Folder for the files; made if need be")->required();

  const std::string codes = "Codes";
  verb.add_option("--cells", options->cells, "n of the n x n inner cells")
      ->check(CLI::Range(4, 8))
      ->capture_default_str()
      ->group(codes);
  verb.add_option("--children", options->children,
                  "Cells that hold children: quincunx, checkerboard, a list such as 0,4,12-14, or "
                  "carpet (three layers that cover all of the marker). Given once it holds for all "
                  "layers, else once for every layer but the last, "
                  "from the top")
      ->capture_default_str()
      ->group(codes);
  verb.add_option("--method", options->method, "search, or mutation (Algorithm 1 of the paper)")
      ->check(CLI::IsMember({"search", "mutation"}))
      ->capture_default_str()
      ->group(codes);
  verb.add_option("--tau", options->tau,
                  "Distance to reach between children (with one layer: between parents); if not "
                  "given, the greatest that is found")
      ->group(codes);
  verb.add_option("--parent-tau", search.parent_distance,
                  "Distance to reach between parents; if not given, the greatest that is found")
      ->group(codes);
  verb.add_option("--min-black", options->min_black, "Least number of black cells in a child")
      ->group(codes);
  verb.add_option("--max-black", options->max_black, "Greatest number of black cells in a child")
      ->group(codes);
  verb.add_option("--seed", search.seed, "Same seed, same codes")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str()
      ->group(codes);
  verb.add_option("--effort", search.effort, "Scales the length of the search")
      ->capture_default_str()
      ->group(codes);
  verb.add_option("--time-limit", search.time_limit_s,
                  "Seconds after which the best codes so far are taken; Ctrl-C does so at any time")
      ->group(codes);
  add_drawing_options(verb, options->drawing);
  verb.callback([options] { generate(*options); });
}

}  // namespace harco::cli
