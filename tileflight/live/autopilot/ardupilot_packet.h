#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "tileflight/core/geometry/transform.h"

namespace tileflight::autopilot {

/// Packet from ArduPilot to a simulator in its JSON interface (ArduPilot, libraries/SITL/examples/JSON/readme.md).
struct ServoPacket {
  std::uint16_t frame_rate = 0;         ///< requested steps a second
  std::uint32_t frame_count = 0;        ///< counts the steps that ArduPilot has made
  int channels = 16;                    ///< 16 or 32
  std::array<std::uint16_t, 32> pwm{};  ///< microseconds by channel, 0: no pulse
};

/// Decodes a datagram: little endian, magic number 18458 (16 channels) or 29569 (32 channels), frame_rate, frame_count,
/// pwm. Throws InputError if it is anything else, or asks for fewer than 10 steps a second.
ServoPacket read_servo_packet(std::string_view datagram);

/// Converts a servo pulse between 1000 and 2000 microseconds to an output from 0 to 1, clamped.
double servo_output(std::uint16_t pwm_us);

/// Apparent wind as a vane on the vehicle measures it.
struct WindVane {
  double direction_rad = 0.0;  ///< the direction from which it blows, clockwise from the vehicle's front
  double speed_m_s = 0.0;
};

/// Answer of the simulator. NED; body axes forward, right, down.
struct ArduPilotState {
  double time_s = 0.0;  ///< since the autopilot started
  geometry::Vec3 gyro_rad_s = geometry::Vec3::Zero();
  geometry::Vec3 accelerometer_m_s2 = geometry::Vec3::Zero();  ///< specific force: (0, 0, -9.8) at rest
  geometry::Vec3 position_m = geometry::Vec3::Zero();          ///< from home
  Eigen::Quaterniond R_ned_body = Eigen::Quaterniond::Identity();
  geometry::Vec3 velocity_m_s = geometry::Vec3::Zero();
  std::vector<double> ranges_m;  ///< distances of the first six range finders
  WindVane wind_vane;
  geometry::Vec3 wind_m_s = geometry::Vec3::Zero();
  double airspeed_m_s = 0.0;
};

/// Writes the state as one line of JSON between two line feeds. ArduPilot looks for keys by text: there are no spaces,
/// and "velocity" stands before "velocity_wind". Numbers are the shortest that read back as the same.
std::string state_line(const ArduPilotState& state);

/// Converts the wind relative to the vehicle, body axes forward, right, down, to an apparent wind.
WindVane wind_vane(const geometry::Vec3& wind_relative_m_s);

}  // namespace tileflight::autopilot
