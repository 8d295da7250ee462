#include "tileflight/core/geometry/prism.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

namespace tileflight::geometry::prism_test {
namespace {

using Eigen::Vector2d;

class Random {
 public:
  double in(double low, double high) { return std::uniform_real_distribution<double>(low, high)(engine_); }
  Vector2d point(double reach) { return {in(-reach, reach), in(-reach, reach)}; }

  /// A star around a centre: corners at increasing angles, so that it does not cross itself.
  Ring star(const Vector2d& middle, double least_m, double most_m, int corners) {
    Ring ring;
    for (int i = 0; i < corners; ++i) {
      const double angle = 2 * std::numbers::pi * (i + in(0, 0.9)) / corners;
      ring.push_back(middle + in(least_m, most_m) * Vector2d(std::cos(angle), std::sin(angle)));
    }
    return ring;
  }

 private:
  std::mt19937 engine_{3};
};

/// Winding number of rings around a point, by the angles subtended by their edges.
bool inside_by_angles(const std::vector<Ring>& rings, const Vector2d& point) {
  int turns = 0;
  for (const Ring& ring : rings) {
    double angle = 0;
    for (std::size_t i = 0; i < ring.size(); ++i) {
      const Vector2d a = ring[i] - point;
      const Vector2d b = ring[(i + 1) % ring.size()] - point;
      angle += std::atan2(a.x() * b.y() - a.y() * b.x(), a.dot(b));
    }
    turns += static_cast<int>(std::lround(angle / (2 * std::numbers::pi)));
  }
  return turns % 2 != 0;
}

/// Two stars side by side, the first with a hole that has an island.
std::vector<Ring> archipelago(Random& random, int corners) {
  return {random.star({0, 0}, 8, 10, corners), random.star({0, 0}, 5, 6, corners / 2), random.star({1, 1}, 1, 3, 7),
          random.star({25, 3}, 2, 9, corners)};
}

TEST(PolygonArea, HoldsThePointsThatItsRingsGoRound) {
  Random random;
  for (const int corners : {6, 40, 3000}) {
    const PolygonArea area(archipelago(random, corners));
    int inside = 0;
    const int points = corners > 1000 ? 400 : 3000;
    for (int i = 0; i < points; ++i) {
      const Vector2d point(random.in(-12, 36), random.in(-12, 14));
      ASSERT_EQ(area.contains(point), inside_by_angles(area.rings(), point)) << point.transpose();
      inside += area.contains(point) ? 1 : 0;
      EXPECT_EQ(area.distance_m(point) == 0, area.contains(point));
    }
    EXPECT_GT(inside, points / 10);
  }
}

/// Points of the triangle on a fine grid of weights.
template <class Inside>
bool any_sample(const std::array<Vec3, 3>& t, const Inside& inside) {
  constexpr int kSteps = 60;
  for (int i = 0; i <= kSteps; ++i) {
    for (int j = 0; i + j <= kSteps; ++j) {
      const double u = static_cast<double>(i) / kSteps;
      const double v = static_cast<double>(j) / kSteps;
      if (inside(Vec3(t[0] + u * (t[1] - t[0]) + v * (t[2] - t[0])))) return true;
    }
  }
  return false;
}

/// Intersections found by sampling must be found. Those found must be confirmed by samples of a slightly larger prism.
TEST(Prism, MeetsTheTrianglesThatHavePointsInIt) {
  Random random;
  int met = 0;
  for (int i = 0; i < 1500; ++i) {
    const Prism prism{PolygonArea(archipelago(random, 12)), -1, 2};
    const double size = i % 3 == 0 ? 20 : 2;
    const Vec3 middle(random.in(-12, 36), random.in(-12, 14), random.in(-3, 4));
    std::array<Vec3, 3> triangle;
    for (Vec3& corner : triangle)
      corner = middle + Vec3(random.in(-size, size), random.in(-size, size), random.in(-2, 2));
    const bool answer = intersects(prism, triangle);
    const bool found = any_sample(triangle, [&](const Vec3& p) { return contains(prism, p); });
    const double step = size / 10;
    const bool nearly = any_sample(triangle, [&](const Vec3& p) {
      return p.z() > -1 - step && p.z() < 2 + step && prism.base.distance_m(p.head<2>()) < step;
    });
    ASSERT_TRUE(!found || answer) << i;
    ASSERT_TRUE(!answer || nearly) << i;
    met += answer ? 1 : 0;
  }
  EXPECT_GT(met, 200);
  EXPECT_LT(met, 1300);
}

TEST(Prism, WallsLinesAndPoints) {
  const Prism prism{PolygonArea({{{0, 0}, {10, 0}, {10, 10}, {0, 10}}, {{2, 2}, {8, 2}, {8, 8}, {2, 8}}}), 0, 5};
  EXPECT_TRUE(intersects(prism, {Vec3(1, -3, 1), Vec3(1, 30, 1), Vec3(1, 3, 9)}));         // a wall across
  EXPECT_FALSE(intersects(prism, {Vec3(3, 3, 1), Vec3(7, 3, 1), Vec3(5, 3, 4)}));          // a wall in the hole
  EXPECT_FALSE(intersects(prism, {Vec3(1, 1, 6), Vec3(9, 1, 6), Vec3(1, 9, 6)}));          // above
  EXPECT_TRUE(intersects(prism, {Vec3(1, 1, 9), Vec3(1, 1, 9), Vec3(1, 1, 4)}));           // a line that comes down
  EXPECT_TRUE(intersects(prism, {Vec3(-1, 5, 1), Vec3(0, 5, 1), Vec3(-1, 6, 1)}));         // touches
  EXPECT_TRUE(intersects(prism, {Vec3(-90, -90, 1), Vec3(90, -90, 1), Vec3(0, 190, 1)}));  // holds all of it
  EXPECT_EQ(bounds(prism).max(), Vec3(10, 10, 5));
  EXPECT_FALSE(PolygonArea({{{0, 0}, {1, 1}}}).contains({0.5, 0.5}));
}

}  // namespace
}  // namespace tileflight::geometry::prism_test
