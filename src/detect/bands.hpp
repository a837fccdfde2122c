// What the edge fit knows of a side: even bands across it, blurred.
#pragma once

#include <array>
#include <optional>

#include <Eigen/Core>

namespace harco::detect {

constexpr int kMaxAcross = 49;  ///< samples of a profile, at most
using Profile = Eigen::Matrix<double, Eigen::Dynamic, 1, Eigen::ColMajor, kMaxAcross, 1>;

/// Bands of even grey, parted by borders: distances from the side in pixels, ascending, outwards
/// positive. One of them is the side itself, at zero.
struct Bands {
  std::array<double, 3> borders{};
  int count = 0;              ///< of the borders
  double first_spread = 0.0;  ///< how far the first border may lie elsewhere (one sigma)
  double light_spread = 0.0;  ///< how much the light may change a pixel outwards (one sigma)
  void add(double border) { borders[static_cast<std::size_t>(count++)] = border; }
};

/// A linear measure of where a side lies in a profile across it. The bands' grey levels and the
/// blur, which were fitted to the mean profile, don't enter to first order: they are free from one
/// profile to the next, so light and whatever lies beyond the bands may change along the side.
struct EdgeFilter {
  double offset = 0.0;   ///< of the mean profile, pixels outwards
  double sigma = 0.0;    ///< of the blur, pixels; that of the interpolation included
  double by_last = 0.0;  ///< change of the measure when the last border moves outwards by a pixel
  Profile expected;      ///< the mean profile as the bands explain it
  Profile weights;
  /// What was fitted, for another fit that starts from there.
  Eigen::Matrix<double, 8, 1> fitted;

  /// Of a profile: what its greys with the `weights` add up to, and this.
  double constant() const { return offset - weights.dot(expected); }
  double position(const Profile& profile) const { return constant() + weights.dot(profile); }
};

/// Fits the offset of all borders, their Gaussian blur and the bands' levels to a profile whose
/// sample k lies at first + k * step. Starts from what was fitted to about the same profile, if
/// that is given. Empty if no offset of up to a pixel explains it.
std::optional<EdgeFilter> fit_bands(const Profile& mean, double first, double step,
                                    const Bands& bands, const EdgeFilter* start = nullptr);

}  // namespace harco::detect
