#include "tileflight/capture/vehicle/rotor_mixer.h"

#include <gtest/gtest.h>

namespace tileflight::vehicle::rotor_mixer_test {
namespace {

using geometry::Vec3;

const QuadrotorOptions kQuad;
const double kWeight = kQuad.body.mass_kg * kStandardGravity_m_s2;

/// The thrust and torque that the rotors deliver.
RotorDemand after_mixing(const RotorDemand& demand) {
  const RotorMixer mixer(kQuad);
  const RotorSpeeds speeds = mixer.speeds_rad_s(demand);
  EXPECT_GE(speeds.minCoeff(), 0.0);
  EXPECT_LE(speeds.maxCoeff(), kQuad.max_rotor_speed_rad_s * (1 + 1e-12));
  const Wrench wrench = quadrotor_wrench(kQuad, {}, speeds, Vec3::Zero());  // at rest: no drag
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
