#include "harco/marker.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <map>
#include <set>
#include <stdexcept>
#include <string>

namespace harco {
namespace {

// Black cells whose children make more of it white could be read as white ones.
constexpr double kMostWhiteInBlack = 0.25;

int depth(const Marker& marker) {
  int deepest = 0;
  for (const Marker& child : marker.children) deepest = std::max(deepest, depth(child));
  return deepest + 1;
}

bool is_part(const Marker& child) {
  return child.parts >= 1 && child.parts <= kMostParts && child.part >= 0 &&
         child.part < child.parts * child.parts;
}

std::string part_name(const Marker& child) {
  return "part " + std::to_string(child.part) + " of a cell of " + std::to_string(child.parts) +
         " x " + std::to_string(child.parts);
}

PlacedMarker place_child(const PlacedMarker& container, int container_index, const Marker& child) {
  const int n = container.code.cells;
  if (child.cell < 0 || child.cell >= container.code.size())
    throw std::invalid_argument("place: there is no cell " + std::to_string(child.cell));
  if (!is_part(child)) throw std::invalid_argument("place: " + part_name(child) + " is not there");
  PlacedMarker placed;
  placed.parent_index = container.parent_index;
  placed.layer = container.layer + 1;
  placed.id = child.id;
  placed.container = container_index;
  placed.cell = child.cell;
  placed.parts = child.parts;
  placed.code = child.code;
  placed.side_m = container.cell_side_m() / child.parts;
  placed.origin_m =
      container.origin_m +
      container.cell_side_m() * Eigen::Vector2d(child.cell % n + 1, child.cell / n + 1) +
      placed.side_m * Eigen::Vector2d(child.part % child.parts, child.part / child.parts);
  return placed;
}

void place_parent(const Parent& parent, int parent_index, std::vector<PlacedMarker>& all) {
  if (!(parent.side_m > 0.0) || !std::isfinite(parent.side_m))
    throw std::invalid_argument("place: a parent's side must be positive and finite");
  const std::size_t first = all.size();
  PlacedMarker root;
  root.parent_index = parent_index;
  root.id = parent.marker.id;
  root.code = parent.marker.code;
  root.side_m = parent.side_m;
  all.push_back(root);

  // Breadth first: `sources[i]` is the marker that all[first + i] was placed from.
  std::vector<const Marker*> sources{&parent.marker};
  for (std::size_t i = 0; i < sources.size(); ++i)
    for (const Marker& child : sources[i]->children) {
      const PlacedMarker container = all[first + i];
      all.push_back(place_child(container, static_cast<int>(first + i), child));
      sources.push_back(&child);
    }

  double unit = parent.side_m;
  for (std::size_t i = first; i < all.size(); ++i) unit = std::min(unit, all[i].side_m);
  for (std::size_t i = first; i < all.size(); ++i) {
    // Positions are whole numbers wherever all markers have the same n; rounding takes away what
    // arithmetic left.
    const Eigen::Vector2d exact = all[i].origin_m / unit;
    for (int axis = 0; axis < 2; ++axis) {
      const double whole = std::round(exact[axis]);
      all[i].grid_position[axis] = std::abs(exact[axis] - whole) < 1e-6 ? whole : exact[axis];
    }
  }
}

std::string name(const Marker& marker, int layer) {
  return (layer == 1 ? "parent " : "child ") + std::to_string(marker.id);
}

/// The least code of the four turns: equal for codes that can't be told apart.
std::pair<int, std::uint64_t> canonical(const Code& code) {
  std::uint64_t least = code.bits;
  for (int k = 1; k < 4; ++k) least = std::min(least, rotated(code, k).bits);
  return {code.cells, least};
}

/// What has been met so far among the parents, or among the children.
struct Known {
  std::set<int> ids;
  std::map<std::pair<int, std::uint64_t>, int> codes;
};

void validate_cells(int cells, const std::string& who) {
  if (cells < Code::kMinCells || cells > Code::kMaxCells)
    throw std::invalid_argument(who + ": cells must be 3 … 8, not " + std::to_string(cells));
}

/// Whether two children of one marker have a piece of its plane in common.
bool overlap(const Marker& a, const Marker& b) {
  if (a.cell != b.cell) return false;
  // In units of 1 / (a.parts b.parts) of the cell: [start, start + other's parts) each.
  const auto meet = [&](int at_a, int at_b) {
    return at_a * b.parts < (at_b + 1) * a.parts && at_b * a.parts < (at_a + 1) * b.parts;
  };
  return meet(a.part % a.parts, b.part % b.parts) && meet(a.part / a.parts, b.part / b.parts);
}

/// How much of the parent's cell the children take that stand in the same one as `child`.
double share_taken(const Marker& parent, const Marker& child) {
  double sum = 0.0;
  for (const Marker& other : parent.children)
    if (other.cell == child.cell) sum += 1.0 / (other.parts * other.parts);
  return sum;
}

/// `index` is the child's among its siblings.
void validate_place(const Marker& parent, std::size_t index, const std::string& whose) {
  const Marker& child = parent.children[index];
  const std::string cell = "cell " + std::to_string(child.cell);
  if (child.cell < 0 || child.cell >= parent.code.size())
    throw std::invalid_argument(whose + ": there is no " + cell);
  if (!is_part(child))
    throw std::invalid_argument(whose + ": " + part_name(child) + " is not there");
  for (std::size_t i = 0; i < index; ++i)
    if (overlap(parent.children[i], child))
      throw std::invalid_argument(whose + ": " + (child.parts == 1 ? cell : part_name(child)) +
                                  " is taken");
  if (!parent.code.white(child.cell) && share_taken(parent, child) > kMostWhiteInBlack)
    throw std::invalid_argument(whose + ": " + cell + " is black" +
                                (child.parts == 1 ? "" : " and has too much in it"));
}

void validate_marker(const Marker& marker, int layer, Known& parents, Known& children) {
  const std::string who = name(marker, layer);
  const Code& code = marker.code;
  validate_cells(code.cells, who);
  if (code.size() < 64 && (code.bits >> code.size()) != 0)
    throw std::invalid_argument(who + ": its code has more bits than cells");
  if (marker.id < 0) throw std::invalid_argument(who + ": an id must not be negative");
  if (inner_distance(code) == 0)
    throw std::invalid_argument(who + ": its code looks the same when turned");

  Known& known = layer == 1 ? parents : children;
  if (!known.ids.insert(marker.id).second)
    throw std::invalid_argument(who + ": this id is used twice");
  const auto [other, is_new] = known.codes.emplace(canonical(code), marker.id);
  if (!is_new)
    throw std::invalid_argument(who + ": its code is that of " + std::to_string(other->second) +
                                ", perhaps turned");

  for (std::size_t i = 0; i < marker.children.size(); ++i) {
    const Marker& child = marker.children[i];
    validate_place(marker, i, name(child, layer + 1) + " in " + who);
    validate_marker(child, layer + 1, parents, children);
  }
}

}  // namespace

int MarkerSet::layers() const {
  int deepest = 0;
  for (const Parent& parent : parents) deepest = std::max(deepest, depth(parent.marker));
  return deepest;
}

std::array<Eigen::Vector2d, 4> PlacedMarker::corners_m() const {
  return {origin_m, origin_m + Eigen::Vector2d(side_m, 0.0),
          origin_m + Eigen::Vector2d(side_m, side_m), origin_m + Eigen::Vector2d(0.0, side_m)};
}

std::vector<PlacedMarker> place(const MarkerSet& markers) {
  std::vector<PlacedMarker> all;
  for (std::size_t i = 0; i < markers.parents.size(); ++i)
    place_parent(markers.parents[i], static_cast<int>(i), all);
  return all;
}

void validate(const MarkerSet& markers) {
  if (markers.parents.empty()) throw std::invalid_argument("a marker set needs a parent");
  validate_cells(markers.cells, "the set");
  for (const double width : {markers.line.inside, markers.line.outside})
    if (!(width >= 0.0 && width <= 0.25))
      throw std::invalid_argument("line width: inside and outside must be 0 … 0.25 of the side");
  Known parents;
  Known children;
  for (const Parent& parent : markers.parents) {
    if (!(parent.side_m > 0.0) || !std::isfinite(parent.side_m))
      throw std::invalid_argument(name(parent.marker, 1) +
                                  ": side_m must be a positive number of metres");
    validate_marker(parent.marker, 1, parents, children);
  }
  if (!children.ids.empty() && markers.line.inside + markers.line.outside <= 0.0)
    throw std::invalid_argument("line width: children need a line, inside or outside");
}

}  // namespace harco
