#include "tileflight/evaluation/metrics/normal_consistency.h"

#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <random>

namespace tileflight::metrics::normal_consistency_test {
namespace {

using geometry::PointCloud;
using geometry::TriangleIndex;
using geometry::TriangleMesh;
using geometry::Vec3;

TriangleMesh square(double side_m) {
  TriangleMesh mesh;
  mesh.vertices = {{0, 0, 0}, {side_m, 0, 0}, {side_m, side_m, 0}, {0, side_m, 0}};
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  return mesh;
}

PointCloud above_square(std::size_t n, const std::function<Vec3()>& normal) {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> place(1.0, 9.0);
  PointCloud cloud;
  for (std::size_t k = 0; k < n; ++k) {
    cloud.positions.push_back({place(random), place(random), 0.3});
    cloud.normals.push_back(normal().cast<float>());
  }
  return cloud;
}

NormalConsistency consistency(const PointCloud& cloud, const TriangleMesh& mesh) {
  return normal_consistency(cloud, mesh, TriangleIndex(mesh), 1.0, 16);
}

TEST(NormalConsistency, ClosedForm) {
  for (const double degrees : {0.0, 29.0, 31.0, 60.0, 151.0, 180.0}) {
    const double angle = degrees * std::acos(-1.0) / 180.0;
    const auto found =
        consistency(above_square(50, [&] { return Vec3(std::sin(angle), 0, std::cos(angle)); }), square(10.0));
    EXPECT_EQ(found.evaluated, 50u);
    EXPECT_NEAR(found.mean_abs_cos, std::abs(std::cos(angle)), 1e-6) << degrees;
    EXPECT_EQ(found.share_within_30_deg, degrees < 30.0 || degrees > 150.0 ? 1.0 : 0.0) << "either side: " << degrees;
  }
}

TEST(NormalConsistency, RandomDirectionsComeToChance) {
  std::mt19937_64 random(2);
  std::normal_distribution<double> normal(0.0, 1.0);
  const auto any = [&] { return Vec3(normal(random), normal(random), normal(random)).normalized(); };
  const auto found = consistency(above_square(20000, any), square(10.0));
  EXPECT_NEAR(found.mean_abs_cos, 0.5, 0.01);
  EXPECT_NEAR(found.share_within_30_deg, 1.0 - std::sqrt(3.0) / 2.0, 0.01);
}

TEST(NormalConsistency, WhatHasNoNormalOrIsFarAwayIsNotJudged) {
  PointCloud cloud = above_square(10, [] { return Vec3(0, 0, 1); });
  cloud.normals[3].setZero();
  cloud.positions[4].z() = 1.5;
  TriangleMesh mesh = square(10.0);
  mesh.triangles.push_back({1, 1, 1});  // without area, nearest to this one
  mesh.vertices[1] = {10, 0, 0};
  cloud.positions[5] = {10.5, -0.5, 0.0};
  mesh.triangles = {mesh.triangles[2], mesh.triangles[0], mesh.triangles[1]};
  const auto found = consistency(cloud, mesh);
  EXPECT_EQ(found.points, 10u);
  EXPECT_EQ(found.evaluated, 7u);
  EXPECT_DOUBLE_EQ(found.mean_abs_cos, 1.0);
  EXPECT_NEAR(to_json(found).at("share_judged").get<double>(), 0.7, 1e-12);
  const auto none = consistency(above_square(5, [] { return Vec3(0, 0, 0); }), square(10.0));
  EXPECT_TRUE(std::isnan(none.mean_abs_cos));
}

}  // namespace
}  // namespace tileflight::metrics::normal_consistency_test
