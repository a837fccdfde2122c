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

constexpr float kGreys = 256.0F;

/// A side as profiles see it.
struct Side {
  Point direction;
  Point outward;
  double length;
  // Near the corners the other side's edge would be seen as well.
  double margin;
  int positions;

  Side(const Point& a, const Point& b, int most)
      : direction((b - a).normalized()),
        outward(direction.y(), -direction.x()),
        length((b - a).norm()),
        margin(std::min(0.25 * length, 0.06 * length + 1.5)),
        positions(std::clamp(static_cast<int>(usable()), 4, most)) {}

  double usable() const { return length - 2.0 * margin; }
  double from_start(int i) const { return margin + usable() * (i + 0.5) / positions; }
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
  const auto inside = [&](const Point& at) {
    return between_pixels(image, at.x() - kRounding, at.y() - kRounding) &&
           between_pixels(image, at.x() + kRounding, at.y() + kRounding);
  };
  std::array<std::int32_t, kMaxPositions> x;
  std::array<std::int32_t, kMaxPositions> y;
  int count = 0;
  for (int i = 0; i < side.positions; ++i) {
    const double t = side.from_start(i);
    const Point middle = a + t * side.direction;
    if (!inside(middle + inner) || !inside(middle + outer)) continue;
    x[static_cast<std::size_t>(count)] = place(middle.x());
    y[static_cast<std::size_t>(count)] = place(middle.y());
    profiles.along(count++) = static_cast<float>(t - 0.5 * side.length);
  }
  profiles.along.conservativeResize(count);
  for (int k = -profiles.inward; k <= profiles.outward; ++k)
    kernels::bilinear(image, x.data(), y.data(), place(k * kStep * side.outward.x()),
                      place(k * kStep * side.outward.y()), count, profiles.at(k).data());
}

void read_through(const Lens& lens, const ImageView& image, const Point& a, const Side& side,
                  Profiles& profiles) {
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

Profiles read_profiles(const ImageView& image, const Lens& lens, const Point& a, const Point& b,
                       const Window& window, int most) {
  const Side side(a, b, most);
  Profiles profiles;
  profiles.inward = window.inward;
  profiles.outward = window.outward;
  profiles.along.resize(side.positions);
  if (lens.bends())
    read_through(lens, image, a, side, profiles);
  else
    read_straight(image, a, side, profiles);
  return profiles;
}

float median_at(const Profiles& profiles, int step) {
  return middle_of(profiles.at(step).data(), profiles.count(), kGreys);
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
  const float first = middle_of(grey.data(), half, kGreys);
  const float second = middle_of(grey.data() + half, count - half, kGreys);
  const float first_along = 0.5F * (along(0) + along(half - 1));
  const float second_along = 0.5F * (along(half) + along(count - 1));
  const float rough = (second - first) / (second_along - first_along);
  const Positions away = (grey - first - rough * (along - first_along)).abs();
  const float limit = 1.0F + 4.5F * middle_of(away.data(), count, 2.0F * kGreys);  // 3 deviations
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
