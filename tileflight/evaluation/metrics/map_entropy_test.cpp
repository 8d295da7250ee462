#include "tileflight/evaluation/metrics/map_entropy.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <Eigen/Dense>
#include <cmath>
#include <numbers>
#include <random>

#include "tileflight/core/base/input_error.h"

namespace tileflight::metrics::map_entropy_test {
namespace {

using geometry::Mat3;
using geometry::PointCloud;
using geometry::Vec3;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

const double kLog2PiE = std::log(2.0 * std::numbers::pi * std::numbers::e);

PointCloud slab(double thickness_m, std::size_t n = 4000) {
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> place(0.0, 20.0);
  std::normal_distribution<double> across(0.0, thickness_m);
  PointCloud cloud;
  for (std::size_t k = 0; k < n; ++k) cloud.positions.push_back({place(random), place(random), across(random)});
  return cloud;
}

TEST(MapEntropy, OfANormalDistributionIsTheTextbooks) {
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal(0.0, 1.0);
  PointCloud cloud;
  for (int k = 0; k < 1500; ++k)
    cloud.positions.push_back({0.5 * normal(random), 0.2 * normal(random), 0.1 * normal(random)});
  const MapEntropy e = map_entropy(cloud, {.radius_m = 1e3});  // every point sees all of them
  EXPECT_EQ(e.evaluated, 1500u);
  EXPECT_NEAR(e.mean, 1.5 * kLog2PiE + std::log(0.5 * 0.2 * 0.1), 0.1);
}

/// Compares with the definition, point by point.
void expect_brute_force(const PointCloud& cloud) {
  double sum = 0.0;
  std::size_t judged = 0;
  for (const Vec3& p : cloud.positions) {
    std::vector<Vec3> near;
    for (const Vec3& q : cloud.positions)
      if ((p - q).norm() <= 2.0) near.push_back(q);
    if (near.size() < 5) continue;
    Eigen::MatrixXd offsets(3, near.size());
    for (std::size_t i = 0; i < near.size(); ++i) offsets.col(static_cast<Eigen::Index>(i)) = near[i];
    offsets.colwise() -= Vec3(offsets.rowwise().mean());
    const Mat3 S = offsets * offsets.transpose() / static_cast<double>(near.size() - 1);
    sum += 0.5 * (3.0 * kLog2PiE + std::log(S.determinant()));
    ++judged;
  }
  const MapEntropy e = map_entropy(cloud);
  EXPECT_EQ(e.evaluated, judged);
  EXPECT_LT(e.evaluated, e.points) << "some have too few neighbours";
  EXPECT_NEAR(e.mean, sum / static_cast<double>(judged), 1e-9);
}

TEST(MapEntropy, AgreesWithBruteForce) {
  PointCloud cloud = slab(0.3, 300);
  expect_brute_force(cloud);
  for (std::size_t k = 0; k < 100; ++k) cloud.positions.push_back(cloud.positions[k % 7]);  // equal points count each
  expect_brute_force(cloud);
}

TEST(MapEntropy, ThickerIsMoreAndScaleAddsItsLogarithm) {
  EXPECT_LT(map_entropy(slab(0.05)).mean, map_entropy(slab(0.1)).mean);
  EXPECT_LT(map_entropy(slab(0.1)).mean, map_entropy(slab(0.3)).mean);
  PointCloud larger = slab(0.1);
  for (Vec3& p : larger.positions) p *= 3.0;
  EXPECT_NEAR(map_entropy(larger, {.radius_m = 6.0}).mean, map_entropy(slab(0.1)).mean + 3.0 * std::log(3.0), 1e-9);
}

TEST(MapEntropy, AnEvenChoiceGivesTheMeanOfAllWithinItsStandardError) {
  // Two sheets, one of which is thicker and denser: an uneven subsample would be biased.
  PointCloud cloud = slab(0.05, 20000);
  for (const Vec3& p : slab(0.4, 40000).positions) cloud.positions.push_back(p + Vec3(30.0, 0.0, 0.0));
  const MapEntropy all = map_entropy(cloud, {.max_total_neighbors = 1e12});
  EXPECT_EQ(all.sampled, 60000u);
  EXPECT_EQ(all.standard_error, 0.0);
  for (const std::size_t most : {500u, 2000u, 8000u}) {
    const MapEntropy some = map_entropy(cloud, {.max_points = most, .max_total_neighbors = 1e12});
    EXPECT_EQ(some.sampled, most);
    EXPECT_EQ(some.points, 60000u);
    EXPECT_NEAR(some.mean, all.mean, 3.0 * some.standard_error) << most;
    EXPECT_GT(some.standard_error, 0.0);
  }
  const MapEntropy dense = map_entropy(cloud, {.max_total_neighbors = 1e6});
  EXPECT_LT(dense.sampled, 4000u);
  EXPECT_NEAR(dense.mean, all.mean, 3.0 * dense.standard_error);
}

TEST(MapEntropy, WhatCannotBeJudgedIsCountedNotScored) {
  PointCloud flat, one;
  for (int k = 0; k < 100; ++k) flat.positions.push_back({0.1 * (k % 10), 0.1 * (k / 10), 5.0});
  EXPECT_EQ(map_entropy(flat).evaluated, 0u);
  one.positions = {{1, 2, 3}};
  const MapEntropy e = map_entropy(one);
  EXPECT_EQ(e.points, 1u);
  EXPECT_TRUE(std::isnan(e.mean));
  EXPECT_EQ(to_json(e).at("share_judged"), 0.0);
  one.positions.assign(50, Vec3(1, 2, 3));
  EXPECT_EQ(map_entropy(one).evaluated, 0u) << "all in one place";
}

TEST(MapEntropy, SameBitsForAnyNumberOfThreads) {
  std::vector<double> means;
  for (const std::size_t threads : {1u, 2u, 5u}) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    means.push_back(map_entropy(slab(0.2, 1000)).mean);
  }
  EXPECT_EQ(means[0], means[1]);
  EXPECT_EQ(means[0], means[2]);
}

TEST(MapEntropy, RefusesBadInput) {
  EXPECT_THAT([&] { map_entropy({}); }, ThrowsMessage<InputError>(HasSubstr("map: has no points")));
  EXPECT_THAT([&] { map_entropy(slab(0.1), {.radius_m = 0.0}); },
              ThrowsMessage<InputError>(HasSubstr("radius of the map's entropy: must be above zero")));
  PointCloud broken = slab(0.1);
  broken.positions[7].y() = std::nan("");
  EXPECT_THAT([&] { map_entropy(broken); }, ThrowsMessage<InputError>(HasSubstr("map: a point is not finite")));
}

}  // namespace
}  // namespace tileflight::metrics::map_entropy_test
