#include "harco/view_range.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>
#include <string>
#include <vector>

namespace harco {
namespace {

// What the result may lie above the least distance, as a share of it.
constexpr double kTolerance = 0.02;
constexpr double kNever = std::numeric_limits<double>::infinity();
// Where two sizes hardly meet, the least change of the view opens a gap; boxes smaller than that
// count as if it were open.
constexpr double kLeastChange = 0.002;

/// Markers of one size.
struct Size {
  double half_side_m = 0.0;  ///< with the line around
  double farthest_m = 0.0;   ///< where it is still found
  std::vector<Eigen::Vector2d> centres_m;
};

/// All aims up to `reach_m` from `aim_m` along either axis, all turns up to `sweep` from `turn`.
struct Box {
  Eigen::Vector2d aim_m;
  double turn;
  double reach_m;
  double sweep;
};

std::vector<Size> sizes_of(const MarkerSet& markers, const ViewOptions& view) {
  std::vector<Size> sizes;
  for (const PlacedMarker& marker : place(markers)) {
    if (marker.parent_index != 0) break;
    const bool parent = marker.layer == 1;
    const double half_side = marker.side_m * (parent ? 0.5 : 0.5 + markers.line.outside);
    const double farthest =
        view.focal_px * marker.side_m / (parent ? view.parent_px : view.child_px);
    const auto same = std::find_if(sizes.begin(), sizes.end(), [&](const Size& size) {
      return std::abs(size.half_side_m - half_side) < 1e-9 * half_side &&
             std::abs(size.farthest_m - farthest) < 1e-9 * farthest;
    });
    Size& size = same == sizes.end() ? sizes.emplace_back() : *same;
    size.half_side_m = half_side;
    size.farthest_m = farthest;
    size.centres_m.emplace_back(marker.origin_m + 0.5 * marker.side_m * Eigen::Vector2d(1.0, 1.0));
  }
  std::stable_sort(sizes.begin(), sizes.end(),
                   [](const Size& a, const Size& b) { return a.farthest_m > b.farthest_m; });
  return sizes;
}

void check(const ViewOptions& view) {
  const auto require = [](bool good, const char* what) {
    if (!good) throw std::invalid_argument(what);
  };
  require(view.width_px > 0 && view.height_px > 0, "image size must be positive");
  for (const double value : {view.focal_px, view.parent_px, view.child_px})
    require(value > 0.0 && std::isfinite(value),
            "focal length and least sides must be positive and finite");
  require(view.usable_share > 0.0 && view.usable_share <= 1.0,
          "usable share of the image must be above 0 and at most 1");
  require(view.aim >= 0.0 && view.aim <= 0.5, "aim must be 0 … 0.5 of the side");
}

class Search {
 public:
  Search(const MarkerSet& markers, const ViewOptions& view)
      : sizes_(sizes_of(markers, view)),
        half_width_(0.5 * view.usable_share * view.width_px / view.focal_px),
        half_height_(0.5 * view.usable_share * view.height_px / view.focal_px),
        half_diagonal_(std::hypot(half_width_, half_height_)) {}

  /// The greatest distance, over the views of a box, below which some view has a gap.
  double nearest(const Box& box) {
    double found = 0.0;  // in some view
    double worst = 0.0;  // in no view more
    std::vector<Box> open{box};
    while (!open.empty()) {
      const Box now = open.back();
      open.pop_back();
      const Reach reached = reach(now);
      found = std::max(found, reached.centre_m);
      if (reached.bound_m <= worst) continue;
      if (reached.bound_m <= found * (1.0 + kTolerance) ||
          now.reach_m + reached.radius_m * now.sweep <=
              kLeastChange * half_height_ * reached.centre_m)
        worst = std::max(worst, reached.bound_m);
      else
        split(now, reached.radius_m, open);
    }
    return worst;
  }

  double farthest() const { return sizes_.front().farthest_m; }

 private:
  /// From where on a marker is wholly in view.
  struct Reach {
    double centre_m;  ///< in the box's middle
    double bound_m;   ///< everywhere in the box
    double radius_m;  ///< how far from the aim the marker reaches that gives the bound
  };

  /// The best marker of a size.
  Reach best_of(const Size& size, const Box& box) const {
    const double c = std::cos(box.turn);
    const double s = std::sin(box.turn);
    // Half the extent of the turned square along the image's axes.
    const double extent = size.half_side_m * (std::abs(c) + std::abs(s));
    const double shift = std::numbers::sqrt2 * box.reach_m;
    Reach best{kNever, kNever, 0.0};
    for (const Eigen::Vector2d& centre : size.centres_m) {
      const Eigen::Vector2d away = centre - box.aim_m;
      const double squared = away.squaredNorm();
      // No point farther away than the corner of the image is in it.
      if (squared > std::pow(best.bound_m * half_diagonal_, 2)) continue;
      const double x = std::abs(c * away.x() - s * away.y()) + extent;
      const double y = std::abs(s * away.x() + c * away.y()) + extent;
      best.centre_m = std::min(best.centre_m, std::max(x / half_width_, y / half_height_));
      // A corner moves with the aim, and by a turn across the line to it; less than half the
      // turn's square along it.
      const double radius = std::sqrt(squared) + std::numbers::sqrt2 * size.half_side_m;
      const double along = 0.5 * radius * box.sweep * box.sweep;
      const double bound = std::max((x + shift + y * box.sweep + along) / half_width_,
                                    (y + shift + x * box.sweep + along) / half_height_);
      if (bound >= best.bound_m) continue;
      best.bound_m = bound;
      best.radius_m = radius;
    }
    return best;
  }

  /// Downwards from the farthest distance, size by size, until one is found too late.
  Reach reach(const Box& box) const {
    Reach reached{farthest(), farthest(), 0.0};
    for (const Size& size : sizes_) {
      if (size.farthest_m < reached.centre_m) break;
      const Reach next = best_of(size, box);
      reached.centre_m = std::min(reached.centre_m, next.centre_m);
      if (size.farthest_m < reached.bound_m || next.bound_m >= reached.bound_m) continue;
      reached.bound_m = next.bound_m;
      reached.radius_m = next.radius_m;
    }
    return reached;
  }

  /// Halves what leaves more open, aims or turns.
  static void split(const Box& box, double radius_m, std::vector<Box>& open) {
    if (box.reach_m >= radius_m * box.sweep) {
      const double half = 0.5 * box.reach_m;
      for (const double x : {-half, half})
        for (const double y : {-half, half})
          open.push_back({box.aim_m + Eigen::Vector2d(x, y), box.turn, half, box.sweep});
    } else {
      const double half = 0.5 * box.sweep;
      for (const double turn : {-half, half})
        open.push_back({box.aim_m, box.turn + turn, box.reach_m, half});
    }
  }

  std::vector<Size> sizes_;
  double half_width_;  ///< of the usable image, at a distance of 1
  double half_height_;
  double half_diagonal_;
};

}  // namespace

DistanceRange range_in_view(const MarkerSet& markers, const ViewOptions& view) {
  check(view);
  if (markers.parents.empty()) throw std::invalid_argument("a marker set needs a parent");
  const double side = markers.parents.front().side_m;
  Search search(markers, view);
  // Half a turn shows the same square of the image again.
  const double quarter = 0.5 * std::numbers::pi;
  const double nearest =
      search.nearest({0.5 * side * Eigen::Vector2d(1.0, 1.0), quarter, view.aim * side, quarter});
  if (nearest >= search.farthest())
    throw std::invalid_argument("image: too small for the parent at the least side that is found");
  return {nearest, search.farthest()};
}

}  // namespace harco
