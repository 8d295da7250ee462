#include "tileflight/core/geometry/nearest.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <set>

#include "tileflight/core/base/input_error.h"

namespace tileflight::geometry::nearest_test {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

std::vector<Vec3> random_points(std::size_t count, unsigned seed, double size_m = 10.0) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(0.0, size_m);
  std::vector<Vec3> points(count);
  for (Vec3& p : points) p = Vec3(uniform(random), uniform(random), uniform(random));
  return points;
}

/// Points on a lattice: many exactly equal distances.
std::vector<Vec3> lattice(int side) {
  std::vector<Vec3> points;
  for (int i = 0; i < side * side * side; ++i) points.emplace_back(i % side, i / side % side, i / side / side);
  std::shuffle(points.begin(), points.end(), std::mt19937(3));
  return points;
}

/// All points, nearest first; on ties the lower index first.
std::vector<Neighbor> brute_force(const std::vector<Vec3>& points, const Vec3& query) {
  std::vector<Neighbor> all;
  for (std::size_t i = 0; i < points.size(); ++i) all.push_back({i, (points[i] - query).norm()});
  std::stable_sort(all.begin(), all.end(),
                   [](const Neighbor& a, const Neighbor& b) { return a.distance_m < b.distance_m; });
  return all;
}

void expect_equal(const std::vector<Neighbor>& actual, const std::vector<Neighbor>& expected) {
  ASSERT_EQ(actual.size(), expected.size());
  for (std::size_t i = 0; i < actual.size(); ++i) {
    EXPECT_EQ(actual[i].index, expected[i].index) << i;
    EXPECT_DOUBLE_EQ(actual[i].distance_m, expected[i].distance_m) << i;
  }
}

TEST(NearestIndex, EqualsBruteForceOnRandomPoints) {
  const auto points = random_points(2000, 1);
  const NearestIndex index(points);
  EXPECT_EQ(index.size(), 2000U);
  for (const Vec3& query : random_points(200, 2, 12.0)) {
    const auto expected = brute_force(points, query);
    EXPECT_EQ(index.nearest(query)->index, expected[0].index);
    expect_equal(index.nearest_k(query, 17), {expected.begin(), expected.begin() + 17});
    const auto end =
        std::find_if(expected.begin(), expected.end(), [](const Neighbor& n) { return n.distance_m > 1.5; });
    expect_equal(index.within(query, 1.5), {expected.begin(), end});
    std::set<std::size_t> visited, near;
    for (auto neighbor = expected.begin(); neighbor != end; ++neighbor) near.insert(neighbor->index);
    index.for_each_within(query, 1.5, [&](std::size_t i) { EXPECT_TRUE(visited.insert(i).second) << "once"; });
    EXPECT_EQ(visited, near);
  }
}

TEST(NearestIndex, LowestIndexOfEqualDistancesWins) {
  const auto points = lattice(7);
  const NearestIndex index(points);
  for (int i = 0; i < 13 * 13 * 13; ++i) {
    const Vec3 query = 0.5 * Vec3(i % 13, i / 13 % 13, i / 169);
    const auto expected = brute_force(points, query);
    EXPECT_EQ(index.nearest(query)->index, expected[0].index) << query.transpose();
    expect_equal(index.nearest_k(query, 9), {expected.begin(), expected.begin() + 9});
  }
}

TEST(NearestIndex, DuplicatesAndOnePoint) {
  const NearestIndex index(std::vector<Vec3>(100, Vec3(1, 2, 3)));
  EXPECT_EQ(index.nearest(Vec3(1, 2, 3))->index, 0U);
  EXPECT_EQ(index.nearest(Vec3(4, 2, 3))->distance_m, 3.0);
  EXPECT_EQ(index.nearest_k(Vec3::Zero(), 3)[2].index, 2U);
  EXPECT_EQ(index.nearest_k(Vec3::Zero(), 1000).size(), 100U);
  const NearestIndex one({Vec3(1, 0, 0)});
  EXPECT_EQ(one.nearest(Vec3::Zero())->index, 0U);
}

TEST(NearestIndex, EqualPointsAmongOthersAreAllFound) {
  std::mt19937 random(7);
  std::vector<Vec3> points;
  const std::vector<Vec3> places = random_points(40, 5);  // some with many points, some with one
  for (int i = 0; i < 2000; ++i) points.push_back(places[random() % 30 * (random() % 2)]);
  points.insert(points.end(), places.begin() + 30, places.end());
  points.push_back(Vec3(1e30, 0, 0));  // all others lie in one cell of the Morton curve
  const NearestIndex index(points);
  EXPECT_EQ(index.size(), points.size());
  for (const Vec3& query : random_points(50, 6, 12.0)) {
    const auto expected = brute_force(points, query);
    EXPECT_EQ(index.nearest(query)->index, expected[0].index);
    expect_equal(index.nearest_k(query, 900), {expected.begin(), expected.begin() + 900});
    const auto end = std::ranges::find_if(expected, [](const Neighbor& n) { return n.distance_m > 6.0; });
    const std::vector<Neighbor> near(expected.begin(), end);
    expect_equal(index.within(query, 6.0), near);
    std::size_t visited = 0, counted = 0;
    index.for_each_within(query, 6.0, [&](std::size_t) { ++visited; });
    for (const Place& place : index.places_within(query, 6.0)) {
      EXPECT_EQ(place.index, near[counted].index);
      EXPECT_DOUBLE_EQ(place.distance_m, near[counted].distance_m);
      EXPECT_EQ(static_cast<std::size_t>(std::ranges::count(points, points[place.index])), place.count);
      counted += place.count;
    }
    EXPECT_EQ(visited, near.size());
    EXPECT_EQ(counted, near.size());
  }
}

// Each search would visit all the others: a hundred thousand million steps.
TEST(NearestIndex, AMapAtOnePlaceIsSearchedAtOnce) {
  std::vector<Vec3> points(300000, Vec3(1, 2, 3));
  points.push_back(Vec3(4, 6, 3));
  const NearestIndex index(points);
  for (std::size_t i = 0; i < points.size(); ++i) {
    ASSERT_EQ(index.nearest(points[i])->index, i + 1 < points.size() ? 0 : i);
    ASSERT_EQ(index.nearest_k(points[i], 2).size(), 2U);
  }
  EXPECT_EQ(index.nearest_k(Vec3::Zero(), 301000).back().index, 300000U);
}

TEST(NearestIndex, RadiusIsInclusive) {
  const NearestIndex index({Vec3(3, 4, 0)});
  EXPECT_TRUE(index.nearest(Vec3::Zero(), 5.0));
  EXPECT_FALSE(index.nearest(Vec3::Zero(), 4.999999));
  EXPECT_EQ(index.within(Vec3::Zero(), 5.0).size(), 1U);
  EXPECT_TRUE(index.nearest(Vec3(3, 4, 0), 0.0));
}

TEST(NearestIndex, EmptyAndNotFinite) {
  const NearestIndex empty({});
  EXPECT_FALSE(empty.nearest(Vec3::Zero()));
  EXPECT_TRUE(empty.nearest_k(Vec3::Zero(), 3).empty());
  EXPECT_TRUE(empty.within(Vec3::Zero(), 1.0).empty());
  const NearestIndex index({Vec3::Zero()});
  EXPECT_FALSE(index.nearest(Vec3(std::nan(""), 0, 0)));
  EXPECT_FALSE(index.nearest(Vec3::Zero(), -1.0));
  EXPECT_THAT(
      [&] {
        NearestIndex({Vec3::Zero(), Vec3(0, INFINITY, 0)});
      },
      ThrowsMessage<InputError>(HasSubstr("point 1: a coordinate is not finite")));
}

TEST(NearestIndex, MovesAndAnswersInParallel) {
  const auto points = random_points(5000, 4);
  NearestIndex built(points);
  const NearestIndex index = std::move(built);
  std::vector<std::size_t> found(points.size());
  tbb::parallel_for(std::size_t{0}, points.size(), [&](std::size_t i) { found[i] = index.nearest(points[i])->index; });
  for (std::size_t i = 0; i < found.size(); ++i) EXPECT_EQ(found[i], i);
}

}  // namespace
}  // namespace tileflight::geometry::nearest_test
