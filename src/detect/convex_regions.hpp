// Second stage, first half: regions that may be convex, told from all others by few steps down
// their two sides.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "detect/kernels/outline.hpp"
#include "detect/kernels/region_walk.hpp"
#include "detect/threshold.hpp"

namespace harco::detect {

/// What regions have to be like to be worth following.
struct RegionLimits {
  int least_extent = 1;     ///< of the bounding box's both sides, in pixels
  int least_length = 4;     ///< of the way around it, in steps along the sides of pixels
  double least_area = 0.0;  ///< square pixels
};

/// A region by the ends of its rows, of those that are looked at.
struct Region {
  bool dark;
  int y;                      ///< of its first row
  int row_step;               ///< pixels from one row to the next
  int rows;                   ///< how many there are
  int columns;                ///< of the bounding box
  const std::int32_t* left;   ///< the first pixel of each row
  const std::int32_t* right;  ///< and the last one
  /// Of its outline, clockwise: x in the image, y from the top of the first row.
  kernels::OutlineCorners corners;
  int height() const { return rows * row_step; }
};

/// Finds the regions of a dark map that have about the shape of a quadrilateral, whatever they hold
/// inside. A region is followed row by row from its top, by its leftmost and its rightmost pixel
/// only: around something convex the one goes out to the left and back once, the other to the
/// right. So most of what texture consists of costs some rows, nothing has to be remembered of it,
/// and a row's way along a flat edge is one step. Dark pixels that touch at a corner hang together,
/// bright ones don't. What touches the image's border isn't found.
class ConvexRegions {
 public:
  /// Gets ready for the regions of one level.
  void start(const Threshold& threshold, std::size_t level, const RegionLimits& limits);

  /// Likewise for those of `whole`, which has been started and stays where it is, that begin in
  /// some rows: from first_row to before end_row. Other parts may be looked through at the same
  /// time.
  void start(const ConvexRegions& whole, int first_row, int end_row);

  const RegionLimits& limits() const { return limits_; }

  /// The next region, from the bottom of the image upwards, or null if there are no more. It stays
  /// until the next one is asked for.
  const Region* next();

 private:
  /// Of this row, where ways begin that regions may begin with.
  const std::uint64_t* good_ways() const {
    return step_ == 1 ? ways_.data() + 1 + (goals_ - 1) * ways_stride_ : broad_.data();
  }
  // So many that the one below the last is still within the map's padding.
  int rows() const { return map_->height() / step_; }
  const std::uint64_t* row_of(const DarkMap& map, int row) const { return map.row(row * step_); }
  void start_rows(int first_row, int end_row);
  void find_tall();
  void join_rows();
  void find_ways_down();
  void find_tops();
  void add_top(int left, int right);
  void add_open_top(int word);
  bool is_news() const;
  bool walk_some();
  void find_starts();
  template <bool kDark>
  bool may_be_convex(std::size_t walk);
  void take_rows(const kernels::RegionWalk& walk);
  bool outlines_quad(std::int64_t area);
  bool is_filled_along() const;

  const Threshold* threshold_ = nullptr;
  const DarkMap* map_ = nullptr;
  const DarkMap* walked_ = nullptr;  // that one, or the rows of the whole that were joined:
  DarkMap joined_;
  const DarkMap* steep_ = nullptr;  // where the edge above a region may lie
  RegionLimits limits_;
  bool dark_ = true;
  // Only every so many rows are looked at; rows below count those.
  int step_ = 1;
  const DarkMap* known_ = nullptr;  // at the low level, the map in which all others are found
  int first_row_ = 1;
  int row_ = 0;
  // Pixels of this row from which a way within the region leads down to the first, the second ...
  // goals_-th goal, one row of bits after the other, with one word of padding on either side; and
  // of the row below. Every goals_apart_-th row is a goal: so a few rows of bits tell of ways
  // through many rows, to one row more or less.
  std::vector<std::uint64_t> ways_, ways_below_;
  std::ptrdiff_t ways_stride_ = 0;
  // Where they are broad, of every second row: regions are larger there. With a word of padding.
  std::vector<std::uint64_t> broad_;
  int goals_ = 1;
  int goals_apart_ = 1;
  std::vector<std::uint64_t> top_ends_, top_open_, tops_in_;  // of this row: kernels::Tops
  std::vector<kernels::RegionStart> starts_;                  // of some rows
  // Of those, the ones from first_walk_ on are walked together, and what became of them.
  std::size_t first_walk_ = 0;
  std::size_t walk_count_ = 0;
  std::size_t next_walk_ = 0;
  std::vector<kernels::RegionWalk> walks_;
  std::vector<kernels::WalkEnd> walk_ends_;
  std::array<std::vector<std::int32_t>, 3> walked_rows_;  // kernels::WalkedRows
  Region region_{};                                       // the last one,
  std::vector<std::int32_t> left_ends_, right_ends_;      // and the ends of its rows
  DarkMap tall_;                         // where this and the two pixels above are the region's:
  const DarkMap* whole_tall_ = nullptr;  // one's own, or that of the whole
};

}  // namespace harco::detect
