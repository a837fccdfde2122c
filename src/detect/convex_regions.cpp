#include "detect/convex_regions.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include "detect/kernels/region_tops.hpp"
#include "detect/kernels/tall_bits.hpp"
#include "detect/kernels/ways_down.hpp"

namespace harco::detect {
namespace {

// Words of pixels are read byte by byte.
static_assert(std::endian::native == std::endian::little);

/// Pixels of a row from any one on, the first one lowest; 57 at least. Ones are the region's.
constexpr int kWord = 57;
template <bool kDark>
std::uint64_t pixels_from(const std::uint8_t* row, int x) {
  std::uint64_t word = 0;
  std::memcpy(&word, row + (x >> 3), sizeof word);
  return (kDark ? word : ~word) >> (x & 7);
}

/// A region's leftmost pixel in a row where it has more than a word of pixels, or none, around `x`;
/// beyond `high` if there is none.
template <bool kDark>
[[gnu::noinline]] int far_leftmost(const std::uint8_t* row, int x, int high) {
  if ((pixels_from<kDark>(row, x) & 1) == 0) {
    for (; x <= high; x += kWord)
      if (const std::uint64_t right = pixels_from<kDark>(row, x))
        return x + std::countr_zero(right);
    return x;
  }
  while (x >= 0 && (pixels_from<kDark>(row, x) & 1) != 0) --x;
  return x + 1;
}

/// Likewise its rightmost pixel; before `low` if there is none.
template <bool kDark>
[[gnu::noinline]] int far_rightmost(const std::uint8_t* row, int x, int low, int width) {
  if ((pixels_from<kDark>(row, x) & 1) == 0) {
    while (x >= low && (pixels_from<kDark>(row, x) & 1) == 0) --x;
    return x;
  }
  for (;;) {
    const int ones = std::countr_one(pixels_from<kDark>(row, x));
    if (ones < kWord || x >= width) return x + ones - 1;
    x += kWord;
  }
}

// Where `x` lies in the word that is looked at around it.
constexpr int kMiddle = 28;

/// One end of a region in a row.
struct End {
  int x;
  bool from_above;  ///< going outwards, it has met what comes down from farther above
};

/// The leftmost pixel of the region in a row, given that it touches those from `low` to `high` in
/// the row above; beyond `high` if there is none.
template <bool kDark>
End leftmost(const std::uint8_t* row, const std::uint8_t* tall_above, int low, int high) {
  const int first = low - kMiddle;
  const std::uint64_t around = pixels_from<kDark>(row, first);
  const int ones = std::countl_one(around << (63 - kMiddle));  // up to `low`
  const int zeros = std::countr_zero(around >> kMiddle);       // from `low` on
  // The pixel next to the last end may hang on to it.
  const std::uint64_t tall = pixels_from<true>(tall_above, first) << (63 - kMiddle + 2);
  const bool from_above = ones > 2 && std::countl_zero(tall) < ones - 2;
  if (ones > kMiddle || zeros > kMiddle) return {far_leftmost<kDark>(row, low, high), from_above};
  return {low + zeros - (ones > 0 ? ones - 1 : 0), from_above};
}

/// Likewise the rightmost one; before `low` if there is none.
template <bool kDark>
End rightmost(const std::uint8_t* row, const std::uint8_t* tall_above, int low, int high,
              int width) {
  const int first = high - kMiddle;
  const std::uint64_t around = pixels_from<kDark>(row, first);
  const int ones = std::countr_one(around >> kMiddle);
  const int zeros = std::countl_zero(around << (63 - kMiddle));
  const std::uint64_t tall = pixels_from<true>(tall_above, first) >> (kMiddle + 2);
  const bool from_above = ones > 2 && std::countr_zero(tall) < ones - 2;
  if (ones > kMiddle || zeros > kMiddle)
    return {far_rightmost<kDark>(row, high, low, width), from_above};
  return {high - zeros + (ones > 0 ? ones - 1 : 0), from_above};
}

/// One side of a region on its way down: whether it has turned back, and whether it does so again.
class Side {
 public:
  Side(int extreme, bool inwards) : extreme_(extreme), inwards_(inwards) {}
  /// `at` counts outwards. False if it goes out again after it has come in.
  bool go_to(int at, int tolerance) {
    if (!inwards_) {
      if (at >= extreme_)
        extreme_ = at;
      else if (at < extreme_ - tolerance) {
        inwards_ = true;
        extreme_ = at;
      }
      return true;
    }
    if (at < extreme_) extreme_ = at;
    return at <= extreme_ + tolerance;
  }

 private:
  int extreme_;
  bool inwards_;
};

/// How far an outline may lie beside the sides between some corners.
kernels::OutlineSlack slack_of(const kernels::OutlineCorners& corners) {
  // Steps of pixels, noise and rounded corners, and what lenses bend long sides by.
  constexpr float kStray = 2.6F;
  constexpr float kBend = 0.05F;
  kernels::OutlineSlack slack;
  for (std::size_t i = 0; i < 4; ++i) {
    const auto x = static_cast<float>(corners[(i + 1) % 4].x - corners[i].x);
    const auto y = static_cast<float>(corners[(i + 1) % 4].y - corners[i].y);
    const float length = std::sqrt(x * x + y * y);
    slack[i] = static_cast<std::int32_t>(2.0F * std::max(length, 1.0F) * (kStray + kBend * length));
  }
  return slack;
}

}  // namespace

void ConvexRegions::start(const Threshold& threshold, std::size_t level,
                          const RegionLimits& limits) {
  threshold_ = &threshold;
  map_ = &threshold.map(level);
  steep_ = &threshold.upper_edges(level);
  dark_ = Threshold::kLevels[level].dark;
  step_ = Threshold::kLevels[level].row_step;
  known_ = level == Threshold::kLowLevel ? &threshold.map(Threshold::kMiddleLevel) : nullptr;
  limits_ = limits;
  find_tall();
  whole_tall_ = &tall_;
  walked_ = map_;
  if (step_ > 1) {
    join_rows();
    walked_ = &joined_;
  }
  // More pixels than this tell hardly more.
  constexpr int kMostDown = 12;
  constexpr int kGoalsApart = 2;
  const int steps = std::clamp(limits.least_extent - 2, 0, kMostDown) / step_;
  // To the last goal it is no more steps than that from any row.
  goals_apart_ = std::min(steps + 1, kGoalsApart);
  goals_ = (steps - goals_apart_ + 1) / goals_apart_ + 1;
  start_rows(0, rows());
}

void ConvexRegions::start(const ConvexRegions& whole, int first_row, int end_row) {
  threshold_ = whole.threshold_;
  map_ = whole.map_;
  steep_ = whole.steep_;
  dark_ = whole.dark_;
  step_ = whole.step_;
  known_ = whole.known_;
  limits_ = whole.limits_;
  whole_tall_ = &whole.tall_;
  walked_ = whole.walked_;
  goals_ = whole.goals_;
  goals_apart_ = whole.goals_apart_;
  const auto row = [&](int y) { return std::min((y + step_ - 1) / step_, rows()); };
  start_rows(row(first_row), row(end_row));
}

void ConvexRegions::start_rows(int first_row, int end_row) {
  // What begins in the first row touches the border.
  first_row_ = std::max(1, first_row);
  starts_.clear();
  first_walk_ = next_walk_ = walk_count_ = 0;
  constexpr std::size_t kRead = 64;  // beyond the last, by kernels
  for (auto* ends : {&left_ends_, &right_ends_})
    ends->resize(static_cast<std::size_t>(rows()) + kRead);
  const int words = map_->words_in_row();
  for (auto* tops : {&top_ends_, &top_open_}) tops->resize(static_cast<std::size_t>(words));
  tops_in_.resize(static_cast<std::size_t>(words + 63) / 64);
  broad_.resize(static_cast<std::size_t>(words) + 1);
  ways_stride_ = words + 2;
  for (auto* ways : {&ways_, &ways_below_})
    ways->assign(static_cast<std::size_t>(goals_ * ways_stride_), 0);
  // Ways lead through the rows below.
  row_ = std::min(end_row + goals_ * goals_apart_, rows());
  while (row_ > end_row) {
    --row_;
    find_ways_down();
  }
}

const Region* ConvexRegions::next() {
  for (;;) {
    while (next_walk_ < walk_count_) {
      const std::size_t walk = next_walk_++;
      if (walk_ends_[walk] != kernels::WalkEnd::given_up &&
          (dark_ ? may_be_convex<true>(walk) : may_be_convex<false>(walk)))
        return &region_;
    }
    if (!walk_some()) return nullptr;
  }
}

/// Walks the next regions together, as far as that goes. False if there are none left.
bool ConvexRegions::walk_some() {
  first_walk_ += walk_count_;
  next_walk_ = walk_count_ = 0;
  if (first_walk_ == starts_.size()) find_starts();
  if (starts_.empty()) return false;
  walk_count_ = std::min(starts_.size() - first_walk_, kernels::kWalkTogether);
  walks_.resize(kernels::kWalkTogether);
  walk_ends_.resize(kernels::kWalkTogether);
  for (auto& listed : walked_rows_) listed.resize(kernels::kWalkRoom);
  const auto bytes = [](const DarkMap& map) {
    return reinterpret_cast<const std::uint8_t*>(map.origin());
  };
  kernels::walk_regions(
      {bytes(*walked_), bytes(*whole_tall_), step_ * map_->bits_in_row() / 8, map_->width(), rows(),
       step_, dark_, limits_.least_extent, limits_.least_length,
       static_cast<int>(std::ceil(limits_.least_area / step_))},
      starts_.data() + first_walk_, walk_count_,
      {walked_rows_[0].data(), walked_rows_[1].data(), walked_rows_[2].data()}, walks_.data(),
      walk_ends_.data());
  return true;
}

/// Of as many of the rows above as give enough to be walked at the same time; none if there are no
/// more rows.
void ConvexRegions::find_starts() {
  starts_.clear();
  first_walk_ = 0;
  while (starts_.size() < kernels::kWalkTogether && --row_ >= first_row_) {
    find_ways_down();
    find_tops();
  }
}

void ConvexRegions::find_tall() {
  const std::uint64_t flip = dark_ ? 0 : ~std::uint64_t{0};
  const int words = map_->words_in_row();
  tall_.resize(map_->width(), map_->height());
  for (int row = 0; row < rows(); ++row) {
    std::uint64_t* tall = tall_.row(row * step_);
    const int top = row - 2 / step_;
    if (top >= 0)
      kernels::tall_bits(row_of(*map_, row), row_of(*map_, row - 1), row_of(*map_, top), flip,
                         words, tall);
    else
      std::fill_n(tall, words, 0);
  }
}

/// Of every second row, the dark pixels that hang together with dark ones of the row above: what
/// lies behind a bright gap of one row doesn't belong to what is walked down.
void ConvexRegions::join_rows() {
  joined_.resize(map_->width(), map_->height());
  const std::ptrdiff_t stride = joined_.bits_in_row() / 64;
  for (int row = 0; row < rows(); ++row) {
    const int y = row * step_;
    // Ways that lead upwards here; those through one row only go to a row that isn't looked at.
    kernels::ways_down(
        {map_->row(y), 0, map_->words_in_row(), 2, true, 1, map_->row(y - 1), stride},
        joined_.row(y - 1));
  }
}

/// From those of the row below.
void ConvexRegions::find_ways_down() {
  ways_.swap(ways_below_);
  // Pixels beside, for a row down: what a square seen at 60 degrees takes; of every second row,
  // where regions are larger and lead down by other ways as well, at 48.
  const int reach = step_ == 1 ? 2 : 3;
  kernels::ways_down(
      {row_of(*map_, row_), dark_ ? 0 : ~std::uint64_t{0}, map_->words_in_row(), goals_,
       row_ % goals_apart_ == 0, reach, ways_below_.data() + 1, ways_stride_},
      ways_.data() + 1, step_ == 1 ? nullptr : broad_.data());
}

/// Appends where regions begin in this row that go on down for a while: stretches of dark below
/// nothing but something much brighter, or the other way round.
void ConvexRegions::find_tops() {
  const std::uint64_t flip = dark_ ? 0 : ~std::uint64_t{0};
  const std::uint64_t* here = row_of(*map_, row_);
  kernels::region_tops({here, row_of(*map_, row_ - 1), flip, row_of(*steep_, row_), good_ways(),
                        map_->words_in_row()},
                       {top_ends_.data(), top_open_.data(), tops_in_.data()});
  for (std::size_t block = 0; block < tops_in_.size(); ++block)
    for (std::uint64_t some = tops_in_[block]; some != 0; some &= some - 1) {
      const std::size_t word = 64 * block + static_cast<std::size_t>(std::countr_zero(some));
      const int first = 64 * static_cast<int>(word);
      for (std::uint64_t ends = top_ends_[word]; ends != 0; ends &= ends - 1) {
        const int end = std::countr_zero(ends);
        const std::uint64_t outside = ~(here[word] ^ flip) & ((std::uint64_t{1} << end) - 1);
        add_top(first + 64 - std::countl_zero(outside), first + end - 1);
      }
      if (top_open_[word] != 0) add_open_top(static_cast<int>(word));
    }
}

void ConvexRegions::add_top(int left, int right) {
  if (left > 0 && right < map_->width() - 1) starts_.push_back({left, right, row_});
}

/// Likewise the stretch that begins in a word and reaches its end.
void ConvexRegions::add_open_top(int word) {
  const std::uint64_t flip = dark_ ? 0 : ~std::uint64_t{0};
  const std::uint64_t* here = row_of(*map_, row_);
  const std::uint64_t* above = row_of(*map_, row_ - 1);
  const std::uint64_t* steep = row_of(*steep_, row_);
  const int left = 64 * word + 64 - std::countl_one(here[word] ^ flip);
  std::uint64_t stretch = ~std::uint64_t{0} << (left % 64);
  std::uint64_t good = 0;
  for (;;) {
    if (((above[word] ^ flip) & stretch) != 0) return;
    good |= steep[word] & good_ways()[word] & stretch;
    if (stretch >> 63 == 0 || ++word == map_->words_in_row()) break;
    const int ones = std::countr_one(here[word] ^ flip);
    stretch = ones == 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << ones) - 1;
  }
  if (good != 0) add_top(left, 64 * word + 63 - std::countl_zero(stretch));
}

/// The ends of a region's rows that were walked.
void ConvexRegions::take_rows(const kernels::RegionWalk& walk) {
  auto listed = static_cast<std::size_t>(walk.last_row);
  for (auto row = static_cast<std::size_t>(walk.rows); row-- > 0;) {
    left_ends_[row] = walked_rows_[0][listed];
    right_ends_[row] = walked_rows_[1][listed];
    if (row > 0) listed = static_cast<std::size_t>(walked_rows_[2][listed]);
  }
}

/// Whether the region that was walked ends like something convex, and has about the shape of a
/// quadrilateral. Where it isn't known yet, goes on down both sides.
template <bool kDark>
bool ConvexRegions::may_be_convex(std::size_t walk) {
  const kernels::RegionStart& start = starts_[first_walk_ + walk];
  const kernels::RegionWalk& so_far = walks_[walk];
  take_rows(so_far);
  int rows = so_far.rows;
  int least = so_far.least;
  int most = so_far.most;
  std::int64_t area = so_far.area;
  if (walk_ends_[walk] == kernels::WalkEnd::open) {
    constexpr int kTouch = kDark ? 1 : 0;
    const auto bytes = [&](const DarkMap& map) {
      return reinterpret_cast<const std::uint8_t*>(row_of(map, start.y + rows - 1));
    };
    const std::uint8_t* row = bytes(*walked_);
    const std::uint8_t* tall = bytes(*whole_tall_);
    const std::ptrdiff_t stride = step_ * map_->bits_in_row() / 8;
    const int width = map_->width();
    const int most_rows = this->rows() - start.y;
    int left = left_ends_[static_cast<std::size_t>(rows - 1)];
    int right = right_ends_[static_cast<std::size_t>(rows - 1)];
    Side left_side(so_far.left_extreme, so_far.left_inwards);
    Side right_side(so_far.right_extreme, so_far.right_inwards);
    for (;; ++rows) {
      row += stride;
      if (rows >= most_rows) return false;
      const int low = left - kTouch;
      const int high = right + kTouch;
      const End left_end = leftmost<kDark>(row, tall, low, high);
      const End right_end = rightmost<kDark>(row, tall, low, high, width);
      tall += stride;
      left = left_end.x;
      if (left > high) break;
      right = right_end.x;
      if (left_end.from_above || right_end.from_above) return false;
      if (left <= 0 || right >= width - 1) return false;
      const int tolerance = kernels::walk_tolerance(rows * step_);
      const bool left_convex = left_side.go_to(-left, tolerance);
      const bool right_convex = right_side.go_to(right, tolerance);
      if (!left_convex || !right_convex) return false;
      least = std::min(least, left);
      most = std::max(most, right);
      area += right - left + 1;
      left_ends_[static_cast<std::size_t>(rows)] = left;
      right_ends_[static_cast<std::size_t>(rows)] = right;
    }
  }
  region_ = {
      kDark, start.y * step_, step_, rows, most - least + 1, left_ends_.data(), right_ends_.data(),
      {}};
  if (std::min(region_.height(), region_.columns) < limits_.least_extent) return false;
  if (2 * (region_.height() + region_.columns) < limits_.least_length) return false;
  return outlines_quad(step_ * area) && is_news();
}

/// Whether beside some part of the region's sides there is the third grey that made a lower level
/// necessary: bright there, dark in the middle. Otherwise that one finds the region as well.
bool ConvexRegions::is_news() const {
  if (!known_) return true;
  int news = 0;
  for (int row = 0; row < region_.rows; ++row) {
    const int y = region_.y + row * step_;
    news += known_->dark(region_.left[row] - 1, y) || known_->dark(region_.right[row] + 1, y);
  }
  return 8 * news >= region_.rows;
}

/// Whether a region is about the quadrilateral between the two points of its outline that are
/// farthest from one another and those farthest from the line between them, on both sides: by area,
/// and by how far the outline strays from the sides.
bool ConvexRegions::outlines_quad(std::int64_t area) {
  if (static_cast<double>(area) < limits_.least_area) return false;
  const kernels::Outline outline{region_.left, region_.right, region_.rows, step_, region_.columns};
  const kernels::OutlineCorners& corners = region_.corners = kernels::outline_corners(outline);
  const auto cross = [&](std::size_t i, std::size_t k) {
    return std::int64_t{corners[i].x - corners[0].x} * (corners[k].y - corners[0].y) -
           std::int64_t{corners[i].y - corners[0].y} * (corners[k].x - corners[0].x);
  };
  const std::int64_t quad = cross(1, 2) + cross(2, 3);  // twice its area
  const std::int64_t length = 2 * (region_.height() + region_.columns);
  // Half a pixel along the way is what noise takes; blur rounds corners.
  const std::int64_t surplus = 2 * area - quad;
  if (surplus < -quad / 6 - length || surplus > quad / 8 + length / 2) return false;
  return kernels::outline_keeps_to(outline, corners, slack_of(corners)) && is_filled_along();
}

/// Whether the region lies just inside the sides of a quadrilateral as above: bays from below or
/// above don't show at the ends of rows. Only of small ones: there are few others, and their sides
/// may be bent.
bool ConvexRegions::is_filled_along() const {
  const kernels::OutlineCorners& corners = region_.corners;
  constexpr int kSmall = 64;       // pixels
  constexpr float kInside = 0.7F;  // pixels; the border of the smallest marker is hardly thicker
  constexpr int kPlaces = 7;       // a side
  constexpr int kMostMissed = 6;   // of all, and no more than
  constexpr int kMostOfASide = 3;  // of them on one side
  if (std::max(region_.height(), region_.columns) >= kSmall) return true;
  int all_missed = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    const kernels::OutlineCorner& from = corners[i];
    const kernels::OutlineCorner& to = corners[(i + 1) % 4];
    const auto along_x = static_cast<float>(to.x - from.x);
    const auto along_y = static_cast<float>(to.y - from.y);
    const float inwards =
        kInside / std::max(std::sqrt(along_x * along_x + along_y * along_y), 1.0F);
    const float x = static_cast<float>(from.x) - inwards * along_y;
    const float y = static_cast<float>(from.y + region_.y) + inwards * along_x;
    int missed = 0;
    for (int place = 1; place <= kPlaces; ++place) {
      const float share = static_cast<float>(place) / (kPlaces + 1);
      const int column = static_cast<int>(x + share * along_x);
      const int row = static_cast<int>(y + share * along_y);
      missed += map_->dark(column, row) != dark_ ? 1 : 0;
    }
    if (missed > kMostOfASide) return false;
    all_missed += missed;
  }
  return all_missed <= kMostMissed;
}

}  // namespace harco::detect
