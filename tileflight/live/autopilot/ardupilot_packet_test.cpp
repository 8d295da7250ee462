#include "tileflight/live/autopilot/ardupilot_packet.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <nlohmann/json.hpp>
#include <numbers>

#include "tests/refusal.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/live/autopilot/limited_log.h"
#include "tileflight/live/autopilot/lockstep.h"
#include "tileflight/live/autopilot/ports.h"
#include "tileflight/live/autopilot/test_ardupilot_client.h"

namespace tileflight::autopilot::ardupilot_packet_test {
namespace {

using geometry::Vec3;
using test_support::servo_datagram;
using testing::ElementsAre;
using testing::HasSubstr;

std::string why_refused(const std::string& datagram) {
  try {
    read_servo_packet(datagram);
  } catch (const InputError& error) {
    return error.what();
  }
  return "not refused";
}

TEST(ArduPilotPacket, ReadsBytesThatWereWrittenByHand) {
  // 18458 = 0x481A, 400 = 0x0190, 0x01020304, 1100 = 0x044C, then 15 times 2000 = 0x07D0.
  std::string bytes("\x1A\x48\x90\x01\x04\x03\x02\x01\x4C\x04", 10);
  for (int i = 0; i < 15; ++i) bytes += "\xD0\x07";
  const ServoPacket packet = read_servo_packet(bytes);
  EXPECT_EQ(packet.frame_rate, 400);
  EXPECT_EQ(packet.frame_count, 0x01020304U);
  EXPECT_EQ(packet.channels, 16);
  EXPECT_EQ(packet.pwm[0], 1100);
  EXPECT_EQ(packet.pwm[15], 2000);
  EXPECT_EQ(packet.pwm[16], 0);
}

TEST(ArduPilotPacket, ReadsThirtyTwoChannels) {
  const ServoPacket packet = read_servo_packet(servo_datagram(1200, 7, std::vector<std::uint16_t>(32, 1500), 32));
  EXPECT_EQ(packet.channels, 32);
  EXPECT_EQ(packet.pwm[31], 1500);
}

TEST(ArduPilotPacket, RefusesWhatIsNoServoPacket) {
  const std::string good = servo_datagram(400, 1, {1000});
  EXPECT_THAT(why_refused(""), HasSubstr("too short"));
  EXPECT_THAT(why_refused(good.substr(0, 7)), HasSubstr("too short"));
  EXPECT_THAT(why_refused(good.substr(0, 39)), HasSubstr("39 bytes instead of 40"));
  EXPECT_THAT(why_refused(good + "x"), HasSubstr("41 bytes instead of 40"));
  EXPECT_THAT(why_refused("{\"timestamp\":1}"), HasSubstr("no servo packet"));
  EXPECT_THAT(why_refused(servo_datagram(0, 1, {})), HasSubstr("0 steps a second"));
  EXPECT_THAT(why_refused(servo_datagram(9, 1, {})), HasSubstr("SIM_RATE_HZ"));
}

TEST(ArduPilotPacket, PulsesAreOutputs) {
  EXPECT_DOUBLE_EQ(servo_output(1000), 0.0);
  EXPECT_DOUBLE_EQ(servo_output(1500), 0.5);
  EXPECT_DOUBLE_EQ(servo_output(2000), 1.0);
  EXPECT_DOUBLE_EQ(servo_output(0), 0.0);  // no pulse
  EXPECT_DOUBLE_EQ(servo_output(65535), 1.0);
}

ArduPilotState example() {
  ArduPilotState state;
  state.time_s = 12.0025;
  state.gyro_rad_s = {0.1, -0.2, 1e-7};
  state.accelerometer_m_s2 = {0.5, 0.25, -9.80665};
  state.position_m = {1.0 / 3.0, -2000.125, -3.5};
  state.R_ned_body = Eigen::Quaterniond(0.5, -0.5, 0.5, -0.5);
  state.velocity_m_s = {4, 5, 6};
  state.ranges_m = {1.5, 2.5};
  state.wind_vane = {0.25, 3.0};
  state.wind_m_s = {7, 8, 9};
  state.airspeed_m_s = 2.25;
  return state;
}

TEST(ArduPilotPacket, StateIsOneLineOfJson) {
  const std::string line = state_line(example());
  ASSERT_EQ(line.front(), '\n');
  ASSERT_EQ(line.find('\n', 1), line.size() - 1);
  const auto json = nlohmann::json::parse(line);
  EXPECT_EQ(json.at("timestamp"), 12.0025);
  EXPECT_THAT(json.at("imu").at("gyro"), ElementsAre(0.1, -0.2, 1e-7));
  EXPECT_THAT(json.at("imu").at("accel_body"), ElementsAre(0.5, 0.25, -9.80665));
  EXPECT_THAT(json.at("position"), ElementsAre(1.0 / 3.0, -2000.125, -3.5));
  EXPECT_THAT(json.at("quaternion"), ElementsAre(0.5, -0.5, 0.5, -0.5));
  EXPECT_THAT(json.at("velocity"), ElementsAre(4, 5, 6));
  EXPECT_EQ(json.at("rng_2"), 2.5);
  EXPECT_FALSE(json.contains("rng_3"));
  EXPECT_EQ(json.at("windvane").at("speed"), 3.0);
  EXPECT_THAT(json.at("velocity_wind"), ElementsAre(7, 8, 9));
  EXPECT_EQ(json.at("airspeed"), 2.25);
}

/// ArduPilot has no JSON parser: it looks for the first place of the key's text and reads what comes two characters
/// behind (quote and colon), with strtod and with scanf's "[%f, %f, %f]".
TEST(ArduPilotPacket, StateIsReadByAnAutopilotThatSearchesForKeys) {
  const std::string line = state_line(example());
  const auto value_of = [&](const char* section, const char* key) {
    const char* at = std::strstr(line.c_str() + 1, section);
    at = std::strstr(at + std::strlen(section) + 1, key);
    return at + std::strlen(key) + 2;
  };
  double x = 0, y = 0, z = 0;
  ASSERT_EQ(std::sscanf(value_of("", "velocity"), "[%lf, %lf, %lf]", &x, &y, &z), 3);
  EXPECT_EQ(Vec3(x, y, z), Vec3(4, 5, 6));
  ASSERT_EQ(std::sscanf(value_of("imu", "accel_body"), "[%lf, %lf, %lf]", &x, &y, &z), 3);
  EXPECT_EQ(Vec3(x, y, z), Vec3(0.5, 0.25, -9.80665));
  ASSERT_EQ(std::sscanf(value_of("", "position"), "[%lf, %lf, %lf]", &x, &y, &z), 3);
  EXPECT_EQ(y, -2000.125);
  EXPECT_EQ(std::atof(value_of("windvane", "speed")), 3.0);
  EXPECT_EQ(std::atof(value_of("", "airspeed")), 2.25);
  EXPECT_EQ(std::atof(value_of("", "timestamp")), 12.0025);
}

TEST(ArduPilotPacket, WindVanePointsToWhereTheWindComesFrom) {
  EXPECT_NEAR(wind_vane(Vec3(-5, 0, 0)).direction_rad, 0.0, 1e-12);                        // head wind
  EXPECT_NEAR(wind_vane(Vec3(0, -5, 0)).direction_rad, std::numbers::pi / 2, 1e-12);       // from the right
  EXPECT_NEAR(std::abs(wind_vane(Vec3(5, 0, 1)).direction_rad), std::numbers::pi, 1e-12);  // from behind
  EXPECT_NEAR(wind_vane(Vec3(-3, -4, 7)).speed_m_s, 5.0, 1e-12);
}

TEST(FrameLockstep, OneStepForEachFrame) {
  FrameLockstep lockstep;
  EXPECT_TRUE(lockstep.receive(0, 400).restarted);
  const FrameRequest next = lockstep.receive(1, 400);
  EXPECT_FALSE(next.restarted);
  EXPECT_EQ(next.steps, 1);
  EXPECT_DOUBLE_EQ(next.step_s, 0.0025);
  EXPECT_DOUBLE_EQ(lockstep.receive(2, 1000).step_s, 0.001);  // the rate has changed
}

TEST(FrameLockstep, RepetitionsMakeNoStepAndSmallerNumbersAreRestarts) {
  FrameLockstep lockstep;
  lockstep.receive(500, 400);
  EXPECT_EQ(lockstep.receive(500, 400).steps, 0);
  EXPECT_FALSE(lockstep.receive(501, 400).restarted);
  const FrameRequest again = lockstep.receive(0, 400);
  EXPECT_TRUE(again.restarted);
  EXPECT_EQ(again.steps, 1);
}

TEST(FrameLockstep, LostFramesAreMadeUpForWithinASecond) {
  FrameLockstep lockstep;
  lockstep.receive(0, 400);
  EXPECT_EQ(lockstep.receive(5, 400).steps, 5);
  EXPECT_EQ(lockstep.receive(405, 400).steps, 400);
  EXPECT_EQ(lockstep.receive(4'000'000'000U, 400).steps, 1);
}

TEST(LimitedLog, OneLineOfAKindInAnInterval) {
  LimitedLog::Clock::time_point now{};
  std::vector<std::string> lines;
  LimitedLog log([&](const std::string& line) { lines.push_back(line); }, std::chrono::seconds(5), [&] { return now; });
  for (int i = 0; i < 10'000; ++i) log.line("malformed", "bad");
  log.line("other", "also bad");
  now += std::chrono::seconds(6);
  log.line("malformed", "bad");
  EXPECT_THAT(lines, ElementsAre("bad", "also bad", "bad (and 9999 such before)"));
}

TEST(UdpPort, AnswersWhereDatagramsComeFrom) {
  UdpPort simulator("127.0.0.1", 0);
  EXPECT_EQ(simulator.receive(std::chrono::milliseconds(1)), std::nullopt);
  test_support::UdpClient autopilot(simulator.port());
  autopilot.send("ping");
  EXPECT_EQ(simulator.receive(std::chrono::seconds(10)), "ping");
  simulator.answer("pong");
  EXPECT_EQ(autopilot.receive(), "pong");
}

TEST(UdpPort, RefusesAPortThatIsTakenAndAnAddressThatIsNone) {
  const UdpPort first("127.0.0.1", 0);
  EXPECT_THAT(tests::refusal_of([&] { const UdpPort second("127.0.0.1", first.port()); }),
              testing::HasSubstr("choose another ControlPort"));
  EXPECT_THAT(tests::refusal_of([] { const UdpPort none("somewhere", 0); }),
              testing::HasSubstr("address somewhere: is not an IPv4 or IPv6 address"));
}

}  // namespace
}  // namespace tileflight::autopilot::ardupilot_packet_test
