#include "tileflight/evaluation/registration/similarity_estimate.h"

#include <gtest/gtest.h>

#include <random>

namespace tileflight::registration::similarity_estimate_test {
namespace {

using geometry::Sim3;
using geometry::Vec3;
using geometry::Vec7;

Sim3 some_similarity() { return {8.0, geometry::so3_exp({2.0, 0.3, -0.5}), {10.0, -5.0, 40.0}}; }

Mat7 random_information(unsigned seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  Mat7 root;
  for (double& x : root.reshaped()) x = normal(random);
  return root * root.transpose() + 0.1 * Mat7::Identity();
}

TEST(SimilarityEstimate, MotionsAreAppliedAndFoundAgain) {
  const Vec3 center(30.0, -20.0, 12.0);
  Vec7 motion;
  motion << 0.3, -0.2, 0.1, 0.02, -0.01, 0.03, 0.015;
  const Sim3 T = some_similarity(), moved = apply_motion(T, motion, center);
  EXPECT_LT((motion_between(T, moved, center) - motion).norm(), 1e-12);
  // A target point at the centre moves by the translation alone.
  const Vec3 source = T.inverse() * center;
  EXPECT_LT((moved * source - center - motion.head<3>()).norm(), 1e-12);
}

TEST(SimilarityEstimate, AnotherCenterTellsTheSameProbability) {
  const SimilarityEstimate a{some_similarity(), Vec3(1.0, 2.0, 3.0), random_information(1)};
  const SimilarityEstimate b = a.recentered(Vec3(-15.0, 4.0, 20.0));
  Vec7 small;
  small << 3e-5, -1e-5, 2e-5, 1e-6, -2e-6, 3e-6, 1e-6;
  const Sim3 moved = apply_motion(a.T_target_source, small, a.center);
  const Vec7 about_b = motion_between(b.T_target_source, moved, b.center);
  EXPECT_NEAR(about_b.dot(b.information * about_b) / small.dot(a.information * small), 1.0, 1e-3);
  EXPECT_LT((b.recentered(a.center).information - a.information).norm(), 1e-9 * a.information.norm());
}

}  // namespace
}  // namespace tileflight::registration::similarity_estimate_test
