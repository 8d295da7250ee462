#include "tileflight/core/alignment/umeyama.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "tileflight/core/base/input_error.h"

namespace tileflight::alignment::umeyama_test {
namespace {

using geometry::Sim3;
using geometry::Vec3;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

std::vector<Vec3> random_points(std::size_t n, double extent_m, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> coordinate(-extent_m, extent_m);
  std::vector<Vec3> points(n);
  for (Vec3& p : points) p = {coordinate(random), coordinate(random), coordinate(random)};
  return points;
}

std::vector<Vec3> moved(const Sim3& T, const std::vector<Vec3>& points) {
  std::vector<Vec3> result;
  for (const Vec3& p : points) result.push_back(T * p);
  return result;
}

Sim3 some_similarity() { return {0.37, geometry::so3_exp({0.4, -1.1, 2.0}), {350.0, -120.0, 2890.0}}; }

double difference(const Sim3& a, const Sim3& b) { return (a.matrix() - b.matrix()).norm(); }

double squared_error(const Sim3& T, const std::vector<Vec3>& source, const std::vector<Vec3>& target) {
  double sum = 0.0;
  for (std::size_t i = 0; i < source.size(); ++i) sum += (target[i] - T * source[i]).squaredNorm();
  return sum;
}

TEST(Umeyama, RecoversASimilarityExactly) {
  const auto source = random_points(50, 20.0, 1);
  const auto result = umeyama(source, moved(some_similarity(), source));
  EXPECT_LT(difference(result.T_target_source, some_similarity()), 1e-9);
  EXPECT_LT(result.rmse_m, 1e-9);
  EXPECT_EQ(result.inliers, 50u);
  EXPECT_TRUE(result.well_conditioned);
}

TEST(Umeyama, InverseProblemGivesTheInverse) {
  const auto source = random_points(50, 20.0, 2);
  const auto target = moved(some_similarity(), source);
  EXPECT_LT(difference(umeyama(target, source).T_target_source, some_similarity().inverse()), 1e-6);
}

// The worked example of the paper, section IV: three points and their mirror image, whose best rotation is not a
// reflection.
TEST(Umeyama, WorkedExampleOfThePaper) {
  const std::vector<Vec3> source = {{0, 0, 0}, {1, 0, 0}, {0, 2, 0}};
  const std::vector<Vec3> target = {{0, 0, 0}, {-1, 0, 0}, {0, 2, 0}};
  const auto result = umeyama(source, target);
  // In space (unlike in the plane) half a turn about the y axis maps one exactly to the other.
  EXPECT_LT(result.rmse_m, 1e-12);
  EXPECT_NEAR(result.T_target_source.rotation.toRotationMatrix().determinant(), 1.0, 1e-12);
}

TEST(Umeyama, MirroredPointsGiveARotationAndNoReflection) {
  const auto source = random_points(40, 10.0, 3);
  auto target = source;
  for (Vec3& p : target) p.x() = -p.x();
  const auto result = umeyama(source, target, ScaleMode::kFixed);
  EXPECT_NEAR(result.T_target_source.rotation.toRotationMatrix().determinant(), 1.0, 1e-12);
  EXPECT_GT(result.rmse_m, 1.0);
}

TEST(Umeyama, NoNearbySimilarityIsBetter) {
  const auto source = random_points(60, 15.0, 4);
  auto target = moved(some_similarity(), source);
  const auto noise = random_points(60, 2.0, 5);
  for (std::size_t i = 0; i < target.size(); ++i) target[i] += noise[i];
  const Sim3 best = umeyama(source, target).T_target_source;
  const double least = squared_error(best, source, target);
  for (int axis = 0; axis < 3; ++axis) {
    for (const double h : {-1e-3, 1e-3}) {
      const Vec3 step = h * Vec3::Unit(axis);
      EXPECT_GT(squared_error({best.scale, best.rotation, best.translation + step}, source, target), least);
      EXPECT_GT(squared_error({best.scale, geometry::so3_exp(step) * best.rotation, best.translation}, source, target),
                least);
      EXPECT_GT(squared_error({best.scale * (1.0 + h), best.rotation, best.translation}, source, target), least);
    }
  }
}

TEST(Umeyama, FixedScaleStaysOne) {
  const auto source = random_points(30, 10.0, 6);
  EXPECT_DOUBLE_EQ(umeyama(source, moved(some_similarity(), source), ScaleMode::kFixed).T_target_source.scale, 1.0);
}

TEST(Umeyama, WeightsRepeatPairs) {
  const auto source = random_points(6, 10.0, 7);
  auto target = moved(some_similarity(), source);
  target[0] += Vec3(1.0, 2.0, 3.0);
  auto repeated_source = source, repeated_target = target;
  repeated_source.push_back(source[0]);
  repeated_source.push_back(source[0]);
  repeated_target.push_back(target[0]);
  repeated_target.push_back(target[0]);
  const auto weighted = weighted_umeyama(source, target, {3, 1, 1, 1, 1, 1});
  EXPECT_LT(difference(weighted.T_target_source, umeyama(repeated_source, repeated_target).T_target_source), 1e-9);
}

TEST(Umeyama, PointsOnALineAreFlagged) {
  std::vector<Vec3> source;
  for (int i = 0; i < 10; ++i) source.push_back(Vec3(1.0, 2.0, -0.5) * i);
  const auto result = umeyama(source, moved(some_similarity(), source));
  EXPECT_FALSE(result.well_conditioned);
  EXPECT_LT(result.rmse_m, 1e-9) << "any rotation about the line fits; one of them must be given";
}

TEST(Umeyama, PointsAtOnePlaceAreFlagged) {
  const std::vector<Vec3> source(5, Vec3(1, 2, 3)), target(5, Vec3(-4, 0, 9));
  const auto result = umeyama(source, target);
  EXPECT_FALSE(result.well_conditioned);
  EXPECT_LT((result.T_target_source * source[0] - target[0]).norm(), 1e-12);
  EXPECT_TRUE(result.T_target_source.matrix().allFinite());
}

TEST(Umeyama, RefusesBadInput) {
  const auto points = random_points(5, 1.0, 8);
  auto broken = points;
  broken[2].y() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT([&] { umeyama({}, {}); }, ThrowsMessage<InputError>(HasSubstr("needs at least 3 pairs, there are 0")));
  EXPECT_THAT(
      [&] {
        umeyama({points[0], points[1]}, {points[0], points[1]});
      },
      ThrowsMessage<InputError>(HasSubstr("needs at least 3 pairs, there are 2")));
  EXPECT_THAT(
      [&] {
        umeyama(points, {points[0], points[1], points[2]});
      },
      ThrowsMessage<InputError>(HasSubstr("5 in the source, 3 in the target")));
  EXPECT_THAT([&] { umeyama(broken, points); }, ThrowsMessage<InputError>(HasSubstr("pair 2 is not finite")));
  EXPECT_THAT([&] { umeyama(points, broken); }, ThrowsMessage<InputError>(HasSubstr("pair 2 is not finite")));
  EXPECT_THAT([&] { weighted_umeyama(points, points, std::vector<double>(5, 0.0)); },
              ThrowsMessage<InputError>(HasSubstr("all weights are zero")));
  EXPECT_THAT([&] { robust_umeyama(points, points, ScaleMode::kFixed, {.inlier_m = 0.0}); },
              ThrowsMessage<InputError>(HasSubstr("inlier_m: must be above zero")));
}

TEST(RobustUmeyama, SurvivesFortyPercentOutliers) {
  const auto source = random_points(200, 50.0, 9);
  auto target = moved(some_similarity(), source);
  const auto noise = random_points(200, 0.2, 10), wild = random_points(200, 100.0, 11);
  for (std::size_t i = 0; i < target.size(); ++i) target[i] += i % 5 < 2 ? wild[i] : noise[i];
  const auto result = robust_umeyama(source, target, ScaleMode::kEstimated, {.inlier_m = 1.0});
  EXPECT_NEAR(result.T_target_source.scale, 0.37, 0.001);
  EXPECT_LT((result.T_target_source * Vec3::Zero() - some_similarity() * Vec3::Zero()).norm(), 0.05);
  EXPECT_GE(result.inliers, 120u);
  EXPECT_LE(result.inliers, 125u);
  EXPECT_LT(result.rmse_m, 0.3);
  EXPECT_GT(difference(umeyama(source, target).T_target_source, some_similarity()), 1.0)
      << "the plain fit is led astray";
}

TEST(RobustUmeyama, SameAnswerEachTime) {
  const auto source = random_points(100, 50.0, 12);
  auto target = moved(some_similarity(), source);
  const auto noise = random_points(100, 3.0, 13);
  for (std::size_t i = 0; i < target.size(); ++i) target[i] += noise[i];
  const auto a = robust_umeyama(source, target, ScaleMode::kEstimated, {});
  const auto b = robust_umeyama(source, target, ScaleMode::kEstimated, {});
  EXPECT_EQ(a.T_target_source.matrix(), b.T_target_source.matrix());
}

TEST(RobustUmeyama, WithoutNoiseItIsThePlainFit) {
  const auto source = random_points(30, 10.0, 14);
  const auto target = moved(some_similarity(), source);
  const auto result = robust_umeyama(source, target, ScaleMode::kEstimated, {});
  EXPECT_LT(difference(result.T_target_source, some_similarity()), 1e-9);
  EXPECT_EQ(result.inliers, 30u);
}

}  // namespace
}  // namespace tileflight::alignment::umeyama_test

namespace tileflight::alignment::pose_alignment_test {
namespace {

using geometry::SE3;
using geometry::Sim3;
using geometry::Vec3;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

const Sim3 kTrue(40.0, geometry::so3_exp({0.5, -1.0, 0.3}), {10.0, -20.0, 5.0});

/// A path along x that bends sideways by `bend` of its length; orientations turn. With noise in the target.
std::pair<std::vector<SE3>, std::vector<SE3>> poses(double bend, double noise_m, double noise_rad) {
  std::mt19937_64 random(4);
  std::normal_distribution<double> normal(0.0, 1.0);
  const auto noise = [&](double sigma) -> Vec3 { return sigma * Vec3(normal(random), normal(random), normal(random)); };
  std::vector<SE3> source, target;
  for (int k = 0; k < 100; ++k) {
    const Vec3 p(0.01 * k, bend * std::sin(0.03 * k), 0.0);
    source.push_back({geometry::so3_exp({0.01 * k, 0.3, 0.0}), p});
    target.push_back(
        {kTrue.rotation * source.back().rotation * geometry::so3_exp(noise(noise_rad)), kTrue * p + noise(noise_m)});
  }
  return {source, target};
}

TEST(FitPoses, ExactPosesGiveTheExactSimilarity) {
  for (const double bend : {0.3, 0.0}) {
    const auto [source, target] = poses(bend, 0.0, 0.0);
    const Sim3 T = fit_poses(source, target);
    EXPECT_LT((T.matrix() - kTrue.matrix()).norm(), 1e-9) << "bend " << bend;
  }
}

TEST(FitPoses, AStraightPathDoesNotLeaveTheTurnAboutItOpen) {
  const auto [source, target] = poses(0.0, 0.01, 0.001);
  std::vector<Vec3> from, to;
  for (std::size_t i = 0; i < source.size(); ++i) {
    from.push_back(source[i].translation);
    to.push_back(target[i].translation);
  }
  const Vec3 aside(0.5, 2.0, 0.0);
  EXPECT_GT((umeyama(from, to).T_target_source * aside - kTrue * aside).norm(), 1.0) << "positions alone do";
  EXPECT_LT((fit_poses(source, target) * aside - kTrue * aside).norm(), 0.05);
}

TEST(FitPoses, RefusesUnpairedPosesAndTakesASinglePose) {
  const auto paired = poses(0.3, 0.0, 0.0);
  const std::vector<SE3>& source = paired.first;
  const std::vector<SE3>& target = paired.second;
  EXPECT_THAT(
      [&] { fit_poses({}, {}); },
      ThrowsMessage<InputError>(HasSubstr("poses: both lists must hold the same number of poses, at least one")));
  EXPECT_THAT([&] { fit_poses(source, {target[0]}); },
              ThrowsMessage<InputError>(HasSubstr("the same number of poses")));
  EXPECT_DOUBLE_EQ(fit_poses({source[0]}, {target[0]}).scale, 1.0);
}

}  // namespace
}  // namespace tileflight::alignment::pose_alignment_test
