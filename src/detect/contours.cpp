#include "detect/contours.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace harco::detect {
namespace {

struct Step {
  int x, y;
};

// Directions clockwise as seen on the screen (y down): right, down, left, up.
constexpr std::array<Step, 4> kSteps{{{1, 0}, {0, 1}, {-1, 0}, {0, -1}}};
constexpr int kUp = 3;

Step step(int direction) { return kSteps[static_cast<std::size_t>(direction & 3)]; }

double signed_area(const std::vector<Point>& points) {
  double twice = 0.0;
  for (std::size_t i = 0, j = points.size() - 1; i < points.size(); j = i++)
    twice += points[j].x() * points[i].y() - points[i].x() * points[j].y();
  return 0.5 * twice;
}

}  // namespace

void BorderFollower::trace(const ThresholdMap& map, int x, int y) {
  contour_.points.clear();
  contour_.at_image_edge = false;
  const int start_x = x;
  const int start_y = y;
  int side = kUp;  // the bright pixel lies on this side of the dark one (x, y)
  do {
    const Step out = step(side);
    const double dark = map.row(y)[x];
    const int bright_x = x + out.x;
    const int bright_y = y + out.y;
    const double bright = map.row(bright_y)[bright_x];
    const double share = dark / (dark - bright);
    contour_.points.emplace_back(x + share * out.x, y + share * out.y);
    if (bright_x < 0 || bright_y < 0 || bright_x >= map.width() || bright_y >= map.height())
      contour_.at_image_edge = true;
    if (side == kUp) visited_[static_cast<std::size_t>(y * map.width() + x)] = 1;

    // Walk with the dark on the right-hand side.
    const Step ahead = step(side + 1);
    const int ahead_value = map.row(y + ahead.y)[x + ahead.x];
    const int beyond_value = map.row(bright_y + ahead.y)[bright_x + ahead.x];
    bool to_beyond = beyond_value < 0;
    if (to_beyond && ahead_value >= 0)  // two dark pixels touch at a corner
      to_beyond = dark + bright + ahead_value + beyond_value < 0;
    if (to_beyond) {
      x = bright_x + ahead.x;
      y = bright_y + ahead.y;
      side = (side + 3) & 3;
    } else if (ahead_value < 0) {
      x += ahead.x;
      y += ahead.y;
    } else {
      side = (side + 1) & 3;
    }
  } while (x != start_x || y != start_y || side != kUp);
}

void BorderFollower::follow(const ThresholdMap& map, std::size_t min_points, double min_extent,
                            const std::function<void(const Contour&)>& visit) {
  visited_.assign(static_cast<std::size_t>(map.width()) * static_cast<std::size_t>(map.height()),
                  0);
  for (int y = 0; y < map.height(); ++y) {
    const std::int16_t* row = map.row(y);
    const std::int16_t* above = map.row(y - 1);
    for (int x = 0; x < map.width(); ++x) {
      if (row[x] >= 0 || above[x] < 0 || visited_[static_cast<std::size_t>(y * map.width() + x)])
        continue;
      trace(map, x, y);
      if (contour_.points.size() < min_points) continue;
      Point low = contour_.points.front();
      Point high = low;
      for (const Point& point : contour_.points) {
        low = low.cwiseMin(point);
        high = high.cwiseMax(point);
      }
      if ((high - low).minCoeff() < min_extent) continue;
      // Clockwise on the screen, y down, gives a positive area: dark inside bright.
      const double area = signed_area(contour_.points);
      contour_.hole = area < 0.0;
      contour_.area = std::abs(area);
      visit(contour_);
    }
  }
}

}  // namespace harco::detect
