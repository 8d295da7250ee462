#include "tileflight/slam/keyframes/synthetic_scene.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <random>

namespace tileflight::keyframes::synthetic_scene_test {
namespace {

using geometry::Vec3;
using test_support::cosine;
using test_support::hit_distance;
using test_support::Relief;
using test_support::sine;
using test_support::sine_hills;

TEST(SyntheticScene, SineIsThatOfTheLibrary) {
  for (double x = -2000.0; x < 2000.0; x += 0.0137) {
    ASSERT_NEAR(sine(x), std::sin(x), 1.2e-9) << x;
    ASSERT_NEAR(cosine(x), std::cos(x), 1.2e-9) << x;
  }
}

Relief hills() { return sine_hills({.amplitude_m = 1.5, .k_x = 0.35, .k_y = 0.28, .phase_x = 0.2}, 0.6); }

TEST(SyntheticScene, HillsAreNowhereHigherOrSteeperThanTheySay) {
  const Relief relief = hills();
  double highest = 0.0, steepest = 0.0;
  for (double x = -10.0; x < 10.0; x += 0.05) {
    for (double y = -12.0; y < 12.0; y += 0.05) {
      const double height = relief.height_m(x, y);
      highest = std::max(highest, height);
      steepest = std::max(
          steepest, std::hypot(relief.height_m(x + 1e-4, y) - height, relief.height_m(x, y + 1e-4) - height) / 1e-4);
    }
  }
  EXPECT_LE(highest, relief.highest_m);
  EXPECT_GT(highest, 0.999 * relief.highest_m);
  EXPECT_LE(steepest, relief.steepest * (1 + 1e-4));
  EXPECT_GT(steepest, 0.999 * relief.steepest);
}

/// Distance at which a ray is first below the relief, by steps of a centimetre; 0: nowhere.
double first_below_m(const Relief& relief, const Vec3& origin, const Vec3& ray) {
  for (double d = 0.0; d < 200.0; d += 0.01) {
    const Vec3 p = origin + d * ray;
    if (p.z() <= relief.height_m(p.x(), p.y())) return d;
  }
  return 0.0;
}

TEST(SyntheticScene, RaysEndOnTheGroundThatTheyMeetFirst) {
  const Relief relief = hills();
  Relief unknown_slopes = relief;
  unknown_slopes.steepest = std::numeric_limits<double>::infinity();
  const Vec3 origin(1.0, -2.0, 12.0);
  for (double heading = 0.0; heading < 6.3; heading += 0.13) {
    for (const double down : {0.2, 0.4, 0.56, 0.8, 2.0}) {
      const Vec3 ray = Vec3(std::cos(heading), std::sin(heading), -down).normalized();
      const double distance_m = hit_distance(relief, origin, ray);
      const Vec3 p = origin + distance_m * ray;
      EXPECT_NEAR(p.z(), relief.height_m(p.x(), p.y()), 1e-6);
      EXPECT_NEAR(distance_m, first_below_m(relief, origin, ray), 0.011);
      EXPECT_NEAR(distance_m, hit_distance(unknown_slopes, origin, ray), 2e-6);
      for (const double guess_m : {0.1, 0.9 * distance_m, 1.1 * distance_m, 200.0})
        EXPECT_NEAR(distance_m, hit_distance(relief, origin, ray, guess_m), 2e-6) << guess_m;
    }
  }
  EXPECT_EQ(hit_distance(relief, origin, Vec3(1.0, 0.0, 0.1).normalized()), 0.0);
}

/// Rays of every kind beside each other: to the sky, along the ground, and down; from above the hills and between them.
TEST(SyntheticScene, FourRaysTogetherEndWhereEachEndsAloneToTheLastBit) {
  const test_support::SineHills shape{.amplitude_m = 1.5, .k_x = 0.35, .k_y = 0.28, .phase_x = 0.2};
  const Relief relief = sine_hills(shape, 0.6);
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  int skies = 0, grounds = 0;
  for (int i = 0; i < 5000; ++i) {
    test_support::FourRays four;
    std::array<double, 4> guesses{};
    for (std::size_t k = 0; k < 4; ++k) {
      four.origins[k] = Vec3(20.0 * uniform(random), 20.0 * uniform(random), 6.0 + 5.5 * uniform(random));
      four.rays[k] = Vec3(uniform(random), uniform(random), 0.7 * uniform(random) - 0.4).normalized();
      guesses[k] = four.distances[k] = std::max(0.0, 40.0 * uniform(random));
    }
    hit_distances(relief, shape, four);
    for (std::size_t k = 0; k < 4; ++k) {
      const double alone = hit_distance(relief, four.origins[k], four.rays[k], guesses[k]);
      ASSERT_EQ(four.distances[k], alone) << i;
      ++(alone > 0 ? grounds : skies);
    }
  }
  EXPECT_GT(skies, 1000);
  EXPECT_GT(grounds, 10000);
}

}  // namespace
}  // namespace tileflight::keyframes::synthetic_scene_test
