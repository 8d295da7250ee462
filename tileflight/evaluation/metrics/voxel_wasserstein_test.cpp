#include "tileflight/evaluation/metrics/voxel_wasserstein.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <Eigen/Dense>
#include <array>
#include <cmath>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <random>
#include <vector>

#include "tests/refusal.h"
#include "tileflight/core/base/strict_section.h"

namespace tileflight::metrics::voxel_wasserstein_test {
namespace {

using geometry::Mat3;
using geometry::PointCloud;
using geometry::Vec3;
using ::testing::HasSubstr;
using tests::refusal_of;

/// Square root of a positive definite matrix by Newton's iteration in the form of Denman and Beavers (1976).
Mat3 newton_root(const Mat3& A) {
  Mat3 Y = A, Z = Mat3::Identity();
  for (int k = 0; k < 60; ++k) {
    const Mat3 next = 0.5 * (Y + Z.inverse());
    Z = 0.5 * (Z + Y.inverse());
    Y = next;
  }
  return Y;
}

/// The formula as MapEval prints it.
double textbook_wasserstein(const Gaussian3& a, const Gaussian3& b) {
  const Mat3 root = newton_root(a.covariance);
  const Mat3 cross = newton_root(root * b.covariance * root);
  return std::sqrt((a.mean - b.mean).squaredNorm() + (a.covariance + b.covariance - 2.0 * cross).trace());
}

/// The same by the eigenvalues of A B, whose roots have the sum of the cross term; for covariances that are nearly
/// flat, at which Newton's iteration fails.
double wasserstein_by_eigenvalues(const Gaussian3& a, const Gaussian3& b) {
  const Eigen::EigenSolver<Mat3> solver(Mat3(a.covariance * b.covariance), false);
  const double cross = solver.eigenvalues().real().cwiseMax(0.0).cwiseSqrt().sum();
  return std::sqrt((a.mean - b.mean).squaredNorm() + (a.covariance + b.covariance).trace() - 2.0 * cross);
}

Gaussian3 random_gaussian(std::mt19937_64& random) {
  std::normal_distribution<double> normal(0.0, 1.0);
  Mat3 F;
  Vec3 mean;
  for (int i = 0; i < 9; ++i) F(i / 3, i % 3) = normal(random);
  for (int i = 0; i < 3; ++i) mean[i] = normal(random);
  return {mean, F * F.transpose() + 0.05 * Mat3::Identity()};
}

TEST(GaussianWasserstein, AgreesWithTheTextbookByNewtonsIteration) {
  std::mt19937_64 random(1);
  for (int k = 0; k < 200; ++k) {
    const Gaussian3 a = random_gaussian(random), b = random_gaussian(random);
    EXPECT_NEAR(gaussian_wasserstein(a, b), textbook_wasserstein(a, b), 1e-6) << k;
    EXPECT_NEAR(gaussian_wasserstein(a, b), wasserstein_by_eigenvalues(a, b), 1e-6) << k;
    EXPECT_NEAR(gaussian_wasserstein(a, b), gaussian_wasserstein(b, a), 1e-12) << k;
  }
}

// Covariances with the same axes: the distance of the standard deviations along them.
TEST(GaussianWasserstein, AlongCommonAxesIsTheDistanceOfTheDeviations) {
  const Mat3 axes = geometry::so3_exp({0.3, -1.2, 0.7}).toRotationMatrix();
  const auto with = [&](const Vec3& sigmas, const Vec3& mean) {
    return Gaussian3{mean, axes * sigmas.cwiseAbs2().asDiagonal() * axes.transpose()};
  };
  EXPECT_NEAR(gaussian_wasserstein(with({1, 2, 3}, {0, 0, 0}), with({2, 2, 1}, {0, 0, 0})), std::sqrt(1.0 + 4.0), 1e-9);
  EXPECT_NEAR(gaussian_wasserstein(with({1, 2, 0}, {1, 0, 0}), with({1, 2, 0}, {1, 2, 0})), 2.0, 1e-9);
  EXPECT_NEAR(gaussian_wasserstein(with({0, 0, 0}, {0, 3, 4}), with({0, 0, 0}, {0, 0, 0})), 5.0, 1e-12);
  EXPECT_NEAR(gaussian_wasserstein(with({1, 1, 0}, {0, 0, 0}), with({1, 1, 1e-6}, {0, 0, 0})), 1e-6, 1e-10)
      << "two sheets that are nearly the same: the textbook's formula cancels";
}

// A line along x against one along y: the cross term vanishes, so that W^2 is the sum of both variances.
TEST(GaussianWasserstein, OfCrossedLines) {
  const Gaussian3 x{Vec3::Zero(), Vec3(4, 0, 0).asDiagonal()}, y{Vec3::Zero(), Vec3(0, 9, 0).asDiagonal()};
  EXPECT_NEAR(gaussian_wasserstein(x, y), std::sqrt(13.0), 1e-9);
}

PointCloud random_cloud(std::size_t n, std::uint64_t seed, double noise_m = 0.0) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> place(-20.0, 20.0);
  std::normal_distribution<double> noise(0.0, 1.0);
  PointCloud cloud;
  for (std::size_t k = 0; k < n; ++k) {
    const double x = place(random), y = place(random), z = 2.0 * std::sin(0.3 * x) + 0.1 * y;
    cloud.positions.push_back(Vec3(x, y, z) + noise_m * Vec3(noise(random), noise(random), noise(random)));
  }
  return cloud;
}

using Voxels = std::map<std::array<long, 3>, std::vector<Vec3>>;

Voxels sorted_into(const PointCloud& cloud, double edge_m) {
  Voxels voxels;
  for (const Vec3& p : cloud.positions) {
    std::array<long, 3> index{};
    for (std::size_t i = 0; i < 3; ++i)
      index[i] = static_cast<long>(std::floor(p[static_cast<Eigen::Index>(i)] / edge_m));
    voxels[index].push_back(p);
  }
  return voxels;
}

Gaussian3 fitted(const std::vector<Vec3>& points) {
  Eigen::MatrixXd all(3, points.size());
  for (std::size_t i = 0; i < points.size(); ++i) all.col(static_cast<Eigen::Index>(i)) = points[i];
  const Vec3 mean = all.rowwise().mean();
  all.colwise() -= mean;
  return {mean, all * all.transpose() / static_cast<double>(points.size() - 1)};
}

/// By definition: the distance of each voxel, and a look at all voxels for the neighbours of each.
VoxelWasserstein by_brute_force(const PointCloud& map, const PointCloud& truth,
                                const VoxelWassersteinOptions& options) {
  const Voxels a = sorted_into(map, options.voxel_m), b = sorted_into(truth, options.voxel_m);
  VoxelWasserstein result;
  std::map<std::array<long, 3>, double> distances;
  for (const auto& [index, points] : a) {
    const auto other = b.find(index);
    if (other == b.end()) {
      ++result.voxels_map_only;
      continue;
    }
    if (points.size() < options.min_points || other->second.size() < options.min_points) {
      ++result.voxels_sparse;
      continue;
    }
    distances[index] = wasserstein_by_eigenvalues(fitted(points), fitted(other->second));
    result.map_points_scored += points.size();
  }
  for (const auto& [index, points] : b) result.voxels_truth_only += a.count(index) == 0;
  result.voxels = distances.size();
  result.awd = result.scs = 0.0;
  for (const auto& [index, w] : distances) result.awd += w / static_cast<double>(distances.size());
  for (const auto& [index, own] : distances) {
    std::vector<double> near;
    for (const auto& [place, w] : distances) {
      long away = 0;
      for (std::size_t i = 0; i < 3; ++i) away = std::max(away, std::abs(place[i] - index[i]));
      if (away > 0 && away <= options.neighborhood_voxels) near.push_back(w);
    }
    if (near.size() < 2) continue;
    const Eigen::Map<const Eigen::ArrayXd> w(near.data(), static_cast<Eigen::Index>(near.size()));
    result.scs += std::sqrt((w - w.mean()).square().mean()) / w.mean();
    ++result.scs_voxels;
  }
  result.scs /= static_cast<double>(result.scs_voxels);
  return result;
}

TEST(VoxelWasserstein, AgreesWithBruteForce) {
  const PointCloud truth = random_cloud(9000, 1, 0.05), map = random_cloud(6000, 2, 0.3);
  for (const VoxelWassersteinOptions& options : {VoxelWassersteinOptions{},
                                                 {.voxel_m = 2.0, .min_points = 12, .neighborhood_voxels = 1},
                                                 {.voxel_m = 1.3, .min_points = 4, .neighborhood_voxels = 2}}) {
    const VoxelWasserstein expected = by_brute_force(map, truth, options);
    const VoxelWasserstein w = voxel_wasserstein(map, truth, options);
    EXPECT_GT(expected.voxels, 20u);
    EXPECT_GT(expected.voxels_map_only, 0u);
    EXPECT_GT(expected.voxels_sparse, 0u);
    EXPECT_EQ(w.voxels, expected.voxels);
    EXPECT_EQ(w.voxels_map_only, expected.voxels_map_only);
    EXPECT_EQ(w.voxels_truth_only, expected.voxels_truth_only);
    EXPECT_EQ(w.voxels_sparse, expected.voxels_sparse);
    EXPECT_EQ(w.map_points_scored, expected.map_points_scored);
    EXPECT_EQ(w.scs_voxels, expected.scs_voxels);
    EXPECT_NEAR(w.awd, expected.awd, 1e-6);
    EXPECT_NEAR(w.scs, expected.scs, 1e-6);
  }
}

/// Eight points around the middle of each of `count` voxels in a row, metres apart.
PointCloud blobs(int count, const std::function<Vec3(int)>& offset) {
  PointCloud cloud;
  for (int k = 0; k < count; ++k) {
    for (int corner = 0; corner < 8; ++corner)
      cloud.positions.push_back(Vec3(3.0 * k + 1.5, 1.5, 1.5) + offset(k) +
                                0.2 * Vec3(corner & 1, corner >> 1 & 1, corner >> 2));
  }
  return cloud;
}

TEST(VoxelWasserstein, AShiftIsTheDistanceAndAnEvenOneIsConsistent) {
  const PointCloud truth = blobs(6, [](int) { return Vec3::Zero(); });
  const auto shifted = [&](const std::function<Vec3(int)>& by) {
    return voxel_wasserstein(blobs(6, by), truth, {.min_points = 8});
  };
  const VoxelWasserstein even = shifted([](int) { return Vec3(0.3, 0.4, 0.0); });
  EXPECT_EQ(even.voxels, 6u);
  EXPECT_NEAR(even.awd, 0.5, 1e-9);
  EXPECT_NEAR(even.std, 0.0, 1e-9);
  EXPECT_NEAR(even.scs, 0.0, 1e-9) << "a map that is off as a whole is consistent";
  const VoxelWasserstein ragged = shifted([](int k) { return Vec3(k % 2 == 0 ? 0.1 : 0.7, 0.0, 0.0); });
  EXPECT_NEAR(ragged.awd, 0.4, 1e-9);
  EXPECT_NEAR(ragged.std, 0.3, 1e-9);
  // Each voxel has the five others as neighbours: two of its own kind and three of the other.
  const auto variation = [](double p, double low, double high) {
    const double mean = p * low + (1.0 - p) * high;
    return std::sqrt(p * (1.0 - p)) * (high - low) / mean;
  };
  EXPECT_NEAR(ragged.scs, 0.5 * (variation(0.4, 0.1, 0.7) + variation(0.6, 0.1, 0.7)), 1e-9);
  EXPECT_EQ(ragged.scs_voxels, 6u);
}

TEST(VoxelWasserstein, ChanceIsTheDistanceOfTwoDrawsFromOneSurface) {
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal(0.0, 0.2);
  // Some 2000 voxels of 10 m with 50 points of each cloud, drawn from one distribution.
  PointCloud map, truth;
  for (int k = 0; k < 2000; ++k) {
    for (int i = 0; i < 50; ++i) {
      for (PointCloud* cloud : {&map, &truth})
        cloud->positions.push_back(Vec3(10.0 * k + 5.0, 5.0, 5.0) + Vec3(normal(random), normal(random), 0.0));
    }
  }
  const VoxelWasserstein w = voxel_wasserstein(map, truth, {.voxel_m = 10.0});
  EXPECT_EQ(w.voxels, 2000u);
  // Two dimensions of one variance v: 3/2 2 v + v/2, for two clouds.
  EXPECT_NEAR(w.chance, 0.2 * std::sqrt(3.5 * 2.0 / 50.0), 0.001);
  EXPECT_GT(w.awd, 0.9 * w.chance) << "a mean is below the root mean square";
  EXPECT_LT(w.awd, w.chance);
}

TEST(VoxelWasserstein, WhatOneCloudAloneHasIsCountedNotScored) {
  const PointCloud truth = blobs(4, [](int) { return Vec3::Zero(); });
  PointCloud map = blobs(2, [](int) { return Vec3::Zero(); });
  map.positions.push_back({1e300, 0, 0});
  map.positions.push_back({-50, 0, 0});
  map.positions.push_back({7.0, 1.0, 1.0});  // one point in the truth's third voxel
  const VoxelWasserstein w = voxel_wasserstein(map, truth, {.min_points = 8});
  EXPECT_EQ(w.voxels, 2u);
  EXPECT_EQ(w.voxels_sparse, 1u);
  EXPECT_EQ(w.voxels_map_only, 2u);
  EXPECT_EQ(w.voxels_truth_only, 1u);
  EXPECT_EQ(w.map_points_scored, 16u);
  EXPECT_EQ(w.truth_points_scored, 16u);
  EXPECT_NEAR(w.awd, 0.0, 1e-12);
  EXPECT_TRUE(std::isnan(w.scs)) << "one neighbour has no spread";
  EXPECT_EQ(to_json(w)["share_of_truth"], 0.5);
  const VoxelWasserstein none = voxel_wasserstein(map, truth, {.min_points = 100});
  EXPECT_EQ(none.voxels, 0u);
  EXPECT_TRUE(std::isnan(none.awd));
}

TEST(VoxelWasserstein, SameBitsForAnyNumberOfThreads) {
  std::vector<VoxelWasserstein> results;
  for (const std::size_t threads : {1u, 2u, 5u}) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    results.push_back(voxel_wasserstein(random_cloud(5000, 2, 0.3), random_cloud(9000, 1), {.voxel_m = 2.0}));
  }
  for (const VoxelWasserstein& w : results) {
    EXPECT_EQ(w.awd, results[0].awd);
    EXPECT_EQ(w.scs, results[0].scs);
  }
}

TEST(VoxelWasserstein, ComesBackFromItsJson) {
  const VoxelWasserstein w = voxel_wasserstein(random_cloud(5000, 2, 0.3), random_cloud(9000, 1));
  const nlohmann::json written = to_json(w);
  EXPECT_EQ(to_json(read_voxel_wasserstein(base::StrictSection(written, "metrics.json"))), written);
}

TEST(VoxelWasserstein, RefusesBadInput) {
  const PointCloud cloud = random_cloud(100, 1);
  EXPECT_THAT(refusal_of([&] { voxel_wasserstein(geometry::PointCloud{}, cloud); }), HasSubstr("map: has no points"));
  EXPECT_THAT(refusal_of([&] { voxel_wasserstein(cloud, {}); }), HasSubstr("surface samples: has no points"));
  EXPECT_THAT(refusal_of([&] { voxel_wasserstein(cloud, cloud, {.voxel_m = 0.0}); }), HasSubstr("must be above zero"));
  EXPECT_THAT(refusal_of([&] { voxel_wasserstein(cloud, cloud, {.min_points = 1}); }), HasSubstr("at least 2"));
  EXPECT_THAT(refusal_of([&] { voxel_wasserstein(cloud, cloud, {.neighborhood_voxels = 0}); }),
              HasSubstr("at least 1 voxel"));
  PointCloud broken = cloud;
  broken.positions[3].z() = std::nan("");
  EXPECT_THAT(refusal_of([&] { voxel_wasserstein(broken, cloud); }), HasSubstr("map: a point is not finite"));
}

}  // namespace
}  // namespace tileflight::metrics::voxel_wasserstein_test
