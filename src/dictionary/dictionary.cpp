#include "harco/dictionary.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <stdexcept>

#include "dictionary/demand.hpp"
#include "dictionary/generation.hpp"
#include "dictionary/monitor.hpp"
#include "dictionary/turns.hpp"

namespace harco {
namespace {

constexpr int kMinCells = 4;
constexpr int kMostLayers = 8;

void check_cells(int cells) {
  if (cells < kMinCells || cells > Code::kMaxCells)
    refuse("cells must be 4 … 8, not " + std::to_string(cells));
}

/// n of layer-1 markers.
int parent_cells(const DictionaryOptions& options) {
  return options.given_parents.empty() ? options.cells : options.given_parents.front().cells;
}

void check_given(const DictionaryOptions& options) {
  for (const Code& parent : options.given_parents)
    if (parent.cells != parent_cells(options) || parent.cells < Code::kMinCells ||
        parent.cells > Code::kMaxCells)
      refuse("given parents must all have the same n, 3 … 8");
  if (options.given_child_cells.empty()) return;
  if (options.given_child_cells.size() != options.given_parents.size())
    refuse("given_child_cells must have a list for every given parent");
  for (std::size_t i = 0; i < options.given_parents.size(); ++i) {
    const std::string what = "child cells of given parent " + std::to_string(i);
    check_list(options.given_child_cells[i], parent_cells(options), what);
    for (const int cell : options.given_child_cells[i])
      if (!options.given_parents[i].white(cell))
        refuse(what + ": cell " + std::to_string(cell) + " is black");
  }
}

void check(const DictionaryOptions& options) {
  check_cells(options.cells);
  if (options.given_parents.empty() && options.parents < 1)
    refuse("parents must be at least 1, not " + std::to_string(options.parents));
  if (options.parents > kMostCodes) refuse("more than " + std::to_string(kMostCodes) + " parents");
  check_given(options);
  if (options.child_cells.size() + 1 > kMostLayers)
    refuse("at most " + std::to_string(kMostLayers) + " layers");
  for (std::size_t i = 0; i < options.child_cells.size(); ++i) {
    if (i == 0 && !options.given_child_cells.empty()) continue;
    const std::string what = "child cells of layer " + std::to_string(i + 1);
    if (options.child_cells[i].empty()) refuse(what + ": the list is empty");
    check_list(options.child_cells[i], i == 0 ? parent_cells(options) : options.cells, what);
  }
  check_list(options.white_cells, options.cells, "white cells");
  check_search(options);
}

std::uint64_t mask(const std::vector<int>& cells) {
  std::uint64_t bits = 0;
  for (const int cell : cells) bits |= std::uint64_t{1} << cell;
  return bits;
}

/// For every layer-1 marker, its cells that hold children.
std::vector<std::vector<int>> first_child_cells(const Dictionary& dictionary) {
  if (!dictionary.given_child_cells.empty()) return dictionary.given_child_cells;
  std::vector<std::vector<int>> lists;
  for (const Code& parent : dictionary.parents) {
    lists.emplace_back();
    for (const int cell : dictionary.child_cells.front())
      if (parent.white(cell)) lists.back().push_back(cell);
  }
  return lists;
}

Demand parent_demand(const DictionaryOptions& options) {
  const std::uint64_t white = options.child_cells.empty() ? 0 : mask(options.child_cells.front());
  return {options.cells,
          options.parent_black.value_or(default_parent_black(options.cells)),
          {{options.parents, white}}};
}

/// N_(l+1) = |R_l|: as many children as there are cells for them in the layer above.
Demand child_demand(const DictionaryOptions& options, std::size_t in_first_layer) {
  Demand demand{
      options.cells, options.child_black.value_or(default_child_black(options.cells)), {}};
  std::size_t count = in_first_layer;
  std::size_t sum = 0;
  for (std::size_t layer = 1; layer <= options.child_cells.size(); ++layer) {
    sum += count;
    if (sum > static_cast<std::size_t>(kMostCodes))
      refuse("more than " + std::to_string(kMostCodes) + " children");
    const bool last = layer == options.child_cells.size();
    const std::uint64_t white = last ? 0 : mask(options.child_cells[layer]);
    demand.groups.push_back({static_cast<int>(count), white | mask(options.white_cells)});
    if (!last) count *= options.child_cells[layer].size();
  }
  if (sum == 0) refuse("no child cell is white in any of the given parents");
  return demand;
}

/// Builds the tree: takes codes from every layer's list in order.
class TreeBuilder {
 public:
  explicit TreeBuilder(const Dictionary& dictionary)
      : dictionary_(dictionary), next_(dictionary.children.size()) {
    if (!dictionary.child_cells.empty()) first_cells_ = first_child_cells(dictionary);
    int id = 0;
    for (const auto& layer : dictionary.children) {
      first_id_.push_back(id);
      id += static_cast<int>(layer.size());
    }
  }

  Marker parent(int index) {
    Marker marker;
    marker.id = index;
    marker.code = dictionary_.parents[static_cast<std::size_t>(index)];
    if (!first_cells_.empty())
      add_children(marker, 0, first_cells_[static_cast<std::size_t>(index)]);
    return marker;
  }

  bool all_taken() const {
    for (std::size_t layer = 0; layer < next_.size(); ++layer)
      if (next_[layer] != dictionary_.children[layer].size()) return false;
    return true;
  }

 private:
  void add_children(Marker& marker, std::size_t layer, const std::vector<int>& cells) {
    for (const int cell : cells) {
      const std::size_t index = next_[layer]++;
      if (index >= dictionary_.children[layer].size())
        refuse("too few codes for layer " + std::to_string(layer + 2));
      Marker child;
      child.id = first_id_[layer] + static_cast<int>(index);
      child.cell = cell;
      child.code = dictionary_.children[layer][index];
      if (layer + 1 < next_.size())
        add_children(child, layer + 1, dictionary_.child_cells[layer + 1]);
      marker.children.push_back(std::move(child));
    }
  }

  const Dictionary& dictionary_;
  std::vector<std::vector<int>> first_cells_;  ///< of layer 1
  std::vector<std::size_t> next_;              ///< code of each layer
  std::vector<int> first_id_;
};

}  // namespace

BlackRange default_child_black(int cells) {
  check_cells(cells);
  const int most = 6 * (cells + 2) * (cells + 2) / 49;
  return {std::max(4, most - 1), most};
}

BlackRange default_parent_black(int cells) {
  check_cells(cells);
  return {cells, cells * cells - cells};
}

int dictionary_distance(const std::vector<Code>& codes) {
  if (codes.empty()) return 0;
  const Turns turns(codes.front().cells);
  int least = turns.size();
  for (std::size_t i = 0; i < codes.size(); ++i) {
    if (codes[i].cells != turns.cells())
      throw std::invalid_argument("dictionary_distance: codes of different size");
    least = std::min(least, turns.inner_distance(codes[i].bits));
    for (std::size_t j = 0; j < i; ++j)
      least = std::min(least, turns.distance(codes[i].bits, codes[j].bits));
  }
  return least;
}

Dictionary generate_dictionary(const DictionaryOptions& options,
                               const DictionaryCallback& callback) {
  check(options);
  const bool new_parents = options.given_parents.empty();
  const bool has_children = !options.child_cells.empty();
  Dictionary dictionary;
  dictionary.child_cells = options.child_cells;
  dictionary.parents = options.given_parents;
  if (new_parents)
    dictionary.parent_bound =
        check_demand(parent_demand(options), options.parent_distance, "parents");
  dictionary.given_child_cells = options.given_child_cells;
  // All is checked before anything is searched.
  std::optional<Demand> children;
  if (has_children) {
    std::size_t in_first_layer = 0;
    if (new_parents)
      in_first_layer =
          static_cast<std::size_t>(options.parents) * options.child_cells.front().size();
    else
      for (const auto& list : first_child_cells(dictionary)) in_first_layer += list.size();
    children = child_demand(options, in_first_layer);
    dictionary.child_bound = check_demand(*children, options.child_distance, "children");
  }

  Monitor monitor(options.time_limit_s, callback);
  if (new_parents) {
    monitor.begin(0.0, has_children ? kParentShare : 1.0, kParentWork * options.effort);
    const int most = options.parent_distance.value_or(dictionary.parent_bound->distance);
    dictionary.parents = search_codes(parent_demand(options), false, most, options, monitor,
                                      monitor.progress().parent_distance)
                             .front();
  }
  dictionary.parent_distance = dictionary_distance(dictionary.parents);
  monitor.progress().parent_distance = dictionary.parent_distance;
  if (has_children) {
    monitor.begin(new_parents ? kParentShare : 0.0, 1.0, kChildWork * options.effort);
    const int most = options.child_distance.value_or(dictionary.child_bound->distance);
    dictionary.children =
        search_codes(*children, true, most, options, monitor, monitor.progress().child_distance);
    dictionary.child_distance = dictionary_distance(joined(dictionary.children));
  }
  dictionary.iterations = monitor.iterations();
  dictionary.cut_short = monitor.cut();
  return dictionary;
}

MarkerSet build_markers(const Dictionary& dictionary, double side_m, const LineWidth& line) {
  if (dictionary.children.size() != dictionary.child_cells.size())
    refuse("children and child_cells must have the same number of layers");
  if (!dictionary.given_child_cells.empty() &&
      dictionary.given_child_cells.size() != dictionary.parents.size())
    refuse("given_child_cells must have a list for every parent");
  MarkerSet markers;
  markers.line = line;
  TreeBuilder builder(dictionary);
  for (std::size_t i = 0; i < dictionary.parents.size(); ++i)
    markers.parents.push_back({side_m, builder.parent(static_cast<int>(i))});
  if (!builder.all_taken()) refuse("more codes of children than cells for them");
  if (!markers.parents.empty())
    markers.cells = dictionary.children.empty() ? dictionary.parents.front().cells
                                                : dictionary.children.front().front().cells;
  validate(markers);
  return markers;
}

}  // namespace harco
