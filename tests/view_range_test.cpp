#include "harco/view_range.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <stdexcept>
#include <vector>

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "harco/layout.hpp"

namespace harco {
namespace {

constexpr double kAbove = 1.02;  // what the result may lie above the least distance

/// 750 x 480 pixels, f = 700, all of it usable.
ViewOptions view(double aim) {
  ViewOptions options;
  options.width_px = 750;
  options.height_px = 480;
  options.focal_px = 700.0;
  options.usable_share = 1.0;
  options.aim = aim;
  return options;
}

void expect_nearest(const Marker& layout, const ViewOptions& options, double by_hand) {
  const DistanceRange range = range_in_view(without_codes(layout, 1, 1.0), options);
  EXPECT_GE(range.nearest_m, by_hand * (1.0 - 1e-9));
  EXPECT_LE(range.nearest_m, by_hand * kAbove);
  EXPECT_DOUBLE_EQ(range.farthest_m, 700.0 / 14.0);
}

TEST(RangeInView, OfAParentByHand) {
  // Turned by 45 degrees, its corners are sqrt(1/2) sides above and below the middle of the image;
  // 240 px are 240 / 700 of the distance.
  const Marker parent = uniform_layout(5, {});
  expect_nearest(parent, view(0.0), std::sqrt(0.5) * 700.0 / 240.0);
  // Aimed 0.35 sides beside the centre along both axes, the far corner is 0.85 sqrt(2) away.
  expect_nearest(parent, view(0.35), 0.85 * std::sqrt(2.0) * 700.0 / 240.0);
  // Of a higher image than it is wide, the width counts.
  ViewOptions upright = view(0.0);
  std::swap(upright.width_px, upright.height_px);
  expect_nearest(parent, upright, std::sqrt(0.5) * 700.0 / 240.0);
  // Half of it usable.
  ViewOptions half = view(0.0);
  half.usable_share = 0.5;
  expect_nearest(parent, half, std::sqrt(0.5) * 700.0 / 120.0);
}

TEST(RangeInView, OfChildrenByHand) {
  // The child in the centre: 1/7 of the side, with its line 8/7 of that.
  const Marker quincunxes = uniform_layout(5, {quincunx(5)});
  expect_nearest(quincunxes, view(0.0), 8.0 / 49.0 * std::sqrt(0.5) * 700.0 / 240.0);
  // If it is found from 60 px only, at 700 / 7 / 60 = 1.67 m, the parent has left the view before.
  ViewOptions coarse = view(0.0);
  coarse.child_px = 60.0;
  expect_nearest(quincunxes, coarse, std::sqrt(0.5) * 700.0 / 240.0);
}

TEST(RangeInView, MoreChildrenNeverServeLess) {
  for (const double aim : {0.0, 0.2, 0.35}) {
    double before = 1e9;
    for (const Marker& layout :
         {uniform_layout(5, {}), uniform_layout(5, {{12}}), uniform_layout(5, {quincunx(5)}),
          uniform_layout(5, {checkerboard(5)}),
          uniform_layout(5, {checkerboard(5), checkerboard(5)})}) {
      const double now = range_in_view(without_codes(layout, 1, 1.0), view(aim)).nearest_m;
      EXPECT_LE(now, before * kAbove) << aim;
      before = now;
    }
  }
}

/// Whether any marker is wholly in the image, and large enough: from its corners, one by one.
bool any_in_view(const MarkerSet& set, const std::vector<PlacedMarker>& placed,
                 const ViewOptions& options, const Eigen::Vector2d& aim, double turn,
                 double distance) {
  return std::any_of(placed.begin(), placed.end(), [&](const PlacedMarker& marker) {
    const double least = marker.layer == 1 ? options.parent_px : options.child_px;
    if (options.focal_px * marker.side_m / distance < least) return false;
    const double out = marker.layer == 1 ? 0.0 : set.line.outside * marker.side_m;
    for (const Eigen::Vector2d& direction : {Eigen::Vector2d(-1, -1), {1, -1}, {1, 1}, {-1, 1}}) {
      const Eigen::Vector2d corner = marker.origin_m + 0.5 * marker.side_m * Eigen::Vector2d(1, 1) +
                                     (0.5 * marker.side_m + out) * direction;
      const Eigen::Vector2d pixel =
          options.focal_px / distance * (Eigen::Rotation2Dd(turn) * (corner - aim));
      if (std::abs(pixel.x()) > 0.5 * options.usable_share * options.width_px ||
          std::abs(pixel.y()) > 0.5 * options.usable_share * options.height_px)
        return false;
    }
    return true;
  });
}

TEST(RangeInView, AgreesWithViewsTriedOut) {
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  for (const Marker& layout : {uniform_layout(5, {quincunx(5), quincunx(5)}),
                               uniform_layout(4, {checkerboard(4), {0, 5}}), carpet(5)}) {
    for (const double aim : {0.1, 0.35}) {
      ViewOptions options = view(aim);
      options.usable_share = 0.9;
      const MarkerSet set = without_codes(layout, 1, 1.0);
      const std::vector<PlacedMarker> placed = place(set);
      const DistanceRange range = range_in_view(set, options);
      const auto seen = [&](double distance) {
        const Eigen::Vector2d at(0.5 + aim * (2.0 * unit(random) - 1.0),
                                 0.5 + aim * (2.0 * unit(random) - 1.0));
        return any_in_view(set, placed, options, at, 2.0 * std::numbers::pi * unit(random),
                           distance);
      };
      int lost_nearer = 0;
      for (int i = 0; i < 4000; ++i) {
        const double distance =
            range.nearest_m * std::pow(range.farthest_m / range.nearest_m, unit(random));
        EXPECT_TRUE(seen(distance * (1.0 - 1e-9))) << distance;
        EXPECT_TRUE(seen(range.nearest_m)) << range.nearest_m;
        lost_nearer += !seen((0.5 + 0.47 * unit(random)) * range.nearest_m);
      }
      EXPECT_GT(lost_nearer, 0) << placed.size() << " " << aim << " " << range.nearest_m;
    }
  }
}

TEST(RangeInView, RefusesNonsense) {
  const MarkerSet set = without_codes(uniform_layout(5, {}), 1, 1.0);
  EXPECT_THROW(range_in_view({}, view(0.0)), std::invalid_argument);
  EXPECT_THROW(range_in_view(set, view(-0.1)), std::invalid_argument);
  EXPECT_THROW(range_in_view(set, view(0.6)), std::invalid_argument);
  EXPECT_THROW(range_in_view(set, view(std::nan(""))), std::invalid_argument);
  for (double ViewOptions::*field : {&ViewOptions::focal_px, &ViewOptions::parent_px,
                                     &ViewOptions::child_px, &ViewOptions::usable_share}) {
    ViewOptions wrong = view(0.0);
    wrong.*field = 0.0;
    EXPECT_THROW(range_in_view(set, wrong), std::invalid_argument);
  }
  ViewOptions tiny = view(0.0);
  tiny.height_px = 19;  // a parent of 14 px is 19.8 px high if turned
  EXPECT_THROW(range_in_view(set, tiny), std::invalid_argument);
}

}  // namespace
}  // namespace harco
