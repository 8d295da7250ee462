#include "tileflight/core/alignment/surface_descriptor.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace tileflight::alignment::surface_descriptor_test {
namespace {

using geometry::Vec3;

/// Random points on a floor and on a wall at its edge.
std::vector<Vec3> floor_and_wall() {
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  std::vector<Vec3> points;
  for (int k = 0; k < 600; ++k) points.emplace_back(20.0 * unit(random), 20.0 * unit(random), 0.3 * std::sin(k));
  for (int k = 0; k < 300; ++k) points.emplace_back(0.3 * std::cos(k), 20.0 * unit(random), 10.0 * unit(random));
  return points;
}

TEST(ThinnedToGrid, OneMeanForEachCell) {
  const std::vector<Vec3> points = {{0.1, 0.1, 0.1}, {0.3, 0.5, 0.9}, {-0.1, 0.1, 0.1}, {5.0, 5.5, 5.5}};
  const std::vector<Vec3> thin = voxel_downsample(points, 1.0);
  ASSERT_EQ(thin.size(), 3u);
  EXPECT_EQ(thin[0], Vec3(-0.1, 0.1, 0.1));
  EXPECT_LT((thin[1] - Vec3(0.2, 0.3, 0.5)).norm(), 1e-12);
}

TEST(SurfaceDescriptors, DoNotChangeWithTheFrame) {
  const std::vector<Vec3> points = floor_and_wall();
  const auto moved_by = [&](const Eigen::Quaterniond& rotation) {
    std::vector<Vec3> moved;
    for (const Vec3& p : points) moved.push_back(rotation * p + Vec3(100.0, -50.0, 7.0));
    return moved;
  };
  const Eigen::Quaterniond any(Eigen::AngleAxisd(2.0, Vec3(1.0, 2.0, -0.5).normalized()));
  const Eigen::MatrixXf here = compute_surface_descriptors(points, {.radius_m = 4.0});
  const Eigen::MatrixXf there = compute_surface_descriptors(moved_by(any), {.radius_m = 4.0});
  // A value on the border of two bins may fall to either side; a share of one neighbour is about 0.02.
  EXPECT_LT((here - there).rowwise().lpNorm<Eigen::Infinity>().mean(), 1e-3f);

  const DescriptorOptions upright{.radius_m = 4.0, .up = Vec3::UnitZ()};
  const DescriptorOptions turned{.radius_m = 4.0, .up = any * Vec3::UnitZ()};
  const Eigen::MatrixXf a = compute_surface_descriptors(points, upright),
                        b = compute_surface_descriptors(moved_by(any), turned);
  EXPECT_EQ(a.cols(), 55);
  EXPECT_LT((a - b).rowwise().lpNorm<Eigen::Infinity>().mean(), 1e-3f);
}

TEST(SurfaceDescriptors, TellFloorFromEdgeAndWithGravityFromWall) {
  std::vector<Vec3> points = floor_and_wall();
  points.emplace_back(10.0, 10.0, 0.0);
  points.emplace_back(14.0, 8.0, 0.0);
  points.emplace_back(0.2, 10.0, 0.2);
  points.emplace_back(0.0, 10.0, 6.0);
  const auto n = static_cast<Eigen::Index>(points.size());
  const Eigen::MatrixXf plain = compute_surface_descriptors(points, {.radius_m = 3.0});
  const auto apart = [&](const Eigen::MatrixXf& d, Eigen::Index a, Eigen::Index b) {
    return (d.row(a) - d.row(b)).norm();
  };
  const Eigen::Index floor = n - 4, other_floor = n - 3, edge = n - 2, wall = n - 1;
  EXPECT_GT(apart(plain, floor, edge), 2.0f * apart(plain, floor, other_floor));
  const Eigen::MatrixXf upright = compute_surface_descriptors(points, {.radius_m = 3.0, .up = Vec3::UnitZ()});
  EXPECT_GT(apart(upright, floor, wall), 2.0f * apart(upright, floor, other_floor));
}

TEST(SurfaceDescriptors, LonelyPointsHaveNone) {
  const Eigen::MatrixXf rows = compute_surface_descriptors({{0, 0, 0}, {100, 0, 0}, {0, 100, 0}, {0, 0, 100}}, {});
  EXPECT_TRUE(rows.isZero());
  EXPECT_EQ(compute_surface_descriptors({}, {}).rows(), 0);
}

}  // namespace
}  // namespace tileflight::alignment::surface_descriptor_test
