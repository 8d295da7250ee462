#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <mutex>
#include <thread>

#include "tests/refusal.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/live/autopilot/test_px4_client.h"
#include "tileflight/live/simulator/settings.h"
#include "tileflight/live/simulator/test_world.h"

/// Vehicles that a scripted autopilot flies in PX4's place.
namespace tileflight::simulator::px4_flight_test {
namespace {

using autopilot::HilActuatorControls;
using autopilot::test_support::frame_of;
using autopilot::test_support::Px4Ears;
using autopilot::test_support::ScriptedPx4;
using test_world::LoggedLines;
using test_world::world;
using testing::HasSubstr;

constexpr const char* kFast = R"({"StepOnDemand": true, "Vehicles": {"PX4": {"VehicleType": "PX4Multirotor",
  "UseSerial": false, "UseTcp": true, "TcpPort": 0, "LockStep": true}}})";

std::uint16_t port_of(const Simulator& simulator) {
  return static_cast<std::uint16_t>(simulator.autopilots().at(0).port);
}

HilActuatorControls controls(std::uint64_t time_us, float output) {
  HilActuatorControls message;
  message.time_us = time_us;
  message.mode = 129;
  message.controls.fill(output);
  return message;
}

TEST(Px4Flight, TakesOffFliesASquareAndLands) {
  const auto simulator = world(kFast);
  const auto points = autopilot::test_support::square(10.0, 4.0);
  ScriptedPx4 px4(port_of(*simulator), points);
  px4.fly(90.0);
  EXPECT_TRUE(px4.autopilot().landed());
  EXPECT_EQ(px4.autopilot().points_reached(), points.size());
  EXPECT_LT(px4.observation().position_m.norm(), 1.0);
  EXPECT_EQ(simulator->vehicles().get_multirotor_state("PX4").landed_state, 0);
}

TEST(Px4Flight, SamePacketsSameBytes) {
  const auto once = [] {
    const auto simulator = world(kFast);
    ScriptedPx4 px4(port_of(*simulator), {{0, 0, -3}, {4, 0, -3}});
    px4.fly(10.0);
    return px4.ears().heard();
  };
  const std::string first = once();
  EXPECT_GT(first.size(), 250'000U);
  EXPECT_TRUE(first == once());
}

/// At rest on level ground: gravity, the Earth's field, the pressure and the place, each with its sensor's noise.
TEST(Px4Flight, SensorsAreThoseOfTheVehicle) {
  const auto simulator = world(kFast);
  Px4Ears ears(port_of(*simulator));
  geometry::Vec3 force = geometry::Vec3::Zero(), field = geometry::Vec3::Zero();
  constexpr int kRounds = 500;
  float first_force = 0.0F;
  bool noisy = false;
  for (int i = 0; i < kRounds; ++i) {
    ASSERT_TRUE(ears.hear());
    EXPECT_EQ(ears.sensor.time_us, 1'000'000U + 4000U * static_cast<unsigned>(i));
    EXPECT_EQ((ears.sensor.updated & 0x3FU), 0x3FU);
    EXPECT_EQ((ears.sensor.updated & 0x1C0U) != 0, i % 5 == 0);
    const auto& a = ears.sensor.accelerometer_m_s2;
    const auto& m = ears.sensor.magnetometer_gauss;
    if (i == 0) first_force = a[2];
    noisy = noisy || a[2] != first_force;
    force += geometry::Vec3(a[0], a[1], a[2]) / kRounds;
    field += geometry::Vec3(m[0], m[1], m[2]) / kRounds;
    ears.client().send(frame_of(controls(ears.sensor.time_us, 0.0F), 0));
  }
  EXPECT_TRUE(noisy);
  EXPECT_LT((force - geometry::Vec3(0, 0, -9.80665)).norm(), 0.1);
  EXPECT_NEAR(field.norm(), 0.5, 0.25);
  ASSERT_TRUE(ears.gps.has_value());
  const GeoPoint home = simulator->vehicles().get_home_geo_point("PX4");
  EXPECT_NEAR(1e-7 * ears.gps->latitude_e7_deg, home.latitude, 1e-5);
  EXPECT_NEAR(1e-7 * ears.gps->longitude_e7_deg, home.longitude, 1e-5);
  EXPECT_NEAR(1e-3 * ears.gps->altitude_mm, home.altitude, 1.0);
  EXPECT_NEAR(1e-7 * ears.state.latitude_e7_deg, home.latitude, 2e-7);
  EXPECT_NEAR(0.01 * ears.state.acceleration_mg[2] / 10.0, -1.0, 0.01);
}

/// The wall is 20 m north of the start; sensors look down, north, and north but up by 30 degrees.
TEST(Px4Flight, DistanceSensorsLookWhereTheirSettingsSay) {
  const auto simulator =
      world(R"({"StepOnDemand": true, "Vehicles": {"PX4": {"VehicleType": "PX4Multirotor", "TcpPort": 0,
    "Sensors": {"A": {"SensorType": 5, "Enabled": true, "Pitch": -90, "MinDistance": 0.1, "NoiseSigma": 0},
                "B": {"SensorType": 5, "Enabled": true, "MaxDistance": 30, "NoiseSigma": 0},
                "C": {"SensorType": 5, "Enabled": true, "Pitch": 30, "MaxDistance": 30, "NoiseSigma": 0}}}}})");
  Px4Ears ears(port_of(*simulator));
  ASSERT_TRUE(ears.hear());
  ASSERT_EQ(ears.distances.size(), 3U);
  EXPECT_EQ(ears.distances[0].orientation, autopilot::kDown);
  EXPECT_NEAR(ears.distances[0].distance_cm, 20, 2);  // it stands 0.2 m high
  EXPECT_EQ(ears.distances[0].min_cm, 10);
  EXPECT_EQ(ears.distances[1].orientation, autopilot::kForward);
  EXPECT_NEAR(ears.distances[1].distance_cm, 2000, 2);
  EXPECT_EQ(ears.distances[2].orientation, autopilot::kByQuaternion);
  EXPECT_NEAR(ears.distances[2].distance_cm, 2000 / std::cos(std::acos(-1.0) / 6.0), 3);
  EXPECT_NEAR(ears.distances[2].attitude_wxyz[2], std::sin(std::acos(-1.0) / 12.0), 1e-6);  // nose up about right
}

/// The flow, without what turning makes, is velocity by distance.
TEST(Px4Flight, OpticalFlowAndOdometryAreThoseOfTheFlight) {
  const auto simulator =
      world(R"({"StepOnDemand": true, "Vehicles": {"PX4": {"VehicleType": "PX4Multirotor", "TcpPort": 0,
    "OpticalFlow": true, "VisionOdometry": "TruthWithNoise"}}})");
  ScriptedPx4 px4(port_of(*simulator), {{0, 0, -5}, {6, 3, -5}});
  double error_m_s = 0.0, fastest_m_s = 0.0, turned_rad = 0.0, position_error_m = 0.0, velocity_error_m_s = 0.0,
         rotation_error_rad = 0.0;
  std::size_t flows = 0, odometries = 0;
  while (!px4.autopilot().landed() && px4.time_s() < 60.0 && px4.round()) {
    if (px4.ears().flows.size() > flows) {
      const autopilot::HilOpticalFlow& flow = px4.ears().flows[flows++];
      ASSERT_EQ(flow.integration_us, 40'000U);
      ASSERT_EQ(flow.quality, 255);
      const Eigen::Vector2d seen_m_s =
          flow.distance_m / 0.04 *
          Eigen::Vector2d(flow.flow_rad[1] - flow.gyro_rad[1], -(flow.flow_rad[0] - flow.gyro_rad[0]));
      const auto now = px4.observation();
      const Eigen::Vector2d true_m_s = (now.R_ned_body.conjugate() * now.velocity_m_s).head<2>();
      error_m_s += (seen_m_s - true_m_s).squaredNorm() / 2.0;
      fastest_m_s = std::max(fastest_m_s, true_m_s.norm());
      turned_rad = std::max(turned_rad, std::abs(static_cast<double>(flow.gyro_rad[1])));
    }
    if (px4.ears().odometries.size() > odometries) {
      const autopilot::Odometry& seen = px4.ears().odometries[odometries++];
      const auto truth = px4.observation();
      const auto v = [](const auto& a) { return geometry::Vec3(a[0], a[1], a[2]); };
      const Eigen::Quaterniond q(seen.attitude_wxyz[0], seen.attitude_wxyz[1], seen.attitude_wxyz[2],
                                 seen.attitude_wxyz[3]);
      position_error_m += (v(seen.position_m) - truth.position_m).squaredNorm() / 3.0;
      velocity_error_m_s += (q * v(seen.velocity_m_s) - truth.velocity_m_s).squaredNorm() / 3.0;
      rotation_error_rad += std::pow(q.angularDistance(truth.R_ned_body), 2) / 3.0;
    }
  }
  ASSERT_TRUE(px4.autopilot().landed());
  ASSERT_GT(flows, 400U);
  ASSERT_GT(odometries, 500U);
  EXPECT_GT(turned_rad, 0.002);
  EXPECT_GT(fastest_m_s, 2.0);
  EXPECT_LT(std::sqrt(error_m_s / static_cast<double>(flows)), 0.12);  // of 0.02 rad/s at up to 5 m
  const auto rms = [&](double sum) { return std::sqrt(sum / static_cast<double>(odometries)); };
  EXPECT_NEAR(rms(position_error_m), 0.05, 0.01);
  EXPECT_NEAR(rms(velocity_error_m_s), 0.05, 0.02);
  EXPECT_NEAR(rms(rotation_error_rad), 0.01, 0.002);
  EXPECT_FLOAT_EQ(px4.ears().odometries.back().pose_covariance[0], 0.0025F);
}

TEST(Px4Flight, HostileBytesAreOneLineEachAndTheSimulatorLives) {
  LoggedLines lines;
  const auto simulator = world(kFast, &lines);
  Px4Ears ears(port_of(*simulator));
  for (int i = 0; i < 50; ++i) {
    ASSERT_TRUE(ears.hear());
    const std::uint64_t now_us = ears.sensor.time_us;
    std::string wrong = frame_of(controls(now_us, 0.9F), 0);
    wrong[15] = static_cast<char>(wrong[15] ^ 0x55);
    ears.client().send("GET / HTTP/1.1\r\n\r\n" + wrong);
    if (i > 0) {
      ears.client().send(frame_of(controls(now_us - 4000 * 2, 0.9F), 0));  // stale, from the third on
      ears.client().send(frame_of(controls(now_us + 900'000, 0.9F), 0));   // future
    }
    ears.client().send(frame_of(controls(now_us, NAN), 0));
  }
  ASSERT_TRUE(ears.hear());
  EXPECT_NEAR(1e-3 * ears.state.altitude_mm, simulator->vehicles().get_home_geo_point("PX4").altitude,
              0.01);  // has not moved
  for (const char* what : {"damaged", "stamped before", "stamped after", "not a number"})
    EXPECT_THAT(lines.count(what), testing::AllOf(testing::Ge(1U), testing::Le(3U))) << what;
}

TEST(Px4Flight, AnAutopilotThatDiesLeavesItsVehicleAndTheNextFindsItAtTheStart) {
  LoggedLines lines;
  const auto simulator = world(kFast, &lines);
  {
    ScriptedPx4 first(port_of(*simulator), {{0, 0, -10}});
    while (first.time_s() < 5.0) ASSERT_TRUE(first.round());
    EXPECT_LT(first.observation().position_m.z(), -2.0);
  }
  ScriptedPx4 second(port_of(*simulator), {{0, 0, -3}});
  ASSERT_TRUE(second.round());
  EXPECT_EQ(second.ears().sensor.time_us, 1'000'000U);
  EXPECT_EQ(lines.count("connection has ended"), 1U);
  second.fly(60.0);
  EXPECT_TRUE(second.autopilot().landed());
  EXPECT_EQ(simulator->vehicles().get_multirotor_state("PX4").landed_state, 0);
}

TEST(Px4Flight, WithoutAnAnswerThereIsNoStep) {
  const auto simulator = world(kFast);
  Px4Ears ears(port_of(*simulator));
  const auto answer = [&] { ears.client().send(frame_of(controls(ears.sensor.time_us, 0.0F), 0)); };
  for (int i = 0; i < 10; ++i) {
    ASSERT_TRUE(ears.hear());
    if (i < 9) answer();
  }
  const std::uint64_t asked_us = ears.sensor.time_us;
  ears.client().send(frame_of(controls(asked_us - 4000, 0.0F), 0));  // the last answer again
  const double before_s = simulator->statistics().sim_seconds;
  std::this_thread::sleep_for(std::chrono::milliseconds(100));
  EXPECT_EQ(simulator->statistics().sim_seconds, before_s);
  answer();
  ASSERT_TRUE(ears.hear());
  EXPECT_EQ(ears.sensor.time_us, asked_us + 4000);
}

/// PX4 sends outputs every 50 ms only while its rate controller is off; both sides would wait for ever.
TEST(Px4Flight, AfterAMissedAnswerTimeGoesByTheWallClockUntilItKeepsInStep) {
  LoggedLines lines;
  const auto simulator = world(kFast, &lines);
  Px4Ears ears(port_of(*simulator));
  const auto answer = [&] { ears.client().send(frame_of(controls(ears.sensor.time_us, 0.0F), 0)); };
  for (int i = 0; i < 10; ++i) {
    ASSERT_TRUE(ears.hear());
    if (i < 9) answer();
  }
  for (int i = 0; i < 36; ++i) {
    ASSERT_TRUE(ears.hear()) << i;
    if (i % 12 == 0) answer();
  }
  EXPECT_EQ(lines.count("time goes by the wall clock"), 1U);
  for (int i = 0; i < 50; ++i) {  // answers to older sensors are on the way still
    answer();
    ASSERT_TRUE(ears.hear());
  }
  std::this_thread::sleep_for(std::chrono::milliseconds(20));
  while (simulator->statistics().sim_seconds + 1.0 > 1e-6 * static_cast<double>(ears.sensor.time_us) + 0.0035)
    ASSERT_TRUE(ears.hear());  // up to the sensors that are waited for
  const double before_s = simulator->statistics().sim_seconds;
  std::this_thread::sleep_for(std::chrono::milliseconds(100));
  EXPECT_EQ(simulator->statistics().sim_seconds, before_s);
}

TEST(Px4Flight, WithoutLockstepTimeGoesOn) {
  const auto simulator = world(R"({"ClockSpeed": 4, "Vehicles": {"PX4": {"VehicleType": "PX4Multirotor",
    "TcpPort": 0, "LockStep": false}}})");
  Px4Ears ears(port_of(*simulator));
  ASSERT_TRUE(ears.hear());
  ears.client().send(frame_of(controls(ears.sensor.time_us, 1.0F), 0));
  while (ears.sensor.time_us < 2'000'000) ASSERT_TRUE(ears.hear());
  EXPECT_GT(1e-3 * ears.state.altitude_mm,
            simulator->vehicles().get_home_geo_point("PX4").altitude + 1.0);  // full thrust
}

TEST(Px4Flight, BeforeItsFirstOutputsTimeGoesOnForPx4ToStart) {
  const auto simulator = world(R"({"ClockSpeed": 4, "Vehicles": {"PX4": {"VehicleType": "PX4Multirotor",
    "TcpPort": 0}}})");
  Px4Ears ears(port_of(*simulator));
  for (int i = 0; i < 20; ++i) ASSERT_TRUE(ears.hear());
  EXPECT_EQ(ears.sensor.time_us, 1'000'000U + 19U * 4000U);
}

TEST(Px4Flight, SettingsAreThoseOfAirSim) {
  const Settings settings = read_settings(R"({"Vehicles": {"PX4": {"VehicleType": "PX4Multirotor", "UseSerial": false,
    "UseTcp": true, "TcpPort": 4561, "LockStep": false, "ControlIp": "127.0.0.1", "ControlPortLocal": 14540,
    "ControlPortRemote": 14580, "LocalHostIp": "127.0.0.1", "QgcHostIp": "", "Model": "Hexacopter"}}})",
                                          "s");
  EXPECT_THAT(settings.warnings, testing::IsEmpty());
  const auto& px4 = settings.vehicles.at(0).autopilot;
  ASSERT_TRUE(px4.has_value());
  EXPECT_EQ(px4->kind, AutopilotKind::kPx4);
  EXPECT_EQ(px4->port, 4561);
  EXPECT_FALSE(px4->lockstep);
  EXPECT_EQ(px4->airframe, vehicle::AirframeKind::kHexaX);
  EXPECT_EQ(px4->thrust_expo, 0.0);
  const auto refusal_with = [](const std::string& key, const std::string& value) {
    return tests::refusal_of([&] {
      read_settings(R"({"Vehicles": {"PX4": {"VehicleType": "PX4Multirotor", ")" + key + R"(": )" + value + "}}}", "s");
    });
  };
  EXPECT_THAT(refusal_with("UseSerial", "true"), testing::HasSubstr("PX4 is served over TCP; set it to false"));
  EXPECT_THAT(refusal_with("UseTcp", "false"), testing::HasSubstr("PX4 is served over TCP; set it to true"));
  EXPECT_THAT(refusal_with("TcpPort", "-1"), testing::HasSubstr("TcpPort"));
  EXPECT_THAT(refusal_with("Model", R"("Tricopter")"), testing::HasSubstr("Model"));
}

}  // namespace
}  // namespace tileflight::simulator::px4_flight_test
