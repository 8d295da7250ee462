#include "tileflight/core/alignment/pose_alignment.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "tileflight/core/alignment/umeyama.h"
#include "tileflight/core/base/input_error.h"

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
  EXPECT_THAT([&] { fit_poses({}, {}); }, ThrowsMessage<InputError>(HasSubstr("poses: both lists must hold the same number of poses, at least one")));
  EXPECT_THAT([&] { fit_poses(source, {target[0]}); },
              ThrowsMessage<InputError>(HasSubstr("the same number of poses")));
  EXPECT_DOUBLE_EQ(fit_poses({source[0]}, {target[0]}).scale, 1.0);
}

}  // namespace
}  // namespace tileflight::alignment::pose_alignment_test
