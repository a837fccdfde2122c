#include "harco/plan.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <optional>
#include <random>
#include <stdexcept>

#include <gtest/gtest.h>

#include "harco/geometry.hpp"

namespace harco {
namespace {

constexpr double kAlpha = 6.0 / 49.0;
constexpr double kBeta = 5.0 / 49.0;
constexpr double kGamma = 1.0 / 32.0;

// --- Equations --------------------------------------------------------------------------------

TEST(Equation2, SideInImage) {
  // 700 * 1.6 / 32 = 35: the paper's 35 px at 32 m (erratum 11).
  EXPECT_DOUBLE_EQ(side_in_image(700.0, 1.6, 32.0), 35.0);
  EXPECT_THROW(side_in_image(700.0, 0.0, 1.0), std::invalid_argument);
  EXPECT_THROW(side_in_image(700.0, 1.0, -1.0), std::invalid_argument);
  EXPECT_THROW(side_in_image(std::nan(""), 1.0, 1.0), std::invalid_argument);
}

TEST(Equation3, RunsFromTheLayerAfterJ) {
  const std::vector<double> theta{0.9, 0.5, 0.25};
  // Layers 1 -> 3: theta_2 theta_3 = 0.5 * 0.25 = 0.125; 8 m become 1 m.
  EXPECT_DOUBLE_EQ(distance_in_layer(8.0, theta, 1, 3), 1.0);
  EXPECT_DOUBLE_EQ(distance_in_layer(8.0, theta, 2, 3), 2.0);
  EXPECT_DOUBLE_EQ(distance_in_layer(8.0, theta, 2, 2), 8.0);
  // As printed, theta_1 = 0.9 comes in as well: 8 * 0.9 * 0.125 = 0.9.
  EXPECT_DOUBLE_EQ(printed::distance_in_layer(8.0, theta, 1, 3), 0.9);
  EXPECT_DOUBLE_EQ(printed::distance_in_layer(8.0, theta, 2, 2), 4.0);
}

TEST(Equation3, AgreesWithEquation2) {
  // Where Eq. 3 puts the camera, the child looks as large as its container did.
  const double side = 1.6;
  const double h = distance_in_layer(4.5, {1.0 / 7.0, 1.0 / 7.0, 1.0 / 7.0}, 1, 3);
  EXPECT_NEAR(side_in_image(700.0, side / 49.0, h), side_in_image(700.0, side, 4.5), 1e-9);
}

TEST(Equation3, RefusesLayersThatAreNotThere) {
  const std::vector<double> theta{0.5, 0.5};
  for (const auto& [j, i] : {std::pair{0, 1}, {2, 1}, {1, 3}}) {
    EXPECT_THROW(distance_in_layer(1.0, theta, j, i), std::invalid_argument);
    EXPECT_THROW(printed::distance_in_layer(1.0, theta, j, i), std::invalid_argument);
  }
  EXPECT_THROW(distance_in_layer(1.0, {0.5, 1.5}, 1, 2), std::invalid_argument);
}

TEST(Equation4, PrintedExampleGivesThreeNotTwo) {
  // ln(0.1 / 5) / ln(1/7) = -3.9120 / -1.9459 = 2.0104, so the ceiling is 3 (erratum 2).
  EXPECT_NEAR(std::log(0.1 / 5.0) / std::log(1.0 / 7.0), 2.0104, 5e-5);
  EXPECT_EQ(printed::layers_needed(0.1, 5.0, 1.0 / 7.0), 3);
  // A whole power stays whole: 49 = 7^2.
  EXPECT_EQ(printed::layers_needed(1.0, 49.0, 1.0 / 7.0), 2);
}

TEST(Equation4, CorrectedCountsWhatOneLayerCovers) {
  // From 16 to 432 px one layer covers a ratio of 27. 5 / 0.1 = 50; 50 / 27 = 1.852;
  // log_7 = 0.6163 / 1.9459 = 0.317, so L = 1 + 1.
  EXPECT_EQ(layers_needed(0.1, 5.0, 1.0 / 7.0, 16.0, 432.0), 2);
  // 35 / 0.1 = 350; 350 / 27 = 12.96; log_7 = 2.5621 / 1.9459 = 1.317, so L = 1 + 2.
  EXPECT_EQ(layers_needed(0.1, 35.0, 1.0 / 7.0, 16.0, 432.0), 3);
  EXPECT_EQ(layers_needed(1.0, 27.0, 1.0 / 7.0, 16.0, 432.0), 1);
  EXPECT_EQ(layers_needed(1.0, 2.0, 1.0 / 7.0, 16.0, 432.0), 1);
  // 27 * 49 is just reached by three layers, 1 % more is not.
  EXPECT_EQ(layers_needed(1.0, 27.0 * 49.0, 1.0 / 7.0, 16.0, 432.0), 3);
  EXPECT_EQ(layers_needed(1.0, 27.3 * 49.0, 1.0 / 7.0, 16.0, 432.0), 4);
}

TEST(Equation4, RefusesImpossibleRanges) {
  EXPECT_THROW(layers_needed(5.0, 0.1, 0.5, 16.0, 432.0), std::invalid_argument);
  EXPECT_THROW(layers_needed(0.0, 1.0, 0.5, 16.0, 432.0), std::invalid_argument);
  EXPECT_THROW(layers_needed(0.1, 1.0, 1.0, 16.0, 432.0), std::invalid_argument);
  EXPECT_THROW(layers_needed(0.1, 1.0, 0.5, 432.0, 16.0), std::invalid_argument);
  EXPECT_THROW(printed::layers_needed(0.1, 1.0, 0.0), std::invalid_argument);
}

TEST(Equation5, PrintedAndExact) {
  // (1 - 2/32)^2 = 0.9375^2 = 0.87890625. Printed: 43/49 of it = 0.771285.
  EXPECT_NEAR(printed::child_white_share(kAlpha, kGamma), 0.771285, 1e-6);
  // Exact: 0.87890625 - 0.12244898 = 0.75645727, less than the "lower bound" (erratum 3).
  EXPECT_NEAR(child_white_share(kAlpha, kGamma), 0.75645727, 1e-8);
  EXPECT_LT(child_white_share(kAlpha, kGamma), printed::child_white_share(kAlpha, kGamma));
  EXPECT_DOUBLE_EQ(child_white_share(0.9, 0.25), 0.0);
}

TEST(Equation6, OneStepByHand) {
  // a_2 = (1 - 5/49 (1 - 0.771285)) 0.771285 = 0.976662 * 0.771285 = 0.753284.
  const double b = printed::child_white_share(kAlpha, kGamma);
  EXPECT_NEAR(printed::carried_white_step(b, kBeta, b), 0.753284, 1e-6);
}

TEST(Equation7, IsEquation6Repeated) {
  const double b = printed::child_white_share(kAlpha, kGamma);
  double a = b;
  for (int layers = 1; layers <= 8; ++layers) {
    EXPECT_NEAR(printed::carried_white_share(layers, kAlpha, kBeta, kGamma), a, 1e-12);
    a = printed::carried_white_step(a, kBeta, b);
  }
  // a_3 = 0.976662^2 * 0.771285 = 0.735704.
  EXPECT_NEAR(printed::carried_white_share(3, kAlpha, kBeta, kGamma), 0.735704, 1e-6);
}

TEST(Equation6And7, CorrectedRecursionByHand) {
  // w_1 = 0.756457, w_2 = 0.756457 - 0.102041 * 0.243543 = 0.731606,
  // w_3 = 0.756457 - 0.102041 * 0.268394 = 0.729070; limit (w_1 - beta)/(1 - beta) =
  // 0.654416 / 0.897959 = 0.728782.
  const LineWidth line{kGamma, 0.0};
  EXPECT_NEAR(carried_white_share(1, kAlpha, kBeta, line), 0.756457, 1e-6);
  EXPECT_NEAR(carried_white_share(2, kAlpha, kBeta, line), 0.731606, 1e-6);
  EXPECT_NEAR(carried_white_share(3, kAlpha, kBeta, line), 0.729070, 1e-6);
  EXPECT_NEAR(carried_white_limit(kAlpha, kBeta, line), 0.728782, 1e-6);
  EXPECT_NEAR(carried_white_share(30, kAlpha, kBeta, line),
              carried_white_limit(kAlpha, kBeta, line), 1e-12);
}

TEST(Equation6And7, InkOutsideByHand) {
  // Line 1/14 outside: w_1 = 1 - 6/49 = 0.877551. Around a grandchild (1 + 1/7)^2 - 1 = 15/49 of
  // its area is ink: w_2 = 0.877551 - 0.102041 (0.122449 + 0.306122) = 0.833819.
  const LineWidth line{0.0, 1.0 / 14.0};
  EXPECT_NEAR(carried_white_share(1, kAlpha, kBeta, line), 0.877551, 1e-6);
  EXPECT_NEAR(carried_white_share(2, kAlpha, kBeta, line), 0.833819, 1e-6);
  EXPECT_DOUBLE_EQ(carried_white_share(5, 0.9, 0.9, line), 0.0);
}

TEST(Equation8, PrintedExampleGivesFiveNotEight) {
  // base 1 - 5/49 (1 - 0.771285) = 0.976662; ln(0.7 / 0.771285) / ln(0.976662) =
  // -0.09698 / -0.023615 = 4.107; 1 + 4 = 5 (erratum 5).
  EXPECT_EQ(printed::most_child_layers(kAlpha, kBeta, kGamma, 0.7), 5);
  // With the paper's own numbers: ln(0.7 / 0.8228) / ln(0.9819) = 8.85; 1 + 8 = 9.
  EXPECT_EQ(printed::most_child_layers(0.9819, 0.8228, 0.7), 9);
  EXPECT_EQ(printed::most_child_layers(kAlpha, kBeta, kGamma, 0.8), 0);
}

TEST(Equation8, PrintedIsTheInverseOfEquation7) {
  for (const double least : {0.5, 0.6, 0.65, 0.7, 0.75}) {
    const int most = printed::most_child_layers(kAlpha, kBeta, kGamma, least);
    EXPECT_GE(printed::carried_white_share(most, kAlpha, kBeta, kGamma), least);
    EXPECT_LT(printed::carried_white_share(most + 1, kAlpha, kBeta, kGamma), least);
  }
}

TEST(Equation8, CorrectedHasNoLimitOrNoLayer) {
  const LineWidth line{kGamma, 0.0};
  // The limit 0.728782 lies above 0.7: any number of layers.
  EXPECT_EQ(most_child_layers(kAlpha, kBeta, line, 0.7), std::nullopt);
  // w_2 = 0.7316 > 0.73 > w_3 = 0.7291.
  EXPECT_EQ(most_child_layers(kAlpha, kBeta, line, 0.73), 2);
  // w_1 = 0.7565 < 0.76.
  EXPECT_EQ(most_child_layers(kAlpha, kBeta, line, 0.76), 0);
  // At the limit itself, with the last bits either way, the count ends.
  const double limit = carried_white_limit(kAlpha, kBeta, line);
  for (const double least : {limit, std::nextafter(limit, 0.0), std::nextafter(limit, 1.0)})
    EXPECT_GT(most_child_layers(kAlpha, kBeta, line, least).value_or(100), 5);
}

TEST(WhiteEquations, RefuseWhatIsNoShare) {
  const LineWidth line;
  for (const double bad : {0.0, 1.0, -0.1, std::numeric_limits<double>::quiet_NaN()}) {
    EXPECT_THROW(child_white_share(bad, kGamma), std::invalid_argument);
    EXPECT_THROW(carried_white_share(1, kAlpha, bad, line), std::invalid_argument);
    EXPECT_THROW(carried_white_limit(bad, kBeta, line), std::invalid_argument);
    EXPECT_THROW(most_child_layers(kAlpha, kBeta, line, bad), std::invalid_argument);
    EXPECT_THROW(printed::child_white_share(bad, kGamma), std::invalid_argument);
    EXPECT_THROW(printed::carried_white_share(1, kAlpha, bad, kGamma), std::invalid_argument);
    EXPECT_THROW(printed::most_child_layers(kAlpha, kBeta, kGamma, bad), std::invalid_argument);
  }
  EXPECT_THROW(child_white_share(kAlpha, 0.3), std::invalid_argument);
  EXPECT_THROW(carried_white_share(1, kAlpha, kBeta, {0.0, 0.3}), std::invalid_argument);
  EXPECT_THROW(carried_white_share(0, kAlpha, kBeta, line), std::invalid_argument);
  EXPECT_THROW(printed::carried_white_share(0, kAlpha, kBeta, kGamma), std::invalid_argument);
}

// --- White shares against the ink of real markers ---------------------------------------------

/// Three layers of children in a quincunx, every child with exactly 6 black cells.
MarkerSet full_set(const LineWidth& line) {
  const std::vector<int> carrying{0, 4, 12, 20, 24};
  std::mt19937 random(3);
  std::vector<Code> used;
  const auto fresh_code = [&] {
    for (;;) {
      Code code{5, (std::uint64_t{1} << 25) - 1};
      while (code.black_count() < 6) {
        const int cell = static_cast<int>(random() % 25);
        if (std::count(carrying.begin(), carrying.end(), cell) == 0)
          code.bits &= ~(std::uint64_t{1} << cell);
      }
      const bool known = std::any_of(used.begin(), used.end(),
                                     [&](const Code& other) { return distance(code, other) == 0; });
      if (known || inner_distance(code) == 0) continue;
      used.push_back(code);
      return code;
    }
  };
  int id = 0;
  const std::function<Marker(int, int)> tree = [&](int cell, int layer) {
    Marker marker;
    marker.cell = cell;
    marker.id = layer == 1 ? 0 : id++;
    marker.code = fresh_code();
    if (layer < 3)
      for (const int child : carrying) marker.children.push_back(tree(child, layer + 1));
    return marker;
  };
  MarkerSet set;
  set.line = line;
  set.parents.push_back({1.6, tree(-1, 1)});
  validate(set);
  return set;
}

/// White shares of all cells in layer `layer` that carry a child.
std::vector<double> carrying_cells(const MarkerSet& set, int layer) {
  const auto cells = predicted_cells(set);
  const auto placed = place(set);
  std::vector<double> shares;
  for (const PlacedMarker& child : placed)
    if (child.layer == layer + 1) {
      const int n = placed[static_cast<std::size_t>(child.container)].code.cells;
      const int index = (child.cell / n + 1) * (n + 2) + child.cell % n + 1;
      shares.push_back(
          cells[static_cast<std::size_t>(child.container)][static_cast<std::size_t>(index)]);
    }
  return shares;
}

TEST(CarriedWhiteShare, IsExactForALineInside) {
  const LineWidth line{kGamma, 0.0};
  const MarkerSet set = full_set(line);
  for (const int layer : {1, 2}) {
    const double expected = carried_white_share(3 - layer, kAlpha, kBeta, line);
    const auto shares = carrying_cells(set, layer);
    ASSERT_EQ(shares.size(), layer == 1 ? 5U : 25U);
    for (const double share : shares) EXPECT_NEAR(share, expected, 1e-9) << "layer " << layer;
  }
}

TEST(CarriedWhiteShare, IsALeastValueForALineOutside) {
  for (const LineWidth line : {LineWidth{}, kPaperLine}) {
    const MarkerSet set = full_set(line);
    const double least = carried_white_share(2, kAlpha, kBeta, line);
    const double without_outside = carried_white_share(2, kAlpha, kBeta, {line.inside, 0.0});
    for (const double share : carrying_cells(set, 1)) {
      EXPECT_GE(share, least - 1e-9);
      EXPECT_LT(share, without_outside);
    }
    for (const double share : carrying_cells(set, 2))
      EXPECT_NEAR(share, carried_white_share(1, kAlpha, kBeta, line), 1e-9);
  }
}

// --- Planner ------------------------------------------------------------------------------------

/// 1.6 m on a 750 x 480 camera of f = 700 px, from 0.1 to 35 m, over the centre.
PlanRequest example() {
  PlanRequest request;
  request.nearest_m = 0.1;
  request.farthest_m = 35.0;
  request.width_px = 750;
  request.height_px = 480;
  request.focal_px = 700.0;
  request.side_m = 1.6;
  request.aim = 0.0;
  request.parent_px = 16.0;
  return request;
}

std::optional<PlanWarning> find(const Plan& plan, PlanConcern concern) {
  for (const PlanWarning& warning : plan.warnings)
    if (warning.concern == concern) return warning;
  return std::nullopt;
}

TEST(Plan, ThreeLayersByHand) {
  const Plan planned = plan(example());
  ASSERT_EQ(planned.layers.size(), 3U);
  EXPECT_EQ(planned.most_black, 6);
  EXPECT_EQ(planned.layout, LayoutKind::quincunx);
  EXPECT_EQ(planned.markers, 31);

  const PlanLayer& parent = planned.layers[0];
  EXPECT_DOUBLE_EQ(parent.side_m, 1.6);
  // Usable are 0.9 * 480 = 432 px: 700 * 1.6 / 432 = 2.59259 m; 700 * 1.6 / 16 = 70 m.
  EXPECT_NEAR(parent.nearest_m, 2.59259, 1e-5);
  EXPECT_NEAR(parent.farthest_m, 70.0, 1e-9);
  EXPECT_NEAR(parent.farthest_cell_px, 16.0 / 7.0, 1e-12);
  EXPECT_FALSE(parent.line_mm);

  const PlanLayer& middle = planned.layers[1];
  // 1.6 / 7 = 0.228571 m, with its line 8/7 of it: 700 * 0.261224 / 432 = 0.423280 m.
  EXPECT_NEAR(middle.side_m, 0.228571, 1e-6);
  EXPECT_NEAR(middle.nearest_m, 0.423280, 1e-6);
  EXPECT_NEAR(middle.farthest_m, 10.0, 1e-9);
  EXPECT_NEAR(middle.nearest_side_px, 378.0, 1e-9);
  // 228.571 mm / 14.
  EXPECT_NEAR(*middle.line_mm, 16.3265, 1e-4);

  const PlanLayer& last = planned.layers[2];
  EXPECT_NEAR(last.side_m, 0.0326531, 1e-7);
  EXPECT_NEAR(last.nearest_m, 0.0604686, 1e-7);
  EXPECT_FALSE(last.overlap);
  EXPECT_FALSE(last.white_share);

  // 10 / 2.59259 and 1.428571 / 0.423280.
  EXPECT_NEAR(*parent.overlap, 3.85714, 1e-5);
  EXPECT_NEAR(*middle.overlap, 3.37500, 1e-5);
  // As in Equation6And7.InkOutsideByHand.
  EXPECT_NEAR(*parent.white_share, 0.833819, 1e-6);
  EXPECT_NEAR(*middle.white_share, 0.877551, 1e-6);

  for (const PlanWarning& warning : planned.warnings)
    EXPECT_EQ(warning.severity, PlanSeverity::note) << warning.text;
}

TEST(Plan, FindsTheSideThatTheFarthestDistanceNeeds) {
  PlanRequest request = example();
  request.side_m.reset();
  // 35 * 16 / 700 = 0.8 m.
  EXPECT_DOUBLE_EQ(plan(request).side_m, 0.8);
  // 33.3 * 16 / 700 = 0.761143, rounded up to 0.762.
  request.farthest_m = 33.3;
  EXPECT_DOUBLE_EQ(plan(request).side_m, 0.762);
  EXPECT_FALSE(find(plan(request), PlanConcern::too_far));
}

TEST(Plan, NumberOfLayersIsThatOfEquation4) {
  std::mt19937_64 random(11);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  for (int trial = 0; trial < 500; ++trial) {
    PlanRequest request = example();
    request.cells = 4 + static_cast<int>(random() % 5);
    request.line = {1.0 / 20.0, 0.0};
    request.nearest_m = 0.01 + unit(random);
    request.farthest_m = request.nearest_m * (1.5 + 5000.0 * unit(random));
    request.side_m = request.farthest_m * request.parent_px / request.focal_px;
    const int expected = layers_needed(request.nearest_m, request.farthest_m,
                                       1.0 / (*request.cells + 2), request.parent_px, 432.0);
    EXPECT_EQ(static_cast<int>(plan(request).layers.size()), expected);
  }
}

TEST(Plan, ServesEveryWantedDistanceOrSaysWhyNot) {
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  int silent = 0;
  int warned = 0;
  for (int trial = 0; trial < 500; ++trial) {
    PlanRequest request = example();
    request.cells = 4 + static_cast<int>(random() % 5);
    request.width_px = 160 + static_cast<int>(random() % 800);
    request.child_px = 12.0 + 30.0 * unit(random);
    request.nearest_m = 0.05 + unit(random);
    request.farthest_m = request.nearest_m * (1.5 + 500.0 * unit(random));
    request.side_m = 0.02 + 2.0 * unit(random);
    if (trial % 3 == 0) request.layers = 1 + static_cast<int>(random() % 4);
    const Plan planned = plan(request);
    const bool complains = find(planned, PlanConcern::gap) || find(planned, PlanConcern::too_far) ||
                           find(planned, PlanConcern::too_near);
    bool served = true;
    for (int step = 0; step <= 2000; ++step) {
      const double h =
          request.nearest_m * std::pow(request.farthest_m / request.nearest_m, step / 2000.0);
      served = served && std::any_of(planned.layers.begin(), planned.layers.end(), [&](auto& l) {
                 return h >= l.nearest_m * (1 - 1e-6) && h <= l.farthest_m * (1 + 1e-6);
               });
    }
    // A gap may hide between two steps, so a complaint need not show here; silence must hold.
    EXPECT_TRUE(served || complains) << "trial " << trial;
    ++(complains ? warned : silent);
  }
  EXPECT_GT(silent, 50);
  EXPECT_GT(warned, 50);
}

TEST(Plan, WarnsOfGaps) {
  PlanRequest request = example();
  request.cells = 8;
  request.line = {1.0 / 20.0, 0.0};
  request.width_px = request.height_px = 240;
  // Usable 216 px; children of a tenth of the side are found from 24 px, so they take over only
  // where the parent has 240 px: 216 / 24 / 10 = 0.9.
  request.child_px = 24.0;
  const Plan gapped = plan(request);
  EXPECT_NEAR(*gapped.layers[0].overlap, 0.9, 1e-9);
  const auto gap = find(gapped, PlanConcern::gap);
  ASSERT_TRUE(gap);
  EXPECT_EQ(gap->severity, PlanSeverity::serious);
  // From 700 * 0.16 / 24 = 4.667 m to 700 * 1.6 / 216 = 5.185 m.
  EXPECT_NE(gap->text.find("from 4.67 m to 5.19 m"), std::string::npos) << gap->text;

  // From 20 px: 216 / 20 / 10 = 1.08.
  request.child_px = 20.0;
  EXPECT_FALSE(find(plan(request), PlanConcern::gap));
  EXPECT_TRUE(find(plan(request), PlanConcern::small_overlap));

  // A gap outside the wanted range is nobody's concern.
  request.child_px = 24.0;
  request.nearest_m = 6.0;
  request.layers = 2;
  EXPECT_FALSE(find(plan(request), PlanConcern::gap));
}

TEST(Plan, WarnsOfEndsThatAreOutOfReach) {
  PlanRequest request = example();
  request.side_m = 0.5;
  // 700 * 0.5 / 16 = 21.9 m; 35 m need 0.8 m.
  const Plan small = plan(request);
  const auto far = find(small, PlanConcern::too_far);
  ASSERT_TRUE(far);
  EXPECT_NE(far->text.find("21.9 m"), std::string::npos) << far->text;
  EXPECT_NE(far->text.find("0.800 m"), std::string::npos) << far->text;
  EXPECT_EQ(small.warnings.front().severity, PlanSeverity::serious);

  request = example();
  request.layers = 2;
  const Plan shallow = plan(request);
  EXPECT_EQ(shallow.layers.size(), 2U);
  EXPECT_TRUE(find(shallow, PlanConcern::too_near));
}

TEST(Plan, WarnsOfThinLines) {
  PlanRequest request = example();
  request.side_m = 0.1;
  request.farthest_m = 3.0;
  request.layers = 3;
  // 100 mm / 49 / 14 = 0.1458 mm: less than 0.2 mm, more than a dot of 0.0423 mm.
  const Plan thin = plan(request);
  ASSERT_TRUE(find(thin, PlanConcern::thin_line));
  EXPECT_EQ(find(thin, PlanConcern::thin_line)->severity, PlanSeverity::warning);
  request.printer_dot_mm = 0.15;
  EXPECT_EQ(find(plan(request), PlanConcern::thin_line)->severity, PlanSeverity::serious);
  request.side_m = 1.6;
  EXPECT_FALSE(find(plan(request), PlanConcern::thin_line));
}

TEST(Plan, WarnsOfDarkCells) {
  PlanRequest request = example();
  EXPECT_FALSE(find(plan(request), PlanConcern::dark_cells));
  // 13 of 49 cells: w_1 = 0.8, w_2 = 0.8 - 0.265 (0.2 + 0.306) = 0.666.
  request.alpha = 0.2;
  request.layout = LayoutKind::checkerboard;
  const Plan low = plan(request);
  ASSERT_TRUE(find(low, PlanConcern::dark_cells));
  EXPECT_EQ(find(low, PlanConcern::dark_cells)->severity, PlanSeverity::warning);
  // w_1 = 0.7, w_2 = 0.7 - 0.265 (0.3 + 0.306) = 0.539.
  request.alpha = 0.3;
  EXPECT_EQ(find(plan(request), PlanConcern::dark_cells)->severity, PlanSeverity::serious);
}

TEST(Plan, NotesPageFocusAndAxis) {
  const Plan large = plan(example());
  EXPECT_TRUE(find(large, PlanConcern::larger_than_page));
  EXPECT_TRUE(find(large, PlanConcern::off_axis));
  // Half a cell of the last layer: 32.65 / 7 / 2 = 2.33 mm.
  ASSERT_TRUE(find(large, PlanConcern::focus));
  EXPECT_NE(find(large, PlanConcern::focus)->text.find("2.34 mm"), std::string::npos)
      << find(large, PlanConcern::focus)->text;

  PlanRequest request = example();
  request.side_m = 0.147;  // with one cell of white around: 0.147 * 9 / 7 = 0.189 m
  request.nearest_m = 1.0;
  request.farthest_m = 3.0;
  const Plan small = plan(request);
  EXPECT_EQ(small.layers.size(), 1U);
  EXPECT_TRUE(small.warnings.empty()) << small.warnings.front().text;
}

TEST(Plan, RefusesWhatMakesNoSense) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  const std::vector<std::function<void(PlanRequest&)>> wrongs{
      [](auto& r) { r.nearest_m = 0.0; },
      [](auto& r) { r.nearest_m = -1.0; },
      [](auto& r) { r.nearest_m = 35.0; },
      [&](auto& r) { r.nearest_m = nan; },
      [&](auto& r) { r.farthest_m = infinity; },
      [&](auto& r) { r.farthest_m = nan; },
      [](auto& r) { r.width_px = 0; },
      [](auto& r) { r.height_px = -480; },
      [](auto& r) { r.height_px = 17; },
      [](auto& r) { r.focal_px = 0.0; },
      [&](auto& r) { r.focal_px = nan; },
      [](auto& r) { r.side_m = 0.0; },
      [&](auto& r) { r.side_m = nan; },
      [&](auto& r) { r.side_m = infinity; },
      [](auto& r) { r.layers = 0; },
      [](auto& r) { r.layers = 9; },
      [](auto& r) { r.cells = 3; },
      [](auto& r) { r.cells = 9; },
      [](auto& r) {
        r.line = {0.0, 0.0};
      },
      [](auto& r) { r.line.outside = 0.3; },
      [&](auto& r) { r.line.inside = nan; },
      [](auto& r) { r.alpha = 0.0; },
      [](auto& r) { r.alpha = 1.0; },
      [&](auto& r) { r.alpha = nan; },
      [](auto& r) { r.alpha = 0.99 / 49.0; },
      [](auto& r) { r.aim = -0.1; },
      [](auto& r) { r.aim = 0.6; },
      [&](auto& r) { r.aim = nan; },
      [](auto& r) {
        r.layout = LayoutKind::carpet;
        r.layers = 2;
      },
      [](auto& r) {
        r.layout = LayoutKind::checkerboard;
        r.layers = 6;
      },
      [](auto& r) { r.parent_px = 0.0; },
      [&](auto& r) { r.child_px = nan; },
      [](auto& r) { r.child_px = 500.0; },
      [](auto& r) { r.usable_share = 0.0; },
      [](auto& r) { r.usable_share = 1.1; },
      [](auto& r) { r.printer_dot_mm = 0.0; },
      [](auto& r) {
        r.side_m.reset();
        r.farthest_m = 1e308;
        r.focal_px = 1e-3;
      },
  };
  for (std::size_t i = 0; i < wrongs.size(); ++i) {
    PlanRequest request = example();
    wrongs[i](request);
    EXPECT_THROW(plan(request), std::invalid_argument) << "case " << i;
  }
}

// --- Layouts ------------------------------------------------------------------------------------

PlanRequest beside(double nearest_m, double farthest_m) {
  PlanRequest request = example();
  request.side_m.reset();
  request.aim = 0.35;
  request.parent_px = 14.0;
  request.nearest_m = nearest_m;
  request.farthest_m = farthest_m;
  return request;
}

TEST(Plan, TakesTheFewestMarkersThatServeBesideTheCentre) {
  // Ratios of 10, 40, 60, 120 and 400 need ever more of them.
  struct Case {
    double nearest_m;
    LayoutKind layout;
    int markers;
  };
  for (const Case& expected : {Case{4.0, LayoutKind::quincunx, 1},
                               {1.0, LayoutKind::quincunx, 6},
                               {0.67, LayoutKind::checkerboard, 14},
                               {0.34, LayoutKind::checkerboard, 183},
                               {0.1, LayoutKind::carpet, 251}}) {
    const PlanRequest request = beside(expected.nearest_m, 40.0);
    const Plan planned = plan(request);
    EXPECT_EQ(planned.layout, expected.layout) << expected.nearest_m;
    EXPECT_EQ(planned.markers, expected.markers) << expected.nearest_m;
    EXPECT_LE(planned.beside.nearest_m, expected.nearest_m);
    EXPECT_LT(planned.centred.nearest_m, planned.beside.nearest_m);
    EXPECT_GE(planned.beside.farthest_m, 40.0);
    EXPECT_FALSE(find(planned, PlanConcern::off_axis));
  }
}

TEST(Plan, CarpetByHand) {
  PlanRequest request = beside(0.1, 40.0);
  request.side_m = 0.63;
  request.layout = LayoutKind::carpet;
  request.cells = 5;
  const Plan planned = plan(request);
  ASSERT_EQ(planned.layers.size(), 3U);
  EXPECT_NEAR(planned.layers[1].side_m, 0.09, 1e-12);
  EXPECT_EQ(planned.layers[1].cells, 7);
  EXPECT_NEAR(planned.layers[2].side_m, 0.01, 1e-12);
  EXPECT_EQ(planned.layers[2].cells, 5);
  // w_1 = 1 - 6/49, w_2 = w_1 - 1/9 (6/49 + 15/49).
  EXPECT_NEAR(*planned.layers[0].white_share, 0.877551 - 0.428571 / 9.0, 1e-6);
}

TEST(Plan, SaysFromWhereOnTheBestLayoutServes) {
  PlanRequest request = beside(0.02, 40.0);
  request.cells = 5;
  const Plan planned = plan(request);
  EXPECT_EQ(planned.layout, LayoutKind::carpet);
  const auto warning = find(planned, PlanConcern::off_axis);
  ASSERT_TRUE(warning);
  EXPECT_EQ(warning->severity, PlanSeverity::warning);
}

TEST(Plan, ConcernsAndSeveritiesHaveNames) {
  EXPECT_EQ(to_string(PlanConcern::small_overlap), "small-overlap");
  EXPECT_EQ(to_string(PlanSeverity::serious), "serious");
}

}  // namespace
}  // namespace harco
