// Second stage: the borders between dark and bright, to a part of a pixel.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "detect/threshold.hpp"

namespace harco::detect {

using Point = Eigen::Vector2d;

/// A closed border, in pixels.
struct Contour {
  std::vector<Point> points;   ///< one for every pair of a dark and a bright pixel that it parts
  double area = 0.0;           ///< square pixels, positive
  bool hole = false;           ///< bright inside dark; otherwise dark inside bright
  bool at_image_edge = false;  ///< part of it is only where the image ends
};

/// How a way around a region bends. Around something convex it turns to one side only, but for
/// noise and lenses.
class Bends {
 public:
  static constexpr std::size_t kBlock = 8;  // steps

  Bends() = default;
  Bends(int x, int y, bool clockwise)
      : across_(x, clockwise), down_(y, true), x_(x), y_(y), clockwise_(clockwise) {}

  /// The next block of steps has led by (dx, dy); `length` is how many there were so far.
  bool convex_so_far(int dx, int dy, std::size_t length) {
    x_ += dx;
    y_ += dy;
    constexpr int kSize = kBlock;
    constexpr int kHollow = 16;  // square pixels
    const int steps = static_cast<int>(length);
    // Blocks of one straight line differ by a pixel or two.
    const int turn = (last_dx_ * dy - last_dy_ * dx) * (clockwise_ ? 1 : -1);
    hollow_ += std::max(0, -turn - kSize);
    last_dx_ = dx;
    last_dy_ = dy;
    const int tolerance = 2 + steps / 32;
    across_.go_to(x_, tolerance);
    down_.go_to(y_, tolerance);
    return hollow_ <= kHollow + steps / 4 && across_.count() <= 2 && down_.count() <= 1;
  }

 private:
  /// One coordinate along the way: how often it has turned back.
  class Reversals {
   public:
    Reversals() = default;
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
    int extreme_ = 0;
    bool rising_ = false;
    int count_ = 0;
  };

  Reversals across_, down_;
  int x_ = 0, y_ = 0;
  int last_dx_ = 0, last_dy_ = 0;
  int hollow_ = 0;
  bool clockwise_ = true;
};

/// Contours that are not worth their time.
struct ContourLimits {
  std::size_t min_points = 4;
  double min_extent = 0.0;     ///< of the bounding box's both sides, in pixels
  double min_area = 0.0;       ///< square pixels
  bool holes = true;           ///< take bright regions inside dark
  bool islands = true;         ///< take dark regions inside bright
  bool at_image_edge = false;  ///< take what the image's edge cuts off
};

/// Follows borders of a dark map along the pixels' edges. Dark pixels that touch at a corner hang
/// together if the grey between them is dark.
class BorderFollower {
 public:
  /// Gets ready for next_convex() or next().
  void start(const Threshold& threshold, std::size_t level, const ContourLimits& limits);

  /// The next contour within the limits that may belong to a convex shape that lies within the
  /// image, or null: one that has about the area of the quadrilateral between its outermost
  /// points. A contour is followed from where its region begins as seen from above, and given up
  /// where it turns as none does that runs around something convex. So most of what texture
  /// consists of costs some steps only, and nothing has to be remembered of it.
  const Contour* next_convex();

  /// The next contour within the limits of any shape, or null.
  const Contour* next();

 private:
  /// A corner of pixels, the one between (x-1, y-1) and (x, y), and the way on from there: the
  /// pixel on the right-hand side is dark, the one on the left-hand side is bright.
  struct Place {
    int x, y;
    std::size_t direction;
  };

  /// A way around a region that may be convex, as far as it was gone.
  struct Walk {
    enum class State { going, closed, given_up };
    static constexpr std::size_t kSteps = 256;  // longer ones are followed one by one

    Place from{};
    State state = State::going;
    std::ptrdiff_t start = 0, at = 0;  // bits of the pixel on the upper left, see DarkMap::origin
    std::ptrdiff_t least = 0;          // the least `at` of the last block
    int dx = 0, dy = 0;                // where the last block led
    std::size_t direction = 0;
    Bends bends;
    std::size_t length = 0;
    std::array<std::uint8_t, kSteps> way{};
  };
  static constexpr std::size_t kWalks = 32;  // at a time
  static constexpr std::size_t kSideBySide = 4;

  void find_tops();
  void find_upper_edges();
  bool worth_following(const Place& from) const;
  bool is_sharp(const Place& from) const;
  bool reaches_down(const Place& from) const;
  void begin_walks();
  void go_on(const std::array<Walk*, kSideBySide>& walks);
  void judge(Walk& walk);
  std::size_t ask(std::size_t direction, std::ptrdiff_t at) const;
  bool follow_convex(const Place& from);
  void follow(const Place& from);
  bool outlines_quad() const;
  void trace(const Place& from, std::span<const std::uint8_t> way);
  bool within_limits() const;
  const Contour* measure();

  const Threshold* threshold_ = nullptr;
  const DarkMap* map_ = nullptr;
  std::size_t level_ = 0;
  ContourLimits limits_;

  int row_ = 0;
  std::vector<Place> starts_;  // in this row
  std::size_t next_start_ = 0;
  std::vector<Walk> walks_;
  std::size_t walk_count_ = 0, next_walk_ = 0;
  DarkMap visited_;  // for next(): dark pixels whose upper edge has been followed

  std::vector<std::uint8_t> way_;  // the directions that were gone,
  std::size_t length_ = 0;         // of which there are so many
  std::vector<int> xs_, ys_;       // the corners on that way
  std::span<const std::uint8_t> traced_;
  int low_x_ = 0, high_x_ = 0, low_y_ = 0, high_y_ = 0;
  Contour contour_;
};

}  // namespace harco::detect
