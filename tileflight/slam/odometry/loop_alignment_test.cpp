// Two keyframes over rendered ground, aligned directly, against their true motion.

#include "tileflight/slam/loop_closure/loop_alignment.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tileflight/slam/odometry/test_synthetic_keyframes.h"

namespace tileflight::odometry::loop_alignment_test {
namespace {

using geometry::SE3;
using geometry::Sim3;
using geometry::Vec3;

const test_support::KeyframeMaker& maker() {
  static const test_support::KeyframeMaker kMaker(test_support::hilly_terrain());
  return kMaker;
}

/// Data of a keyframe in a map that is `scale` times too large.
struct Side {
  loop_closure::KeyframeImage image;
  std::vector<mapping::MapPoint> points;

  Side(const SE3& pose, double scale) : image(maker().image(pose)), points(maker().points(pose, 0)) {
    for (mapping::MapPoint& point : points) {
      point.rho /= static_cast<float>(scale);
      point.rho_variance /= static_cast<float>(scale * scale);
    }
  }
  loop_closure::AlignedKeyframe keyframe() const {
    loop_closure::AlignedKeyframe out{&image, {}};
    for (const mapping::MapPoint& point : points) out.points.push_back(&point);
    return out;
  }
};

const SE3 kFirst = keyframes::test_support::look_along(Vec3(0, 0, 13), Vec3(0, 1, -1.5));
const SE3 kSecond = keyframes::test_support::look_along(Vec3(1.2, 0.7, 13.6), Vec3(0.25, 1, -1.4));
constexpr double kScale = 1.1;  ///< of the second keyframe's map

/// A length in the first keyframe over the same in the second: 1 / kScale.
Sim3 true_motion() {
  const SE3 T = kFirst.inverse() * kSecond;
  return {1.0 / kScale, T.rotation, T.translation};
}

/// Off by a degree, by a hundredth of the ground's distance, and by a hundredth of the scale.
Sim3 start() {
  const Sim3 T = true_motion();
  return {1.01 * T.scale, T.rotation * geometry::so3_exp(Vec3(0.01, -0.008, 0.012)),
          T.translation + Vec3(0.1, -0.1, 0.1)};
}

TEST(LoopAlignment, BothDirectionsAndTheScaleAreTheTrueOnes) {
  const Side a(kFirst, 1.0), b(kSecond, kScale);
  const auto found = loop_closure::align_loop(maker().lens(), a.keyframe(), b.keyframe(), start());
  ASSERT_TRUE(found);
  const SE3 T_a_b = kFirst.inverse() * kSecond;
  const SE3 T_b_a(T_a_b.inverse().rotation, kScale * T_a_b.inverse().translation);
  // The ground is some 15 m away: a hundredth of a pixel is 1 mm there.
  EXPECT_LT((found->a_b.T_a_b.translation - T_a_b.translation).norm(), 0.01);
  EXPECT_LT((found->b_a.T_a_b.translation - T_b_a.translation).norm(), 0.01);
  EXPECT_LT(found->a_b.T_a_b.rotation.angularDistance(T_a_b.rotation), 1e-3);
  EXPECT_LT(found->b_a.T_a_b.rotation.angularDistance(T_b_a.rotation), 1e-3);
  EXPECT_NEAR(found->log_scale, -std::log(kScale), 4.0 * std::sqrt(found->log_scale_variance) + 1e-3);
  EXPECT_LT(std::sqrt(found->log_scale_variance), 0.003);
}

TEST(LoopAlignment, TheCovarianceIsAsLargeAsTheErrors) {
  // Mean of squared errors over their variances; many times one would be a sigma that is too small.
  const Side a(kFirst, 1.0);
  double sum = 0;
  int counted = 0;
  for (int k = 0; k < 6; ++k) {
    const SE3 pose =
        keyframes::test_support::look_along(Vec3(0.5 * k - 1.0, 0.3 * k, 13.0 + 0.2 * k), Vec3(0.05 * k, 1, -1.4));
    const Side b(pose, 1.0);
    const auto found =
        loop_closure::align_loop(maker().lens(), a.keyframe(), b.keyframe(), Sim3(kFirst.inverse() * pose));
    ASSERT_TRUE(found) << k;
    const geometry::Vec6 off = (found->a_b.T_a_b.inverse() * (kFirst.inverse() * pose)).log();
    sum += off.dot(geometry::solve_symmetric(found->a_b.covariance, off));
    counted += 6;
  }
  std::printf("squared error over variance: %.2f\n", sum / counted);
  EXPECT_LT(sum / counted, 2.0);
}

TEST(LoopAlignment, AnotherPlaceIsRefused) {
  const Side a(kFirst, 1.0), b(keyframes::test_support::look_along(Vec3(60.0, -40.0, 13.0), Vec3(0, 1, -1.5)), kScale);
  EXPECT_FALSE(loop_closure::align_loop(maker().lens(), a.keyframe(), b.keyframe(), start()));
}

TEST(LoopAlignment, FewPointsAreRefused) {
  const Side a(kFirst, 1.0), b(kSecond, kScale);
  loop_closure::AlignedKeyframe few = b.keyframe();
  few.points.resize(20);
  EXPECT_FALSE(loop_closure::align_loop(maker().lens(), a.keyframe(), few, start()));
}

TEST(LoopAlignment, AKeptImageIsThePictureToAStep) {
  const keyframes::Pyramid pyramid = maker().pyramid(kFirst);
  const loop_closure::KeyframeImage kept = loop_closure::keep_image(pyramid);
  ASSERT_EQ(kept.level, 0);
  const keyframes::Pyramid restored = loop_closure::restore_pyramid(kept, 3);
  ASSERT_EQ(restored.levels.size(), 3U);
  for (int y = 0; y < kept.height; ++y) {
    for (int x = 0; x < kept.width; ++x)
      ASSERT_NEAR(restored.levels[0].intensity(x, y), pyramid.levels[0].intensity(x, y), 0.51F * kept.grey_per_step);
  }
}

}  // namespace
}  // namespace tileflight::odometry::loop_alignment_test
