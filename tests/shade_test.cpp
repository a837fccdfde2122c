// Shadows as pixels of paper show them, and the light fitted to pixels of all kinds.
#include "pose/shade.hpp"

#include <cmath>
#include <functional>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "pose/light_fit.hpp"

namespace harco {
namespace {

struct Paper {
  std::vector<float> grey, u, v;
  std::optional<Shadow> shadow() const { return find_shadow(grey, u, v); }
};

/// Pixels all over the marker, with noise of 2 grey levels.
Paper paper(const std::function<double(double, double)>& light) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> place(-1.0, 1.0);
  std::normal_distribution<double> noise(0.0, 2.0);
  Paper seen;
  for (int i = 0; i < 900; ++i) {
    const double u = place(random), v = place(random);
    seen.u.push_back(static_cast<float>(u));
    seen.v.push_back(static_cast<float>(v));
    seen.grey.push_back(static_cast<float>(200.0 * light(u, v) + noise(random)));
  }
  return seen;
}

/// Share of the places whose side of the border the shape tells rightly.
double told_rightly(const Shadow& shadow, const std::function<bool(double, double)>& inside) {
  int right = 0, all = 0;
  for (double u = -0.95; u < 1.0; u += 0.1)
    for (double v = -0.95; v < 1.0; v += 0.1) {
      const auto value = shadow.shape.cast<float>().dot(
          ShadowShape::terms(static_cast<float>(u), static_cast<float>(v)));
      right += (value > 0.0F) == inside(u, v) ? 1 : 0;
      ++all;
    }
  return static_cast<double>(right) / all;
}

TEST(Shadow, DepthRunsFromNoneToAllWithItsSlope) {
  EXPECT_EQ(ShadowShape::depth(-9.0F).share, 0.0F);
  EXPECT_EQ(ShadowShape::depth(9.0F).share, 1.0F);
  EXPECT_NEAR(ShadowShape::depth(1.0F).share, 0.841345F, 1e-5F);
  for (const float at : {-2.0F, -0.3F, 0.0F, 1.2F}) {
    const float difference =
        (ShadowShape::depth(at + 0.01F).share - ShadowShape::depth(at - 0.01F).share) / 0.02F;
    EXPECT_NEAR(ShadowShape::depth(at).slope, difference, 1e-3F);
  }
}

TEST(Shadow, FindsBordersOfEveryShape) {
  const std::vector<std::function<bool(double, double)>> shapes{
      [](double u, double v) { return 0.8 * u - 0.6 * v > 0.3; },
      [](double u, double v) { return std::abs(0.8 * u - 0.6 * v - 0.2) < 0.25; },
      [](double u, double v) { return std::hypot(u - 0.3, v + 0.2) < 0.5; },
      [](double u, double v) { return v > 0.4 * u * u - 0.3; },
  };
  for (std::size_t i = 0; i < shapes.size(); ++i) {
    SCOPED_TRACE(i);
    const auto& inside = shapes[i];
    const auto shadow =
        paper([&](double u, double v) { return inside(u, v) ? 0.6 : 1.0; }).shadow();
    ASSERT_TRUE(shadow);
    EXPECT_NEAR(shadow->lit, 200.0, 1.0);
    EXPECT_NEAR(shadow->shaded, 120.0, 1.0);
    EXPECT_GT(told_rightly(*shadow, inside), 0.97);
  }
}

TEST(Shadow, FindsNoneInEvenLightAndNoneInSpots) {
  EXPECT_FALSE(paper([](double, double) { return 1.0; }).shadow());
  EXPECT_FALSE(paper([](double u, double v) {
                 return std::sin(9.0 * u) * std::sin(9.0 * v) > 0.0 ? 0.6 : 1.0;
               }).shadow());
  EXPECT_FALSE(Paper{}.shadow());
}

/// Greys of random pixels under a light, seen partly black and partly white, with noise.
struct Lit {
  LightFit fit;

  Lit(const Light& light, float noise) {
    std::mt19937 random(7);
    std::uniform_real_distribution<float> place(-1.0F, 1.0F), share(0.0F, 1.0F);
    std::normal_distribution<float> error(0.0F, noise);
    for (int i = 0; i < 1500; ++i) {
      const float u = place(random);
      const float v = place(random);
      const float white = share(random);
      fit.add(grey(light, white, u, v) + error(random), white, u, v);
    }
  }

  static float grey(const Light& light, float white, float u, float v) {
    const Eigen::Matrix<float, Light::kLevels, 1> l = light.levels.cast<float>();
    const float bow = l(6) * u * u + l(7) * u * v + l(8) * v * v;
    const float black = l(0) + l(1) * u + l(2) * v + static_cast<float>(light.black_part()) * bow;
    const float bright = l(3) + l(4) * u + l(5) * v + bow;
    const float depth =
        ShadowShape::depth(light.shape.cast<float>().dot(ShadowShape::terms(u, v))).share;
    return (1.0F - depth * static_cast<float>(1.0 - light.shaded_black)) * (1.0F - white) * black +
           (1.0F - depth * static_cast<float>(1.0 - light.shaded_white)) * white * bright;
  }
};

/// A third of the marker in a shadow whose edge fades over a tenth of it.
Light half_in_shadow() {
  Light light;
  light.levels << 30.0, 2.0, -1.0, 200.0, 8.0, -5.0, 3.0, 0.0, -2.0;
  light.shaded_white = 0.5;
  light.shaded_black = 0.6;
  light.shape << -3.0, 8.0, 6.0, 0.0, 0.0, 0.0;
  return light;
}

TEST(LightFit, ComesBackToTheLightFromARoughOne) {
  const Light truth = half_in_shadow();
  Lit lit(truth, 2.0F);
  Light light;
  light.levels << 40.0, 0.0, 0.0, 190.0, 0.0, 0.0, 0.0, 0.0, 0.0;
  light.shaded_white = light.shaded_black = 0.6;
  light.shape << -1.5, 5.0, 3.0, 0.0, 0.0, 0.0;
  EXPECT_GT(lit.fit.fit(light, 100.0), 1U);
  EXPECT_NEAR(light.shaded_white, 0.5, 0.01);
  EXPECT_NEAR(light.shaded_black, 0.6, 0.05);
  EXPECT_NEAR(light.levels(0), 30.0, 1.0);
  EXPECT_NEAR(light.levels(3), 200.0, 1.0);
  EXPECT_NEAR(light.levels(4), 8.0, 1.5);
  // The border, where its polynomial vanishes.
  EXPECT_NEAR(light.shape(0) / light.shape(1), -3.0 / 8.0, 0.02);
  EXPECT_NEAR(light.shape(2) / light.shape(1), 6.0 / 8.0, 0.02);
}

TEST(LightFit, NoEdgeIsSteeperThanAllowed) {
  Lit lit(half_in_shadow(), 1.0F);
  Light light = half_in_shadow();
  lit.fit.fit(light, 5.0);
  EXPECT_LT(std::hypot(light.shape(1), light.shape(2)), 5.5);
}

TEST(LightFit, TellsHowMuchSteeperTheEdgeIs) {
  Lit lit(half_in_shadow(), 1.0F);
  Light light = half_in_shadow();
  light.shape *= 4.0;
  EXPECT_EQ(lit.fit.best_steepness(light), 0.25);
}

}  // namespace
}  // namespace harco
