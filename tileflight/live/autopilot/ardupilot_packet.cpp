#include "tileflight/live/autopilot/ardupilot_packet.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstring>

#include "tileflight/core/base/input_error.h"

namespace tileflight::autopilot {
namespace {

using geometry::Vec3;

constexpr std::uint16_t kMagic16 = 18458, kMagic32 = 29569;
constexpr std::size_t kHeaderBytes = 8;
/// ArduPilot does not follow steps of a tenth of a second and more.
constexpr int kMinFrameRate = 10;
constexpr std::size_t kMaxRanges = 6;

template <class Number>
Number little_endian(std::string_view bytes, std::size_t at) {
  Number value = 0;
  for (std::size_t i = 0; i < sizeof(Number); ++i)
    value = static_cast<Number>(
        value | static_cast<Number>(static_cast<Number>(static_cast<unsigned char>(bytes[at + i])) << (8 * i)));
  return value;
}

int channels_of(std::string_view datagram) {
  if (datagram.size() < kHeaderBytes)
    throw InputError("datagram of " + std::to_string(datagram.size()) + " bytes", "is too short for a servo packet");
  const auto magic = little_endian<std::uint16_t>(datagram, 0);
  if (magic != kMagic16 && magic != kMagic32)
    throw InputError(
        "datagram that starts with " + std::to_string(magic),
        "is no servo packet of ArduPilot's JSON interface (18458 or 29569); start it with -f JSON:ADDRESS");
  return magic == kMagic16 ? 16 : 32;
}

void append(std::string& text, double value) {
  char digits[32];
  const auto result = std::to_chars(digits, digits + sizeof digits, value);
  text.append(digits, result.ptr);
}

void append(std::string& text, std::initializer_list<double> values) {
  char separator = '[';
  for (const double value : values) {
    text += separator;
    append(text, value);
    separator = ',';
  }
  text += ']';
}

void append(std::string& text, const Vec3& v) { append(text, {v.x(), v.y(), v.z()}); }

}  // namespace

ServoPacket read_servo_packet(std::string_view datagram) {
  ServoPacket packet;
  packet.channels = channels_of(datagram);
  const std::size_t wanted = kHeaderBytes + 2 * static_cast<std::size_t>(packet.channels);
  if (datagram.size() != wanted)
    throw InputError("servo packet",
                     "has " + std::to_string(datagram.size()) + " bytes instead of " + std::to_string(wanted));
  packet.frame_rate = little_endian<std::uint16_t>(datagram, 2);
  packet.frame_count = little_endian<std::uint32_t>(datagram, 4);
  if (packet.frame_rate < kMinFrameRate)
    throw InputError("servo packet", "asks for " + std::to_string(packet.frame_rate) +
                                         " steps a second; 10 are the fewest (SIM_RATE_HZ)");
  for (int i = 0; i < packet.channels; ++i)
    packet.pwm[static_cast<std::size_t>(i)] =
        little_endian<std::uint16_t>(datagram, kHeaderBytes + 2 * static_cast<std::size_t>(i));
  return packet;
}

double servo_output(std::uint16_t pwm_us) { return std::clamp((pwm_us - 1000.0) / 1000.0, 0.0, 1.0); }

WindVane wind_vane(const Vec3& wind_relative_m_s) {
  const double forward = -wind_relative_m_s.x(), right = -wind_relative_m_s.y();  // where it comes from
  return {std::atan2(right, forward), std::hypot(forward, right)};
}

std::string state_line(const ArduPilotState& state) {
  std::string line = "\n{\"timestamp\":";
  append(line, state.time_s);
  line += ",\"imu\":{\"gyro\":";
  append(line, state.gyro_rad_s);
  line += ",\"accel_body\":";
  append(line, state.accelerometer_m_s2);
  line += "},\"position\":";
  append(line, state.position_m);
  line += ",\"quaternion\":";
  append(line, {state.R_ned_body.w(), state.R_ned_body.x(), state.R_ned_body.y(), state.R_ned_body.z()});
  line += ",\"velocity\":";
  append(line, state.velocity_m_s);
  for (std::size_t i = 0; i < std::min(state.ranges_m.size(), kMaxRanges); ++i) {
    line += ",\"rng_" + std::to_string(i + 1) + "\":";
    append(line, state.ranges_m[i]);
  }
  line += ",\"windvane\":{\"direction\":";
  append(line, state.wind_vane.direction_rad);
  line += ",\"speed\":";
  append(line, state.wind_vane.speed_m_s);
  line += "},\"airspeed\":";
  append(line, state.airspeed_m_s);
  line += ",\"velocity_wind\":";
  append(line, state.wind_m_s);
  return line + "}\n";
}

}  // namespace tileflight::autopilot
