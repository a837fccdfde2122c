#include "detect/convex_regions.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdlib>
#include <cstring>

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
  explicit Side(int at) : extreme_(at) {}
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
  bool inwards_ = false;
};

}  // namespace

void ConvexRegions::start(const Threshold& threshold, std::size_t level, bool dark,
                          const RegionLimits& limits) {
  threshold_ = &threshold;
  map_ = &threshold.map(level);
  dark_ = dark;
  known_ = level == Threshold::kLowLevel ? &threshold.map(Threshold::kMiddleLevel) : nullptr;
  limits_ = limits;
  find_tall();
  whole_tall_ = &tall_;
  // More rows than this tell hardly more.
  constexpr int kMostRows = 13;
  ways_rows_ = std::clamp(limits.least_extent - 1, 1, kMostRows);
  start_rows(0, map_->height());
}

void ConvexRegions::start(const ConvexRegions& whole, int first_row, int end_row) {
  threshold_ = whole.threshold_;
  map_ = whole.map_;
  dark_ = whole.dark_;
  known_ = whole.known_;
  limits_ = whole.limits_;
  whole_tall_ = &whole.tall_;
  ways_rows_ = whole.ways_rows_;
  start_rows(first_row, end_row);
}

void ConvexRegions::start_rows(int first_row, int end_row) {
  // What begins in the first row touches the border.
  first_row_ = std::max(1, first_row);
  starts_.clear();
  next_start_ = 0;
  ends_.resize(static_cast<std::size_t>(map_->height()));
  ways_stride_ = map_->words_in_row() + 2;
  ways_.assign(static_cast<std::size_t>(ways_rows_ * ways_stride_), 0);
  // Ways lead through the rows below.
  row_ = std::min(end_row + ways_rows_ - 1, map_->height());
  while (row_ > end_row) {
    --row_;
    find_ways_down();
  }
}

bool ConvexRegions::next(RegionTop& top) {
  for (;;) {
    while (next_start_ < starts_.size()) {
      const std::size_t i = next_start_++;
      if (survives_[i] != 0 &&
          (dark_ ? may_be_convex<true>(starts_[i], top) : may_be_convex<false>(starts_[i], top)))
        return true;
    }
    if (!find_survivors()) return false;
  }
}

/// Of the rows above, as many as give enough to be walked at the same time. False if none is left.
bool ConvexRegions::find_survivors() {
  constexpr std::size_t kEnough = 1024;
  starts_.clear();
  next_start_ = 0;
  while (starts_.size() < kEnough && --row_ >= first_row_) {
    find_ways_down();
    find_tops();
  }
  if (starts_.empty()) return false;
  const auto bytes = [](const DarkMap& map) {
    return reinterpret_cast<const std::uint8_t*>(map.origin());
  };
  survives_.resize(starts_.size());
  kernels::walk_regions({bytes(*map_), bytes(*whole_tall_), map_->bits_in_row() / 8, map_->width(),
                         map_->height(), dark_, limits_.least_extent, limits_.least_length,
                         static_cast<int>(std::ceil(limits_.least_area))},
                        starts_.data(), starts_.size(), survives_.data());
  return true;
}

void ConvexRegions::find_tall() {
  const std::uint64_t flip = dark_ ? 0 : ~std::uint64_t{0};
  tall_.resize(map_->width(), map_->height());
  for (int y = 2; y < map_->height(); ++y) {
    std::uint64_t* tall = tall_.row(y);
    for (int word = 0; word < map_->words_in_row(); ++word)
      tall[word] = (map_->row(y)[word] ^ flip) & (map_->row(y - 1)[word] ^ flip) &
                   (map_->row(y - 2)[word] ^ flip);
  }
  for (const int y : {0, 1})
    if (y < map_->height()) std::fill_n(tall_.row(y), map_->words_in_row(), 0);
}

/// From those of the row below.
void ConvexRegions::find_ways_down() {
  const std::uint64_t flip = dark_ ? 0 : ~std::uint64_t{0};
  const int words = map_->words_in_row();
  for (int rows = ways_rows_; rows > 1; --rows)
    kernels::ways_down(map_->row(row_), flip, ways(rows - 1), words, ways(rows));
  std::uint64_t* own = ways(1);
  const std::uint64_t* here = map_->row(row_);
  for (int word = 0; word < words; ++word) own[word] = here[word] ^ flip;
}

/// Appends where regions begin in this row that go on down for a while: stretches of dark below
/// nothing but bright, or of bright below nothing but dark.
void ConvexRegions::find_tops() {
  const std::uint64_t flip = dark_ ? 0 : ~std::uint64_t{0};
  const std::uint64_t* here = map_->row(row_);
  const std::uint64_t* above = map_->row(row_ - 1);
  const std::uint64_t* going_on = ways(ways_rows_);
  const int words = map_->words_in_row();
  // A sum carries a bit that is set anywhere in a stretch of edge to the bit behind the stretch:
  // once the stretch's first one, if the region begins there too, once those with a way down. What
  // leaves a word enters the next one.
  std::uint64_t carry_of_begin = 0;
  std::uint64_t carry_of_ways = 0;
  const auto behind = [](std::uint64_t stretches, std::uint64_t bits, std::uint64_t& carry) {
    const std::uint64_t sum = stretches + bits;
    const std::uint64_t total = sum + carry;
    carry = (sum < stretches ? 1U : 0U) | (total < sum ? 1U : 0U);
    return total & ~stretches;
  };
  std::uint64_t before = flip;
  for (int word = 0; word <= words; ++word) {
    const std::uint64_t inside = here[word] ^ flip;
    const std::uint64_t edge = inside & ~(above[word] ^ flip);
    const std::uint64_t begin = edge & ~(inside << 1 | before >> 63);
    before = inside;
    std::uint64_t found = behind(edge, begin, carry_of_begin) &
                          behind(edge, edge & going_on[word], carry_of_ways) & ~inside;
    for (; found != 0; found &= found - 1) {
      const int end = std::countr_zero(found);
      std::uint64_t outside = ~inside & ((std::uint64_t{1} << end) - 1);
      int at = word;
      while (outside == 0) outside = ~(here[--at] ^ flip);
      const int left = 64 * at + 64 - std::countl_zero(outside);
      const int right = 64 * word + end - 1;
      if (left > 0 && right < map_->width() - 1) starts_.push_back({left, right, row_});
    }
  }
}

/// Whether the grey changes across the upper edge as it does at the edge of ink, and not as at the
/// edge of a shadow.
bool ConvexRegions::is_sharp(const RegionTop& top) const {
  constexpr int kLongEnough = 24;  // pixels of the edge
  constexpr int kLeastShare = 8;   // of the contrast nearby
  const ImageView& image = threshold_->image();
  const std::uint8_t* here = image.row(top.y);
  const std::uint8_t* above = image.row(top.y - 1);
  const int end = std::min(image.width(), top.x + kLongEnough);
  const int least = threshold_->contrast(top.x, top.y);
  for (int x = top.x; x < end && map_->dark(x, top.y) == top.dark; ++x)
    if (kLeastShare * std::abs(here[x] - above[x]) >= least) return true;
  return false;
}

/// Goes down both sides of a region from its top.
template <bool kDark>
bool ConvexRegions::may_be_convex(const kernels::RegionStart& start, RegionTop& top) {
  top = {start.left, start.y, kDark, 0, 0};
  constexpr int kTouch = kDark ? 1 : 0;
  const auto* row = reinterpret_cast<const std::uint8_t*>(map_->origin());
  const std::ptrdiff_t stride = map_->bits_in_row() / 8;
  const int width = map_->width();
  const int height = map_->height();
  row += top.y * stride;
  int left = top.x;
  const auto* tall = reinterpret_cast<const std::uint8_t*>(whole_tall_->origin()) + top.y * stride;
  int right = start.right;
  Side left_side(-left);
  Side right_side(right);
  int least = left;
  int most = right;
  std::int64_t area = 0;
  ends_[0] = {left, right};
  int rows = 1;
  for (;; ++rows) {
    area += right - left + 1;
    row += stride;
    if (top.y + rows >= height) return false;
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
    const int tolerance = 2 + rows / 16;
    const bool left_convex = left_side.go_to(-left, tolerance);
    const bool right_convex = right_side.go_to(right, tolerance);
    if (!left_convex || !right_convex) return false;
    least = std::min(least, left);
    most = std::max(most, right);
    ends_[static_cast<std::size_t>(rows)] = {left, right};
  }
  top.rows = rows;
  top.columns = most - least + 1;
  if (std::min(top.rows, top.columns) < limits_.least_extent) return false;
  if (2 * (top.rows + top.columns) < limits_.least_length) return false;
  return is_sharp(top) && outlines_quad(area, top) && is_news(top);
}

/// Whether beside some part of the region's sides there is the third grey that made a lower level
/// necessary: bright there, dark in the middle. Otherwise that one finds the region as well.
bool ConvexRegions::is_news(const RegionTop& top) const {
  if (!known_) return true;
  int news = 0;
  for (int y = 0; y < top.rows; ++y) {
    const Ends& ends = ends_[static_cast<std::size_t>(y)];
    news += known_->dark(ends.left - 1, top.y + y) || known_->dark(ends.right + 1, top.y + y);
  }
  return 8 * news >= top.rows;
}

/// Whether a region is about the quadrilateral between the two points of its outline that are
/// farthest from one another and those farthest from the line between them, on both sides: by area,
/// and by how far the outline strays from the sides.
bool ConvexRegions::outlines_quad(std::int64_t area, const RegionTop& top) const {
  if (static_cast<double>(area) < limits_.least_area) return false;
  const int rows = top.rows;
  // Corners of pixels, x from the image's border and y from the region's top.
  const auto for_each_corner = [&](auto&& visit) {
    for (int y = 0; y < rows; ++y) {
      const Ends& ends = ends_[static_cast<std::size_t>(y)];
      visit(ends.left, y);
      visit(ends.left, y + 1);
      visit(ends.right + 1, y);
      visit(ends.right + 1, y + 1);
    }
  };
  const auto farthest_from = [&](int from_x, int from_y) {
    Corner best{from_x, from_y};
    std::int64_t most = -1;
    for_each_corner([&](int x, int y) {
      const std::int64_t dx = x - from_x;
      const std::int64_t dy = y - from_y;
      const std::int64_t squared = dx * dx + dy * dy;
      if (squared <= most) return;
      most = squared;
      best = {x, y};
    });
    return best;
  };
  const Ends& middle = ends_[static_cast<std::size_t>(rows / 2)];
  const Corner a = farthest_from((middle.left + middle.right) / 2, rows / 2);
  const Corner c = farthest_from(a.x, a.y);
  const std::int64_t dx = c.x - a.x;
  const std::int64_t dy = c.y - a.y;
  std::int64_t left = 0;
  std::int64_t right = 0;
  Corner b = a;
  Corner d = a;
  for_each_corner([&](int x, int y) {
    const std::int64_t aside = dx * (y - a.y) - dy * (x - a.x);
    if (aside > right) {
      right = aside;
      b = {x, y};
    }
    if (aside < left) {
      left = aside;
      d = {x, y};
    }
  });
  const std::int64_t quad = right - left;  // twice its area
  const std::int64_t length = 2 * (rows + top.columns);
  // Half a pixel along the way is what noise takes; blur rounds corners.
  const std::int64_t surplus = 2 * area - quad;
  if (surplus < -quad / 6 - length || surplus > quad / 8 + length / 2) return false;
  const std::array<Corner, 4> corners{a, d, c, b};
  return keeps_to(corners, rows) && is_filled_along(corners, top);
}

/// Whether the outline keeps to the sides of a quadrilateral, whose corners go around clockwise as
/// seen on the screen.
bool ConvexRegions::keeps_to(const std::array<Corner, 4>& corners, int rows) const {
  // Steps of pixels, noise and rounded corners, and what lenses bend long sides by.
  constexpr float kStray = 2.6F;
  constexpr float kBend = 0.05F;
  struct Line {
    float x, y, at;
  };
  std::array<Line, 4> outside;  // distance outwards, over what is allowed
  for (std::size_t i = 0; i < 4; ++i) {
    const Corner& from = corners[i];
    const Corner& to = corners[(i + 1) % 4];
    const auto x = static_cast<float>(to.x - from.x);
    const auto y = static_cast<float>(to.y - from.y);
    const float length = std::sqrt(x * x + y * y);
    const float scale = 1.0F / (std::max(length, 1.0F) * (kStray + kBend * length));
    outside[i] = {y * scale, -x * scale,
                  (x * static_cast<float>(from.y) - y * static_cast<float>(from.x)) * scale};
  }
  const auto beyond = [&](float x, float y) {
    float most = outside[0].x * x + outside[0].y * y + outside[0].at;
    for (std::size_t i = 1; i < 4; ++i)
      most = std::max(most, outside[i].x * x + outside[i].y * y + outside[i].at);
    return most;
  };
  float least = 0.0F;
  float most = 0.0F;
  for (int row = 0; row < rows; ++row) {
    const Ends& ends = ends_[static_cast<std::size_t>(row)];
    const float y = static_cast<float>(row) + 0.5F;
    const float left = beyond(static_cast<float>(ends.left), y);
    const float right = beyond(static_cast<float>(ends.right + 1), y);
    least = std::min(least, std::min(left, right));
    most = std::max(most, std::max(left, right));
  }
  return least >= -1.0F && most <= 1.0F;
}

/// Whether the region lies just inside the sides of a quadrilateral as above: bays from below or
/// above don't show at the ends of rows. Only of small ones: there are few others, and their sides
/// may be bent.
bool ConvexRegions::is_filled_along(const std::array<Corner, 4>& corners,
                                    const RegionTop& top) const {
  constexpr int kSmall = 64;       // pixels
  constexpr float kInside = 0.7F;  // pixels; the border of the smallest marker is hardly thicker
  constexpr int kPlaces = 7;       // a side
  constexpr int kMostMissed = 6;   // of all, and no more than
  constexpr int kMostOfASide = 3;  // of them on one side
  if (std::max(top.rows, top.columns) >= kSmall) return true;
  int all_missed = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    const Corner& from = corners[i];
    const Corner& to = corners[(i + 1) % 4];
    const auto along_x = static_cast<float>(to.x - from.x);
    const auto along_y = static_cast<float>(to.y - from.y);
    const float inwards =
        kInside / std::max(std::sqrt(along_x * along_x + along_y * along_y), 1.0F);
    const float x = static_cast<float>(from.x) - inwards * along_y;
    const float y = static_cast<float>(from.y + top.y) + inwards * along_x;
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
