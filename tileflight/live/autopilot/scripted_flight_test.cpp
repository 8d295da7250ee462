#include <gtest/gtest.h>

#include <cmath>

#include "tileflight/capture/vehicle/multirotor.h"
#include "tileflight/capture/vehicle/test_obstacles.h"
#include "tileflight/live/autopilot/ardupilot_packet.h"
#include "tileflight/live/autopilot/lockstep.h"
#include "tileflight/live/autopilot/test_ardupilot_client.h"

/// The whole loop without sockets: servo packets in, lines of JSON out, a scripted autopilot between them.
namespace tileflight::autopilot::scripted_flight_test {
namespace {

using geometry::Vec3;
using test_support::Observation;
using test_support::ScriptedAutopilot;
using vehicle::Multirotor;

constexpr double kExpo = 0.65;

/// North, east, down and forward, right, down from what the room vehicle has.
Vec3 ned(const Vec3& enu) { return {enu.y(), enu.x(), -enu.z()}; }
Vec3 frd(const Vec3& flu) { return {flu.x(), -flu.y(), -flu.z()}; }

ArduPilotState state_of(const Multirotor& multirotor, double time_s) {
  const vehicle::RigidBodyState& body = multirotor.state();
  geometry::Mat3 R_ned_enu;
  R_ned_enu << 0, 1, 0, 1, 0, 0, 0, 0, -1;
  ArduPilotState state;
  state.time_s = time_s;
  state.gyro_rad_s = frd(body.angular_velocity_rad_s);
  state.accelerometer_m_s2 = frd(multirotor.inertial().accelerometer_m_s2);
  state.position_m = ned(body.position_m - multirotor.start().position_m);
  state.R_ned_body = Eigen::Quaterniond(R_ned_enu * body.R_local_body * Vec3(1, -1, -1).asDiagonal());
  state.velocity_m_s = ned(body.velocity_m_s);
  return state;
}

struct Flight {
  std::string bytes;  ///< all lines that the simulator sent
  std::vector<Observation> track;
  bool landed = false;
  std::size_t points_reached = 0;
};

Flight fly(const vehicle::AirframeKind kind, const vehicle::ObstacleQuery& ground, const vehicle::WindOptions& wind,
           const std::vector<Vec3>& points, int rate = 400, double limit_s = 90.0) {
  const vehicle::Airframe frame = vehicle::make_airframe(kind);
  Multirotor multirotor(frame, ground, wind, Vec3(0, 0, 0.4), std::acos(-1.0) / 2.0);
  ScriptedAutopilot autopilot(frame, points, kExpo);
  FrameLockstep lockstep;
  Flight flight;
  Observation seen;
  double time_s = 0.0;
  constexpr double kRest_s = 3.0;  // after landing
  double until_s = limit_s;
  for (std::uint32_t frame_count = 0; time_s < until_s; ++frame_count) {
    const ServoPacket packet = read_servo_packet(test_support::servo_datagram(
        static_cast<std::uint16_t>(rate), frame_count, test_support::pulses(autopilot.outputs(seen, 1.0 / rate))));
    const FrameRequest request = lockstep.receive(packet.frame_count, packet.frame_rate);
    std::vector<double> shares;
    for (std::size_t i = 0; i < frame.rotors.size(); ++i)
      shares.push_back(vehicle::thrust_share(servo_output(packet.pwm[i]), kExpo));
    for (int i = 0; i < request.steps; ++i, time_s += request.step_s) multirotor.step(shares, request.step_s);
    const std::string line = state_line(state_of(multirotor, time_s));
    flight.bytes += line;
    seen = test_support::parse_state(line);
    flight.track.push_back(seen);
    if (autopilot.landed() && until_s == limit_s) until_s = time_s + kRest_s;
  }
  flight.landed = autopilot.landed();
  flight.points_reached = autopilot.points_reached();
  return flight;
}

void expect_flown(const Flight& flight, std::size_t points) {
  EXPECT_TRUE(flight.landed);
  EXPECT_EQ(flight.points_reached, points);
  EXPECT_LT(flight.track.back().position_m.head<2>().norm(), 0.8);
  EXPECT_LT(flight.track.back().velocity_m_s.norm(), 0.01);
  EXPECT_GT((flight.track.back().R_ned_body * Vec3::UnitZ()).z(), 0.9);  // upright
}

TEST(ScriptedFlight, QuadrotorFliesASquareAndLands) {
  const auto points = test_support::square(15.0, 5.0);
  const Flight flight = fly(vehicle::AirframeKind::kQuadX, vehicle::test_support::level_ground(0.0), {}, points);
  expect_flown(flight, points.size());
  EXPECT_LT(std::abs(flight.track.back().position_m.z()), 0.05);
}

TEST(ScriptedFlight, HexarotorFliesASquareInGusts) {
  const auto points = test_support::square(10.0, 4.0);
  const vehicle::WindOptions wind{.mean_m_s = Vec3(4, 3, 0), .turbulence = vehicle::Turbulence::kLight};
  expect_flown(fly(vehicle::AirframeKind::kHexaX, vehicle::test_support::level_ground(0.0), wind, points),
               points.size());
}

TEST(ScriptedFlight, OtherRatesFlyTheSameSquare) {
  const auto points = test_support::square(10.0, 4.0);
  for (const int rate : {250, 1200})
    expect_flown(fly(vehicle::AirframeKind::kQuadX, vehicle::test_support::level_ground(0.0), {}, points, rate),
                 points.size());
}

TEST(ScriptedFlight, SamePacketsSameBytes) {
  const auto points = test_support::square(10.0, 4.0);
  const vehicle::WindOptions wind{.mean_m_s = Vec3(2, 0, 0), .turbulence = vehicle::Turbulence::kModerate, .seed = 5};
  const auto once = [&] {
    return fly(vehicle::AirframeKind::kQuadX, vehicle::test_support::level_ground(0.0), wind, points);
  };
  const Flight first = once(), second = once();
  EXPECT_GT(first.bytes.size(), 100'000U);
  EXPECT_TRUE(first.bytes == second.bytes);
}

/// A ridge along the north, 0.06 m high, under its left feet, on ground that falls by 12 degrees.
std::optional<vehicle::SurfaceHit> uneven(const Vec3& from, const Vec3& to) {
  const double fall = std::tan(12.0 * std::acos(-1.0) / 180.0);
  const auto ground = vehicle::test_support::plane(Vec3(fall, 0, 1).normalized(), 0.0);
  const auto ridge = vehicle::test_support::sphere(Vec3(-0.15, 0.15, -0.1), 0.19);
  return vehicle::test_support::first_of(ground, ridge)(from, to);
}

TEST(ScriptedFlight, ArmsOnUnevenGroundAndTakesOff) {
  const Multirotor standing(vehicle::make_airframe(vehicle::AirframeKind::kQuadX), uneven, {}, Vec3(0, 0, 0.4),
                            std::acos(-1.0) / 2.0);
  const double tilt_deg = std::acos((standing.state().R_local_body * Vec3::UnitZ()).z()) * 180.0 / std::acos(-1.0);
  EXPECT_GT(tilt_deg, 5.0);
  const std::vector<Vec3> up{{0, 0, -4}};
  const Flight flight = fly(vehicle::AirframeKind::kQuadX, uneven, {}, up);
  // Before it arms it neither moves nor turns, and feels gravity and nothing else.
  for (const Observation& one : flight.track) {
    if (one.time_s > 0.9) break;
    EXPECT_LT(one.position_m.norm(), 1e-4);
    EXPECT_LT(one.gyro_rad_s.norm(), 1e-3);
  }
  expect_flown(flight, up.size());
}

}  // namespace
}  // namespace tileflight::autopilot::scripted_flight_test
