#include "tileflight/capture/flight_path/path.h"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <random>

#include "tests/refusal.h"
#include "tileflight/capture/flight_path/cubic_spline.h"
#include "tileflight/capture/flight_path/speed_plan.h"
#include "tileflight/core/base/input_error.h"

namespace tileflight::flight_path::path_test {
namespace {

using geometry::SE3;
using geometry::Vec3;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

constexpr double kDegree = std::numbers::pi / 180.0;

Waypoint at(const Vec3& position, double yaw_deg = 0, double pitch_deg = 0, double roll_deg = 0) {
  Waypoint w;
  w.position = position;
  w.yaw_deg = yaw_deg;
  w.pitch_deg = pitch_deg;
  w.roll_deg = roll_deg;
  return w;
}

Waypoint looking(const Vec3& position, const Vec3& target) {
  Waypoint w;
  w.position = position;
  w.look_at = target;
  return w;
}

std::vector<Waypoint> random_mission(unsigned seed, int count) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> place(-80, 80), turn(-180, 180), pitch(-80, 20);
  std::vector<Waypoint> result;
  for (int i = 0; i < count; ++i) {
    result.push_back(
        at({place(random), place(random), 40 + place(random) / 4}, turn(random), pitch(random), turn(random) / 10));
  }
  return result;
}

double turning_rate_deg_s(const Path& path, double t) {
  const double h = 1e-4;
  return path.pose(t - h).rotation.angularDistance(path.pose(t + h).rotation) / (2 * h) / kDegree;
}

/// Time at which the path is nearest to a point, by dense search.
double distance_to(const Path& path, const Vec3& point) {
  double nearest = std::numeric_limits<double>::infinity();
  for (double t = path.start_s(); t <= path.end_s(); t += 2e-3)
    nearest = std::min(nearest, (path.pose(t).translation - point).norm());
  return nearest;
}

void expect_limits_kept(const Path& path, const SpeedLimits& limits) {
  for (double t = path.start_s() + 1e-3; t < path.end_s() - 1e-3; t += 0.01) {
    ASSERT_LE(path.velocity(t).norm(), limits.speed_m_s) << t;
    ASSERT_LE(path.acceleration(t).norm(), limits.acceleration_m_s2) << t;
    ASSERT_LE(turning_rate_deg_s(path, t), limits.yaw_rate_deg_s) << t;
  }
}

TEST(CubicSpline, ReproducesTheNaturalSplineOfThreePoints) {
  // By hand: knots 0, 1, 2 with values 0, 1, 0 have second derivative -3 in the middle; at u = 0.5 that is 11/16.
  const CubicSpline<1> spline({0, 1, 2},
                              {CubicSpline<1>::Vector(0), CubicSpline<1>::Vector(1), CubicSpline<1>::Vector(0)});
  EXPECT_NEAR(spline.second_derivative(1)[0], -3, 1e-14);
  EXPECT_NEAR(spline.value(0.5)[0], 11.0 / 16, 1e-14);
  EXPECT_NEAR(spline.first_derivative(1)[0], 0, 1e-14);
  EXPECT_NEAR(spline.first_derivative(0)[0], 1.5, 1e-14);
}

TEST(CubicSpline, DerivativesAreThoseOfTheValuesAndContinuous) {
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  std::vector<double> knots{0};
  std::vector<Vec3> values{Vec3::Zero()};
  for (int i = 0; i < 8; ++i) {
    knots.push_back(knots.back() + 0.2 + std::abs(normal(random)));
    values.push_back({normal(random), normal(random), normal(random)});
  }
  const CubicSpline<3> spline(knots, values);
  const double h = 1e-5;
  for (double u = h; u < spline.end() - h; u += 0.037) {
    EXPECT_LT((spline.first_derivative(u) - (spline.value(u + h) - spline.value(u - h)) / (2 * h)).norm(), 1e-6);
    EXPECT_LT(
        (spline.second_derivative(u) - (spline.first_derivative(u + h) - spline.first_derivative(u - h)) / (2 * h))
            .norm(),
        1e-3);
  }
  for (std::size_t i = 0; i < knots.size(); ++i) EXPECT_LT((spline.value(knots[i]) - values[i]).norm(), 1e-13);
}

TEST(SpeedPlan, StraightLineTakesTheTimeOfATrapezoid) {
  // 100 m at 10 m/s and 5 m/s^2: 2 s up, 2 s down, 80 m between: 12 s, and the averaging window adds its own length.
  // Cells of 0.1 m.
  CurveBounds bounds;
  for (int i = 0; i <= 1000; ++i) bounds.u.push_back(0.1 * i);
  bounds.first_m.assign(1000, 1.0);
  bounds.second_m.assign(1000, 0.0);
  bounds.rotation_rad.assign(1000, 0.0);
  const SpeedPlan plan(bounds, {10, 5, 1}, 0.5);
  EXPECT_NEAR(plan.duration_s(), 12.5, 1e-3);
  EXPECT_NEAR(plan.at(plan.duration_s() / 2).rate, 10, 1e-9);
  EXPECT_NEAR(plan.at(plan.duration_s() / 2).u, 50, 1e-6);
  EXPECT_NEAR(plan.at(1.0).acceleration, 5, 1e-9);
  EXPECT_NEAR(plan.at(100).u, 100, 1e-9);
  EXPECT_EQ(plan.at(-1).rate, 0);
}

TEST(SpeedPlan, DerivativesAreThoseOfThePositionAndTheSecondIsContinuous) {
  CurveBounds bounds;
  for (int i = 0; i <= 200; ++i) bounds.u.push_back(0.25 * i);
  for (int i = 0; i < 200; ++i) {
    bounds.first_m.push_back(1 + 0.5 * std::sin(0.1 * i));
    bounds.second_m.push_back(i > 90 && i < 110 ? 0.8 : 0.01);
    bounds.rotation_rad.push_back(0.05);
  }
  const SpeedPlan plan(bounds, {8, 4, 1});
  const double h = 1e-4;
  for (double t = h; t < plan.duration_s() - h; t += 0.01) {
    const Progression before = plan.at(t - h), after = plan.at(t + h);
    ASSERT_NEAR(plan.at(t).rate, (after.u - before.u) / (2 * h), 1e-5);
    ASSERT_NEAR(after.acceleration, before.acceleration, 2 * h * 4 * 4 / 0.5 * 2)
        << t;  // jerk is bounded by the window
    ASSERT_GE(plan.at(t).rate, 0);
  }
}

TEST(CameraOrientation, IsRightDownForward) {
  const auto axes = [](double yaw, double pitch, double roll) {
    return camera_orientation(yaw, pitch, roll).toRotationMatrix();
  };
  const auto near = [](const geometry::Mat3& a, const geometry::Mat3& b) { return (a - b).norm() < 1e-12; };
  geometry::Mat3 north, down, east_banked;
  north << Vec3(1, 0, 0), Vec3(0, 0, -1), Vec3(0, 1, 0);        // looks north: right is east, down is down
  down << Vec3(1, 0, 0), Vec3(0, -1, 0), Vec3(0, 0, -1);        // looks down, top of the picture north
  east_banked << Vec3(0, 0, -1), Vec3(0, 1, 0), Vec3(1, 0, 0);  // looks east, right side straight down
  EXPECT_TRUE(near(axes(0, 0, 0), north));
  EXPECT_TRUE(near(axes(0, -90, 0), down));
  EXPECT_TRUE(near(axes(90, 0, 90), east_banked));
  EXPECT_NEAR(axes(30, 20, 10).determinant(), 1, 1e-12);
}

TEST(WaypointPath, KeepsItsLimitsFromRestToRest) {
  const SpeedLimits limits{9, 3.5, 40};
  for (unsigned seed = 1; seed <= 6; ++seed) {
    SCOPED_TRACE(seed);
    const Path path = path_through_waypoints(random_mission(seed, 7), limits);
    expect_limits_kept(path, limits);
    EXPECT_EQ(path.start_s(), 0);
    EXPECT_LT(path.velocity(path.start_s()).norm(), 1e-9);
    EXPECT_LT(path.velocity(path.end_s()).norm(), 1e-9);
  }
}

TEST(WaypointPath, IsNotMuchSlowerThanItMustBe) {
  const Path path = path_through_waypoints({at({0, 0, 50}), at({200, 0, 50}), at({400, 0, 50})}, {8, 4, 60});
  EXPECT_NEAR(path.end_s(), 400.0 / 8 + 8.0 / 4, 2.0);  // a trapezoid of speed, and the margins
}

TEST(WaypointPath, PassesThroughTheWaypointsAsTheySay) {
  const std::vector<Waypoint> mission = random_mission(11, 6);
  const Path path = path_through_waypoints(mission, {8, 4, 60});
  for (const Waypoint& w : mission) EXPECT_LT(distance_to(path, w.position), 0.02);
  const SE3 first = path.pose(path.start_s()), last = path.pose(path.end_s());
  EXPECT_LT((first.translation - mission.front().position).norm(), 1e-9);
  EXPECT_LT((last.translation - mission.back().position).norm(), 1e-9);
  EXPECT_LT(last.rotation.angularDistance(
                camera_orientation(mission.back().yaw_deg, mission.back().pitch_deg, mission.back().roll_deg)),
            1e-7);
}

TEST(WaypointPath, DerivativesAreThoseOfThePositionAndContinuous) {
  const Path path = path_through_waypoints(random_mission(5, 6), {8, 4, 60});
  const double h = 1e-4;
  for (double t = 2 * h; t < path.end_s() - 2 * h; t += 0.013) {
    const Vec3 velocity = (path.pose(t + h).translation - path.pose(t - h).translation) / (2 * h);
    ASSERT_LT((path.velocity(t) - velocity).norm(), 1e-4) << t;
    ASSERT_LT((path.acceleration(t + h) - path.acceleration(t - h)).norm(), 2 * h * 60) << t;
    ASSERT_LT(std::abs(turning_rate_deg_s(path, t + h) - turning_rate_deg_s(path, t - h)), 0.5) << t;
  }
}

TEST(WaypointPath, LooksExactlyAtItsTarget) {
  const Vec3 target(3, -2, 1);
  std::vector<Waypoint> orbit;
  for (int i = 0; i <= 8; ++i)
    orbit.push_back(looking({60 * std::cos(0.7 * i), 60 * std::sin(0.7 * i), 30.0 + i}, target));
  const SpeedLimits limits{10, 4, 20};
  const Path path = path_through_waypoints(orbit, limits);
  for (double t = 0; t < path.end_s(); t += 0.05) {
    const Vec3 seen = (path.pose(t).inverse() * target).normalized();  // straight ahead in the camera
    ASSERT_LT((seen - Vec3::UnitZ()).norm(), 1e-9);
    ASSERT_NEAR(path.pose(t).rotation.toRotationMatrix()(2, 0), 0, 1e-9);  // and level
  }
  expect_limits_kept(path, limits);
}

TEST(WaypointPath, TurnsBackWhereItCame) {
  const SpeedLimits limits{8, 4, 60};
  const Path path = path_through_waypoints({at({0, 0, 30}), at({50, 0, 30}), at({0, 0, 30})}, limits);
  expect_limits_kept(path, limits);
  EXPECT_LT(distance_to(path, {50, 0, 30}), 0.02);
  EXPECT_LT(path.end_s(), 40);
}

TEST(WaypointPath, RefusesWhatCannotBeFlown) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto fault = [](const std::vector<Waypoint>& mission, const SpeedLimits& limits = {}) -> std::string {
    return tests::refusal_of([&] { path_through_waypoints(mission, limits); });
  };
  using testing::HasSubstr;
  const Waypoint a = at({0, 0, 10}), b = at({10, 0, 10});
  EXPECT_THAT(fault({}), HasSubstr("at least two"));
  EXPECT_THAT(fault({a}), HasSubstr("at least two"));
  EXPECT_THAT(fault({a, b, b}), HasSubstr("waypoint 3: is at the same place as waypoint 2"));
  EXPECT_THAT(fault({a, at({nan, 0, 0})}), HasSubstr("waypoint 2: a number is not finite"));
  EXPECT_THAT(fault({a, at({5, 0, 0}, nan)}), HasSubstr("not finite"));
  EXPECT_THAT(fault({a, b}, {0, 4, 60}), HasSubstr("speed_m_s: must be more than 0"));
  EXPECT_THAT(fault({a, b}, {8, -1, 60}), HasSubstr("acceleration_m_s2"));
  EXPECT_THAT(fault({a, b}, {8, 4, nan}), HasSubstr("yaw_rate_deg_s"));
  EXPECT_THAT(fault({a, looking({10, 0, 10}, {10, 0, 0})}), HasSubstr("straight above or below"));
  EXPECT_THAT(fault({looking({-10, 0, 10}, {0, 0, 0}), looking({10, 0, 10}, {0, 0, 0})}),
              HasSubstr("between waypoint 1 and waypoint 2: look_at is straight above or below"));
}

geometry::Trajectory sampled_circle(double step_s) {
  geometry::Trajectory trajectory;
  for (double t = 5; t <= 25 + 1e-9; t += step_s) {
    const double angle = 0.3 * t;
    trajectory.poses.push_back({t,
                                {camera_orientation(angle / kDegree, -30 + 5 * std::sin(t), 3 * std::cos(t)),
                                 Vec3(50 * std::cos(angle), 50 * std::sin(angle), 40 + std::sin(t))}});
  }
  return trajectory;
}

TEST(PosePath, PassesThroughThePosesAndStaysNearTheCurveTheyCameFrom) {
  const geometry::Trajectory coarse = sampled_circle(0.25), fine = sampled_circle(0.01);
  const Path path = path_through_poses(coarse);
  EXPECT_EQ(path.start_s(), coarse.poses.front().time_s);
  EXPECT_EQ(path.end_s(), coarse.poses.back().time_s);
  for (const geometry::StampedPose& pose : coarse.poses) {
    EXPECT_LT((path.pose(pose.time_s).translation - pose.T_local_camera.translation).norm(), 1e-12);
    EXPECT_LT(path.pose(pose.time_s).rotation.angularDistance(pose.T_local_camera.rotation), 1e-7);
  }
  for (const geometry::StampedPose& pose : fine.poses) {
    if (pose.time_s < 7 || pose.time_s > 23) continue;  // a natural spline bends less than the circle at its ends
    EXPECT_LT((path.pose(pose.time_s).translation - pose.T_local_camera.translation).norm(), 1e-3);
    EXPECT_LT(path.pose(pose.time_s).rotation.angularDistance(pose.T_local_camera.rotation), 0.02 * kDegree);
    EXPECT_NEAR(path.velocity(pose.time_s).head<2>().norm(), 15, 0.01);
  }
}

TEST(PosePath, OppositeQuaternionSignsAreOneRotation) {
  geometry::Trajectory trajectory = sampled_circle(0.25), flipped = trajectory;
  for (std::size_t i = 0; i < flipped.size(); i += 3) flipped.poses[i].T_local_camera.rotation.coeffs() *= -1;
  const Path a = path_through_poses(trajectory), b = path_through_poses(flipped);
  for (double t = 5; t < 25; t += 0.031) EXPECT_LT(a.pose(t).rotation.angularDistance(b.pose(t).rotation), 1e-7);
}

TEST(PosePath, DoesNotDependOnTheFrame) {
  const geometry::Trajectory trajectory = sampled_circle(0.5);
  const SE3 T(Eigen::Quaterniond(0.3, -0.5, 0.7, 0.2), Vec3(100, -20, 7));
  const Path a = path_through_poses(trajectory),
             b = path_through_poses(geometry::transformed(geometry::Sim3(T), trajectory));
  for (double t = 5; t < 25; t += 0.1) {
    const SE3 difference = (T * a.pose(t)).inverse() * b.pose(t);
    EXPECT_LT(difference.translation.norm(), 1e-9);
    EXPECT_LT(difference.rotation.vec().norm(), 1e-9);
  }
}

TEST(PosePath, NeedsTwoPoses) {
  EXPECT_THAT([&] { path_through_poses({}); }, ThrowsMessage<InputError>(HasSubstr("a path needs at least two poses")));
}

}  // namespace
}  // namespace tileflight::flight_path::path_test
