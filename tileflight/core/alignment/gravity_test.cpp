#include "tileflight/core/alignment/gravity.h"

#include <gtest/gtest.h>

#include <cmath>

namespace tileflight::alignment::gravity_test {
namespace {

using geometry::Mat3;
using geometry::Trajectory;
using geometry::Vec3;

/// Camera to a level world (z up): heading, pitch (up positive), roll, radians.
Eigen::Quaterniond camera(double heading, double pitch, double roll) {
  Mat3 level;        // columns: the camera's x, y, z, looking to +x of the world
  level << 0, 0, 1,  //
      -1, 0, 0,      //
      0, -1, 0;
  return Eigen::Quaterniond(Eigen::AngleAxisd(heading, Vec3::UnitZ())) *
         Eigen::Quaterniond(Eigen::AngleAxisd(-pitch, Vec3::UnitY())) *
         Eigen::Quaterniond(Eigen::AngleAxisd(roll, Vec3::UnitX())) * Eigen::Quaterniond(level);
}

Trajectory turning(double turn_rad, double roll_rad) {
  const Eigen::Quaterniond map_of_world(Eigen::AngleAxisd(1.1, Vec3(0.3, -0.5, 0.81).normalized()));
  Trajectory trajectory;
  for (int k = 0; k < 100; ++k) {
    const double phase = 0.0628 * k;
    const auto r =
        camera(turn_rad * std::sin(phase), -0.6 + 0.3 * std::cos(2.0 * phase), roll_rad * std::cos(3.0 * phase));
    trajectory.poses.push_back({0.1 * k, {map_of_world * r, Vec3::Zero()}});
  }
  return trajectory;
}

const Vec3 kUpInMap = Eigen::Quaterniond(Eigen::AngleAxisd(1.1, Vec3(0.3, -0.5, 0.81).normalized())) * Vec3::UnitZ();

TEST(UpFromTrajectory, AnUprightCameraThatTurnsTellsIt) {
  const auto up = estimate_up_from_trajectory(turning(1.0, 0.0));
  ASSERT_TRUE(up);
  EXPECT_LT((*up - kUpInMap).norm(), 1e-9);
}

TEST(UpFromTrajectory, SomeRollDoesLittle) {
  const auto up = estimate_up_from_trajectory(turning(1.0, 0.1));
  ASSERT_TRUE(up);
  EXPECT_LT(std::acos(up->dot(kUpInMap)), 0.05);
}

TEST(UpFromTrajectory, WithoutTurnsItIsNotKnown) {
  EXPECT_FALSE(estimate_up_from_trajectory(turning(0.02, 0.0)));
  EXPECT_FALSE(estimate_up_from_trajectory(turning(0.3, 0.3))) << "rolls as much as it turns";
  EXPECT_FALSE(estimate_up_from_trajectory({}));
}

}  // namespace
}  // namespace tileflight::alignment::gravity_test
