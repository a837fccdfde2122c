#include "detect/contours.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

namespace harco::detect {
namespace {

// Of a longer border every second, third ... step is measured: sides are fitted again, to the grey
// across them, once the quad is known.
constexpr std::size_t kMostPoints = 128;

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

void BorderFollower::start(const Threshold& threshold, std::size_t level) {
  threshold_ = &threshold;
  map_ = &threshold.map(level);
  level_ = level;
}

const Contour* BorderFollower::around(const RegionTop& top) {
  const Place from{top.x, top.y, top.dark ? kRight : kDown};
  // Something about convex is hardly longer around than its bounding box.
  const auto most_steps = static_cast<std::size_t>(3 * (top.columns + top.rows) + 16);
  return follow_from_top(from, most_steps) ? measure(from) : nullptr;
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
  const std::size_t apart = (length_ + kMostPoints - 1) / kMostPoints;
  contour_.points.clear();
  int x = from.x;
  int y = from.y;
  double twice = 0.0;
  Point before = Point::Zero();
  for (std::size_t i = 0; i < length_;) {
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
    contour_.points.push_back(point);
    for (const std::size_t next = std::min(i + apart, length_); i < next; ++i) {
      x += kStepX[way_[i]];
      y += kStepY[way_[i]];
    }
  }
  const Point& start = contour_.points.front();
  twice += before.x() * start.y() - start.x() * before.y();
  // Clockwise on the screen, y down, gives a positive area: dark inside bright.
  contour_.hole = twice < 0.0;
  contour_.area = 0.5 * std::abs(twice);
  return &contour_;
}

}  // namespace harco::detect
