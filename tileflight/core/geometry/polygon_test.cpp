#include "tileflight/core/geometry/polygon.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace tileflight::geometry::polygon_test {
namespace {

/// Sum of the triangles' areas along the polygon's normal: overlaps would make it larger, gaps smaller.
double area_along(const std::vector<Vec3>& corners, const Vec3& normal) {
  double area = 0;
  for (const auto& t : triangulate(corners)) {
    const double own = (corners[t[1]] - corners[t[0]]).cross(corners[t[2]] - corners[t[0]]).dot(normal) / 2;
    EXPECT_GE(own, -1e-12) << "a triangle is turned round";
    area += own;
  }
  return area;
}

TEST(Polygon, AnLShapeInAnyPlaneKeepsItsArea) {
  const std::vector<Vec3> flat{{0, 0, 0}, {3, 0, 0}, {3, 1, 0}, {1, 1, 0}, {1, 3, 0}, {0, 3, 0}};
  const Eigen::AngleAxisd turn(2.0, Vec3(1, -2, 0.5).normalized());
  for (std::size_t start = 0; start < flat.size(); ++start) {
    std::vector<Vec3> corners;
    for (std::size_t i = 0; i < flat.size(); ++i)
      corners.push_back(turn * flat[(start + i) % flat.size()] + Vec3(7, 8, 9));
    EXPECT_EQ(triangulate(corners).size(), 4U);
    EXPECT_NEAR(area_along(corners, turn * Vec3::UnitZ()), 5.0, 1e-9);
  }
}

TEST(Polygon, AStarKeepsItsArea) {
  std::vector<Vec3> star;
  for (int i = 0; i < 24; ++i) {
    const double angle = std::numbers::pi * i / 12, radius = i % 2 == 0 ? 2.0 : 0.7;
    star.emplace_back(0, radius * std::cos(angle), radius * std::sin(angle));
  }
  EXPECT_EQ(triangulate(star).size(), 22U);
  EXPECT_NEAR(area_along(star, Vec3::UnitX()), 24 * 0.5 * 2.0 * 0.7 * std::sin(std::numbers::pi / 12), 1e-9);
}

TEST(Polygon, WhatIsNoPolygonStillEnds) {
  EXPECT_TRUE(triangulate({}).empty());
  EXPECT_TRUE(triangulate(std::vector<Vec3>(2, Vec3::Zero())).empty());
  EXPECT_EQ(triangulate(std::vector<Vec3>(3, Vec3::Zero())).size(), 1U);
  EXPECT_EQ(triangulate(std::vector<Vec3>(9, Vec3::Zero())).size(), 7U);
  EXPECT_EQ(triangulate(std::vector<Vec3>{{0, 0, 0}, {1, 1, 0}, {1, 0, 0}, {0, 1, 0}}).size(), 2U);  // a bow tie
  EXPECT_EQ(triangulate(std::vector<Vec3>(5000, Vec3::Ones())).size(), 4998U);
}

}  // namespace
}  // namespace tileflight::geometry::polygon_test
