#include "tileflight/slam/mapping/residual_states.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tileflight/slam/mapping/test_random_window.h"

namespace tileflight::mapping::residual_states_test {
namespace {

using keyframes::ResidualState;

TEST(RemoveBadResiduals, CountsGoodOnesOnceAndRemovesPointsWithoutAny) {
  keyframes::Window window = test_support::random_window(3, 3, 9);
  for (keyframes::Keyframe& keyframe : window.keyframes) {
    keyframe.T_camera_map_linear.rotation.setIdentity();
    keyframe.frame_index = 10 * keyframe.id;
    for (keyframes::ActivePoint& point : keyframe.points) point.patch.ray = Eigen::Vector3f::UnitZ();
  }
  // Keyframe 1 stands one unit beside keyframe 0, keyframe 2 two units.
  for (int i = 0; i < 3; ++i) window.keyframes[i].T_camera_map_linear.translation = geometry::Vec3(-i, 0, 0);
  std::vector<keyframes::ActivePoint>& points = window.keyframes[0].points;
  points[0].rho = 0.5F;
  points[1].observations[1].state = ResidualState::kOutlier;  // in the newest
  points[1].recent_states = {ResidualState::kGood, ResidualState::kOutside};
  points[1].observations[0].counted = true;
  points[1].good_observations = 5;
  for (keyframes::Observation& o : points[2].observations) o.state = ResidualState::kOutside;
  for (keyframes::Observation& o : window.keyframes[2].points[0].observations) o.state = ResidualState::kOutlier;
  remove_bad_residuals(window);

  ASSERT_EQ(points.size(), 2U) << "the third has no good residual";
  EXPECT_EQ(points[0].good_observations, 2);
  EXPECT_EQ(points[0].last_frame, 20);
  EXPECT_NEAR(points[0].parallax_rad, std::atan2(2.0, 2.0), 1e-6) << "two units beside, two units away";
  EXPECT_EQ(points[1].good_observations, 5) << "counted before";
  ASSERT_EQ(points[1].observations.size(), 1U);
  EXPECT_EQ(points[1].observations[0].target, 1);
  EXPECT_EQ(points[1].recent_states[0], ResidualState::kOutlier);
  EXPECT_EQ(points[1].recent_states[1], ResidualState::kGood);
  EXPECT_EQ(window.keyframes[2].points.size(), 3U) << "points of the newest keyframe stay";
  remove_bad_residuals(window);
  EXPECT_EQ(points[0].good_observations, 2);
}

TEST(UpdateEnergyThreshold, IsHalfTheConstantAndHalfOfThe70thPercentile) {
  keyframes::Window window = test_support::random_window(3, 11, 4);
  for (int i = 0; i < 11; ++i) {
    for (keyframes::Keyframe& keyframe : window.keyframes) {
      for (keyframes::Observation& o : keyframe.points[i].observations) {
        // Keyframe 2 sees 1, 4, 9, ..., 121 twice.
        o.raw_energy = o.target == 2 ? static_cast<float>((i + 1) * (i + 1)) : 1e6F;
        o.state = i % 2 == 0 ? ResidualState::kGood : ResidualState::kOutlier;
      }
    }
  }
  for (const int host : {0, 1}) {
    for (keyframes::Observation& o : window.keyframes[host].points[0].observations) {
      o.state = ResidualState::kOutside;
      o.raw_energy = 1e6F;
    }
  }
  const float others = window.keyframes[1].energy_threshold;
  update_energy_threshold(window, 2);
  // 20 energies: at index floor(0.7 * 19) = 13 of 2, 2, 3, 3, ..., 11, 11 squared is 8 squared.
  EXPECT_NEAR(window.keyframes[2].energy_threshold, std::pow(0.5 * 26.0 + 0.5 * 1.5 * 8.0, 2), 1e-3);
  EXPECT_EQ(window.keyframes[1].energy_threshold, others);
}

}  // namespace
}  // namespace tileflight::mapping::residual_states_test
