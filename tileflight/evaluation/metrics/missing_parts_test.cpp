#include "tileflight/evaluation/metrics/missing_parts.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <numeric>
#include <random>

#include "tests/synthetic_maps.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/evaluation/metrics/student_t.h"

namespace tileflight::metrics::missing_parts_test {
namespace {

using geometry::Vec3;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

/// Points on a floor of 60 m x 60 m, `density` a square metre, but for a square of the edge around (20, 30).
KeptDistances floor_without(double edge_m, double density, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> place(0.0, 60.0);
  KeptDistances map;
  for (int k = 0; k < static_cast<int>(3600.0 * density); ++k) {
    const Vec3 p(place(random), place(random), 0.3);
    if ((p - Vec3(20, 30, 0.3)).cwiseAbs().maxCoeff() < 0.5 * edge_m) continue;
    map.positions.push_back(p);
    map.distances.push_back(0.02);
  }
  map.points = map.positions.size();
  return map;
}

SeenSurface seen_floor() {
  SeenSurface seen;
  for (double x = 0.25; x < 60.0; x += 0.5)
    for (double y = 0.25; y < 60.0; y += 0.5) seen.positions.push_back({x, y, 0.3});
  seen.map_distance_m.assign(seen.positions.size(), 0.0);
  return seen;
}

TEST(IncompleteBeta, IsTheBinomialsTail) {
  for (const double p : {0.1, 0.5, 0.8}) {
    double sum = 0.0, term = std::pow(1.0 - p, 12);
    for (int k = 0; k < 12; ++k) {
      sum += term;
      EXPECT_NEAR(incomplete_beta(1.0 - p, 12.0 - k, k + 1.0), sum, 1e-12) << k;
      term *= (12.0 - k) / (k + 1.0) * p / (1.0 - p);
    }
  }
}

TEST(MissingParts, AHoleIsFoundWhereItIs) {
  const SeenSurface seen = seen_floor();
  const auto found = missing_parts(floor_without(0, 3, 1), seen, floor_without(5.0, 3, 2), seen);
  ASSERT_FALSE(found.parts.empty());
  EXPECT_EQ(found.parts[0].lacking_map, 1u);
  EXPECT_LT((found.parts[0].center - Vec3(20, 30, 0.3)).head<2>().norm(), 2.0);
  EXPECT_EQ(found.parts[0].points[1], 0u);
  EXPECT_LT(found.parts[0].p, 1e-3);
  const auto other = missing_parts(floor_without(5.0, 3, 2), seen, floor_without(0, 3, 1), seen);
  EXPECT_EQ(other.parts[0].lacking_map, 0u);
  EXPECT_NEAR(other.parts[0].p, found.parts[0].p, 1e-9 * found.parts[0].p);
}

TEST(MissingParts, AShareOfTheSurfaceIsLackingWhereAHoleIs) {
  const SeenSurface seen = seen_floor();
  for (const double edge_m : {4.0, 10.0, 20.0}) {
    const double hole = edge_m * edge_m / 3600.0;
    const auto found = missing_parts(floor_without(0, 6, 1), seen, floor_without(edge_m, 6, 2), seen);
    EXPECT_NEAR(found.lacking_share(1), hole, 0.1 * hole + 0.001) << edge_m;
    EXPECT_LT(found.lacking_share(0), 0.002);
    EXPECT_GT(std::accumulate(found.informative.begin(), found.informative.end(), 0.0), 0.99 * 14400.0);
  }
  const auto thin = missing_parts(floor_without(0, 0.05, 1), seen, floor_without(10.0, 0.05, 2), seen);
  EXPECT_LT(std::accumulate(thin.informative.begin(), thin.informative.end(), 0.0), 0.3 * 14400.0)
      << "too few points to say";
}

TEST(MissingParts, ErrorsOfThePointsAreNoHoles) {
  // One map's floor lies 0.2 m above the other's, as from correlated errors.
  const SeenSurface seen = seen_floor();
  KeptDistances above = floor_without(0, 3, 2);
  for (Vec3& p : above.positions) p.z() += 0.2;
  for (const double z : {0.0, 0.9, 1.0, 1.9}) {
    KeptDistances a = floor_without(0, 3, 1), b = above;
    SeenSurface there = seen;
    for (auto* points : {&a.positions, &b.positions, &there.positions})
      for (Vec3& p : *points) p.z() += z;
    EXPECT_TRUE(missing_parts(a, there, b, there).parts.empty()) << z;
  }
}

TEST(MissingParts, WhatOneCameraDidNotSeeIsNotMissing) {
  const SeenSurface seen = seen_floor();
  SeenSurface apart;
  for (const Vec3& p : seen.positions)
    if ((p - Vec3(20, 30, 0.3)).cwiseAbs().maxCoeff() > 12.0) apart.positions.push_back(p);
  EXPECT_TRUE(missing_parts(floor_without(0, 3, 1), seen, floor_without(5.0, 3, 2), apart).parts.empty());
  EXPECT_EQ(missing_parts(floor_without(0, 3, 1), {}, floor_without(5.0, 3, 2), seen).balls, 0u);
}

TEST(MissingParts, ChanceAloneFindsSomethingInFewerThanOneOfTwenty) {
  const SeenSurface seen = seen_floor();
  int false_alarms = 0;
  for (std::uint64_t k = 0; k < 60; ++k)
    false_alarms +=
        !missing_parts(floor_without(0, 3, 2 * k), seen, floor_without(0, 2, 2 * k + 1), seen).parts.empty();
  EXPECT_LE(false_alarms, 3);
}

TEST(MissingParts, MapsThatDifferEverywhereHideASmallOne) {
  const SeenSurface seen = seen_floor();
  const tests::SmoothField field(5, 4.0);
  KeptDistances uneven;
  for (const Vec3& p : floor_without(5.0, 6, 3).positions)
    if (tests::as_share(tests::hash_of(1, std::llround(1e6 * p.x()), std::llround(1e6 * p.y()), 0)) <
        0.5 + 0.3 * field.at(p))
      uneven.positions.push_back(p);
  uneven.distances.assign(uneven.positions.size(), 0.02);
  const auto found = missing_parts(floor_without(0, 3, 1), seen, uneven, seen);
  EXPECT_GT(found.correlation, 0.03);
  for (const MissingPart& part : found.parts) EXPECT_GT(part.points[0], 15u) << "only what is gross";
}

/// Some 25 points a square metre: in most of these walls the hole contains a ball with 30 points of the complete map.
TEST(MissingParts, FivePercentOfAWallIsFoundWhereTheMapIsDenseEnough) {
  int found = 0, alarms = 0;
  constexpr std::uint64_t kPlaces = 6;
  for (std::uint64_t k = 0; k < kPlaces; ++k) {
    const tests::SyntheticPlace place(300 + k, 40.0);
    const geometry::TriangleIndex surface(place.mesh());
    const auto map = [&](double wall_share, std::uint64_t seed) {
      return tests::scored(place, surface,
                           tests::synthetic_map(place, {.points = 60000, .gaps = 0.0, .wall_share = wall_share}, seed));
    };
    const ScoredMap whole = map(0.0, 2 * k), lacking = map(0.05, 2 * k + 1), other = map(0.0, 2 * k + 1);
    found += !missing_parts(whole.surface, whole.seen, lacking.surface, lacking.seen).parts.empty();
    alarms += !missing_parts(whole.surface, whole.seen, other.surface, other.seen).parts.empty();
  }
  EXPECT_GE(found, 5) << "of 6; one wall is so small that no ball fits well";
  EXPECT_EQ(alarms, 0);
}

TEST(MissingParts, SameForAnyNumberOfThreads) {
  const SeenSurface seen = seen_floor();
  const auto a = floor_without(0, 3, 1), b = floor_without(6.0, 3, 2);
  const std::string first = to_json(missing_parts(a, seen, b, seen)).dump();
  const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  EXPECT_EQ(to_json(missing_parts(a, seen, b, seen)).dump(), first);
  EXPECT_THAT([&] { missing_parts(a, seen, b, seen, {.diameters_m = {0.0}}); },
              ThrowsMessage<InputError>(HasSubstr("balls: their diameter must be above zero")));
}

}  // namespace
}  // namespace tileflight::metrics::missing_parts_test
