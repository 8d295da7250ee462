#include "tileflight/capture/vehicle/quadrotor.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

#include "tests/refusal.h"
#include "tileflight/capture/vehicle/wind.h"

namespace tileflight::vehicle::quadrotor_test {
namespace {

using geometry::Vec3;

const RotorSpeeds kStill = RotorSpeeds::Zero();

TEST(Quadrotor, DefaultsAreAirSimsGenericQuad) {
  const MultirotorOptions quad;
  EXPECT_NEAR(quad.max_rotor_thrust_n(), 4.179446, 1e-3);  // RotorParams.hpp says both
  EXPECT_NEAR(quad.torque_nm_s2 * std::pow(quad.max_rotor_speed_rad_s, 2), 0.055562, 1e-5);
  const double arm = 0.2275, box_kg = 1.0 - 4 * 0.055;  // MultiRotorParams.hpp's inertia of a box and four motors
  const double arms = 4 * 0.055 * (arm * arm / 2 + 0.025 * 0.025);
  const geometry::Mat3& J = quad.body.inertia_kg_m2;
  EXPECT_NEAR(J(0, 0), box_kg / 12 * (0.11 * 0.11 + 0.04 * 0.04) + arms, 1e-5);
  EXPECT_NEAR(J(1, 1), box_kg / 12 * (0.18 * 0.18 + 0.04 * 0.04) + arms, 1e-5);
  EXPECT_NEAR(J(2, 2), box_kg / 12 * (0.18 * 0.18 + 0.11 * 0.11) + 4 * 0.055 * arm * arm, 1e-5);
  for (const Rotor& rotor : quad.rotors) EXPECT_NEAR(rotor.position_m.head<2>().norm(), arm, 1e-4);
  // Drag faces of the box and of the propellers' discs or their 1 cm high sides, times 0.325 / 2 and 1.225 kg/m^3.
  const double disc = std::numbers::pi * 0.1143 * 0.1143, side = std::numbers::pi * 0.2286 * 0.01,
               factor = 1.225 * 0.325 / 2;
  EXPECT_NEAR(quad.quadratic_drag_n_s2_m2.x(), factor * (0.11 * 0.04 + 4 * side), 1e-5);
  EXPECT_NEAR(quad.quadratic_drag_n_s2_m2.y(), factor * (0.18 * 0.04 + 4 * side), 1e-5);
  EXPECT_NEAR(quad.quadratic_drag_n_s2_m2.z(), factor * (0.18 * 0.11 + 4 * disc), 1e-4);
}

TEST(Quadrotor, RotorsPushWhereTheyAre) {
  const MultirotorOptions quad;
  const auto torque = [&](std::initializer_list<int> fast) {
    RotorSpeeds speeds = RotorSpeeds::Constant(300);
    for (const int i : fast) speeds[i] = 400;
    return multirotor_wrench(quad, {}, {speeds.data(), kRotors}, Vec3::Zero()).torque_nm;
  };
  EXPECT_NEAR(torque({}).norm(), 0, 1e-15);
  EXPECT_GT(torque({1, 2}).x(), 0.05);   // more lift on the left: rolls to the right, about the forward axis
  EXPECT_LT(torque({0, 2}).y(), -0.05);  // more in front: nose up, about minus left
  EXPECT_LT(torque({0, 1}).z(), -0.01);  // the counter-clockwise ones faster: turns clockwise
  EXPECT_NEAR(torque({0, 1}).head<2>().norm(), 0, 1e-15);
}

TEST(Quadrotor, HoversWithoutMoving) {
  const MultirotorOptions quad;
  const RotorSpeeds hover = RotorSpeeds::Constant(hover_rotor_speed_rad_s(quad));
  QuadrotorState state{{}, hover};
  for (int i = 0; i < 1000; ++i) state = integrate(quad, state, hover, Vec3::Zero(), 0.003);
  EXPECT_LT(state.body.position_m.norm(), 1e-9);
}

TEST(Quadrotor, RotorsFollowWithTheirLag) {
  const MultirotorOptions quad;
  const QuadrotorState after = integrate(quad, {}, RotorSpeeds::Constant(500), Vec3::Zero(), 0.005);
  EXPECT_NEAR(after.rotor_speeds_rad_s[0], 500 * (1 - std::exp(-1)), 1e-9);
  const QuadrotorState fast = integrate(quad, after, RotorSpeeds::Constant(5000), Vec3::Zero(), 1.0);
  EXPECT_NEAR(fast.rotor_speeds_rad_s[3], quad.max_rotor_speed_rad_s, 1e-9);
}

TEST(Quadrotor, FallsThroughQuadraticDragAsTheHyperbolicTangent) {
  const MultirotorOptions quad;
  const double g = kStandardGravity_m_s2, terminal = std::sqrt(g / quad.quadratic_drag_n_s2_m2.z());
  QuadrotorState state;
  for (int i = 0; i < 1000; ++i) state = integrate(quad, state, kStill, Vec3::Zero(), 0.003);
  EXPECT_NEAR(state.body.velocity_m_s.z(), -terminal * std::tanh(g * 3.0 / terminal), 1e-9);
  EXPECT_NEAR(state.body.position_m.z(), -terminal * terminal / g * std::log(std::cosh(g * 3.0 / terminal)), 1e-8);
}

TEST(Quadrotor, LinearDragCarriesItWithTheWind) {
  MultirotorOptions quad;
  quad.quadratic_drag_n_s2_m2.setZero();
  quad.linear_drag_n_s_m = {0.5, 0.2, 0.1};
  const RotorSpeeds hover = RotorSpeeds::Constant(hover_rotor_speed_rad_s(quad));
  QuadrotorState state{{}, hover};
  for (int i = 0; i < 1000; ++i) state = integrate(quad, state, hover, Vec3(4, 3, 0), 0.003);
  EXPECT_NEAR(state.body.velocity_m_s.x(), 4 * (1 - std::exp(-0.5 * 3)), 1e-9);
  EXPECT_NEAR(state.body.velocity_m_s.y(), 3 * (1 - std::exp(-0.2 * 3)), 1e-9);
}

TEST(Quadrotor, OptionsThatCannotFlyAreRefused) {
  const auto refusal = [](const auto& change) {
    return tests::refusal_of([&] {
      MultirotorOptions quad;
      change(quad);
      check(quad);
    });
  };
  EXPECT_EQ(refusal([](MultirotorOptions&) {}), "no error");
  EXPECT_THAT(refusal([](MultirotorOptions& q) { q.body.mass_kg = 1.6; }), testing::HasSubstr("cannot lift it"));
  EXPECT_THAT(refusal([](MultirotorOptions& q) { q.body.mass_kg = NAN; }), testing::HasSubstr("the mass"));
  EXPECT_THAT(refusal([](MultirotorOptions& q) { q.body.inertia_kg_m2(0, 0) = -1; }), testing::HasSubstr("inertia"));
  EXPECT_THAT(refusal([](MultirotorOptions& q) { q.linear_drag_n_s_m.x() = -1; }), testing::HasSubstr("drag"));
}

}  // namespace
}  // namespace tileflight::vehicle::quadrotor_test

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
