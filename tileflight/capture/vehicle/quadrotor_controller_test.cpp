#include "tileflight/capture/vehicle/quadrotor_controller.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "tests/refusal.h"
#include "tileflight/capture/vehicle/wind.h"

namespace tileflight::vehicle::quadrotor_controller_test {
namespace {

using geometry::Vec3;

constexpr double kStep_s = 0.003;
const MultirotorOptions kQuad;

Setpoint hold(const Vec3& position, double yaw = 0.0) {
  Setpoint setpoint;
  setpoint.position_m = position;
  setpoint.holds_position = {true, true, true};
  setpoint.yaw_rad = yaw;
  return setpoint;
}

QuadrotorState hovering() { return {{}, RotorSpeeds::Constant(hover_rotor_speed_rad_s(kQuad))}; }

/// States after each step.
std::vector<RigidBodyState> flown(QuadrotorState state, const Setpoint& setpoint, double seconds,
                                  const Vec3& wind = Vec3::Zero(), const ControllerOptions& options = {}) {
  QuadrotorController controller(kQuad, options);
  std::vector<RigidBodyState> states;
  for (int i = 0; i < seconds / kStep_s; ++i) {
    state = integrate(kQuad, state, controller.rotor_speeds_rad_s(state.body, setpoint, kStep_s), wind, kStep_s);
    states.push_back(state.body);
  }
  return states;
}

/// Response to a unit step: the overshoot, and the time after which it stays within 5 %.
struct StepResponse {
  double overshoot = 0.0, settling_s = 0.0;
};

template <typename Value>
StepResponse response_of(const std::vector<RigidBodyState>& states, const Value& value) {
  StepResponse response;
  for (std::size_t i = 0; i < states.size(); ++i) {
    response.overshoot = std::max(response.overshoot, value(states[i]) - 1.0);
    if (std::abs(value(states[i]) - 1.0) > 0.05) response.settling_s = static_cast<double>(i + 1) * kStep_s;
  }
  return response;
}

double tilt_rad(const RigidBodyState& s) { return std::acos((s.R_local_body * Vec3::UnitZ()).z()); }

TEST(QuadrotorController, AttitudeStep) {
  // At constant acceleration the tilt is atan(3 / g).
  Setpoint setpoint;
  setpoint.acceleration_m_s2 = {3, 0, 0};
  ControllerOptions options;
  options.velocity_gain_horizontal = 1e-9;
  options.velocity_integral_horizontal = 0.0;
  const double lean = std::atan(3 / kStandardGravity_m_s2);
  const StepResponse r = response_of(flown(hovering(), setpoint, 2.0, Vec3::Zero(), options),
                                     [&](const RigidBodyState& s) { return tilt_rad(s) / lean; });
  EXPECT_LT(r.overshoot, 0.05);
  EXPECT_LT(r.settling_s, 0.5);
}

TEST(QuadrotorController, VelocityStep) {
  Setpoint setpoint;
  setpoint.velocity_m_s = {2, 0, 0};
  setpoint.holds_position = {false, false, true};
  const StepResponse r =
      response_of(flown(hovering(), setpoint, 12.0), [](const RigidBodyState& s) { return s.velocity_m_s.x() / 2; });
  EXPECT_LT(r.overshoot, 0.25);
  EXPECT_LT(r.settling_s, 4.5);
}

TEST(QuadrotorController, PositionStepsSidewaysAndUp) {
  const auto sideways = flown(hovering(), hold({0, 1, 0}), 15.0);
  const StepResponse r = response_of(sideways, [](const RigidBodyState& s) { return s.position_m.y(); });
  EXPECT_LT(r.overshoot, 0.25);
  EXPECT_LT(r.settling_s, 8.0);
  EXPECT_LT((sideways.back().position_m - Vec3(0, 1, 0)).norm(), 2e-3);
  for (const RigidBodyState& s : sideways) EXPECT_NEAR(s.position_m.z(), 0.0, 0.02);  // keeps its height
  const StepResponse up =
      response_of(flown(hovering(), hold({0, 0, 1}), 15.0), [](const RigidBodyState& s) { return s.position_m.z(); });
  EXPECT_LT(up.overshoot, 0.25);
  EXPECT_LT(up.settling_s, 6.0);
}

TEST(QuadrotorController, FarGoalsAreReachedWithinTheLimitsWithoutRunningPast) {
  const ControllerOptions options;
  double fastest = 0, furthest = 0, steepest = 0;
  const auto states = flown(hovering(), hold({60, 0, 20}), 30.0);
  for (const RigidBodyState& s : states) {
    fastest = std::max(fastest, s.velocity_m_s.head<2>().norm());
    furthest = std::max(furthest, s.position_m.x());
    steepest = std::max(steepest, tilt_rad(s));
  }
  EXPECT_GT(fastest, 0.8 * options.max_speed_m_s);
  EXPECT_LT(fastest, 1.12 * options.max_speed_m_s);
  EXPECT_LT(furthest, 62.5);
  EXPECT_LT(steepest, options.max_tilt_rad + 0.03);
  EXPECT_LT((states.back().position_m - Vec3(60, 0, 20)).norm(), 0.02);
}

TEST(QuadrotorController, NoSteadyErrorInWind) {
  const auto states = flown(hovering(), hold({0, 0, 0}), 40.0, Vec3(8, -4, 1));
  EXPECT_LT(states.back().position_m.norm(), 1e-3);
  EXPECT_GT(tilt_rad(states.back()), 0.02);  // tilts into the wind
  ControllerOptions without;
  without.velocity_integral_horizontal = without.velocity_integral_vertical = 0.0;
  EXPECT_GT(flown(hovering(), hold({0, 0, 0}), 40.0, Vec3(8, -4, 1), without).back().position_m.norm(), 0.05);
}

TEST(QuadrotorController, TurnsToItsYawTheShortWay) {
  QuadrotorState state = hovering();
  state.body.R_local_body = level_orientation(3.0);
  const auto states = flown(state, hold({0, 0, 0}, -3.0), 4.0);
  EXPECT_NEAR(yaw_rad(states.back().R_local_body), -3.0, 1e-3);
  for (const RigidBodyState& s : states) EXPECT_GT(std::abs(yaw_rad(s.R_local_body)), 2.9);
}

TEST(QuadrotorController, ComesBackFromLyingOnItsSide) {
  QuadrotorState state = hovering();
  state.body.R_local_body = Eigen::AngleAxisd(2.0, Vec3(1, 0.3, 0).normalized());
  state.body.angular_velocity_rad_s = {-3, 2, 1};
  const auto states = flown(state, hold({0, 0, 0}), 20.0);
  EXPECT_LT(states.back().position_m.norm(), 0.02);
  EXPECT_LT(tilt_rad(states.back()), 0.01);
}

TEST(QuadrotorController, AttitudeErrorIsTheAngleWhereItIsSmall) {
  const Eigen::Quaterniond wanted = attitude_from_thrust(Vec3(0.3, -0.2, 1), 0.7);
  EXPECT_LT((wanted * Vec3::UnitZ() - Vec3(0.3, -0.2, 1).normalized()).norm(), 1e-15);
  EXPECT_NEAR((wanted * Vec3::UnitY()).dot(Vec3(std::cos(0.7), std::sin(0.7), 0)), 0.0, 1e-15);
  const Vec3 small(1e-4, -2e-4, 3e-4);
  const Eigen::Quaterniond off = wanted * geometry::so3_exp(small);
  EXPECT_LT((attitude_error(wanted.toRotationMatrix(), off.toRotationMatrix()) - small).norm(), 1e-10);
}

TEST(QuadrotorController, ApproachComesToRestAtTheGoal) {
  double distance = 80.0, time = 0.0;
  for (; distance > 1e-3 && time < 60; time += 1e-3) {
    const double speed = approach_speed_m_s(distance, 1.0, 2.0);
    const double later = approach_speed_m_s(distance - 1e-3 * speed, 1.0, 2.0);
    EXPECT_LE(speed - later, 2.0 * 1e-3 * 1.01);  // never exceeds the deceleration
    distance -= 1e-3 * speed;
  }
  EXPECT_LT(time, 20.0);
}

TEST(QuadrotorController, BadOptionsAreRefused) {
  ControllerOptions options;
  options.yaw_gain = 0;
  EXPECT_THAT(tests::refusal_of([&] { check(options); }), testing::HasSubstr("must be more than 0"));
  options = {};
  options.max_tilt_rad = 1.5;
  EXPECT_THAT(tests::refusal_of([&] { check(options); }), testing::HasSubstr("1.2 rad"));
}

}  // namespace
}  // namespace tileflight::vehicle::quadrotor_controller_test

namespace tileflight::vehicle::rotor_mixer_test {
namespace {

using geometry::Vec3;

const MultirotorOptions kQuad;
const double kWeight = kQuad.body.mass_kg * kStandardGravity_m_s2;

/// The thrust and torque that the rotors deliver.
RotorDemand after_mixing(const RotorDemand& demand) {
  const RotorMixer mixer(kQuad);
  const RotorSpeeds speeds = mixer.speeds_rad_s(demand);
  EXPECT_GE(speeds.minCoeff(), 0.0);
  EXPECT_LE(speeds.maxCoeff(), kQuad.max_rotor_speed_rad_s * (1 + 1e-12));
  const Wrench wrench = multirotor_wrench(kQuad, {}, {speeds.data(), kRotors}, Vec3::Zero());  // at rest: no drag
  return {wrench.force_n.z() + kWeight, wrench.torque_nm};
}

TEST(RotorMixer, GivesWhatIsWantedWhereItCan) {
  const RotorDemand demand{kWeight, {0.3, -0.2, 0.04}};
  const RotorDemand given = after_mixing(demand);
  EXPECT_NEAR(given.thrust_n, demand.thrust_n, 1e-12);
  EXPECT_LT((given.torque_nm - demand.torque_nm).norm(), 1e-12);
}

TEST(RotorMixer, TurningGivesWayFirst) {
  const RotorDemand given = after_mixing({kWeight, {0.6, 0.2, 5.0}});
  EXPECT_NEAR(given.thrust_n, kWeight, 1e-12);
  EXPECT_NEAR(given.torque_nm.x(), 0.6, 1e-12);
  EXPECT_NEAR(given.torque_nm.y(), 0.2, 1e-12);
  EXPECT_GT(given.torque_nm.z(), 0.0);
  EXPECT_LT(given.torque_nm.z(), 0.06);
}

TEST(RotorMixer, ThenThrustMakesRoomForRollAndPitch) {
  for (const double thrust_n : {0.0, 100.0}) {
    const RotorDemand given = after_mixing({thrust_n, {0.4, -0.3, 0.0}});
    EXPECT_NEAR(given.torque_nm.x(), 0.4, 1e-12);
    EXPECT_NEAR(given.torque_nm.y(), -0.3, 1e-12);
    EXPECT_GT(given.thrust_n, 2.0);
    EXPECT_LT(given.thrust_n, 4 * kQuad.max_rotor_thrust_n() - 2.0);
  }
}

TEST(RotorMixer, WhatIsTooMuchForAnyThrustKeepsItsDirection) {
  const Vec3 torque = after_mixing({kWeight, {30.0, -15.0, 1.0}}).torque_nm;
  EXPECT_NEAR(torque.y() / torque.x(), -0.5, 1e-12);
  EXPECT_GT(torque.x(), 0.5);
  EXPECT_NEAR(torque.z(), 0.0, 1e-12);
}

}  // namespace
}  // namespace tileflight::vehicle::rotor_mixer_test
