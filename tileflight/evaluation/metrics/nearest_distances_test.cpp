#include "tileflight/evaluation/metrics/nearest_distances.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <limits>
#include <random>

#include "tileflight/core/geometry/nearest.h"

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
