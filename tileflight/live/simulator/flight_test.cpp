#include <gmock/gmock.h>

#include <atomic>
#include <cmath>
#include <future>
#include <numbers>
#include <thread>

#include "tests/refusal.h"
#include "tileflight/live/simulator/test_world.h"

namespace tileflight::simulator::flight_test {
namespace {

using namespace test_world;
using testing::HasSubstr;

constexpr float kAlways_s = 3e38F;
const YawMode kKeep{true, 0.0F};

std::unique_ptr<Simulator> ready(const std::string& settings = kMultirotor, LoggedLines* lines = nullptr) {
  auto world = simulator(settings, {}, lines != nullptr ? lines->log() : SimulatorLog());
  world->vehicles().enable_api_control(true, "");
  world->vehicles().arm_disarm(true, "");
  return world;
}

Vector3r position(Simulator& world) { return world.vehicles().get_multirotor_state("").kinematics_estimated.position; }

bool move_to(Simulator& world, float x, float y, float z, float velocity = 5.0F) {
  return world.flight().move_to_position(x, y, z, velocity, kAlways_s, 0, kKeep, -1, 1, "");
}

double off_m(Simulator& world, double x, double y, double z) {
  const Vector3r p = position(world);
  return std::hypot(p.x_val - x, p.y_val - y, p.z_val - z);
}

TEST(ApiFlight, AVehicleStandsOnTheGroundAndTakesOffTwoMetres) {
  const auto world = ready();
  const float standing = position(*world).z_val;
  EXPECT_NEAR(standing, -0.35, 0.01);
  EXPECT_EQ(world->vehicles().get_multirotor_state("").landed_state, 0);
  EXPECT_TRUE(world->flight().takeoff(20, ""));
  EXPECT_NEAR(position(*world).z_val, standing - 2.0, 0.15);
  EXPECT_EQ(world->vehicles().get_multirotor_state("").landed_state, 1);
  const std::vector<RotorParameters> rotors = world->vehicles().get_rotor_states("").rotors;
  ASSERT_EQ(rotors.size(), 4U);
  for (const RotorParameters& rotor : rotors)
    EXPECT_NEAR(rotor.thrust, 9.80665 / 4, 0.5) << "four rotors carry a kilogram";
  EXPECT_TRUE(world->flight().land(60, ""));
  EXPECT_NEAR(position(*world).z_val, standing, 0.03);
  EXPECT_EQ(world->vehicles().get_multirotor_state("").landed_state, 0);
}

TEST(ApiFlight, MovesEndNearTheGoalInNed) {
  const auto world = ready();
  EXPECT_TRUE(move_to(*world, 8, -6, -10));
  EXPECT_LT(off_m(*world, 8, -6, -10), 0.5);
  EXPECT_TRUE(world->flight().move_on_path({{0, -6, -10}, {0, 0, -12}}, 5, kAlways_s, 1, {false, 0.0F}, -1, 1, ""));
  EXPECT_LT(off_m(*world, 0, 0, -12), 0.5);
  EXPECT_TRUE(world->flight().move_to_z(-6, 3, kAlways_s, kKeep, -1, 1, ""));
  EXPECT_NEAR(position(*world).z_val, -6.0, 0.5);
  EXPECT_TRUE(world->flight().move_on_path({}, 5, kAlways_s, 0, kKeep, -1, 1, "")) << "an empty path is done";
  EXPECT_TRUE(world->flight().hover(""));
  EXPECT_FALSE(world->vehicles().get_collision_info("").has_collided);
}

TEST(ApiFlight, VelocitiesAreOfTheWorldOrOfTheBody) {
  const auto world = ready();
  move_to(*world, 0, 0, -10);
  EXPECT_TRUE(world->flight().move_by_velocity(3, 0, 0, 2, 0, kKeep, ""));
  EXPECT_GT(position(*world).x_val, 3.0);
  EXPECT_TRUE(world->flight().rotate_to_yaw(90, 20, 2, ""));
  const Quaternionr q = world->vehicles().get_vehicle_pose("").orientation;
  EXPECT_NEAR(2 * std::atan2(q.z_val, q.w_val), std::numbers::pi / 2, 0.06);
  const float before = position(*world).y_val;
  EXPECT_TRUE(world->flight().move_by_velocity_body_frame(3, 0, 0, 2, 0, kKeep, ""));
  EXPECT_GT(position(*world).y_val, before + 3.0) << "forward is east now";
  EXPECT_TRUE(world->flight().move_by_velocity_z(0, -2, -14, 3, 0, kKeep, ""));
  EXPECT_NEAR(position(*world).z_val, -14, 0.6);
  EXPECT_TRUE(world->flight().move_by_velocity(1, 0, 0, 0, 0, kKeep, "")) << "no time: done";
  EXPECT_FALSE(world->flight().move_by_velocity_z(1, 0, -5, 0, 0, kKeep, "")) << "as AirSim";
}

TEST(ApiFlight, YawRatesTurnClockwise) {
  const auto world = ready();
  move_to(*world, 0, 0, -10);
  EXPECT_TRUE(world->flight().rotate_by_yaw_rate(30, 2, ""));
  const Quaternionr q = world->vehicles().get_vehicle_pose("").orientation;
  EXPECT_GT(2 * std::atan2(q.z_val, q.w_val), 0.6);
}

TEST(ApiFlight, ATaskThatTimesOutAnswersFalse) {
  const auto world = ready();
  EXPECT_FALSE(world->flight().takeoff(0, ""));
  EXPECT_FALSE(world->flight().move_to_position(15, 0, -10, 1, 0.5, 0, kKeep, -1, 1, ""));
}

TEST(ApiFlight, CancelAndAnyNewTaskEndTheRunningOne) {
  const auto world = ready(R"({"SimMode": "Multirotor", "ClockSpeed": 20})");
  const auto fly_far = [&] { return move_to(*world, -150, 0, -10, 1); };
  for (const bool by_cancel : {true, false}) {
    auto flight = std::async(std::launch::async, fly_far);
    while (world->statistics().tasks_running == 0) std::this_thread::yield();
    if (by_cancel) {
      world->flight().cancel_last_task("");
    } else {
      EXPECT_TRUE(world->flight().hover(""));
    }
    EXPECT_FALSE(flight.get());
  }
  auto flight = std::async(std::launch::async, fly_far);
  while (world->statistics().tasks_running == 0) std::this_thread::yield();
  world->stop();
  EXPECT_FALSE(flight.get()) << "nobody waits for ever when the server ends";
  EXPECT_FALSE(world->flight().takeoff(20, ""));
}

TEST(ApiFlight, WithoutApiControlNothingMovesAndArmingAnswersFalse) {
  const auto world = simulator(kMultirotor);
  EXPECT_FALSE(world->flight().takeoff(20, ""));
  EXPECT_FALSE(world->vehicles().arm_disarm(true, "")) << "AirSim's answer";
  world->vehicles().enable_api_control(true, "");
  EXPECT_TRUE(world->vehicles().arm_disarm(false, ""));
  EXPECT_FALSE(world->flight().takeoff(20, "")) << "not armed";
  EXPECT_TRUE(world->vehicles().arm_disarm(true, ""));
  EXPECT_TRUE(world->flight().takeoff(20, ""));
  EXPECT_FALSE(world->vehicles().arm_disarm(false, "")) << "in the air";
}

TEST(ApiFlight, VehiclesStartAndResetArmed) {
  const auto world = simulator(kMultirotor);
  world->vehicles().enable_api_control(true, "");
  EXPECT_TRUE(world->flight().takeoff(20, "")) << "AirSim's vehicles are armed at start";
  world->reset();
  EXPECT_FALSE(world->vehicles().is_api_control_enabled(""));
  EXPECT_NEAR(position(*world).z_val, -0.35, 0.01);
  EXPECT_FALSE(world->flight().takeoff(20, "")) << "API control is taken back";
  world->vehicles().enable_api_control(true, "");
  world->vehicles().arm_disarm(false, "");
  world->reset();
  world->vehicles().enable_api_control(true, "");
  EXPECT_TRUE(world->flight().takeoff(20, "")) << "armed again";
}

TEST(ApiFlight, AVehicleOfTheStateDisarmedStartsAndResetsUnarmed) {
  for (const char* state : {"Disarmed", "Inactive"}) {
    const auto world = simulator(R"({"StepOnDemand": true, "Vehicles": {"A": {"DefaultVehicleState": ")" +
                                 std::string(state) + R"("}}})");
    for (const char* when : {"at start", "after reset"}) {
      world->vehicles().enable_api_control(true, "");
      EXPECT_FALSE(world->flight().takeoff(20, "")) << state << ' ' << when;
      EXPECT_TRUE(world->vehicles().arm_disarm(true, ""));
      EXPECT_TRUE(world->flight().takeoff(20, "")) << state << ' ' << when;
      world->reset();
    }
  }
}

TEST(ApiFlight, AWallInTheWayIsACollision) {
  const auto world = ready();
  move_to(*world, 0, 0, -10);
  world->flight().move_by_velocity(8, 0, 0, 4, 0, kKeep, "");
  const CollisionInfo collision = world->vehicles().get_collision_info("");
  EXPECT_TRUE(collision.has_collided);
  EXPECT_NEAR(collision.impact_point.x_val, kWallNorth_m, 0.05);
  EXPECT_EQ(collision.object_name, "surface") << "the place itself";
  EXPECT_LT(position(*world).x_val, kWallNorth_m);
}

/// A plane that rises to the north by 30 degrees, 1 m below the origin.
std::vector<imaging::TexturedMesh> slope() {
  const auto height = [](double north_m) { return -1.0 + north_m * std::tan(std::numbers::pi / 6); };
  imaging::TexturedMesh mesh;
  mesh.name = "slope";
  mesh.mesh.vertices = {{-50, -50, height(-50)}, {50, -50, height(-50)}, {50, 50, height(50)}, {-50, 50, height(50)}};
  mesh.mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  return {mesh};
}

TEST(ApiFlight, AContactThatLastsIsReportedAgainAndAgain) {
  SimulatorOptions options;
  options.settings = kMultirotor;
  Simulator world(options, slope());
  world.vehicles().enable_api_control(true, "");
  move_to(world, 0, 0, -6);
  world.flight().move_by_velocity(2, 0, 0, 5, 0, kKeep, "");
  std::uint64_t before = 0;
  for (int second = 0; second < 8; ++second) {
    world.flight().move_by_velocity(2, 0, 0, 1, 0, kKeep, "");
    const CollisionInfo now = world.vehicles().get_collision_info("");
    EXPECT_TRUE(now.has_collided) << second;
    EXPECT_GT(now.time_stamp, before) << second;
    before = now.time_stamp;
  }
}

TEST(ApiFlight, TheSameCommandsGiveTheSameFlightToTheLastBit) {
  const auto flown = [] {
    const auto world = ready();
    world->flight().takeoff(20, "");
    move_to(*world, 5, 5, -8);
    world->clock().continue_for_time(1.0);
    return world->vehicles().get_multirotor_state("");
  };
  const MultirotorState a = flown(), b = flown();
  EXPECT_EQ(a.timestamp, b.timestamp);
  EXPECT_EQ(a.kinematics_estimated.position.x_val, b.kinematics_estimated.position.x_val);
  EXPECT_EQ(a.kinematics_estimated.orientation.y_val, b.kinematics_estimated.orientation.y_val);
}

TEST(ApiFlight, AVehicleStaysWhereItIsPutAndFliesOnFromThere) {
  const auto world = ready();
  world->vehicles().set_vehicle_pose({{3, 4, -9}, {0.9F, 0.1F, 0.1F, 0.1F}}, true, "");
  EXPECT_FLOAT_EQ(position(*world).x_val, 3.0F) << "at once";
  world->clock().continue_for_time(0.3);
  EXPECT_FLOAT_EQ(position(*world).z_val, -9.0F);
  world->clock().pause(false);
  EXPECT_TRUE(move_to(*world, 3, 8, -9));
  EXPECT_LT(off_m(*world, 3, 8, -9), 0.5);
}

/// Angles are those of a body with y right and z down: nose down flies forward, right side down flies right.
TEST(ApiFlight, AnglesAndRatesAreOfTheBody) {
  const auto world = ready();
  const auto reset = [&] { world->vehicles().set_vehicle_pose(pose(0, 0, -10), true, ""); };
  reset();
  EXPECT_TRUE(world->flight().move_by_roll_pitch_yaw_z(0, -0.2F, 0, -10, 2, ""));
  EXPECT_GT(position(*world).x_val, 2.0);
  EXPECT_NEAR(position(*world).y_val, 0.0, 0.1);
  EXPECT_NEAR(position(*world).z_val, -10.0, 0.2);
  reset();
  EXPECT_TRUE(world->flight().move_by_roll_pitch_yawrate_z(0.2F, 0, 0, -10, 2, ""));
  EXPECT_GT(position(*world).y_val, 2.0);
  reset();
  EXPECT_TRUE(world->flight().move_by_angle_rates_z(0, 0, 0.8F, -10, 1, ""));
  EXPECT_NEAR(2 * std::asin(world->vehicles().get_vehicle_pose("").orientation.z_val), 0.8, 0.1)
      << "clockwise from above";
  reset();
  EXPECT_TRUE(world->flight().move_by_angle_rates_throttle(0, -0.4F, 0, 0.6F, 0.5F, ""));
  EXPECT_GT(world->vehicles().get_ground_truth_kinematics("").linear_velocity.x_val, 0.1);
  EXPECT_TRUE(world->flight().move_by_roll_pitch_yaw_throttle(0, 0, 1.5F, 0.8F, 1.5F, ""));
  EXPECT_LT(world->vehicles().get_ground_truth_kinematics("").linear_velocity.z_val, -2.0) << "up";
  EXPECT_THAT(tests::message_of([&] { world->flight().move_by_roll_pitch_yaw_throttle(0, 0, 0, NAN, 1, ""); }),
              HasSubstr("the throttle is not finite"));
  EXPECT_THAT(tests::message_of([&] { world->flight().move_by_angle_rates_z(NAN, 0, 0, -10, 1, ""); }),
              HasSubstr("a rate is not finite"));
}

/// With wind towards the east, the vehicle tilts west to hold its position.
TEST(ApiFlight, WindReachesAVehicleThatIsInTheAir) {
  const auto world = ready();
  move_to(*world, 0, 0, -10);
  const auto lean_after_a_while = [&] {
    world->clock().continue_for_time(8.0);
    return world->vehicles().get_vehicle_pose("").orientation.x_val;
  };
  EXPECT_NEAR(lean_after_a_while(), 0.0, 0.003);
  world->environment().set_wind({0, 8, 0});
  EXPECT_LT(lean_after_a_while(), -0.01);
  EXPECT_LT(off_m(*world, 0, 0, -10), 0.6);
  world->environment().set_wind({0, 0, 0});
  EXPECT_NEAR(lean_after_a_while(), 0.0, 0.003);
}

TEST(ApiFlight, CommandsThatCannotBeFlownAreRefused) {
  const auto world = ready();
  const auto path = [&](float velocity, float lookahead, int drivetrain, float x) {
    return tests::message_of(
        [&] { world->flight().move_to_position(x, 0, -5, velocity, 10, drivetrain, kKeep, lookahead, 1, ""); });
  };
  EXPECT_THAT(path(-1, -1, 0, 1), HasSubstr("velocity"));
  EXPECT_THAT(path(NAN, -1, 0, 1), HasSubstr("velocity"));
  EXPECT_THAT(path(5, 0, 0, 1), HasSubstr("lookahead"));
  EXPECT_THAT(path(5, -1, 1, 1), HasSubstr("forward only"));
  EXPECT_THAT(path(5, -1, 0, NAN), HasSubstr("finite"));
  EXPECT_THAT(tests::message_of([&] { world->clock().continue_for_time(INFINITY); }), HasSubstr("seconds"));
  const auto still = simulator(kComputerVision);
  EXPECT_THAT(tests::message_of([&] { still->flight().takeoff(20, ""); }),
              testing::StartsWith("Vehicle API for 'ComputerVision'"));
}

TEST(ApiFlight, WhatAirSimAcceptsIsFlownOrClampedWithALineInTheLog) {
  LoggedLines lines;
  const auto world = ready(kMultirotor, &lines);
  const auto taken = [&lines](const char* line) { return lines.count(line) == 1U; };
  move_to(*world, 0, 0, -10);
  EXPECT_TRUE(world->flight().move_on_path({}, 0, kAlways_s, 1, kKeep, 0, 1, "")) << "nothing is checked then";
  EXPECT_TRUE(world->flight().rotate_to_yaw(90, 0, 5, "")) << "no time: done";
  EXPECT_NEAR(world->vehicles().get_vehicle_pose("").orientation.z_val, 0.0, 0.05);
  EXPECT_TRUE(lines.lines.empty());
  EXPECT_TRUE(world->flight().rotate_to_yaw(90, 20, 0, ""));
  EXPECT_NEAR(world->vehicles().get_vehicle_pose("").orientation.z_val, std::sqrt(0.5), 0.01);
  EXPECT_TRUE(taken("rotateToYaw: the margin of 0 is taken as 0.01"));
  EXPECT_FALSE(world->flight().move_to_position(5, 0, -10, 0, 2, 0, kKeep, -1, 1, "")) << "stays until the timeout";
  EXPECT_LT(off_m(*world, 0, 0, -10), 1.0);
  EXPECT_TRUE(taken("moveToPosition: the velocity of 0 is taken as 0.001"));
  EXPECT_TRUE(world->flight().move_to_position(1, 0, -10, 3, 20, 7, kKeep, NAN, 1, ""))
      << "a lookahead that is no number";
  EXPECT_TRUE(taken("moveToPosition: the drivetrain 7 is taken as 0, any direction"));
  EXPECT_TRUE(world->flight().move_by_velocity(0, 0, -5000, 0.1F, 0, {false, 7.2e6F}, ""));
  EXPECT_TRUE(taken("moveByVelocity: a velocity of 5000 m/s is taken as 1000 m/s"));
  EXPECT_TRUE(world->flight().move_by_roll_pitch_yaw_throttle(0, 0, 0, 1.5F, 0.1F, ""));
  EXPECT_TRUE(taken("moveByRollPitchYawThrottle: the throttle of 1.5 is taken as 1"));
  EXPECT_TRUE(world->flight().move_by_angle_rates_throttle(0, 0, 0, -0.5F, 0.1F, ""));
  EXPECT_TRUE(taken("moveByAngleRatesThrottle: the throttle of -0.5 is taken as 0"));
  EXPECT_TRUE(world->flight().rotate_by_yaw_rate(2e5F, 0.1F, ""));
  EXPECT_TRUE(taken("rotateByYawRate: the rate of 200000 is taken as 100000"));
}

TEST(ApiFlight, CallsThatWaitForTheClockAreBounded) {
  const auto world = simulator(R"({"SimMode": "Multirotor", "ClockSpeed": 0.1})");
  std::vector<std::thread> waiting;
  std::atomic<std::size_t> refused{0};
  constexpr std::size_t kCalls = Clock::kMaxContinuingCalls + 5;
  for (std::size_t i = 0; i < kCalls; ++i) {
    waiting.emplace_back([&] {
      const std::string message = tests::message_of([&] { world->clock().continue_for_time(3600); });
      if (message.find("128 calls wait for the clock already") != std::string::npos) ++refused;
    });
  }
  while (refused < 5) std::this_thread::yield();
  world->clock().pause(true);
  for (std::thread& one : waiting) one.join();
  EXPECT_EQ(refused, 5U);
}

/// Scripts for AirSim pass its default yaw mode, which is a rate of 0.
TEST(ApiFlight, AYawRateOverridesForwardOnlyExceptAlongPaths) {
  const auto world = ready();
  const YawMode rate_of_zero{true, 0.0F}, turning{true, 30.0F};
  EXPECT_TRUE(world->flight().move_by_velocity_z(0, 3, -5, 3, 1, rate_of_zero, ""));
  EXPECT_GT(position(*world).y_val, 3.0);
  EXPECT_NEAR(world->vehicles().get_vehicle_pose("").orientation.z_val, 0.0, 0.1) << "it still looks north";
  EXPECT_TRUE(world->flight().move_by_velocity(3, 0, 0, 1, 1, rate_of_zero, ""));
  EXPECT_TRUE(world->flight().move_by_velocity_body_frame(3, 0, 0, 1, 1, rate_of_zero, ""));
  EXPECT_TRUE(world->flight().move_by_velocity_z_body_frame(3, 0, -5, 3, 1, turning, ""));
  EXPECT_GT(world->vehicles().get_vehicle_pose("").orientation.z_val, 0.4) << "clockwise by about 90 degrees";
  EXPECT_THAT(tests::message_of([&] {
                world->flight().move_on_path({{9, 0, -5}}, 3, 10, 1, rate_of_zero, -1, 1, "");
              }),
              HasSubstr("forward only"));
}

TEST(ApiFlight, SeveralVehiclesHaveTheirOwnOrigins) {
  const auto world = simulator(
      R"({"StepOnDemand": true, "Vehicles": {"A": {"X": 0}, "B": {"X": 5, "Y": -5, "DefaultVehicleState": "Armed"}}})");
  EXPECT_THAT(world->vehicles().list_vehicles(), testing::ElementsAre("A", "B"));
  world->vehicles().enable_api_control(true, "B");
  EXPECT_TRUE(world->flight().move_to_position(2, 0, -4, 3, 60, 0, kKeep, -1, 1, "B"));
  const Vector3r own = world->vehicles().get_vehicle_pose("B").position;
  EXPECT_NEAR(own.x_val, 2.0, 0.5);
  EXPECT_NEAR(world->objects().get_object_pose("B").position.x_val, own.x_val + 5.0, 1e-4) << "global NED";
  EXPECT_NEAR(world->objects().get_object_pose("A").position.x_val, 0.0, 1e-4);
  EXPECT_TRUE(world->flight().go_home(60, "B"));
  EXPECT_NEAR(world->vehicles().get_vehicle_pose("B").position.x_val, 0.0, 0.6);
}

}  // namespace
}  // namespace tileflight::simulator::flight_test
