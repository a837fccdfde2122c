#include "detect/contours.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>

namespace harco::detect {
namespace {

// Directions clockwise as seen on the screen (y down).
constexpr int kRight = 0;
constexpr int kDown = 1;
constexpr int kLeft = 2;
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

double signed_area(const std::vector<Point>& points) {
  double twice = 0.0;
  for (std::size_t i = 0, j = points.size() - 1; i < points.size(); j = i++)
    twice += points[j].x() * points[i].y() - points[i].x() * points[j].y();
  return 0.5 * twice;
}

/// How a way around a region bends. Around something convex it turns to one side only, but for
/// noise and lenses.
class Bends {
 public:
  static constexpr int kBlock = 8;  // steps

  Bends(int x, int y, bool clockwise)
      : across_(x, clockwise), down_(y, true), x_(x), y_(y), clockwise_(clockwise) {}

  /// Takes the next block of steps; `length` is how many there were so far.
  bool convex_so_far(const std::uint8_t* block, std::size_t length) {
    int dx = 0;
    int dy = 0;
    for (int i = 0; i < kBlock; ++i) {
      dx += kStepX[block[i]];
      dy += kStepY[block[i]];
    }
    x_ += dx;
    y_ += dy;
    const int steps = static_cast<int>(length);
    // Blocks of one straight line differ by a pixel or two.
    const int turn = (last_dx_ * dy - last_dy_ * dx) * (clockwise_ ? 1 : -1);
    hollow_ += std::max(0, -turn - kBlock);
    last_dx_ = dx;
    last_dy_ = dy;
    const int tolerance = 2 + steps / 32;
    across_.go_to(x_, tolerance);
    down_.go_to(y_, tolerance);
    return hollow_ <= 2 * kBlock + steps / 4 && across_.count() <= 2 && down_.count() <= 1;
  }

 private:
  /// One coordinate along the way: how often it has turned back.
  class Reversals {
   public:
    Reversals(int at, bool rising) : extreme_(at), rising_(rising) {}
    void go_to(int at, int tolerance) {
      const int ahead = rising_ ? at - extreme_ : extreme_ - at;
      if (ahead > 0) {
        extreme_ = at;
      } else if (ahead < -tolerance) {
        extreme_ = at;
        rising_ = !rising_;
        ++count_;
      }
    }
    int count() const { return count_; }

   private:
    int extreme_;
    bool rising_;
    int count_ = 0;
  };

  Reversals across_, down_;
  int x_, y_;
  int last_dx_ = 0, last_dy_ = 0;
  int hollow_ = 0;
  bool clockwise_;
};

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
    while (next_start_ < starts_.size()) {
      const Place from = starts_[next_start_++];
      if (follow_convex(from) && take(from)) return &contour_;
    }
    if (++row_ >= map_->height()) return nullptr;
    starts_.clear();
    next_start_ = 0;
    find_tops();
  }
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
      if (take(from)) return &contour_;
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
  auto direction = static_cast<std::size_t>(from.direction);
  Bends bends(from.x, from.y, from.direction == kRight);
  std::uint8_t* way = way_.data();
  length_ = 0;
  for (;;) {
    for (int i = 0; i < Bends::kBlock; ++i) {
      way[length_++] = static_cast<std::uint8_t>(direction);
      at += move[direction];
      if (at < start) return false;
      const unsigned around = two_bits(origin, at) | two_bits(origin, at + stride) << 2;
      direction = kTurns[direction][around];
      if (direction >= kAsk) direction = ask(direction - kAsk, at);
      // From the same corner, dark pixels above may hang on to the region.
      if (at == start) return direction == static_cast<std::size_t>(from.direction);
    }
    if (!bends.convex_so_far(way + length_ - Bends::kBlock, length_) ||
        length_ + Bends::kBlock > way_.size())
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

/// Makes a contour of the way that was gone; false if it isn't within the limits.
bool BorderFollower::take(const Place& from) {
  if (length_ < limits_.min_points) return false;
  int x = from.x;
  int y = from.y;
  int low_x = x;
  int high_x = x;
  int low_y = y;
  int high_y = y;
  for (std::size_t i = 0; i < length_; ++i) {
    x += kStepX[way_[i]];
    y += kStepY[way_[i]];
    low_x = std::min(low_x, x);
    high_x = std::max(high_x, x);
    low_y = std::min(low_y, y);
    high_y = std::max(high_y, y);
  }
  const int extent = static_cast<int>(limits_.min_extent);
  if (high_x - low_x < extent || high_y - low_y < extent) return false;
  contour_.at_image_edge =
      low_x == 0 || low_y == 0 || high_x == map_->width() || high_y == map_->height();
  if (contour_.at_image_edge && !limits_.at_image_edge) return false;

  contour_.points.resize(length_);
  Point low = Point::Constant(1e9);
  Point high = -low;
  for (std::size_t i = 0; i < length_; ++i) {
    // The pixels on the right-hand and on the left-hand side of this step.
    const std::size_t direction = way_[i];
    const int dark_x = x - (direction == kDown || direction == kLeft ? 1 : 0);
    const int dark_y = y - (direction >= kLeft ? 1 : 0);
    const int out_x = kStepY[direction];
    const int out_y = -kStepX[direction];
    const double dark = threshold_->distance(level_, dark_x, dark_y);
    const double bright = threshold_->distance(level_, dark_x + out_x, dark_y + out_y);
    const double share = dark / (dark - bright);
    contour_.points[i] = Point(dark_x + share * out_x, dark_y + share * out_y);
    low = low.cwiseMin(contour_.points[i]);
    high = high.cwiseMax(contour_.points[i]);
    x += kStepX[direction];
    y += kStepY[direction];
  }
  if ((high - low).minCoeff() < limits_.min_extent) return false;
  // Clockwise on the screen, y down, gives a positive area: dark inside bright.
  const double area = signed_area(contour_.points);
  contour_.hole = area < 0.0;
  contour_.area = std::abs(area);
  return contour_.hole ? limits_.holes : limits_.islands;
}

}  // namespace harco::detect
