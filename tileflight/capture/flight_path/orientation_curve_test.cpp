#include "tileflight/capture/flight_path/orientation_curve.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "tileflight/capture/flight_path/path.h"

namespace tileflight::flight_path::orientation_curve_test {
namespace {

using geometry::Vec3;

std::vector<Waypoint> mission(unsigned seed, bool with_targets) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> place(-60, 60), turn(-170, 170);
  std::vector<Waypoint> waypoints;
  for (int i = 0; i < 6; ++i) {
    Waypoint w;
    w.position = {place(random), place(random), 80 + place(random) / 4};
    if (with_targets) w.look_at = Vec3(300 + place(random), place(random), place(random) / 6);
    w.yaw_deg = turn(random);
    w.pitch_deg = turn(random) / 2;
    w.roll_deg = turn(random) / 8;
    waypoints.push_back(w);
  }
  return waypoints;
}

/// The rotation from t - h to t + h, in camera axes, from the poses only.
Vec3 angular_velocity_by_poses(const Path& path, double t, double h) {
  return geometry::so3_log(path.pose(t - h).rotation.conjugate() * path.pose(t + h).rotation) / (2 * h);
}

void expect_derivatives(const Path& path) {
  double largest = 0.0;
  for (double t = path.start_s() + 0.01; t < path.end_s() - 0.01; t += 0.0437) {
    const double h = 1e-4;
    const Vec3 rate = path.angular_velocity(t);
    largest = std::max(largest, rate.norm());
    ASSERT_LT((rate - angular_velocity_by_poses(path, t, h)).norm(), 2e-6) << t;
    const Vec3 by_rates = (path.angular_velocity(t + h) - path.angular_velocity(t - h)) / (2 * h);
    ASSERT_LT((path.angular_acceleration(t) - by_rates).norm(), 2e-3 * (1 + by_rates.norm())) << t;
  }
  EXPECT_GT(largest, 0.05);
}

TEST(OrientationCurve, AngularVelocityAndAccelerationAreThoseOfThePoses) {
  for (unsigned seed = 1; seed <= 3; ++seed) {
    expect_derivatives(path_through_waypoints(mission(seed, false), {}));
    expect_derivatives(path_through_waypoints(mission(seed, true), {}));
  }
}

TEST(OrientationCurve, SoAreThoseOfAPathThroughPoses) {
  geometry::Trajectory trajectory;
  for (int i = 0; i < 40; ++i) {
    const double t = 3.0 + 0.25 * i;
    trajectory.poses.push_back(
        {t, {camera_orientation(40.0 * t, -30 + 20 * std::sin(t), 25 * std::cos(2 * t)), Vec3(t, 0, 0)}});
  }
  const Path path = path_through_poses(trajectory);
  expect_derivatives(path);
  EXPECT_EQ(path.angular_velocity(2.0).norm(), 0.0);
  EXPECT_EQ(path.angular_acceleration(99.0).norm(), 0.0);
}

// Circling the centre at constant height, looking at it: rotation about the vertical only, to the left (-z) at v / r.
TEST(OrientationCurve, CirclingATargetIsATurnAboutTheVertical) {
  geometry::Trajectory trajectory;
  for (int i = 0; i <= 200; ++i) {
    const double t = 0.1 * i, angle = 0.2 * t;
    const Vec3 position(30 * std::cos(angle), 30 * std::sin(angle), 0);
    trajectory.poses.push_back({t, {orientation_looking_along(-position, 0.0), position}});
  }
  const Path path = path_through_poses(trajectory);
  EXPECT_LT((path.angular_velocity(10.0) - Vec3(0, -0.2, 0)).norm(), 1e-5);
  EXPECT_LT(path.angular_acceleration(10.0).norm(), 1e-4);
}

}  // namespace
}  // namespace tileflight::flight_path::orientation_curve_test
