#include "tileflight/capture/vehicle/vehicle_flight.h"

#include <gmock/gmock.h>

#include <cmath>
#include <fstream>
#include <numbers>

#include "tests/refusal.h"
#include "tests/temporary_folder.h"
#include "tileflight/capture/vehicle/test_obstacles.h"

namespace tileflight::vehicle::vehicle_flight_test {
namespace {

using geometry::Vec3;

const flight_path::SpeedLimits kLimits{6.0, 2.5, 40.0};

std::vector<flight_path::Waypoint> round_trip() {
  std::vector<flight_path::Waypoint> waypoints(4);
  waypoints[0].position = {0, 0, 20};
  waypoints[1].position = {25, 10, 24};
  waypoints[2].position = {30, 35, 22};
  waypoints[3].position = {5, 40, 20};
  for (std::size_t i = 0; i < 4; ++i) {
    waypoints[i].yaw_deg = 30.0 * static_cast<double>(i);
    waypoints[i].pitch_deg = i == 2 ? -90.0 : -35.0;
  }
  return waypoints;
}

VehicleFlight flown(const VehiclePlan& plan, const ObstacleQuery& obstacles = {}) {
  const std::vector<flight_path::Waypoint> waypoints = round_trip();
  return fly_along(flight_path::path_through_waypoints(waypoints, kLimits), waypoints, kLimits, plan, obstacles);
}

TEST(VehicleFlight, KeepsToAPlannedPathInStillAir) {
  const VehicleFlight flight = flown({});
  EXPECT_EQ(flight.outcome, Outcome::kFinished);
  ASSERT_TRUE(flight.tracking);
  EXPECT_LT(flight.tracking->rms_m, 0.15);
  EXPECT_LT(flight.tracking->max_m, 0.4);
  EXPECT_GT(flight.tracking->max_m, 1e-3);
  ASSERT_EQ(flight.tracking->nearest_to_waypoints_m.size(), 4u);
  for (const double nearest_m : flight.tracking->nearest_to_waypoints_m) EXPECT_LT(nearest_m, 0.25);
  const flight_path::Path planned = flight_path::path_through_waypoints(round_trip(), kLimits);
  EXPECT_NEAR(flight.path.end_s(), planned.end_s(), 0.01);
  EXPECT_LT((flight.path.pose(0).translation - round_trip()[0].position).norm(), 1e-3);
}

TEST(VehicleFlight, AGimbalKeepsThePlansPitchAndAFixedCameraTheBodys) {
  const flight_path::Path planned = flight_path::path_through_waypoints(round_trip(), kLimits);
  const VehicleFlight stabilised = flown({});
  VehiclePlan fixed;
  fixed.mount.gimbal = false;
  fixed.mount.pitch_deg = -35.0;
  const VehicleFlight shaken = flown(fixed);
  double most_tilted = 0;
  for (double t = 0.0; t < stabilised.path.end_s(); t += 0.31) {
    const auto is = stabilised.path.pose(t).rotation, wanted = planned.pose(t).rotation;
    EXPECT_NEAR((is * Vec3::UnitZ()).z(), (wanted * Vec3::UnitZ()).z(), 1e-3);
    EXPECT_NEAR((is * Vec3::UnitX()).z(), (wanted * Vec3::UnitX()).z(), 1e-3);
    EXPECT_LT(is.angularDistance(wanted), 0.1);
    most_tilted = std::max(most_tilted, std::abs((shaken.path.pose(t).rotation * Vec3::UnitX()).z()));
  }
  EXPECT_GT(most_tilted, 0.05);
}

TEST(VehicleFlight, ACameraAwayFromTheCentreIsWhereThePlanHasIt) {
  VehiclePlan plan;
  plan.mount.offset_m = {0.3, 0.0, -0.1};
  const VehicleFlight flight = flown(plan);
  EXPECT_LT(flight.tracking->rms_m, 0.25);
  EXPECT_LT((flight.path.pose(0).translation - round_trip()[0].position).norm(), 1e-3);
}

TEST(VehicleFlight, WindCostsAccuracyButNotMuch) {
  VehiclePlan plan;
  plan.options.wind = {{6, -3, 0}, Turbulence::kModerate, 30.0, 5};
  const VehicleFlight flight = flown(plan);
  EXPECT_EQ(flight.outcome, Outcome::kFinished);
  EXPECT_GT(flight.tracking->rms_m, flown({}).tracking->rms_m);
  EXPECT_LT(flight.tracking->rms_m, 0.5);
  EXPECT_EQ(flight.path.pose(7.0).translation, flown(plan).path.pose(7.0).translation);
}

TEST(VehicleFlight, AccelerationsOfThePathAreThoseOfTheForces) {
  // A simulated IMU uses the path's derivatives: they must match the forces of rotors, drag and gravity.
  VehicleOptions options;
  options.wind = {{5, 0, 0}, Turbulence::kModerate, 30.0, 2};
  Vehicle vehicle(options, {}, {0, 0, 20}, 0.0);
  const TrackReference circle{[](double t) {
                                Setpoint s;
                                s.position_m = {10 * std::sin(0.5 * t), 10 - 10 * std::cos(0.5 * t), 20};
                                s.velocity_m_s = {5 * std::cos(0.5 * t), 5 * std::sin(0.5 * t), 0};
                                s.holds_position = {true, true, true};
                                return s;
                              },
                              12.0};
  geometry::Trajectory samples;
  std::vector<std::pair<double, Vec3>> felt;
  int steps = 0;
  vehicle.run(circle, [&](const Vehicle& v) {
    ++steps;
    if (steps % 3 == 0) samples.poses.push_back({v.time_s(), {v.state().R_local_body, v.state().position_m}});
    const RotorSpeeds speeds = v.rotor_speeds_rad_s();
    const Wrench w = multirotor_wrench(v.options().quadrotor, v.state(), {speeds.data(), kRotors}, v.wind_m_s());
    if (steps % 3 == 1 && v.time_s() > 2.0)
      felt.emplace_back(v.time_s(), w.force_n / v.options().quadrotor.body.mass_kg);
  });
  const flight_path::Path path = flight_path::path_through_poses(samples);
  double squares = 0, size = 0;
  for (const auto& [time_s, acceleration] : felt) {
    if (time_s > 11.8) continue;
    squares += (path.acceleration(time_s) - acceleration).squaredNorm();
    size += acceleration.squaredNorm();
  }
  EXPECT_GT(std::sqrt(size / static_cast<double>(felt.size())), 2.0);
  EXPECT_LT(std::sqrt(squares / static_cast<double>(felt.size())), 0.02);
}

TEST(VehicleFlight, AWallEndsItOrBouncesIt) {
  VehiclePlan plan;
  plan.options.collision = CollisionPolicy::kStop;
  const ObstacleQuery wall = test_support::plane({1, 0, 0}, 20.0);
  const VehicleFlight stopped = flown(plan, wall);
  EXPECT_EQ(stopped.outcome, Outcome::kCollided);
  ASSERT_TRUE(stopped.last_collision);
  EXPECT_NEAR(stopped.last_collision->time_s, stopped.path.end_s(), 0.01);
  EXPECT_NEAR(stopped.path.pose(stopped.path.end_s()).translation.x(), 20 - plan.options.radius_m, 1e-6);
  plan.options.collision = CollisionPolicy::kBounce;
  const VehicleFlight bouncing = flown(plan, wall);
  EXPECT_EQ(bouncing.outcome, Outcome::kFinished);
  EXPECT_GT(bouncing.collisions, 0);
  EXPECT_GT(bouncing.tracking->max_m, 5.0);
  EXPECT_THAT(tileflight::tests::refusal_of([&] {
                flown(plan, test_support::plane({1, 0, 0}, 0.1));
              }),
              testing::HasSubstr("collides at its start position"));
}

class VehicleFile : public testing::Test {
 protected:
  base::StrictSection load(const std::string& text) {
    std::ofstream(folder_ / "flight.yaml") << text;
    return base::StrictSection::load(folder_ / "flight.yaml");
  }
  VehiclePlan vehicle(const std::string& text) {
    base::StrictSection file = load(text);
    auto section = file.section("vehicle");
    return read_vehicle(*section);
  }
  std::vector<MissionStep> mission(const std::string& text) {
    base::StrictSection file = load(text);
    return read_mission(file);
  }
  tileflight::tests::TemporaryFolder folder_;
};

constexpr const char* kMission = R"(mission:
  - {do: takeoff, height_m: 8, speed_m_s: 1.5}
  - {do: go_to, position: [20, 5, 10], speed_m_s: 5, drivetrain: forward}
  - {do: path, points: [25, 15, 10,  10, 20, 12], speed_m_s: 4, heading_deg: 45}
  - {do: velocity, velocity_m_s: [-2, 0, 0], duration_s: 3, frame: heading, height_m: 11, yaw_rate_deg_s: 10}
  - {do: turn, heading_deg: 270}
  - {do: turn_rate, yaw_rate_deg_s: -20, duration_s: 2}
  - {do: hover, duration_s: 1}
  - {do: land, speed_m_s: 1}
)";

TEST_F(VehicleFile, AMissionIsFlownFromTakeOffToLanding) {
  VehiclePlan plan = vehicle("vehicle: {collision: stop, start: [1, 2, 0.35], landed: true, pitch_deg: -30}\n");
  EXPECT_EQ(plan.options.collision, CollisionPolicy::kStop);
  const VehicleFlight flight = fly_mission(mission(kMission), plan, test_support::level_ground(0.0));
  EXPECT_EQ(flight.outcome, Outcome::kFinished);
  ASSERT_EQ(flight.mission.size(), 8u);
  EXPECT_EQ(flight.mission[2].name, "path");
  EXPECT_NEAR(flight.mission[5].ended_s - flight.mission[5].started_s, 2.0, 0.01);
  const auto after = [&](std::size_t i) { return flight.path.pose(flight.mission[i].ended_s); };
  EXPECT_LT((after(1).translation - Vec3(20, 5, 10)).norm(), 0.55);
  EXPECT_LT((after(2).translation - Vec3(10, 20, 12)).norm(), 0.55);
  EXPECT_NEAR(after(3).translation.z(), 11.0, 0.3);
  EXPECT_NEAR(after(7).translation.z(), 0.35, 1e-3);
  EXPECT_NEAR((after(4).rotation * Vec3::UnitZ()).x(), -std::cos(std::numbers::pi / 6), 0.02);  // west, 30 degrees down
}

TEST_F(VehicleFile, KeysAreReadAndOthersRefused) {
  const VehiclePlan plan = vehicle(
      "vehicle: {wind_m_s: [3, 1, 0], turbulence: light, seed: 4, height_above_ground_m: 40, collision: bounce,\n"
      "  mount: fixed, pitch_deg: 20, offset_m: [0.1, 0, 0], mass_kg: 1.2, max_tilt_deg: 30}\n");
  EXPECT_EQ(plan.options.wind.mean_m_s, Vec3(3, 1, 0));
  EXPECT_EQ(plan.options.wind.turbulence, Turbulence::kLight);
  EXPECT_EQ(plan.options.wind.seed, 4u);
  EXPECT_FALSE(plan.mount.gimbal);
  EXPECT_EQ(plan.options.quadrotor.body.mass_kg, 1.2);
  EXPECT_EQ(vehicle("vehicle: {}\n").options.collision, CollisionPolicy::kOff);
  const auto fault = [&](const std::string& text) {
    return tileflight::tests::refusal_of([&] { vehicle("vehicle: {" + text + "}\n"); });
  };
  EXPECT_THAT(fault("turbulance: light"), testing::HasSubstr("did you mean 'turbulence'?"));
  EXPECT_THAT(fault("collision: crash"), testing::HasSubstr("'vehicle.collision'"));
  EXPECT_THAT(fault("mass_kg: 0"), testing::HasSubstr("must be more than 0"));
  const auto bad_step = [&](const std::string& text) {
    return tileflight::tests::refusal_of([&] { mission("mission:\n  - {" + text + "}\n"); });
  };
  EXPECT_THAT(bad_step("height_m: 3"), testing::HasSubstr("'mission[0].do' is missing"));
  EXPECT_THAT(bad_step("do: go_to, positon: [1, 2, 3]"), testing::HasSubstr("'mission[0].position' is missing"));
  EXPECT_THAT(bad_step("do: hover, speed_m_s: 3"), testing::HasSubstr("'mission[0].speed_m_s' is not a key here"));
  EXPECT_THAT(bad_step("do: path, points: [1, 2, 3, 4]"), testing::HasSubstr("east, north, up"));
  EXPECT_THAT(bad_step("do: hover, duration_s: -1"), testing::HasSubstr("must be from 0 to 3600 seconds"));
}

}  // namespace
}  // namespace tileflight::vehicle::vehicle_flight_test
