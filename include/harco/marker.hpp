// What a HArCo marker is: a tree of square codes, each child filling one white cell of its parent,
// or a part of a cell of any colour, and the file that describes it (markers.json).
//
// Lengths inside a marker are metres in the marker frame: origin at the top-left corner of the
// layer-1 black square, x right, y down, z = x cross y into the plane.
#pragma once

#include <array>
#include <filesystem>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "harco/code.hpp"

namespace harco {

/// The black line around a child, as shares of that child's side: how far it reaches into the
/// child's own square and how far out of it. The paper's delta / C is `inside` = `outside`.
struct LineWidth {
  double inside = 0.0;
  double outside = 1.0 / 14.0;
};

/// The paper's line: 1/32 of the child's side on both sides of the border (section 3.2.2).
inline constexpr LineWidth kPaperLine{1.0 / 32.0, 1.0 / 32.0};

/// One marker and everything that it holds.
struct Marker {
  int id = 0;
  int cell = -1;  ///< the parent's inner cell that this one fills (row-first); -1 on layer 1
  Code code;
  std::vector<Marker> children;

  /// A child may be smaller than its cell: divided into parts x parts squares, the cell gives it
  /// the one of index `part` (row-first). Such a child may stand in a black cell, too, as a white
  /// square.
  int parts = 1;
  int part = 0;
};

/// A layer-1 marker with the one length that gives all others.
struct Parent {
  double side_m = 0.0;  ///< side of the black square
  Marker marker;
};

/// The most layers of a set.
inline constexpr int kMostLayers = 8;

/// The most squares along a cell's side that it may be divided into.
inline constexpr int kMostParts = 32;

/// All that one detector looks for: the content of markers.json.
struct MarkerSet {
  int cells = 5;  ///< n of markers that don't say otherwise
  LineWidth line;
  std::vector<Parent> parents;

  /// Number of layers of the deepest parent; 1 means no children.
  int layers() const;
};

/// One marker of the tree at its place in its parent's plane.
struct PlacedMarker {
  int parent_index = 0;  ///< index into MarkerSet::parents
  int layer = 1;
  int id = 0;
  int container =
      -1;         ///< index, in the same list, of the marker whose cell it fills; -1 on layer 1
  int cell = -1;  ///< that cell
  int parts = 1;  ///< into so many parts along its sides the cell is divided
  Code code;
  Eigen::Vector2d origin_m = Eigen::Vector2d::Zero();  ///< its top-left corner
  double side_m = 0.0;  ///< side of its full square (the cell, or part of a cell, that it fills)
  Eigen::Vector2d grid_position = Eigen::Vector2d::Zero();  ///< section 3.3.4, in last-layer sides

  /// Side of one of its (n+2) x (n+2) cells.
  double cell_side_m() const { return side_m / (code.cells + 2); }
  /// Corners of the full square: top-left, top-right, bottom-right, bottom-left.
  std::array<Eigen::Vector2d, 4> corners_m() const;
};

/// Every marker of every parent with its place, parents in order, each followed by its
/// descendants layer by layer. Throws std::invalid_argument for a child in a cell or a part of one
/// that is not there or a side that is not positive and finite; the other rules are validate's.
std::vector<PlacedMarker> place(const MarkerSet& markers);

/// Throws std::invalid_argument, naming the marker, if the set breaks a rule: no parents, a side
/// that is not positive and finite, a child in a cell that is taken or not there, or black and
/// filled by more than a quarter, an id used twice among parents or among children, two markers
/// whose codes can't be told apart, a line width outside [0, 0.25], no line though there are
/// children, n outside 3 … 8.
void validate(const MarkerSet& markers);

/// Reads markers.json. Fields that it doesn't know are ignored. Throws Error if the file can't be
/// read, is no JSON, is of another format or version, or describes an impossible set.
MarkerSet load_markers(const std::filesystem::path& file);

/// The text of markers.json and back, for callers that keep it elsewhere than in a file.
/// parse_markers throws Error; `name` stands in its message in place of a file's name.
std::string format_markers(const MarkerSet& markers);
MarkerSet parse_markers(const std::string& json, const std::string& name = "markers");

/// Writes markers.json; the file appears whole or not at all. Throws Error.
void save_markers(const MarkerSet& markers, const std::filesystem::path& file);

}  // namespace harco
