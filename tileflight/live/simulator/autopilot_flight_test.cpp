#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <mutex>
#include <thread>

#include "tests/refusal.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/live/autopilot/test_ardupilot_client.h"
#include "tileflight/live/simulator/settings.h"
#include "tileflight/live/simulator/test_world.h"

/// Vehicles that a scripted autopilot flies over a real UDP port.
namespace tileflight::simulator::autopilot_flight_test {
namespace {

using autopilot::test_support::Observation;
using autopilot::test_support::ScriptedAutopilot;
using autopilot::test_support::UdpClient;
using geometry::Vec3;
using test_world::LoggedLines;
using test_world::world;
using testing::HasSubstr;

constexpr const char* kCopter = R"({"Vehicles": {"Copter": {"VehicleType": "ArduCopter", "ControlPort": 0}}})";
constexpr int kRate = 400;

/// An autopilot at the port of one of the simulator's vehicles.
class Copter {
 public:
  Copter(const Simulator& simulator, std::vector<Vec3> points, std::size_t vehicle = 0,
         vehicle::AirframeKind kind = vehicle::AirframeKind::kQuadX)
      : client_(static_cast<std::uint16_t>(simulator.autopilots().at(vehicle).port)),
        autopilot_(vehicle::make_airframe(kind), std::move(points), 0.65) {}

  /// Makes one frame; the line that came back, empty if none did.
  std::string frame(int rate = kRate) {
    const auto pwm = autopilot::test_support::pulses(autopilot_.outputs(seen_, 1.0 / rate));
    const std::string line =
        client_.ask(autopilot::test_support::servo_datagram(static_cast<std::uint16_t>(rate), count_++, pwm));
    if (!line.empty()) seen_ = autopilot::test_support::parse_state(line);
    return line;
  }
  /// Flies until it has landed or the time is over, returns all that the simulator sent.
  std::string fly(double limit_s) {
    std::string bytes;
    while (!autopilot_.landed() && seen_.time_s < limit_s) {
      const std::string line = frame();
      if (line.empty()) break;
      bytes += line;
    }
    return bytes;
  }
  const UdpClient& client() const { return client_; }
  const Observation& seen() const { return seen_; }
  const ScriptedAutopilot& autopilot() const { return autopilot_; }
  std::uint32_t count() const { return count_; }

 private:
  UdpClient client_;
  ScriptedAutopilot autopilot_;
  Observation seen_;
  std::uint32_t count_ = 0;
};

TEST(AutopilotFlight, TakesOffFliesASquareAndLands) {
  const auto simulator = world(kCopter);
  const auto points = autopilot::test_support::square(10.0, 4.0);
  Copter copter(*simulator, points);
  copter.fly(90.0);
  EXPECT_TRUE(copter.autopilot().landed());
  EXPECT_EQ(copter.autopilot().points_reached(), points.size());
  EXPECT_LT(copter.seen().position_m.norm(), 0.8);
  const MultirotorState state = simulator->vehicles().get_multirotor_state("Copter");
  EXPECT_EQ(state.landed_state, 0);
  EXPECT_NEAR(state.kinematics_estimated.position.z_val, -0.2, 0.05);  // its feet on the ground
}

TEST(AutopilotFlight, SamePacketsSameBytes) {
  const auto once = [] {
    const auto simulator = world(R"({"Wind": {"X": 2, "Y": 3, "Z": 0}, "Vehicles": {"Copter": {
      "VehicleType": "ArduCopter", "ControlPort": 0, "Model": "Hexacopter"}}})");
    return Copter(*simulator, {{0, 0, -3}, {5, 0, -3}}, 0, vehicle::AirframeKind::kHexaX).fly(15.0);
  };
  const std::string first = once();
  EXPECT_GT(first.size(), 1'000'000U);
  EXPECT_TRUE(first == once());
}

TEST(AutopilotFlight, CamerasAndLidarAreServedWhileItFlies) {
  const auto simulator = world(R"({"Vehicles": {"Copter": {"VehicleType": "ArduCopter", "ControlPort": 0,
    "Sensors": {"Down": {"SensorType": 5, "Enabled": true, "Pitch": -90, "MaxDistance": 50},
                "Lidar": {"SensorType": 6, "Enabled": true}}}}})");
  Copter copter(*simulator, {{0, 0, -30}});
  std::string line;
  while (copter.seen().time_s < 8.0) line = copter.frame();
  const auto images = simulator->cameras().get_images({{"bottom_center", 2, true, false}}, "Copter", false);
  ASSERT_EQ(images.size(), 1U);
  const auto& depth = images[0].image_data_float;
  ASSERT_FALSE(depth.empty());
  const double height_m = -copter.seen().position_m.z();
  EXPECT_GT(height_m, 6.0);
  EXPECT_NEAR(depth[depth.size() / 2 + 128], height_m, 0.3);
  EXPECT_FALSE(simulator->sensors().get_lidar_data("Lidar", "Copter").point_cloud.empty());
  EXPECT_NEAR(nlohmann::json::parse(line).at("rng_1").get<double>(), height_m + 0.2, 0.02);
  // The clock of all else follows in steps of 3 ms.
  EXPECT_NEAR(simulator->statistics().sim_seconds, copter.seen().time_s, 0.0035);
}

/// Ground that rises by a quarter towards the east (14 degrees).
TEST(AutopilotFlight, ArmsOnASlopeTakesOffAndLandsOnIt) {
  imaging::TexturedMesh slope = test_world::meshes().front();
  for (Vec3& vertex : slope.mesh.vertices) vertex.z() += 0.25 * vertex.x();
  SimulatorOptions options;
  options.settings = kCopter;
  const Simulator simulator(options, {slope});
  const auto tilt_deg = [](const Observation& seen) {
    return std::acos((seen.R_ned_body * Vec3::UnitZ()).z()) * 180.0 / std::acos(-1.0);
  };
  Copter copter(simulator, {{0, 0, -4}, {3, 3, -4}, {0, 0, -4}});
  while (copter.seen().time_s < 0.9) {
    copter.frame();
    ASSERT_LT(copter.seen().position_m.norm(), 1e-4);
    ASSERT_LT(copter.seen().gyro_rad_s.norm(), 1e-3);
    ASSERT_NEAR(tilt_deg(copter.seen()), 14.04, 0.5);
  }
  copter.fly(60.0);
  EXPECT_TRUE(copter.autopilot().landed());
  for (int i = 0; i < 2 * kRate; ++i) copter.frame();  // its motors off
  EXPECT_NEAR(tilt_deg(copter.seen()), 14.04, 0.5);
  EXPECT_LT(copter.seen().velocity_m_s.norm(), 1e-3);
}

TEST(AutopilotFlight, AgainTheSameFrameGivesTheSameAnswerAndNoStep) {
  const auto simulator = world(kCopter);
  const UdpClient client(static_cast<std::uint16_t>(simulator->autopilots().at(0).port));
  client.ask(autopilot::test_support::servo_datagram(400, 0, {}));
  const std::string first = client.ask(autopilot::test_support::servo_datagram(400, 1, {}));
  EXPECT_EQ(client.ask(autopilot::test_support::servo_datagram(400, 1, {})), first);
  const std::string next = client.ask(autopilot::test_support::servo_datagram(400, 2, {}));
  EXPECT_NEAR(autopilot::test_support::parse_state(next).time_s - autopilot::test_support::parse_state(first).time_s,
              0.0025, 1e-12);
}

TEST(AutopilotFlight, ARestartedAutopilotFindsItsVehicleAtTheStart) {
  LoggedLines lines;
  const auto simulator = world(kCopter, &lines);
  {
    Copter first(*simulator, {{0, 0, -5}, {20, 0, -5}});
    while (first.seen().time_s < 6.0) first.frame();
    EXPECT_LT(first.seen().position_m.z(), -2.0);
  }
  Copter second(*simulator, {{0, 0, -3}});
  second.frame();
  EXPECT_LT(second.seen().position_m.norm(), 1e-4);
  EXPECT_NEAR(second.seen().time_s, 0.0025, 1e-12);
  second.fly(60.0);
  EXPECT_TRUE(second.autopilot().landed());
}

TEST(AutopilotFlight, ChangedRatesChangeTheStep) {
  const auto simulator = world(kCopter);
  Copter copter(*simulator, {{0, 0, -3}});
  copter.frame(400);
  const double before_s = copter.seen().time_s;
  copter.frame(1000);
  EXPECT_NEAR(copter.seen().time_s - before_s, 0.001, 1e-12);
  while (copter.seen().time_s < 5.0) copter.frame(250);
  EXPECT_LT(copter.seen().position_m.z(), -1.0);
}

TEST(AutopilotFlight, APauseHoldsTheAnswerBack) {
  const auto simulator = world(kCopter);
  const UdpClient client(static_cast<std::uint16_t>(simulator->autopilots().at(0).port));
  client.ask(autopilot::test_support::servo_datagram(100, 0, {}));
  simulator->clock().pause(true);
  const UdpClient hasty(static_cast<std::uint16_t>(simulator->autopilots().at(0).port), 0.3);
  client.send(autopilot::test_support::servo_datagram(100, 1, {}));
  EXPECT_EQ(hasty.receive(), "");
  simulator->clock().pause(false);
  EXPECT_NEAR(autopilot::test_support::parse_state(client.receive()).time_s, 0.02, 1e-12);
}

TEST(AutopilotFlight, HostileDatagramsAreOneLineEachAndTheSimulatorLives) {
  LoggedLines lines;
  const auto simulator = world(kCopter, &lines);
  Copter copter(*simulator, {{0, 0, -3}});
  copter.frame();
  const std::string good = autopilot::test_support::servo_datagram(400, 1, {});
  for (int i = 0; i < 1000; ++i) {
    copter.client().send(std::string(static_cast<std::size_t>(i), 'x'));
    copter.client().send(good.substr(0, static_cast<std::size_t>(i) % good.size()));
    if (i % 20 == 0) copter.frame();  // so that the port's buffer does not overflow
  }
  EXPECT_LT(copter.seen().position_m.norm(), 0.01);
  copter.fly(60.0);
  EXPECT_TRUE(copter.autopilot().landed());
  EXPECT_GE(lines.count("servo packet"), 1U);
  EXPECT_LE(lines.count("servo packet"), 4U);
}

TEST(AutopilotFlight, TwoAutopilotsKeepInStepUntilOneDies) {
  LoggedLines lines;
  const auto simulator = world(R"({"Vehicles": {
    "A": {"VehicleType": "ArduCopter", "ControlPort": 0, "Y": -5},
    "B": {"VehicleType": "ArduCopter", "ControlPort": 0, "Y": 5}}})",
                               &lines);
  Copter a(*simulator, {{0, 0, -3}}), b(*simulator, {{0, 0, -4}}, 1);
  a.frame();
  b.frame(250);
  std::atomic<bool> done{false};
  std::atomic<double> b_s{b.seen().time_s};
  std::thread other([&] {
    while (b.seen().time_s < 3.0) {
      b.frame(250);
      b_s = b.seen().time_s;
    }
    done = true;
  });
  while (!done) {
    EXPECT_FALSE(a.frame().empty());
    EXPECT_LT(std::abs(a.seen().time_s - b_s), 0.02);
  }
  other.join();
  // Now A flies on alone, once B has been silent for long enough.
  const double before_s = a.seen().time_s;
  while (a.seen().time_s < before_s + 1.0) ASSERT_FALSE(a.frame().empty());
  EXPECT_EQ(lines.count("'B': ArduPilot is silent"), 1U);
}

TEST(AutopilotFlight, ClientsCommandsAreRefusedInWords) {
  const auto simulator = world(kCopter);
  simulator->vehicles().enable_api_control(true, "Copter");
  simulator->vehicles().arm_disarm(true, "Copter");
  try {
    simulator->flight().takeoff(1.0F, "Copter");
    FAIL() << "not refused";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("flown by its autopilot"));
  }
}

TEST(AutopilotFlight, AVehicleThatIsPlacedFliesOnFromThere) {
  const auto simulator = world(kCopter);
  Copter copter(*simulator, {{0, 0, -3}});
  copter.frame();
  simulator->vehicles().set_vehicle_pose(test_world::pose(5, 0, -10), true, "Copter");
  copter.frame();
  EXPECT_NEAR(copter.seen().position_m.x(), 5.0, 0.01);
  for (int i = 0; i < 200; ++i) copter.frame();
  EXPECT_GT(copter.seen().velocity_m_s.z(), 3.0);  // its motors are off: it falls
}

TEST(AutopilotFlight, APortThatIsTakenEndsTheStart) {
  const auto first = world(kCopter);
  const std::string taken = std::to_string(first->autopilots().at(0).port);
  try {
    world(R"({"Vehicles": {"Copter": {"VehicleType": "ArduCopter", "ControlPort": )" + taken + "}}}");
    FAIL() << "not refused";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("choose another ControlPort"));
  }
}

TEST(AutopilotFlight, SettingsAreThoseOfAirSim) {
  const Settings settings = read_settings(R"({"Vehicles": {"Copter": {"VehicleType": "ArduCopter", "UseSerial": false,
    "LocalHostIp": "127.0.0.1", "UdpIp": "127.0.0.1", "UdpPort": 9003, "ControlPort": 9012}}})",
                                          "settings.json");
  EXPECT_THAT(settings.warnings, testing::IsEmpty());
  ASSERT_TRUE(settings.vehicles.at(0).autopilot.has_value());
  EXPECT_EQ(settings.vehicles[0].autopilot->port, 9012);
  EXPECT_EQ(settings.vehicles[0].autopilot->airframe, vehicle::AirframeKind::kQuadX);
  EXPECT_TRUE(settings.clock.by_autopilots);
  const auto refusal_of = [](const std::string& text) { return tests::refusal_of([&] { read_settings(text, "s"); }); };
  EXPECT_THAT(refusal_of(R"({"SimMode": "ComputerVision", "Vehicles": {"C": {"VehicleType": "ArduCopter"}}})"),
              HasSubstr("an autopilot flies in the mode Multirotor"));
  EXPECT_THAT(refusal_of(R"({"Vehicles": {"C": {"VehicleType": "ArduCopter", "ControlPort": 70000}}})"),
              HasSubstr("ControlPort' is 70000, out of range: from 0 to 65535"));
}

}  // namespace
}  // namespace tileflight::simulator::autopilot_flight_test
