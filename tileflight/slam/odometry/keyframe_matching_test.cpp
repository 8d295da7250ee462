// Feature matching and the similarity between two keyframes, on rendered ground with known truth.

#include "tileflight/slam/loop_closure/keyframe_matching.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "tileflight/slam/loop_closure/keyframe_similarity.h"
#include "tileflight/slam/odometry/test_synthetic_keyframes.h"

namespace tileflight::odometry::keyframe_matching_test {
namespace {

using geometry::SE3;
using geometry::Sim3;
using geometry::Vec3;
using test_support::KeyframeMaker;

const KeyframeMaker& maker() {
  static const KeyframeMaker kMaker(test_support::hilly_terrain());
  return kMaker;
}

/// Over the same ground: displaced sideways, higher, and rolled by a third of a turn about the axis.
const SE3 kFirst = keyframes::test_support::look_along(Vec3(0, 0, 14), Vec3(0.1, 1.0, -1.6));
const SE3 kSecond = keyframes::test_support::look_along(Vec3(1.0, 0.6, 15), Vec3(-0.1, 1.0, -1.7)) *
                    SE3(geometry::so3_exp(Vec3(0, 0, 2.1)), Vec3::Zero());

TEST(KeyframeMatching, FindsCornersAgainUnderAnotherRollAndAWideLens) {
  const auto first = maker().features(kFirst), second = maker().features(kSecond);
  ASSERT_GT(first.size(), 200U);
  const auto matches = keyframes::match_features(first, second);
  int right = 0;
  for (const keyframes::FeatureMatch& match : matches) {
    const Vec3 point = kFirst * (first[match.a].ray.cast<double>() / first[match.a].rho);
    const auto pixel = maker().camera().project(kSecond.inverse() * point);
    right += pixel && (pixel->cast<float>() - second[match.b].pixel).norm() < 3.0F * second[match.b].size_px;
  }
  EXPECT_GT(right, 60);
  EXPECT_GT(right, 0.9 * static_cast<double>(matches.size()));
}

TEST(KeyframeMatching, OtherGroundMatchesHardlyAnywhere) {
  const SE3 far(kFirst.rotation, kFirst.translation + Vec3(400, 300, 0));
  EXPECT_LT(keyframes::match_features(maker().features(kFirst), maker().features(far)).size(), 15U);
}

TEST(KeyframeMatching, DistanceIsTheBruteForceOne) {
  std::mt19937_64 random(3);
  for (int i = 0; i < 20; ++i) {
    const keyframes::BinaryDescriptor a{random(), random(), random(), random()},
        b{random(), random(), random(), random()};
    int bits = 0;
    for (int k = 0; k < 256; ++k) bits += (a[k / 64] >> (k % 64) & 1) != (b[k / 64] >> (k % 64) & 1);
    EXPECT_EQ(keyframes::hamming(a, b), bits);
    EXPECT_EQ(keyframes::hamming(a, a), 0);
  }
}

TEST(FeatureIndex, VotesForThePlaceThatIsSeenAgain) {
  loop_closure::FeatureIndex index;
  for (int k = 0; k < 6; ++k) index.add(k, maker().features(SE3(kFirst.rotation, Vec3(60.0 * k, 0, 14))));
  const auto votes = index.candidates(maker().features(SE3(kFirst.rotation, Vec3(180.5, 0.3, 14.2))), 6, 3);
  ASSERT_FALSE(votes.empty());
  EXPECT_EQ(votes[0].keyframe, 3);
  ASSERT_GT(votes.size(), 1U);
  EXPECT_GT(votes[0].votes, 1.4 * votes[1].votes);  // smooth ground looks similar everywhere
  EXPECT_TRUE(index.candidates(maker().features(kFirst), 0, 3).empty());
}

TEST(KeyframeSimilarity, IsTheTrueOneWithItsScale) {
  constexpr double kScale = 1.4;  // a length in the second one's units over the same in the first one's
  std::mt19937 random(5);
  std::normal_distribution<float> noise(0.0F, 0.03F);
  auto first = maker().features(kFirst), second = maker().features(kSecond);
  for (keyframes::Feature& feature : first) feature.rho *= 1.0F + noise(random);
  for (keyframes::Feature& feature : second) feature.rho *= (1.0F + noise(random)) / static_cast<float>(kScale);
  const auto found = loop_closure::find_similarity(first, second, keyframes::match_features(first, second), {});
  ASSERT_TRUE(found);
  const SE3 truth = kFirst.inverse() * kSecond;
  EXPECT_GT(found->inliers.size(), 60U);
  EXPECT_NEAR(found->T_a_b.scale, 1.0 / kScale, 0.01);
  EXPECT_LT(geometry::so3_log(found->T_a_b.rotation.conjugate() * truth.rotation).norm(), 0.003);
  EXPECT_LT((found->T_a_b.translation - truth.translation).norm(), 0.1);
  EXPECT_LT(found->angle_rms_rad, 0.006);
}

TEST(KeyframeSimilarity, NeedsDistancesInBoth) {
  auto first = maker().features(kFirst), second = maker().features(kSecond);
  for (keyframes::Feature& feature : second) feature.rho = 0.0F;
  EXPECT_FALSE(loop_closure::find_similarity(first, second, keyframes::match_features(first, second), {}));
}

}  // namespace
}  // namespace tileflight::odometry::keyframe_matching_test
