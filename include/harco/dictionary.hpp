// Generating the codes of a marker set (paper, section 3.3, Eq. 9-16, Algorithm 1).
//
// Parents and children have a dictionary each (Eq. 9): D_F holds the codes of layer 1, D_C those of
// all children of all parents and layers. Codes of one dictionary keep a distance of at least tau
// to one another and to their own other turns (Eq. 11, both cases). Parents are never mistaken for
// children: their outer cells are black, those of children white. Every child of a set has a code
// of its own, so any one child tells the whole pose.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "harco/code.hpp"
#include "harco/layout.hpp"
#include "harco/marker.hpp"

namespace harco {

/// Least and greatest number of black cells of a code, both allowed.
struct BlackRange {
  int least = 0;
  int most = 0;
};

/// Children: at most 6/49 of the (n+2)² cells are black (the paper's alpha), at least one less than
/// that; few black cells keep the parent's cell white, too few are found by chance on printed
/// grids. 4 for n = 4, then 5-6, 6-7, 8-9 and 11-12 for n = 8.
BlackRange default_child_black(int cells);

/// Parents: at least n black cells and, if possible, n white ones.
BlackRange default_parent_black(int cells);

enum class DictionaryMethod {
  search,   ///< local search over all admissible codes: reaches the larger distances
  mutation  ///< Algorithm 1 of the paper, corrected where it slips
};

/// What has been reached while a dictionary is being generated.
struct DictionaryProgress {
  double share = 0.0;  ///< of the iterations or of the time allowed, whichever ends first; 0 … 1
  int parent_distance = 0;  ///< tau reached for D_F so far; 0: none yet
  int child_distance = 0;   ///< tau reached for D_C so far; 0: none yet
};

/// Called some times a second; false stops the generation, which then returns the best so far.
using DictionaryCallback = std::function<bool(const DictionaryProgress&)>;

/// What is asked of codes, and how they are searched for.
struct CodeSearch {
  /// Cells that are white in every child of every layer, beside those that hold children. Detectors
  /// that look at a parent's cell in its centre only, such as AprilTag's, read white there.
  std::vector<int> white_cells;

  std::optional<BlackRange> child_black;   ///< default_child_black(cells) unless given
  std::optional<BlackRange> parent_black;  ///< default_parent_black(cells) unless given

  /// The tau to reach, 1 … n²; generation ends when it is reached. Not given: the greatest that can
  /// be found. What was reached stands in the result.
  std::optional<int> parent_distance;
  std::optional<int> child_distance;

  DictionaryMethod method = DictionaryMethod::search;

  /// Same seed, same result, on every machine, unless the generation was cut short.
  std::uint64_t seed = 1;

  /// Scales the number of iterations, > 0. At 1, three layers take some seconds.
  double effort = 1.0;

  /// Seconds after which the best so far is returned. Only the iterations count otherwise, not the
  /// machine's speed.
  double time_limit_s = std::numeric_limits<double>::infinity();
};

/// The tree of generate_dictionary, in which all generated markers have the same n.
struct DictionaryOptions : CodeSearch {
  int cells = 5;    ///< n of every generated marker, 4 … 8
  int parents = 1;  ///< how many parents, N_1

  /// For every layer but the last, from the top: the cells of each of its markers that hold
  /// children (R_l of Eq. 10). Empty: parents only. Three layers of the paper: two times
  /// quincunx(5).
  std::vector<std::vector<int>> child_cells;

  /// Parents whose codes stand already, such as another family's; their n may be another. If any,
  /// they are taken instead of `parents` new ones, and each has children in those of
  /// child_cells[0] that are white in its code, or in its own list of given_child_cells.
  std::vector<Code> given_parents;

  /// For every given parent the white cells of it that hold children; child_cells[0] is not looked
  /// at then. Empty: see given_parents.
  std::vector<std::vector<int>> given_child_cells;
};

/// No dictionary of the size, the black cells and the fixed cells asked for has a greater tau.
struct DistanceBound {
  int distance = 0;
  std::string reason;  ///< the bound that says so, such as "inner distance" or "Johnson bound"
};

/// The codes of a marker set.
struct Dictionary {
  std::vector<Code> parents;  ///< D_F

  /// D_C layer by layer; children[0] is layer 2. Within a layer: the children of the first marker
  /// of the layer above in the order of its cells, then those of its second, and so on.
  std::vector<std::vector<Code>> children;

  std::vector<std::vector<int>> child_cells;        ///< as in the options
  std::vector<std::vector<int>> given_child_cells;  ///< as in the options

  int parent_distance = 0;                    ///< tau of D_F; of given parents, too
  int child_distance = 0;                     ///< tau of D_C; 0 without children
  std::optional<DistanceBound> parent_bound;  ///< empty for given parents
  std::optional<DistanceBound> child_bound;   ///< empty without children

  std::int64_t iterations = 0;  ///< moves of the search, or generations of Algorithm 1
  bool cut_short = false;       ///< by the time limit or the callback
};

/// Generates both dictionaries. Throws std::invalid_argument, saying what, for options outside
/// their range, fixed cells that leave too few for the black ones, more markers than there are
/// codes, or a wanted distance above its bound.
Dictionary generate_dictionary(const DictionaryOptions& options,
                               const DictionaryCallback& callback = {});

/// The tree of markers that the dictionary was made for. Parents get the ids 0, 1, 2, …; children,
/// in the order of Dictionary::children, 0, 1, 2, … over all layers. `side_m` is the side of every
/// parent's black square. Throws std::invalid_argument if the numbers of codes don't fit the tree.
MarkerSet build_markers(const Dictionary& dictionary, double side_m, const LineWidth& line = {});

/// What was reached for the codes of one kind.
struct DictionaryReached {
  bool children = false;  ///< or parents
  int cells = 5;          ///< n
  int count = 0;          ///< of codes
  int distance = 0;       ///< tau
  DistanceBound bound;
};

/// A set with codes, and how far apart they are.
struct CodedMarkers {
  MarkerSet markers;
  std::vector<DictionaryReached> dictionaries;  ///< of the parents, then of the children by their n
  bool cut_short = false;                       ///< by the time limit or the callback
};

/// Gives codes and ids to all markers of a set without codes (layout.hpp), whatever their places:
/// the cells that whole children fill are white. Markers of different n are never mistaken for one
/// another, so every n has a dictionary of its own; distances, `child_black` and `parent_black`
/// hold for each of them that can have them (child_black for children of the set's own n). Ids
/// count from 0 among the parents and, layer by layer, among the children. Throws as
/// generate_dictionary.
CodedMarkers generate_codes(MarkerSet without_codes, const CodeSearch& search,
                            const DictionaryCallback& callback = {});

/// tau of a set of codes: the least of all distances and inner distances (Eq. 11 and 12, with the
/// inner distance that Eq. 12 leaves out although its text demands it). 0 for an empty set.
int dictionary_distance(const std::vector<Code>& codes);

}  // namespace harco
