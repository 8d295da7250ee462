#include "tileflight/evaluation/metrics/part_search.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <limits>
#include <map>
#include <random>

#include "tileflight/core/geometry/nearest.h"

namespace tileflight::metrics::part_search_test {
namespace {

using geometry::Box3;
using geometry::Vec3;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Points in columns of some metres, like the blocks of a truth; a column may be empty.
struct Parts {
  std::vector<std::vector<Vec3>> points;
  std::vector<Box3> bounds;

  Parts(const std::vector<Vec3>& all, double edge_m) {
    std::map<std::pair<int, int>, std::vector<Vec3>> columns;
    for (const Vec3& p : all)
      columns[{static_cast<int>(p.x() / edge_m), static_cast<int>(p.y() / edge_m)}].push_back(p);
    for (auto& [key, column] : columns) {
      Box3 box;
      for (const Vec3& p : column) box.extend(p);
      points.push_back(std::move(column));
      bounds.push_back(box);
    }
    points.emplace_back();
    bounds.emplace_back();
  }
};

std::vector<Vec3> random_points(std::size_t count, double side_m, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> at(0.0, side_m), up(0.0, 5.0);
  std::vector<Vec3> points;
  for (std::size_t i = 0; i < count; ++i) points.emplace_back(at(random), at(random), up(random));
  return points;
}

class PartSearchTest : public ::testing::TestWithParam<double> {};

TEST_P(PartSearchTest, FindsWhatBruteForceFinds) {
  const std::vector<Vec3> targets = random_points(800, 100.0, 1);
  std::vector<Vec3> points = random_points(3000, 140.0, 2);
  points.emplace_back(1e6, -1e6, 3e5);  // an outlier, far from every part
  points.push_back(targets[17]);
  const Parts parts(targets, GetParam());
  for (const double within_m : {kInfinity, 3.0}) {
    std::vector<double> reach(points.size(), within_m);
    std::map<std::size_t, int> visits;
    search_parts(points, parts.bounds, reach, [&](std::size_t part, const std::vector<std::uint32_t>& asked) {
      EXPECT_LE(++visits[part], 2);
      const geometry::NearestIndex index(parts.points[part]);
      const auto nearest = [&](const Vec3& p, double limit_m) -> std::optional<double> {
        const auto found = index.nearest(p, limit_m);
        return found ? std::optional(found->distance_m) : std::nullopt;
      };
      lower_reach(points, asked, nearest, reach);
    });
    for (std::size_t i = 0; i < points.size(); ++i) {
      double least = kInfinity;
      for (const Vec3& t : targets) {
        const Vec3 d = points[i] - t;
        least = std::min(least, std::sqrt(d.x() * d.x() + d.y() * d.y() + d.z() * d.z()));
      }
      ASSERT_EQ(reach[i], std::min(least, within_m)) << i;
    }
    EXPECT_FALSE(visits.contains(parts.bounds.size() - 1)) << "holds nothing";
  }
}

INSTANTIATE_TEST_SUITE_P(OfAnySize, PartSearchTest, ::testing::Values(4.0, 17.0, 60.0, 1000.0));

TEST(PartSearch, WhatIsEquallyNearIsFoundInEveryPart) {
  const std::vector<Vec3> points{Vec3(0, 0, 0), Vec3(0.25, 0, 0)};
  const std::vector<Box3> bounds{Box3(Vec3(-3, -1, 0), Vec3(-1, 1, 0)), Box3(Vec3(1, -1, 0), Vec3(4, 1, 0)),
                                 Box3(Vec3(1.5, -1, 0), Vec3(4, 1, 0))};
  std::vector<double> reach(2, kInfinity);
  std::vector<std::vector<std::uint32_t>> asked_of(3);
  search_parts(points, bounds, reach, [&](std::size_t part, const std::vector<std::uint32_t>& asked) {
    for (const std::uint32_t i : asked) {
      reach[i] = std::min(reach[i], bounds[part].exteriorDistance(points[i]));
      asked_of[part].push_back(i);
    }
  });
  EXPECT_EQ(std::ranges::count(asked_of[0], 0U) + std::ranges::count(asked_of[1], 0U), 2);
  EXPECT_EQ(reach, (std::vector<double>{1.0, 0.75}));
  EXPECT_TRUE(asked_of[2].empty()) << "is farther than what was found";
}

}  // namespace
}  // namespace tileflight::metrics::part_search_test

namespace tileflight::metrics::nearest_distances_test {
namespace {

using geometry::Vec3;

std::vector<Vec3> scattered(std::size_t n, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> place(-50.0, 50.0);
  std::vector<Vec3> points;
  for (std::size_t k = 0; k < n; ++k) points.push_back({place(random), place(random), 0.02 * place(random)});
  return points;
}

TEST(NearestDistances, DistancesAreThoseOfSingleSearches) {
  const auto targets = scattered(500, 2), points = scattered(5000, 3);
  const geometry::NearestIndex index(targets);
  const NearestWithin nearest = [&](const Vec3& p, double radius_m) -> std::optional<double> {
    const auto found = index.nearest(p, radius_m);
    return found ? std::optional(found->distance_m) : std::nullopt;
  };
  for (const double radius_m : {1.5, std::numeric_limits<double>::infinity()}) {
    std::vector<double> single;
    for (const Vec3& p : points)
      single.push_back(nearest(p, radius_m).value_or(std::numeric_limits<double>::infinity()));
    for (const std::size_t threads : {1u, 5u}) {
      const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
      EXPECT_EQ(nearest_distances(points, radius_m, nearest), single) << radius_m;
    }
  }
}

}  // namespace
}  // namespace tileflight::metrics::nearest_distances_test
