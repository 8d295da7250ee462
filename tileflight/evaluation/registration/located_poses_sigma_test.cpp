#include "tileflight/evaluation/registration/located_poses_sigma.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace tileflight::registration::located_poses_sigma_test {
namespace {

using geometry::SE3;
using geometry::Sim3;
using geometry::Vec3;

constexpr int kPoses = 100, kLocated = 20;

/// Points below a path of 50 m, 30 m away.
alignment::PointSpread ground() {
  std::vector<Vec3> points;
  for (int x = 0; x <= 50; x += 5)
    for (int y = -20; y <= 20; y += 5) points.emplace_back(x, y, -30.0);
  return alignment::compute_spread(points);
}

/// All poses of a path along x, located exactly; the map's path lies `bend_m` times the square of its share aside, and
/// turns with it.
std::vector<LocatedPose> bent_path(double bend_m) {
  std::vector<LocatedPose> poses;
  for (int k = 0; k < kPoses; ++k) {
    const double share = k / (kPoses - 1.0);
    const SE3 found{Eigen::Quaterniond::Identity(), Vec3(50.0 * share, 0.0, 0.0)};
    const SE3 bend{Eigen::Quaterniond(Eigen::AngleAxisd(bend_m / 50.0 * share, Vec3::UnitZ())),
                   Vec3(0.0, bend_m * share * share, 0.0)};
    poses.push_back({bend * found, found});
  }
  return poses;
}

/// Every fifth pose, located with errors of `sigma_m` per axis and `sigma_rad`, of which `shared` neighbours have one.
std::vector<LocatedPose> located(const std::vector<LocatedPose>& path, double sigma_m, double sigma_rad, int shared,
                                 unsigned seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  std::vector<LocatedPose> some;
  Vec3 off = Vec3::Zero(), turned = Vec3::Zero();
  for (int k = 0; k < kLocated; ++k) {
    if (k % shared == 0) {
      off = sigma_m * Vec3(normal(random), normal(random), normal(random));
      turned = sigma_rad * Vec3(normal(random), normal(random), normal(random));
    }
    some.push_back(path[static_cast<std::size_t>(k * kPoses / kLocated + 2)]);
    SE3& found = some.back().T_local_camera;
    found = SE3(found.rotation * Eigen::Quaterniond(geometry::so3_exp(turned)), found.translation + off);
  }
  return some;
}

/// Error and stated sigma, RMS over samples.
struct Calibration {
  double error_m = 0.0, sigma_m = 0.0;
};

Calibration calibration(double bend_m, double sigma_m, double sigma_rad, int shared) {
  const std::vector<LocatedPose> path = bent_path(bend_m);
  const Sim3 truth = similarity_of(path);
  constexpr int kSamples = 200;
  Calibration rms;
  for (int k = 0; k < kSamples; ++k) {
    const auto some = located(path, sigma_m, sigma_rad, shared, static_cast<unsigned>(k));
    rms.error_m += std::pow(alignment::rms_motion_m(truth, similarity_of(some), ground()), 2) / kSamples;
    rms.sigma_m += std::pow(similarity_sigma_m(some, ground(), PathCoverage::kWhole), 2) / kSamples;
  }
  return {std::sqrt(rms.error_m), std::sqrt(rms.sigma_m)};
}

TEST(LocatedPosesSigma, IsTheErrorOfIndependentLocations) {
  const Calibration c = calibration(0.0, 0.01, 0.0005, 1);
  EXPECT_GT(c.error_m, 0.003);
  EXPECT_NEAR(c.sigma_m / c.error_m, 1.0, 0.25);
}

TEST(LocatedPosesSigma, IsTheErrorOfLocationsThatNeighboursShare) {
  const Calibration c = calibration(0.0, 0.01, 0.0005, 2);
  EXPECT_GT(c.sigma_m / c.error_m, 0.7);
  EXPECT_LT(c.sigma_m / c.error_m, 1.5);
}

TEST(LocatedPosesSigma, ABendOfThePathIsNoErrorOfTheSample) {
  const Calibration c = calibration(0.5, 0.01, 0.0005, 1);  // a percent of its length
  EXPECT_GT(c.sigma_m / c.error_m, 0.7);
  EXPECT_LT(c.sigma_m / c.error_m, 3.0);
}

TEST(LocatedPosesSigma, OfPartsOfABentPathTheBendIsAnError) {
  const std::vector<LocatedPose> path = bent_path(0.5);
  std::vector<LocatedPose> half = located(path, 0.0, 0.0, 1, 1);
  half.resize(kLocated / 2);
  const double whole_m = similarity_sigma_m(half, ground(), PathCoverage::kWhole);
  EXPECT_GT(similarity_sigma_m(half, ground(), PathCoverage::kParts), 2.0 * whole_m);
}

TEST(LocatedPosesSigma, IsUnknownForFewPoses) {
  const std::vector<LocatedPose> path = bent_path(0.0);
  EXPECT_TRUE(std::isnan(similarity_sigma_m({path[0], path[50], path[99]}, ground(), PathCoverage::kWhole)));
}

}  // namespace
}  // namespace tileflight::registration::located_poses_sigma_test
