#include "tileflight/capture/vehicle/rigid_body.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace tileflight::vehicle::rigid_body_test {
namespace {

using geometry::Vec3;

const Wrench kNothing;

RigidBody brick() {
  RigidBody body{2.0, Vec3(0.02, 0.05, 0.11).asDiagonal()};
  body.inertia_kg_m2(0, 1) = body.inertia_kg_m2(1, 0) = 0.004;  // its axes are not the body's
  return body;
}

/// Turning about the middle axis is unstable: it tumbles.
RigidBodyState tumbling() {
  RigidBodyState state;
  state.velocity_m_s = {1, -2, 3};
  state.angular_velocity_rad_s = {0.3, 6.0, -0.2};
  return state;
}

/// Returns the kinetic energy of translation and rotation.
double kinetic_energy_j(const RigidBody& body, const RigidBodyState& state) {
  const Vec3& w = state.angular_velocity_rad_s;
  return 0.5 * body.mass_kg * state.velocity_m_s.squaredNorm() + 0.5 * w.dot(body.inertia_kg_m2 * w);
}

/// About the centre of mass, local frame, kg m^2/s.
Vec3 angular_momentum(const RigidBody& body, const RigidBodyState& state) {
  return state.R_local_body * (body.inertia_kg_m2 * state.angular_velocity_rad_s);
}

RigidBodyState after(const RigidBody& body, RigidBodyState state, double seconds, int steps,
                     const WrenchFunction& wrench) {
  for (int i = 0; i < steps; ++i) state = integrate(body, state, seconds / steps, wrench);
  return state;
}

TEST(RigidBody, FreeTumblingKeepsEnergyAndAngularMomentumForAMinute) {
  const RigidBody body = brick();
  const RigidBodyState start = tumbling();
  RigidBodyState state = start;
  double largest_energy = 0, largest_momentum = 0, most_turned = 0;
  for (int i = 0; i < 20000; ++i) {  // 60 s
    state = integrate(body, state, 0.003, [](const RigidBodyState&, double) { return kNothing; });
    largest_energy =
        std::max(largest_energy, std::abs(kinetic_energy_j(body, state) / kinetic_energy_j(body, start) - 1));
    largest_momentum =
        std::max(largest_momentum, (angular_momentum(body, state) - angular_momentum(body, start)).norm());
    most_turned = std::max(most_turned, (state.angular_velocity_rad_s - start.angular_velocity_rad_s).norm());
  }
  EXPECT_GT(most_turned, 6.0);  // it did tumble
  EXPECT_LT(largest_energy, 2e-8);
  EXPECT_LT(largest_momentum, 2e-8 * angular_momentum(body, start).norm());
  EXPECT_NEAR(state.R_local_body.norm(), 1.0, 1e-14);
}

TEST(RigidBody, SteadyTurningOfATopPrecessesAsInTheBooks) {
  // Symmetric body: the axis precesses about the angular momentum at |L| / J1 (Goldstein, Classical Mechanics, 5.6).
  const RigidBody top{1.0, Vec3(0.04, 0.04, 0.01).asDiagonal()};
  RigidBodyState start;
  start.angular_velocity_rad_s = {1.0, 0.0, 9.0};
  const Vec3 momentum = angular_momentum(top, start);
  const double seconds = 7.0;
  const RigidBodyState end = after(top, start, seconds, 2000, [](const RigidBodyState&, double) { return kNothing; });
  const Eigen::AngleAxisd precession(momentum.norm() / 0.04 * seconds, momentum.normalized());
  EXPECT_LT((end.R_local_body * Vec3::UnitZ() - precession * Vec3::UnitZ()).norm(), 1e-7);
}

TEST(RigidBody, FreeFallIsAParabola) {
  RigidBodyState start = tumbling();
  const RigidBody body = brick();
  const Vec3 weight(0, 0, -9.80665 * body.mass_kg);
  const RigidBodyState end = after(body, start, 3.0, 1000, [&](const RigidBodyState&, double) {
    return Wrench{weight, Vec3::Zero()};
  });
  EXPECT_LT((end.position_m - (3.0 * start.velocity_m_s + Vec3(0, 0, -4.5 * 9.80665))).norm(), 1e-10);
  EXPECT_LT((end.velocity_m_s - (start.velocity_m_s + Vec3(0, 0, -3 * 9.80665))).norm(), 1e-11);
}

TEST(RigidBody, ErrorsShrinkWithTheFourthPowerOfTheStep) {
  const RigidBody body = brick();
  const auto wrench = [](const RigidBodyState& s, double) {  // depends on place, speed, attitude and rate
    return Wrench{-3.0 * s.position_m - 0.2 * s.velocity_m_s + s.R_local_body * Vec3(0, 0, 1),
                  -0.02 * s.angular_velocity_rad_s + 0.1 * (s.R_local_body.conjugate() * Vec3::UnitZ())};
  };
  const auto end = [&](int steps) { return after(body, tumbling(), 2.0, steps, wrench); };
  const RigidBodyState exact = end(8000);
  const auto error = [&](int steps) {
    const RigidBodyState s = end(steps);
    return (s.position_m - exact.position_m).norm() + (s.angular_velocity_rad_s - exact.angular_velocity_rad_s).norm() +
           s.R_local_body.angularDistance(exact.R_local_body);
  };
  EXPECT_NEAR(std::log2(error(125) / error(250)), 4.0, 0.3);
  EXPECT_NEAR(std::log2(error(250) / error(500)), 4.0, 0.3);
}

TEST(RigidBody, YawAndHeading) {
  using std::numbers::pi;
  EXPECT_NEAR(heading_to_yaw_rad(0), pi / 2, 1e-15);
  EXPECT_NEAR(heading_to_yaw_rad(90), 0, 1e-15);
  EXPECT_NEAR(heading_to_yaw_rad(180), -pi / 2, 1e-15);
  EXPECT_NEAR(heading_to_yaw_rad(-90), pi, 1e-15);
  EXPECT_NEAR(yaw_rad(level_orientation(2.0) * Eigen::AngleAxisd(0.4, Vec3::UnitX())), 2.0, 1e-12);
  EXPECT_EQ(wrap_angle_rad(-pi), pi);
  EXPECT_NEAR(wrap_angle_rad(7.0), 7.0 - 2 * pi, 1e-15);
}

}  // namespace
}  // namespace tileflight::vehicle::rigid_body_test
