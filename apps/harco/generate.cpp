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
#include "number_list.hpp"
#include "verbs.hpp"
#include "write_markers.hpp"

namespace harco::cli {
namespace {

struct GenerateOptions {
  int layers = 0;
  double side_m = 0.0;
  std::string out;
  std::vector<std::string> children{"quincunx"};
  std::string method = "search";
  std::optional<int> tau;
  std::optional<int> min_black;
  std::optional<int> max_black;
  DictionaryOptions dictionary;
  DrawingOptions drawing;
};

/// One choice holds for all layers that carry children; otherwise there is one for each.
std::vector<std::vector<int>> tree_of(const GenerateOptions& options) {
  const auto carrying = static_cast<std::size_t>(options.layers - 1);
  if (options.children.size() != 1 && options.children.size() != carrying)
    throw std::invalid_argument(
        fmt::format("--children: {} are given, but {} layers carry children (the last does not)",
                    options.children.size(), carrying));
  std::vector<std::vector<int>> tree;
  for (std::size_t layer = 0; layer < carrying; ++layer) {
    const std::string& choice = options.children[options.children.size() == 1 ? 0 : layer];
    tree.push_back(parse_cells(choice, options.dictionary.cells, "--children"));
  }
  return tree;
}

DictionaryOptions dictionary_options(const GenerateOptions& options) {
  DictionaryOptions dictionary = options.dictionary;
  dictionary.child_cells = tree_of(options);
  dictionary.method =
      options.method == "mutation" ? DictionaryMethod::mutation : DictionaryMethod::search;
  (options.layers == 1 ? dictionary.parent_distance : dictionary.child_distance) = options.tau;
  if (options.min_black || options.max_black) {
    BlackRange black = default_child_black(dictionary.cells);
    // A limit given alone takes the other along if they would cross.
    if (options.min_black) black.least = *options.min_black;
    if (options.max_black) black.most = *options.max_black;
    if (!options.max_black) black.most = std::max(black.most, black.least);
    if (!options.min_black) black.least = std::min(black.least, black.most);
    dictionary.child_black = black;
  }
  return dictionary;
}

void print_distance(const char* name, std::size_t codes, int distance,
                    const std::optional<DistanceBound>& bound) {
  fmt::print("{:9} {} code{}, tau = {}", name, codes, codes == 1 ? "" : "s", distance);
  if (bound) fmt::print(" (at most {}: {})", bound->distance, bound->reason);
  fmt::print("\n");
}

void print_reached(const Dictionary& dictionary) {
  print_distance("parents:", dictionary.parents.size(), dictionary.parent_distance,
                 dictionary.parent_bound);
  std::size_t children = 0;
  for (const auto& layer : dictionary.children) children += layer.size();
  if (children > 0)
    print_distance("children:", children, dictionary.child_distance, dictionary.child_bound);
}

void warn_if_missed(const char* whose, const std::optional<int>& wanted, int reached) {
  if (wanted && reached < *wanted)
    fmt::print(stderr, "harco: warning: tau = {} was asked for the {}, {} was reached\n", *wanted,
               whose, reached);
}

/// A marker with one child a layer, found at once: all that drawing may refuse shows in it already.
MarkerSet sample_of(DictionaryOptions dictionary, const GenerateOptions& options) {
  dictionary.parents = 1;
  for (std::vector<int>& cells : dictionary.child_cells) cells.resize(1);
  dictionary.parent_distance = dictionary.child_distance = 1;
  return build_markers(generate_dictionary(dictionary), options.side_m,
                       line_width(options.drawing));
}

void generate(const GenerateOptions& options) {
  if (!(options.side_m > 0.0) || !std::isfinite(options.side_m))
    throw std::invalid_argument("--side must be a positive number of metres");
  const DictionaryOptions wanted = dictionary_options(options);
  check_writable(options.out);
  check_drawing(sample_of(wanted, options), options.drawing);

  const Dictionary dictionary = search_codes(wanted);
  write_markers(build_markers(dictionary, options.side_m, line_width(options.drawing)), options.out,
                options.drawing);
  print_reached(dictionary);
  warn_if_missed("parents", wanted.parent_distance, dictionary.parent_distance);
  warn_if_missed("children", wanted.child_distance, dictionary.child_distance);
  if (dictionary.cut_short)
    fmt::print(stderr, "harco: warning: stopped early, these are the best codes found so far\n");
}

}  // namespace

void add_generate(CLI::App& app) {
  CLI::App& verb = *app.add_subcommand("generate", "Make new markers, ready to print");
  // The callback needs the options for as long as the command lives.
  const auto options = std::make_shared<GenerateOptions>();
  DictionaryOptions& dictionary = options->dictionary;
  verb.add_option("--layers", options->layers, "Layers of every marker; 1 has no children")
      ->required()
      ->check(CLI::Range(1, 8));
  verb.add_option("--parents", dictionary.parents, "How many markers")
      ->required()
      ->check(CLI::Range(1, 1000000));
  verb.add_option("--side", options->side_m, "Side of the black square in metres")->required();
  verb.add_option("--out", options->out, "Folder for the files; made if need be")->required();

  const std::string codes = "Codes";
  verb.add_option("--cells", dictionary.cells, "n of the n x n inner cells")
      ->check(CLI::Range(4, 8))
      ->capture_default_str()
      ->group(codes);
  verb.add_option("--children", options->children,
                  "Cells that hold children: quincunx, checkerboard, or a list such as 0,4,12-14. "
                  "Given once it holds for all layers, else once for every layer but the last, "
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
  verb.add_option("--parent-tau", dictionary.parent_distance,
                  "Distance to reach between parents; if not given, the greatest that is found")
      ->group(codes);
  verb.add_option("--min-black", options->min_black, "Least number of black cells in a child")
      ->group(codes);
  verb.add_option("--max-black", options->max_black, "Greatest number of black cells in a child")
      ->group(codes);
  verb.add_option("--seed", dictionary.seed, "Same seed, same codes")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str()
      ->group(codes);
  verb.add_option("--effort", dictionary.effort, "Scales the length of the search")
      ->capture_default_str()
      ->group(codes);
  verb.add_option("--time-limit", dictionary.time_limit_s,
                  "Seconds after which the best codes so far are taken; Ctrl-C does so at any time")
      ->group(codes);
  add_drawing_options(verb, options->drawing);
  verb.callback([options] { generate(*options); });
}

}  // namespace harco::cli
