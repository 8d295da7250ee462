#include "tileflight/evaluation/registration/located_poses.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <random>

#include "tileflight/core/base/input_error.h"
#include "tileflight/evaluation/registration/test_flights.h"

namespace tileflight::registration::located_poses_test {
namespace {

using namespace test_flights;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

std::vector<LocatedPose> found_exactly(const geometry::Trajectory& local) {
  std::vector<LocatedPose> poses;
  const geometry::Trajectory map = geometry::transformed(T_local_map().inverse(), local);
  for (std::size_t k = 0; k < local.size(); ++k) {
    poses.push_back({map.poses[k].T_local_camera, local.poses[k].T_local_camera});
    poses.back().information.diagonal() << 1e4, 1e4, 1e4, 1e6, 1e6, 1e6;  // sigmas of a centimetre and a milliradian
  }
  return poses;
}

TEST(LocatedPoses, AStraightPathGivesItAllThroughItsTurns) {
  const LocatedPosesFit fit = fit_located_poses(found_exactly(straight_path()), Sim3());
  EXPECT_EQ(fit.inliers, 20U);
  EXPECT_LT((fit.estimate.T_target_source.matrix() - T_local_map().matrix()).norm(), 1e-6);
}

TEST(LocatedPoses, PosesThatWereFoundElsewhereAreTold) {
  std::vector<LocatedPose> poses = found_exactly(curved_path());
  for (const std::size_t k : {2U, 7U, 11U, 15U, 16U, 20U}) poses[k].T_local_camera.translation += Vec3(1.5, -0.7, 0.4);
  const LocatedPosesFit fit = fit_located_poses(poses, Sim3());
  EXPECT_EQ(fit.inliers, poses.size() - 6);
  EXPECT_FALSE(fit.is_inlier[7]);
  EXPECT_NEAR(fit.distances_m[7], Vec3(1.5, -0.7, 0.4).norm(), 0.05);
  EXPECT_LT((fit.estimate.T_target_source * Vec3(1, 1, 1) - T_local_map() * Vec3(1, 1, 1)).norm(), 0.02);
}

TEST(LocatedPoses, NoiseIsMeasured) {
  std::vector<LocatedPose> poses = found_exactly(curved_path());
  std::mt19937_64 random(4);
  std::normal_distribution<double> normal;
  for (LocatedPose& pose : poses) {  // errors five times the stated sigma
    geometry::Vec6 twist;
    for (int k = 0; k < 6; ++k) twist[k] = 5.0 * normal(random) * (k < 3 ? 1e-2 : 1e-3);
    pose.T_local_camera = pose.T_local_camera * SE3::exp(twist);
  }
  const LocatedPosesFit fit = fit_located_poses(poses, T_local_map());
  EXPECT_NEAR(fit.noise, 5.0, 1.5);
  EXPECT_EQ(fit.inliers, poses.size());
}

TEST(LocatedPoses, OnePoseIsTooFew) {
  EXPECT_THAT([&] { fit_located_poses({found_exactly(curved_path()).front()}, Sim3()); },
              ThrowsMessage<InputError>(HasSubstr("located poses: at least two are needed")));
}

}  // namespace
}  // namespace tileflight::registration::located_poses_test

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
    some.push_back(path[static_cast<std::size_t>(k) * kPoses / kLocated + 2]);
    SE3& found = some.back().T_local_camera;
    found = SE3(found.rotation * Eigen::Quaterniond(geometry::so3_exp(turned)), found.translation + off);
  }
  return some;
}

/// Returns the displacement of the ground by the errors of the similarity, by the path's intervals.
double similarity_sigma_m(const std::vector<LocatedPose>& poses, PathCoverage coverage) {
  const SimilarityEstimate estimate = estimate_similarity(poses, ground(), coverage).value();
  return motion_sigma_m(estimate.information.inverse(), estimate.T_target_source, estimate.center, ground());
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
    rms.sigma_m += std::pow(similarity_sigma_m(some, PathCoverage::kWhole), 2) / kSamples;
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
  const double whole_m = similarity_sigma_m(half, PathCoverage::kWhole);
  EXPECT_GT(similarity_sigma_m(half, PathCoverage::kParts), 2.0 * whole_m);
}

TEST(LocatedPosesSigma, IsUnknownForFewPoses) {
  const std::vector<LocatedPose> path = bent_path(0.0);
  EXPECT_FALSE(estimate_similarity({path[0], path[50], path[99]}, ground(), PathCoverage::kWhole));
}

/// Returns poses of cameras at `positions`, 10 m above the ground z = 0, each located by parts of its image on blocks
/// of ground of 2 m. Each block pulls all images that show it by one random displacement.
std::vector<LocatedPose> located_by_ground(const std::vector<Vec3>& positions, unsigned seed) {
  constexpr int kHalf = 3;
  constexpr double kSide_m = 2.0, kSigma_m = 0.1;
  std::map<std::pair<int, int>, Vec3> pulls;
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal(0.0, kSigma_m);
  std::vector<LocatedPose> poses;
  for (const Vec3& position : positions) {
    LocatedPose pose{SE3(Eigen::Quaterniond::Identity(), position), SE3(Eigen::Quaterniond::Identity(), position)};
    geometry::Vec6 error = geometry::Vec6::Zero();
    for (int x = -kHalf; x < kHalf; ++x) {
      for (int y = -kHalf; y < kHalf; ++y) {
        const std::pair block(static_cast<int>(std::floor(position.x() / kSide_m)) + x,
                              static_cast<int>(std::floor(position.y() / kSide_m)) + y);
        auto pull = pulls.find(block);
        if (pull == pulls.end())
          pull = pulls.emplace(block, Vec3(normal(random), normal(random), normal(random))).first;
        constexpr double kShare = 1.0 / (4.0 * kHalf * kHalf);
        PosePart part{.point_local = kSide_m * Vec3(block.first, block.second, 0.0), .size_m = kSide_m};
        part.motion << kShare * pull->second, 0.1 * kShare * Vec3(x, y, 0.0).cross(pull->second);
        error += part.motion;
        pose.parts.push_back(part);
      }
    }
    pose.T_local_camera = pose.T_local_camera * SE3(geometry::so3_exp(error.tail<3>()), error.head<3>());
    poses.push_back(pose);
  }
  return poses;
}

/// Returns the ratio of stated to true error (RMS over samples) of the similarity of poses that ground has pulled.
double ground_calibration(const std::vector<Vec3>& positions) {
  constexpr int kSamples = 200;
  double errors = 0.0, sigmas = 0.0;
  for (unsigned k = 0; k < kSamples; ++k) {
    const std::vector<LocatedPose> poses = located_by_ground(positions, k);
    errors += std::pow(alignment::rms_motion_m(similarity_of(poses), Sim3(), ground()), 2);
    const Vec3 center(3.0, -2.0, 5.0);
    sigmas += std::pow(motion_sigma_m(ground_covariance(poses, center), similarity_of(poses), center, ground()), 2);
  }
  return std::sqrt(sigmas / errors);
}

TEST(GroundSigma, IsTheErrorOfImagesThatShowTheSameGround) {
  std::vector<Vec3> positions;
  for (int k = 0; k < 40; ++k) positions.emplace_back(0.5 * std::cos(0.3 * k), 0.5 * std::sin(0.3 * k), 10.0);
  EXPECT_NEAR(ground_calibration(positions), 1.0, 0.15);
}

TEST(GroundSigma, IsTheErrorOfImagesOfNewGround) {
  std::vector<Vec3> positions;
  for (int k = 0; k < 40; ++k) positions.emplace_back(1.3 * k, 0.0, 10.0);
  EXPECT_NEAR(ground_calibration(positions), 1.0, 0.15);
}

TEST(GroundSigma, IsZeroWithoutParts) { EXPECT_EQ(ground_covariance(bent_path(0.0), Vec3::Zero()).norm(), 0.0); }

}  // namespace
}  // namespace tileflight::registration::located_poses_sigma_test
