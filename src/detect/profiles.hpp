// Grey values across a straight side.
#pragma once

#include <Eigen/Core>

#include "detect/bands.hpp"
#include "detect/lens.hpp"
#include "detect/quad.hpp"
#include "harco/image.hpp"

namespace harco::detect {

constexpr int kMaxPositions = 96;  ///< along a side
constexpr double kStep = 0.5;      ///< across it, in pixels

/// One value for each position along a side.
using Positions = Eigen::Array<float, Eigen::Dynamic, 1, Eigen::ColMajor, kMaxPositions, 1>;

/// How far to look across a side, in steps.
struct Window {
  int inward;
  int outward;
};

/// What changes evenly along a side: a grey level with the light, a width with the perspective.
struct Linear {
  double middle = 0.0;
  double slope = 0.0;  // a pixel
  double at(double along) const { return middle + slope * along; }
  Positions at(const Positions& along) const {
    return static_cast<float>(middle) + static_cast<float>(slope) * along;
  }
};

/// Grey values across one side, at steps from `-inward` to `outward`. Each position along it has
/// its profile; a step's greys at all positions lie side by side in memory.
struct Profiles {
  Eigen::Array<float, kMaxPositions, kMaxAcross> grey;  ///< positions down, steps from the inside
  Positions along;  ///< of each position, pixels from the side's middle
  int inward = 0;
  int outward = 0;

  int count() const { return static_cast<int>(along.size()); }
  int across() const { return inward + outward + 1; }
  auto at(int step) const { return grey.col(step + inward).head(along.size()); }
  auto at(int step) { return grey.col(step + inward).head(along.size()); }
};

/// Across the side from a to b, at no more than `most` positions along it. Its outside is on the
/// left of the way. Profiles that aren't all in the image are left out.
Profiles read_profiles(const ImageView& image, const Lens& lens, const Point& a, const Point& b,
                       const Window& window, int most);

/// Median of what isn't negative, to a thousandth of the greater ones.
float middle_size(const Positions& sizes);

/// Median of the greys at one step.
float median_at(const Profiles& profiles, int step);

/// The level at one step: a straight line through the greys along the side, without those that
/// something hides. It is even unless its slope stands out of the noise; short sides can't tell.
Linear level_at(const Profiles& profiles, int step);

/// Of the neighbours alone: where a shadow begins somewhere along the side.
Positions levels_nearby(const Profiles& profiles, int step);

/// Profiles as wider pixels would see them: means over two pixels across the side.
void widen_pixels(Profiles& profiles);

/// Mean of the profiles, each with its weight.
Profile mean_profile(const Profiles& profiles, const Positions& weights);

/// Of each profile the sum of its greys with these weights, which go from the inside out.
Positions weighted_sums(const Profiles& profiles, const Profile& weights);

}  // namespace harco::detect
