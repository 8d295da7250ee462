#include "tileflight/capture/vehicle/quadrotor.h"

#include <gmock/gmock.h>

#include <cmath>
#include <numbers>

#include "tests/refusal.h"

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
