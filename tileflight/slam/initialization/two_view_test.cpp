#include "tileflight/slam/initialization/two_view.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

namespace tileflight::initialization::two_view_test {
namespace {

using geometry::Mat3;
using geometry::SE3;
using geometry::Vec3;

const SE3 kMotion(geometry::so3_exp(Vec3(0.05, -0.1, 0.03)), Vec3(0.9, 0.1, -0.4).normalized());

/// Points 3 to 9 baselines away in all directions in front (a lens of 150 degrees).
std::vector<RayPair> scene(bool planar, double noise_rad, std::size_t count = 200) {
  std::mt19937 random(11);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  std::normal_distribution<double> noise(0.0, noise_rad);
  std::vector<RayPair> pairs;
  while (pairs.size() < count) {
    const Vec3 ray = Vec3(2.5 * unit(random), 2.5 * unit(random), 1.0).normalized();
    // Ground four below (y down), or anywhere.
    const double distance = planar ? (ray.y() > 0.15 ? 4.0 / ray.y() : 0.0) : 6.0 + 3.0 * unit(random);
    if (distance <= 0) continue;
    const Vec3 seen = (kMotion * (distance * ray)).normalized();
    const auto disturbed = [&](const Vec3& v) {
      return (v + Vec3(noise(random), noise(random), noise(random))).normalized();
    };
    pairs.push_back({disturbed(ray), disturbed(seen)});
  }
  return pairs;
}

double direction_error(const SE3& T) {
  return std::acos(std::clamp(T.translation.normalized().dot(kMotion.translation), -1.0, 1.0));
}
double rotation_error(const SE3& T) { return geometry::so3_log(T.rotation.conjugate() * kMotion.rotation).norm(); }

TEST(EssentialFromFive, HoldsTheTrueOne) {
  const auto pairs = scene(false, 0.0);
  const Mat3 truth = (geometry::skew(kMotion.translation) * kMotion.rotation.toRotationMatrix()).normalized();
  for (std::size_t first = 0; first + 5 <= pairs.size(); first += 5) {
    const std::vector<RayPair> five(pairs.begin() + first, pairs.begin() + first + 5);
    double nearest = 1.0;
    for (const Mat3& E : solve_five_point(five)) {
      nearest = std::min({nearest, (E - truth).norm(), (E + truth).norm()});
      for (const RayPair& pair : five) EXPECT_LT(std::abs(pair.b.dot(E * pair.a)), 1e-8);
      EXPECT_LT((2 * E * E.transpose() * E - (E * E.transpose()).trace() * E).norm(), 1e-6);
    }
    EXPECT_LT(nearest, 1e-5);
  }
}

TEST(Homography, DecomposesIntoTheTrueMotionAndItsMirror) {
  const auto pairs = scene(true, 0.0);
  const Mat3 H = fit_homography(pairs);
  for (const RayPair& pair : pairs) EXPECT_LT((H * pair.a).normalized().cross(pair.b).norm(), 1e-9);
  const std::vector<SE3> poses = poses_from_homography(H, pairs);
  ASSERT_EQ(poses.size(), 2U);
  const double best = std::min(direction_error(poses[0]) + rotation_error(poses[0]),
                               direction_error(poses[1]) + rotation_error(poses[1]));
  const double worst = std::max(direction_error(poses[0]), direction_error(poses[1]));
  EXPECT_LT(best, 1e-6);
  EXPECT_GT(worst, 0.1);
}

TEST(RelativePoseCandidates, HoldTheTrueMotionWithNoiseAndOutliers) {
  for (const bool planar : {false, true}) {
    auto pairs = scene(planar, 3e-4);
    for (std::size_t i = 0; i < pairs.size(); i += 4) pairs[i].b = pairs[(i * 7 + 3) % pairs.size()].b;
    double best = 10;
    for (const SE3& T : relative_pose_candidates(pairs, 1.5e-3, 1))
      best = std::min(best, direction_error(T) + rotation_error(T));
    EXPECT_LT(best, 0.05) << "planar " << planar;
  }
}

TEST(InverseDistance, IsThatOfThePoint) {
  const Vec3 point(1.0, -2.0, 5.0);
  const RayPair pair{point.normalized(), (kMotion * point).normalized()};
  EXPECT_NEAR(triangulate_inverse_distance(kMotion, pair), 1.0 / point.norm(), 1e-12);
}

TEST(FitRotation, FindsARotationAndTellsParallax) {
  std::vector<RayPair> pairs = scene(false, 0.0);
  for (RayPair& pair : pairs) pair.b = kMotion.rotation * pair.a;
  for (std::size_t i = 0; i < pairs.size(); i += 5) pairs[i].b = Vec3(0, 0, 1);
  const RotationFit still = fit_rotation(pairs);
  EXPECT_LT(geometry::so3_log(still.R_b_a.conjugate() * kMotion.rotation).norm(), 1e-3);
  EXPECT_LT(still.median_rad, 1e-3);
  EXPECT_GT(fit_rotation(scene(false, 0.0)).median_rad, 0.03);
}

}  // namespace
}  // namespace tileflight::initialization::two_view_test
