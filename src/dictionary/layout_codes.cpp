// Codes for any tree of markers: one dictionary for the parents, one for the children of each n.
#include <algorithm>
#include <map>

#include "dictionary/generation.hpp"

namespace harco {
namespace {

/// Markers that share a dictionary, in the order of their layers.
using Family = std::vector<Marker*>;

/// All markers of a layer of the set, parent by parent; the next layer of each follows from it.
Family children_of(const Family& layer) {
  Family next;
  for (Marker* marker : layer)
    for (Marker& child : marker->children) next.push_back(&child);
  return next;
}

/// The cells that whole children fill, beside those that are to be white anyway.
std::uint64_t white_mask(const Marker& marker, const std::vector<int>& white_cells) {
  std::uint64_t bits = 0;
  for (const int cell : white_cells) bits |= std::uint64_t{1} << cell;
  for (const Marker& child : marker.children)
    if (child.parts == 1) bits |= std::uint64_t{1} << child.cell;
  return bits;
}

/// One dictionary to be found: what is asked, and who gets its codes.
struct Task {
  bool children;
  Demand demand;
  std::vector<Family> takers;  ///< of each of the demand's groups
  std::optional<int> wanted;
  DistanceBound bound;
};

/// Sorts a family into groups of equal white cells. Groups with more of them come first, so that
/// the last admits all codes.
Task task_of(const Family& family, bool children, int set_cells, const CodeSearch& search) {
  Task task{children, {}, {}, {}, {}};
  task.demand.cells = family.front()->code.cells;
  if (task.demand.cells < 4 || task.demand.cells > Code::kMaxCells)
    refuse("cells must be 4 … 8, not " + std::to_string(task.demand.cells));
  const bool own = task.demand.cells == set_cells;
  if (children) {
    task.demand.black =
        own && search.child_black ? *search.child_black : default_child_black(task.demand.cells);
    task.wanted = search.child_distance;
  } else {
    task.demand.black = search.parent_black.value_or(default_parent_black(task.demand.cells));
    task.wanted = search.parent_distance;
  }
  std::map<std::uint64_t, Family> groups;
  for (Marker* marker : family)
    groups[white_mask(*marker, children && own ? search.white_cells : std::vector<int>{})]
        .push_back(marker);
  std::vector<std::pair<std::uint64_t, Family>> sorted(groups.begin(), groups.end());
  std::stable_sort(sorted.begin(), sorted.end(), [](const auto& a, const auto& b) {
    return std::popcount(a.first) > std::popcount(b.first);
  });
  for (auto& [white, takers] : sorted) {
    if ((sorted.back().first & ~white) != 0)
      refuse("markers of one n must not have children in cells that overlap only in part");
    task.demand.groups.push_back({static_cast<int>(takers.size()), white});
    task.takers.push_back(std::move(takers));
  }
  if (task.demand.size() > kMostCodes)
    refuse("more than " + std::to_string(kMostCodes) + (children ? " children" : " parents"));
  return task;
}

/// Numbers all markers and sorts those that share a dictionary.
std::vector<Task> tasks_of(MarkerSet& markers, const CodeSearch& search) {
  Family layer;
  for (Parent& parent : markers.parents) layer.push_back(&parent.marker);
  if (layer.empty()) refuse("parents must be at least 1, not 0");
  std::map<int, Family> parents;
  std::map<int, Family> children;
  for (bool first = true; !layer.empty(); first = false) {
    for (Marker* marker : layer) (first ? parents : children)[marker->code.cells].push_back(marker);
    layer = children_of(layer);
  }
  std::vector<Task> tasks;
  for (const auto& [cells, family] : parents)
    tasks.push_back(task_of(family, false, markers.cells, search));
  for (const auto& [cells, family] : children)
    tasks.push_back(task_of(family, true, markers.cells, search));
  return tasks;
}

void number(MarkerSet& markers) {
  Family layer;
  for (Parent& parent : markers.parents) layer.push_back(&parent.marker);
  for (std::size_t i = 0; i < layer.size(); ++i) layer[i]->id = static_cast<int>(i);
  int next = 0;
  for (layer = children_of(layer); !layer.empty(); layer = children_of(layer))
    for (Marker* child : layer) child->id = next++;
}

}  // namespace

CodedMarkers generate_codes(MarkerSet without_codes, const CodeSearch& search,
                            const DictionaryCallback& callback) {
  CodedMarkers result;
  result.markers = std::move(without_codes);
  check_search(search);
  check_list(search.white_cells, result.markers.cells, "white cells");
  number(result.markers);
  // All is checked before anything is searched.
  std::vector<Task> tasks = tasks_of(result.markers, search);
  for (Task& task : tasks) {
    const bool own = task.demand.cells == result.markers.cells;
    if (!own) task.wanted.reset();
    task.bound = check_demand(task.demand, task.wanted, task.children ? "children" : "parents");
  }

  Monitor monitor(search.time_limit_s, callback);
  double from = 0.0;
  for (Task& task : tasks) {
    const auto left = static_cast<double>(&tasks.back() - &task + 1);
    const double to = from + (task.children ? (1.0 - from) / left : kParentShare);
    monitor.begin(from, to, (task.children ? kChildWork : kParentWork) * search.effort);
    from = to;
    DictionaryProgress& progress = monitor.progress();
    int& reached = task.children ? progress.child_distance : progress.parent_distance;
    reached = 0;
    const CodeGroups codes =
        search_codes(task.demand, task.children, task.wanted.value_or(task.bound.distance), search,
                     monitor, reached);
    for (std::size_t group = 0; group < codes.size(); ++group)
      for (std::size_t i = 0; i < codes[group].size(); ++i)
        task.takers[group][i]->code = codes[group][i];
    result.dictionaries.push_back({task.children, task.demand.cells, task.demand.size(),
                                   dictionary_distance(joined(codes)), task.bound});
  }
  result.cut_short = monitor.cut();
  validate(result.markers);
  return result;
}

}  // namespace harco
