#include "detect/contours.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

namespace harco::detect {
namespace {

// Directions clockwise as seen on the screen (y down).
constexpr std::size_t kRight = 0;
constexpr std::size_t kDown = 1;
constexpr std::size_t kLeft = 2;
constexpr std::array<int, 4> kStepX{1, 0, -1, 0};
constexpr std::array<int, 4> kStepY{0, 1, 0, -1};

// The four pixels around a corner, as bits.
constexpr unsigned kNorthWest = 1;
constexpr unsigned kNorthEast = 2;
constexpr unsigned kSouthWest = 4;
constexpr unsigned kSouthEast = 8;

/// The pixels on both sides of the way on, seen from a corner.
struct Ahead {
  unsigned left, right;
};
constexpr std::array<Ahead, 4> kAhead{{{kNorthEast, kSouthEast},
                                       {kSouthEast, kSouthWest},
                                       {kSouthWest, kNorthWest},
                                       {kNorthWest, kNorthEast}}};

// Added to a direction where the four pixels alone don't tell how to go on, since two dark ones
// touch at the corner.
constexpr std::size_t kAsk = 4;

/// The direction in which to go on, by the one gone so far and the dark ones of the four pixels.
constexpr auto kTurns = [] {
  std::array<std::array<std::uint8_t, 16>, 4> turns{};
  for (unsigned direction = 0; direction < 4; ++direction)
    for (unsigned around = 0; around < 16; ++around) {
      const bool left = (around & kAhead[direction].left) != 0;
      const bool right = (around & kAhead[direction].right) != 0;
      turns[direction][around] =
          static_cast<std::uint8_t>(left ? (right ? (direction + 3) % 4 : direction + kAsk)
                                         : (right ? direction : (direction + 1) % 4));
    }
  return turns;
}();

// Words of pixels are read byte by byte.
static_assert(std::endian::native == std::endian::little);

/// Two neighbouring bits, the first one `bit` bits behind `origin`.
unsigned two_bits(const std::uint8_t* origin, std::ptrdiff_t bit) {
  std::uint16_t bits = 0;
  std::memcpy(&bits, origin + (bit >> 3), sizeof bits);
  return bits >> (bit & 7) & 3U;
}

/// Those stretches of ones in `bits` of which `seeds` has some bit.
std::uint64_t fill(std::uint64_t bits, std::uint64_t seeds) {
  std::uint64_t open = bits;
  for (int step = 1; step < 64; step *= 2) {
    seeds |= open & (seeds >> step);
    open &= open >> step;
  }
  // Upwards, a sum carries through the rest of the stretch.
  return seeds | (bits & (bits ^ (bits + seeds)));
}

double signed_area(const std::vector<Point>& points) {
  double twice = 0.0;
  for (std::size_t i = 0, j = points.size() - 1; i < points.size(); j = i++)
    twice += points[j].x() * points[i].y() - points[i].x() * points[j].y();
  return 0.5 * twice;
}

}  // namespace

void BorderFollower::start(const Threshold& threshold, std::size_t level,
                           const ContourLimits& limits) {
  threshold_ = &threshold;
  map_ = &threshold.map(level);
  level_ = level;
  limits_ = limits;
  way_.resize(
      std::max(way_.size(), static_cast<std::size_t>(8 * (map_->width() + map_->height()))));
  row_ = -1;
  starts_.clear();
  next_start_ = 0;
  walks_.resize(kWalks);
  walk_count_ = next_walk_ = 0;
}

/// Appends where regions begin in this row: stretches of dark below nothing but bright, or of
/// bright below nothing but dark.
void BorderFollower::find_tops() {
  const std::uint64_t* here = map_->row(row_);
  const std::uint64_t* above = map_->row(row_ - 1);
  const int words = map_->words_in_row();
  // Sums carry a bit through every stretch of edge that starts where its region does; it comes out
  // behind the stretch. What leaves a word enters the next one.
  std::uint64_t island_carry = 0;
  std::uint64_t hole_carry = 0;
  const auto ends = [](std::uint64_t inside, std::uint64_t before, std::uint64_t edge,
                       std::uint64_t& carry) {
    const std::uint64_t begin = edge & ~(inside << 1 | before >> 63);
    const std::uint64_t sum = edge + begin;
    const std::uint64_t total = sum + carry;
    carry = (sum < edge ? 1U : 0U) | (total < sum ? 1U : 0U);
    return total & ~edge & ~inside;
  };
  // Where the stretch that ends before `bit` of a word begins.
  const auto begin_of = [](const std::uint64_t* inside, std::uint64_t flip, int word, int bit) {
    std::uint64_t outside = ~(inside[word] ^ flip) & ((std::uint64_t{1} << bit) - 1);
    while (outside == 0) outside = ~(inside[--word] ^ flip);
    return 64 * word + 64 - std::countl_zero(outside);
  };
  for (int word = 0; word <= words; ++word) {
    if (here[word] == above[word] && (island_carry | hole_carry) == 0) continue;
    if (limits_.islands)
      for (std::uint64_t left =
               ends(here[word], here[word - 1], here[word] & ~above[word], island_carry);
           left != 0; left &= left - 1)
        starts_.push_back({begin_of(here, 0, word, std::countr_zero(left)), row_, kRight});
    if (limits_.holes)
      for (std::uint64_t left =
               ends(~here[word], ~here[word - 1], above[word] & ~here[word], hole_carry);
           left != 0; left &= left - 1)
        starts_.push_back(
            {begin_of(here, ~std::uint64_t{0}, word, std::countr_zero(left)), row_, kDown});
  }
}

/// Appends every dark pixel of this row below a bright one whose upper edge wasn't followed yet;
/// some may be followed by the time that their turn comes.
void BorderFollower::find_upper_edges() {
  const std::uint64_t* here = map_->row(row_);
  const std::uint64_t* above = map_->row(row_ - 1);
  const std::uint64_t* visited = visited_.row(row_);
  for (int word = 0; word < map_->words_in_row(); ++word)
    for (std::uint64_t left = here[word] & ~above[word] & ~visited[word]; left != 0;
         left &= left - 1)
      starts_.push_back({64 * word + std::countr_zero(left), row_, kRight});
}

const Contour* BorderFollower::next_convex() {
  for (;;) {
    while (next_walk_ < walk_count_) {
      const Walk& walk = walks_[next_walk_++];
      if (walk.state == Walk::State::going) {  // too long to be followed beside others
        if (!follow_convex(walk.from)) continue;
        trace(walk.from, {way_.data(), length_});
      } else {
        if (walk.state != Walk::State::closed || walk.length < limits_.min_points) continue;
        trace(walk.from, {walk.way.data(), walk.length});
      }
      if (!within_limits() || !outlines_quad()) continue;
      if (const Contour* contour = measure()) return contour;
    }
    begin_walks();
    if (walk_count_ == 0) return nullptr;
    std::array<Walk*, kWalks> going{};
    std::size_t count = 0;
    for (std::size_t i = 0; i < walk_count_; ++i) going[count++] = &walks_[i];
    while (count > 0) {
      for (std::size_t i = 0; i < count; i += kSideBySide) {
        // Two that go the same way do no harm.
        std::array<Walk*, kSideBySide> some{};
        for (std::size_t k = 0; k < kSideBySide; ++k) some[k] = going[std::min(i + k, count - 1)];
        go_on(some);
      }
      std::size_t left = 0;
      for (std::size_t i = 0; i < count; ++i) {
        Walk& walk = *going[i];
        judge(walk);
        if (walk.state == Walk::State::going && walk.length + Bends::kBlock <= Walk::kSteps)
          going[left++] = &walk;
      }
      count = left;
    }
  }
}

/// Collects starts of walks from the next rows.
void BorderFollower::begin_walks() {
  const std::ptrdiff_t stride = map_->bits_in_row();
  walk_count_ = 0;
  next_walk_ = 0;
  while (walk_count_ < kWalks) {
    if (next_start_ == starts_.size()) {
      if (row_ + 1 >= map_->height()) return;
      ++row_;
      starts_.clear();
      next_start_ = 0;
      find_tops();
      continue;
    }
    const Place from = starts_[next_start_++];
    if (!worth_following(from)) continue;
    Walk& walk = walks_[walk_count_++];
    walk.from = from;
    walk.state = Walk::State::going;
    walk.start = walk.at = std::ptrdiff_t{from.y - 1} * stride + from.x - 1;
    walk.direction = from.direction;
    walk.bends = Bends(from.x, from.y, from.direction == kRight);
    walk.length = 0;
  }
}

/// Whether a region may be a marker's, by its first rows.
bool BorderFollower::worth_following(const Place& from) const {
  return from.y > 0 && is_sharp(from) && reaches_down(from);
}

/// Whether the grey changes across the first edge as it does at the edge of ink, and not as at
/// the edge of a shadow.
bool BorderFollower::is_sharp(const Place& from) const {
  constexpr int kLongEnough = 24;  // pixels of the edge
  constexpr int kLeastShare = 8;   // of the contrast nearby
  const ImageView& image = threshold_->image();
  const std::uint8_t* here = image.row(from.y);
  const std::uint8_t* above = image.row(from.y - 1);
  const bool dark = from.direction == kRight;
  const int end = std::min(image.width(), from.x + kLongEnough);
  const int least = threshold_->contrast(from.x, from.y);
  for (int x = from.x; x < end && map_->dark(x, from.y) == dark; ++x)
    if (kLeastShare * std::abs(here[x] - above[x]) >= least) return true;
  return false;
}

/// Whether the region goes on down for the least extent of a marker. Most of the regions in noise
/// and fine texture don't.
bool BorderFollower::reaches_down(const Place& from) const {
  const auto* origin = reinterpret_cast<const std::uint8_t*>(map_->origin());
  const std::uint64_t flip = from.direction == kRight ? 0 : ~std::uint64_t{0};
  const std::ptrdiff_t stride = map_->bits_in_row();
  // A window of 64 pixels, about in the middle of which the region begins.
  constexpr int kBefore = 28;
  std::ptrdiff_t bit = std::ptrdiff_t{from.y} * stride + std::max(from.x - kBefore, -64);
  bit &= ~std::ptrdiff_t{7};
  std::uint64_t window = 0;
  std::memcpy(&window, origin + bit / 8, sizeof window);
  window ^= flip;
  std::uint64_t region = fill(window, std::uint64_t{1} << (from.y * stride + from.x - bit));
  const int rows = std::min(static_cast<int>(limits_.min_extent), map_->height() - from.y);
  for (int row = 1; row < rows; ++row) {
    constexpr std::uint64_t kEnds = std::uint64_t{1} << 63 | 1;
    if ((region & kEnds) != 0) return true;  // it leaves the window
    bit += stride;
    std::memcpy(&window, origin + bit / 8, sizeof window);
    window ^= flip;
    region = fill(window, window & (region | region << 1 | region >> 1));
    if (region == 0) return false;
  }
  return true;
}

/// A block of steps of several walks, one step of each after the other: what one step finds decides
/// on the next, so that a single walk would mostly wait.
void BorderFollower::go_on(const std::array<Walk*, kSideBySide>& walks) {
  const auto* origin = reinterpret_cast<const std::uint8_t*>(map_->origin());
  const std::ptrdiff_t stride = map_->bits_in_row();
  const std::array<std::ptrdiff_t, 4> move{1, stride, -1, -stride};
  std::array<std::ptrdiff_t, kSideBySide> at;
  std::array<std::ptrdiff_t, kSideBySide> began;
  std::array<std::ptrdiff_t, kSideBySide> least;
  std::array<std::size_t, kSideBySide> direction;
  std::array<std::uint8_t*, kSideBySide> way;
  for (std::size_t k = 0; k < kSideBySide; ++k) {
    at[k] = began[k] = walks[k]->at;
    least[k] = std::numeric_limits<std::ptrdiff_t>::max();
    direction[k] = walks[k]->direction;
    way[k] = walks[k]->way.data() + walks[k]->length;
  }
  for (std::size_t i = 0; i < Bends::kBlock; ++i)
    for (std::size_t k = 0; k < kSideBySide; ++k) {
      way[k][i] = static_cast<std::uint8_t>(direction[k]);
      at[k] += move[direction[k]];
      least[k] = std::min(least[k], at[k]);
      const unsigned around = two_bits(origin, at[k]) | two_bits(origin, at[k] + stride) << 2;
      direction[k] = kTurns[direction[k]][around];
      if (direction[k] >= kAsk) direction[k] = ask(direction[k] - kAsk, at[k]);
    }
  for (std::size_t k = 0; k < kSideBySide; ++k) {
    // A block leads less than half a row's bits to the side.
    const std::ptrdiff_t led = at[k] - began[k];
    const std::ptrdiff_t rows = (led + stride * 16 + stride / 2) / stride - 16;
    walks[k]->dx = static_cast<int>(led - rows * stride);
    walks[k]->dy = static_cast<int>(rows);
    walks[k]->least = least[k];
    walks[k]->at = at[k];
    walks[k]->direction = direction[k];
  }
}

/// Looks at the block of steps that a walk has just gone.
void BorderFollower::judge(Walk& walk) {
  if (walk.least > walk.start) {
    walk.length += Bends::kBlock;
    if (!walk.bends.convex_so_far(walk.dx, walk.dy, walk.length))
      walk.state = Walk::State::given_up;
    return;
  }
  // It has come back to its start, or above. Once more from the block's beginning, to the step.
  const std::ptrdiff_t stride = map_->bits_in_row();
  const std::array<std::ptrdiff_t, 4> move{1, stride, -1, -stride};
  const std::uint8_t* block = walk.way.data() + walk.length;
  std::ptrdiff_t at = walk.at - walk.dy * stride - walk.dx;
  std::size_t step = 0;
  do at += move[block[step++]];
  while (at > walk.start);
  // From the same corner, dark pixels above may hang on to the region.
  const std::size_t next = step < Bends::kBlock ? block[step] : walk.direction;
  const bool closed = at == walk.start && next == walk.from.direction;
  walk.state = closed ? Walk::State::closed : Walk::State::given_up;
  walk.length += step;
}

const Contour* BorderFollower::next() {
  if (row_ < 0) {
    visited_.resize(map_->width(), map_->height());
    visited_.clear();
  }
  for (;;) {
    while (next_start_ < starts_.size()) {
      const Place from = starts_[next_start_++];
      if (visited_.dark(from.x, from.y)) continue;
      follow(from);
      if (length_ < limits_.min_points) continue;
      trace(from, {way_.data(), length_});
      if (!within_limits()) continue;
      if (const Contour* contour = measure()) return contour;
    }
    if (++row_ >= map_->height()) return nullptr;
    starts_.clear();
    next_start_ = 0;
    find_upper_edges();
  }
}

/// The direction in which to go on from a corner where two dark pixels touch; `at` is the bit of
/// the pixel on its upper left.
std::size_t BorderFollower::ask(std::size_t direction, std::ptrdiff_t at) const {
  // Bits of rows above the image count from below zero.
  const std::ptrdiff_t stride = map_->bits_in_row();
  const auto y = static_cast<int>((at + 64 + stride) / stride - 1);
  const auto x = static_cast<int>(at - y * stride);
  const int grey = threshold_->distance(level_, x, y) + threshold_->distance(level_, x + 1, y) +
                   threshold_->distance(level_, x, y + 1) +
                   threshold_->distance(level_, x + 1, y + 1);
  return (direction + (grey < 0 ? 3 : 1)) % 4;
}

/// Goes around a region from its first corner, row by row. False if it turns out not to be the
/// first, or if the region can't be convex.
bool BorderFollower::follow_convex(const Place& from) {
  const auto* origin = reinterpret_cast<const std::uint8_t*>(map_->origin());
  const std::ptrdiff_t stride = map_->bits_in_row();
  const std::array<std::ptrdiff_t, 4> move{1, stride, -1, -stride};
  const std::ptrdiff_t start = std::ptrdiff_t{from.y - 1} * stride + from.x - 1;
  std::ptrdiff_t at = start;
  std::size_t direction = from.direction;
  Bends bends(from.x, from.y, from.direction == kRight);
  std::uint8_t* way = way_.data();
  length_ = 0;
  for (;;) {
    for (std::size_t i = 0; i < Bends::kBlock; ++i) {
      way[length_++] = static_cast<std::uint8_t>(direction);
      at += move[direction];
      if (at < start) return false;
      const unsigned around = two_bits(origin, at) | two_bits(origin, at + stride) << 2;
      direction = kTurns[direction][around];
      if (direction >= kAsk) direction = ask(direction - kAsk, at);
      // From the same corner, dark pixels above may hang on to the region.
      if (at == start) return direction == from.direction;
    }
    int dx = 0;
    int dy = 0;
    for (std::size_t i = length_ - Bends::kBlock; i < length_; ++i) {
      dx += kStepX[way[i]];
      dy += kStepY[way[i]];
    }
    if (!bends.convex_so_far(dx, dy, length_) || length_ + Bends::kBlock > way_.size())
      return false;
  }
}

/// Goes around a region of any shape.
void BorderFollower::follow(const Place& from) {
  const auto* origin = reinterpret_cast<const std::uint8_t*>(map_->origin());
  const std::ptrdiff_t stride = map_->bits_in_row();
  const std::array<std::ptrdiff_t, 4> move{1, stride, -1, -stride};
  const std::ptrdiff_t start = std::ptrdiff_t{from.y - 1} * stride + from.x - 1;
  std::ptrdiff_t at = start;
  std::size_t direction = kRight;
  length_ = 0;
  do {
    // The dark pixel below is the one on the lower right of this corner.
    if (direction == kRight) visited_.set(at + stride + 1);
    if (length_ == way_.size()) way_.resize(2 * way_.size());
    way_[length_++] = static_cast<std::uint8_t>(direction);
    at += move[direction];
    const unsigned around = two_bits(origin, at) | two_bits(origin, at + stride) << 2;
    direction = kTurns[direction][around];
    if (direction >= kAsk) direction = ask(direction - kAsk, at);
  } while (at != start || direction != kRight);
}

/// Lists the corners of pixels on a way.
void BorderFollower::trace(const Place& from, std::span<const std::uint8_t> way) {
  traced_ = way;
  if (xs_.size() < way.size()) {
    xs_.resize(way.size());
    ys_.resize(way.size());
  }
  int x = from.x;
  int y = from.y;
  low_x_ = high_x_ = x;
  low_y_ = high_y_ = y;
  for (std::size_t i = 0; i < way.size(); ++i) {
    xs_[i] = x;
    ys_[i] = y;
    low_x_ = std::min(low_x_, x);
    high_x_ = std::max(high_x_, x);
    low_y_ = std::min(low_y_, y);
    high_y_ = std::max(high_y_, y);
    x += kStepX[way[i]];
    y += kStepY[way[i]];
  }
}

bool BorderFollower::within_limits() const {
  const int extent = static_cast<int>(limits_.min_extent);
  if (high_x_ - low_x_ < extent || high_y_ - low_y_ < extent) return false;
  const bool at_image_edge =
      low_x_ == 0 || low_y_ == 0 || high_x_ == map_->width() || high_y_ == map_->height();
  return limits_.at_image_edge || !at_image_edge;
}

/// Whether the area within the way is about that of the quadrilateral between the two points
/// farthest from one another and those farthest from the line between them, on both its sides.
bool BorderFollower::outlines_quad() const {
  const std::size_t n = traced_.size();
  const auto farthest_from = [&](int x, int y) {
    std::size_t best = 0;
    std::int64_t most = -1;
    for (std::size_t i = 0; i < n; ++i) {
      const std::int64_t dx = xs_[i] - x;
      const std::int64_t dy = ys_[i] - y;
      const std::int64_t squared = dx * dx + dy * dy;
      if (squared > most) {
        most = squared;
        best = i;
      }
    }
    return best;
  };
  const std::size_t a = farthest_from((low_x_ + high_x_) / 2, (low_y_ + high_y_) / 2);
  const std::size_t c = farthest_from(xs_[a], ys_[a]);
  const std::int64_t dx = xs_[c] - xs_[a];
  const std::int64_t dy = ys_[c] - ys_[a];
  std::int64_t left = 0;
  std::int64_t right = 0;
  std::int64_t twice_area = 0;
  for (std::size_t i = 0; i < n; ++i) {
    const std::int64_t aside = dx * (ys_[i] - ys_[a]) - dy * (xs_[i] - xs_[a]);
    right = std::max(right, aside);
    left = std::min(left, aside);
    twice_area += 2 * std::int64_t{kStepY[traced_[i]]} * (xs_[i] - xs_[a]);
  }
  const std::int64_t quad = right - left;
  if (static_cast<double>(quad) < 2.0 * limits_.min_area - static_cast<double>(n)) return false;
  // Half a pixel along the way is what blur and noise take or give.
  const auto tolerance = quad / 6 + static_cast<std::int64_t>(n);
  return std::abs(std::abs(twice_area) - quad) <= tolerance;
}

/// The traced way's contour, or null if it is not within the limits.
const Contour* BorderFollower::measure() {
  contour_.at_image_edge =
      low_x_ == 0 || low_y_ == 0 || high_x_ == map_->width() || high_y_ == map_->height();
  contour_.points.resize(traced_.size());
  Point low = Point::Constant(1e9);
  Point high = -low;
  for (std::size_t i = 0; i < traced_.size(); ++i) {
    // The pixels on the right-hand and on the left-hand side of this step.
    const std::size_t direction = traced_[i];
    const int dark_x = xs_[i] - (direction == kDown || direction == kLeft ? 1 : 0);
    const int dark_y = ys_[i] - (direction >= kLeft ? 1 : 0);
    const int out_x = kStepY[direction];
    const int out_y = -kStepX[direction];
    const double dark = threshold_->distance(level_, dark_x, dark_y);
    const double bright = threshold_->distance(level_, dark_x + out_x, dark_y + out_y);
    const double share = dark / (dark - bright);
    contour_.points[i] = Point(dark_x + share * out_x, dark_y + share * out_y);
    low = low.cwiseMin(contour_.points[i]);
    high = high.cwiseMax(contour_.points[i]);
  }
  if ((high - low).minCoeff() < limits_.min_extent) return nullptr;
  // Clockwise on the screen, y down, gives a positive area: dark inside bright.
  const double area = signed_area(contour_.points);
  contour_.hole = area < 0.0;
  contour_.area = std::abs(area);
  if (contour_.area < limits_.min_area) return nullptr;
  return (contour_.hole ? limits_.holes : limits_.islands) ? &contour_ : nullptr;
}

}  // namespace harco::detect
