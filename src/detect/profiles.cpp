#include "detect/profiles.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>

#include "detect/kernels/bilinear.hpp"
#include "detect/median.hpp"
#include "detect/sample.hpp"

namespace harco::detect {
namespace {

/// To a sixteenth of a grey level.
float middle_grey(const float* greys, int count) { return middle_of(greys, count, 256.0F, 12); }

/// A side as profiles see it.
struct Side {
  Point direction;
  Point outward;
  double length;
  // Near the corners the other side's edge would be seen as well.
  double margin;
  int positions;
  double spacing;

  Side(const Point& a, const Point& b, int most)
      : direction((b - a).normalized()),
        outward(direction.y(), -direction.x()),
        length((b - a).norm()),
        margin(std::min(0.25 * length, 0.06 * length + 1.5)),
        positions(std::clamp(static_cast<int>(length - 2.0 * margin), 4, most)),
        spacing((length - 2.0 * margin) / positions) {}

  double from_start(int i) const { return margin + spacing * (i + 0.5); }
};

/// In the units of kernels::bilinear().
std::int32_t place(double pixels) {
  const double parts = pixels * (1 << kernels::kPlaceBits);
  return static_cast<std::int32_t>(parts + (parts < 0.0 ? -0.5 : 0.5));
}

void read_straight(const ImageView& image, const Point& a, const Side& side, Profiles& profiles) {
  constexpr double kRounding = 0.001;
  const Point inner = -profiles.inward * kStep * side.outward;
  const Point outer = profiles.outward * kStep * side.outward;
  const auto middle = [&](int i) -> Point { return a + side.from_start(i) * side.direction; };
  const auto inside = [&](const Point& at) {
    return between_pixels(image, at.x() - kRounding, at.y() - kRounding) &&
           between_pixels(image, at.x() + kRounding, at.y() + kRounding);
  };
  const auto whole = [&](int i) {
    const Point at = middle(i);
    return inside(at + inner) && inside(at + outer);
  };
  // Those in the image follow one another, since it is convex.
  int first = 0;
  int end = side.positions;
  while (first < end && !whole(first)) ++first;
  while (first < end && !whole(end - 1)) --end;
  const int count = end - first;
  std::array<std::int32_t, kMaxPositions> x;
  std::array<std::int32_t, kMaxPositions> y;
  profiles.along.resize(count);
  for (int i = 0; i < count; ++i) {
    const double t = side.from_start(first + i);
    x[static_cast<std::size_t>(i)] = place(a.x() + t * side.direction.x());
    y[static_cast<std::size_t>(i)] = place(a.y() + t * side.direction.y());
    profiles.along(i) = static_cast<float>(t - 0.5 * side.length);
  }
  for (int k = -profiles.inward; k <= profiles.outward; ++k)
    kernels::bilinear(image, x.data(), y.data(), place(k * kStep * side.outward.x()),
                      place(k * kStep * side.outward.y()), count, profiles.at(k).data());
}

void read_through(const Lens& lens, const ImageView& image, const Point& a, const Side& side,
                  Profiles& profiles) {
  profiles.along.resize(side.positions);
  int count = 0;
  for (int i = 0; i < side.positions; ++i) {
    const double t = side.from_start(i);
    const Point middle = a + t * side.direction;
    bool whole = true;
    for (int k = -profiles.inward; k <= profiles.outward && whole; ++k) {
      const auto pixel = lens.from_ideal(middle + k * kStep * side.outward);
      const auto grey = pixel ? sample(image, pixel->x(), pixel->y()) : std::nullopt;
      whole = grey.has_value();
      if (whole) profiles.grey(count, k + profiles.inward) = static_cast<float>(*grey);
    }
    if (whole) profiles.along(count++) = static_cast<float>(t - 0.5 * side.length);
  }
  profiles.along.conservativeResize(count);
}

}  // namespace

float middle_size(const Positions& sizes) {
  // Half of them are as large, so that it is no more than their root mean square times 1.42.
  const auto n = static_cast<float>(sizes.size());
  const float most = 1.5F * std::sqrt(sizes.square().sum() / n);
  return middle_of(sizes.data(), static_cast<int>(sizes.size()), most, 10);
}

Profiles read_profiles(const ImageView& image, const Lens& lens, const Point& a, const Point& b,
                       const Window& window, int most) {
  const Side side(a, b, most);
  Profiles profiles;
  profiles.inward = window.inward;
  profiles.outward = window.outward;
  if (lens.bends())
    read_through(lens, image, a, side, profiles);
  else
    read_straight(image, a, side, profiles);
  return profiles;
}

float median_at(const Profiles& profiles, int step) {
  return middle_grey(profiles.at(step).data(), profiles.count());
}

Linear level_at(const Profiles& profiles, int step) {
  constexpr int kEnough = 16;
  const auto line = [](float middle, float slope) {
    return Linear{static_cast<double>(middle), static_cast<double>(slope)};
  };
  const int count = profiles.count();
  if (count < kEnough) return line(median_at(profiles, step), 0.0F);
  const Positions& along = profiles.along;
  const auto grey = profiles.at(step);
  // A first line through the medians of both halves says which greys belong.
  const int half = count / 2;
  const float first = middle_grey(grey.data(), half);
  const float second = middle_grey(grey.data() + half, count - half);
  const float first_along = 0.5F * (along(0) + along(half - 1));
  const float second_along = 0.5F * (along(half) + along(count - 1));
  const float rough = (second - first) / (second_along - first_along);
  const Positions away = (grey - first - rough * (along - first_along)).abs();
  const float limit = 1.0F + 4.5F * middle_size(away);  // three deviations
  Positions belongs(count);
  for (int i = 0; i < count; ++i) belongs(i) = away(i) < limit ? 1.0F : 0.0F;

  const float n = belongs.sum();
  const float centre = (belongs * along).sum() / n;
  const float level = (belongs * grey).sum() / n;
  const Positions t = along - centre;
  const Positions g = belongs * (grey - level);
  const float tt = (belongs * t * t).sum();
  const float slope = (t * g).sum() / tt;
  const float slope_variance = std::max(0.0F, (g * (g - slope * t)).sum()) / (n - 2.0F) / tt;
  if (slope * slope < 6.0F * slope_variance) return line(level, 0.0F);
  return line(level - slope * centre, slope);
}

Positions levels_nearby(const Profiles& profiles, int step) {
  constexpr int kReach = 2;
  const int count = profiles.count();
  const auto grey = profiles.at(step);
  // Mirrored at both ends.
  Eigen::Array<float, Eigen::Dynamic, 1, Eigen::ColMajor, kMaxPositions + 2 * kReach, 1> row(
      count + 2 * kReach);
  row.segment(kReach, count) = grey;
  for (int i = 1; i <= kReach; ++i) {
    row(kReach - i) = grey(std::min(i, count - 1));
    row(kReach + count - 1 + i) = grey(std::max(count - 1 - i, 0));
  }
  const auto shifted = [&](int by) { return row.segment(by, count); };
  // The median of five: what is neither least nor greatest of four, and the fifth.
  const Positions low = shifted(0).min(shifted(1)).max(shifted(2).min(shifted(3)));
  const Positions high = shifted(0).max(shifted(1)).min(shifted(2).max(shifted(3)));
  const Positions lower = low.min(high);
  const Positions upper = low.max(high);
  return lower.max(upper.min(shifted(4)));
}

void widen_pixels(Profiles& profiles) {
  auto& grey = profiles.grey;
  const int count = profiles.count();
  const auto column = [&](int k) { return grey.col(k).head(count); };
  for (int k = 2; k + 2 < profiles.across(); ++k)
    column(k - 2) = 0.125F * (column(k - 2) + column(k + 2)) +
                    0.25F * (column(k - 1) + column(k) + column(k + 1));
  profiles.inward -= 2;
  profiles.outward -= 2;
}

Profile mean_profile(const Profiles& profiles, const Positions& weights) {
  Profile mean(profiles.across());
  const float scale = 1.0F / std::max(weights.sum(), 1e-9F);
  for (int k = -profiles.inward; k <= profiles.outward; ++k)
    mean(k + profiles.inward) = static_cast<double>((weights * profiles.at(k)).sum() * scale);
  return mean;
}

Positions weighted_sums(const Profiles& profiles, const Profile& weights) {
  Positions sums = Positions::Zero(profiles.count());
  for (int k = -profiles.inward; k <= profiles.outward; ++k)
    sums += static_cast<float>(weights(k + profiles.inward)) * profiles.at(k);
  return sums;
}

}  // namespace harco::detect
