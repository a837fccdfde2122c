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
constexpr std::array<int, 4> kStepX{1, 0, -1, 0};
constexpr std::array<int, 4> kStepY{0, 1, 0, -1};
// From a corner, the pixel on the right-hand side of the way.
constexpr std::array<int, 4> kDarkX{0, -1, -1, 0};
constexpr std::array<int, 4> kDarkY{0, 0, -1, -1};

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

}  // namespace

void BorderFollower::start(const Threshold& threshold, std::size_t level,
                           std::size_t least_length) {
  threshold_ = &threshold;
  map_ = &threshold.map(level);
  level_ = level;
  least_length_ = least_length;
  way_.resize(std::max<std::size_t>(way_.size(), 1024));
  row_ = -1;
  starts_.clear();
  next_start_ = 0;
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

const Contour* BorderFollower::around(const RegionTop& top) {
  const Place from{top.x, top.y, top.dark ? kRight : kDown};
  // Something about convex is hardly longer around than its bounding box.
  const auto most_steps = static_cast<std::size_t>(3 * (top.columns + top.rows) + 16);
  if (!follow_from_top(from, most_steps) || length_ < least_length_) return nullptr;
  return measure(from);
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
      if (length_ < least_length_) continue;
      return measure(from);
    }
    if (++row_ >= map_->height()) return nullptr;
    starts_.clear();
    next_start_ = 0;
    find_upper_edges();
  }
}

/// What going on takes of a map.
struct BorderFollower::Ground {
  explicit Ground(const DarkMap& map)
      : bits(reinterpret_cast<const std::uint8_t*>(map.origin())),
        stride(map.bits_in_row()),
        move{1, stride, -1, -stride} {}
  const std::uint8_t* bits;
  std::ptrdiff_t stride;
  std::array<std::ptrdiff_t, 4> move;
};

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

/// Goes around a region of any shape.
void BorderFollower::follow(const Place& from) {
  const Ground ground(*map_);
  const Step first = first_step(from);
  Step step = first;
  length_ = 0;
  do {
    // The dark pixel below is the one on the lower right of this corner.
    if (step.direction == kRight) visited_.set(step.at + map_->bits_in_row() + 1);
    if (length_ == way_.size()) way_.resize(2 * way_.size());
    way_[length_++] = static_cast<std::uint8_t>(step.direction);
    go_on(ground, step);
  } while (step != first);
}

/// Goes around a region from its first corner, row by row. False if it turns out not to be the
/// first, or if it takes more steps.
bool BorderFollower::follow_from_top(const Place& from, std::size_t most_steps) {
  const Ground ground(*map_);
  const Step first = first_step(from);
  Step step = first;
  way_.resize(std::max(way_.size(), most_steps));
  length_ = 0;
  do {
    if (length_ == most_steps) return false;
    way_[length_++] = static_cast<std::uint8_t>(step.direction);
    go_on(ground, step);
    if (step.at < first.at) return false;
  } while (step != first);
  return true;
}

BorderFollower::Step BorderFollower::first_step(const Place& from) const {
  return {std::ptrdiff_t{from.y - 1} * map_->bits_in_row() + from.x - 1, from.direction};
}

inline void BorderFollower::go_on(const Ground& ground, Step& step) const {
  step.at += ground.move[step.direction];
  const unsigned around =
      two_bits(ground.bits, step.at) | two_bits(ground.bits, step.at + ground.stride) << 2;
  step.direction = kTurns[step.direction][around];
  if (step.direction >= kAsk) step.direction = ask(step.direction - kAsk, step.at);
}

/// The contour along the way from `from` on.
const Contour* BorderFollower::measure(const Place& from) {
  contour_.points.resize(length_);
  int x = from.x;
  int y = from.y;
  int low_x = x, high_x = x;
  int low_y = y, high_y = y;
  double twice = 0.0;
  Point before = Point::Zero();
  for (std::size_t i = 0; i < length_; ++i) {
    // The pixels on the right-hand and on the left-hand side of this step.
    const std::size_t direction = way_[i];
    const int dark_x = x + kDarkX[direction];
    const int dark_y = y + kDarkY[direction];
    const int out_x = kStepY[direction];
    const int out_y = -kStepX[direction];
    const int dark = threshold_->distance_inside(level_, dark_x, dark_y);
    const int bright = threshold_->distance(level_, dark_x + out_x, dark_y + out_y);
    const double share = static_cast<double>(dark) / static_cast<double>(dark - bright);
    const Point point(dark_x + share * out_x, dark_y + share * out_y);
    twice += before.x() * point.y() - point.x() * before.y();
    before = point;
    contour_.points[i] = point;
    low_x = std::min(low_x, x);
    high_x = std::max(high_x, x);
    low_y = std::min(low_y, y);
    high_y = std::max(high_y, y);
    x += kStepX[direction];
    y += kStepY[direction];
  }
  const Point& start = contour_.points.front();
  twice += before.x() * start.y() - start.x() * before.y();
  contour_.at_image_edge =
      low_x == 0 || low_y == 0 || high_x == map_->width() || high_y == map_->height();
  // Clockwise on the screen, y down, gives a positive area: dark inside bright.
  contour_.hole = twice < 0.0;
  contour_.area = 0.5 * std::abs(twice);
  return &contour_;
}

}  // namespace harco::detect
