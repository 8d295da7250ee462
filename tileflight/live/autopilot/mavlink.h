#pragma once

// The messages of PX4's simulator interface (mavlink.io, common message set). Fields in the order of the wire: by size,
// then as defined, then extensions.

#include <array>
#include <cstdint>
#include <cstring>
#include <optional>
#include <string>
#include <string_view>

namespace tileflight::autopilot {

/// A message of MAVLink 2 on the wire (mavlink.io, Packet Serialization).
struct MavlinkFrame {
  std::uint8_t sequence = 0, system = 1, component = 1;
  std::uint32_t message = 0;  ///< number of the message
  std::string payload;        ///< as received: zero bytes at its end may be missing
};

/// Number of a message, seed of its checksum (CRC_EXTRA, from names and types of its fields), and longest payload.
struct MavlinkMessage {
  std::uint32_t number;
  std::uint8_t crc_extra;
  std::size_t bytes;
};

/// Encodes a frame without signature. Zero bytes at the payload's end are left out, except for the first byte.
std::string encode_frame(const MavlinkMessage& message, const MavlinkFrame& frame);

/// Finds frames in the bytes of a stream. Noise between frames, wrong checksums and messages other than those of
/// mavlink.h are counted and skipped; signatures are not checked. It holds at most one frame's bytes beyond the
/// last push().
class MavlinkReader {
 public:
  void push(std::string_view bytes) { bytes_.append(bytes); }
  /// Returns the next frame, or nullopt until more bytes come.
  std::optional<MavlinkFrame> next();

  std::uint64_t wrong_checksums() const { return wrong_checksums_; }
  std::uint64_t noise_bytes() const { return noise_bytes_; }

 private:
  std::string bytes_;
  std::uint64_t wrong_checksums_ = 0, noise_bytes_ = 0;
};

struct Heartbeat {
  static constexpr MavlinkMessage kMessage{0, 50, 9};
  std::uint32_t custom_mode = 0;
  std::uint8_t type = 0;       ///< MAV_TYPE; 0: generic
  std::uint8_t autopilot = 8;  ///< MAV_AUTOPILOT; 8: none
  std::uint8_t base_mode = 0, system_status = 0;
  std::uint8_t mavlink_version = 3;

  template <class Self, class Visitor>
  static void visit(Self& m, const Visitor& v) {
    v(m.custom_mode), v(m.type), v(m.autopilot), v(m.base_mode), v(m.system_status), v(m.mavlink_version);
  }
};

/// Outputs of the autopilot.
struct HilActuatorControls {
  static constexpr MavlinkMessage kMessage{93, 47, 81};
  std::uint64_t time_us = 0;
  std::uint64_t flags = 0;           ///< bit 0: in lockstep
  std::array<float, 16> controls{};  ///< commands of the motors, 0 to 1
  std::uint8_t mode = 0;             ///< MAV_MODE_FLAG; 128: armed

  template <class Self, class Visitor>
  static void visit(Self& m, const Visitor& v) {
    v(m.time_us), v(m.flags), v(m.controls), v(m.mode);
  }
};

/// Bits of HilSensor::updated: the readings that are new.
enum HilSensorField : std::uint32_t {
  kAccelerometerUpdated = 0x7,
  kGyroUpdated = 0x38,
  kMagnetometerUpdated = 0x1C0,
  kBarometerUpdated = 0x1A00,  ///< pressure, altitude, temperature
};

/// Inertial unit, magnetometer and barometer; body axes forward, right, down.
struct HilSensor {
  static constexpr MavlinkMessage kMessage{107, 108, 65};
  std::uint64_t time_us = 0;
  std::array<float, 3> accelerometer_m_s2{}, gyro_rad_s{}, magnetometer_gauss{};
  float pressure_hpa = 0, differential_pressure_hpa = 0, pressure_altitude_m = 0, temperature_c = 0;
  std::uint32_t updated = 0;  ///< HilSensorField
  std::uint8_t id = 0;

  template <class Self, class Visitor>
  static void visit(Self& m, const Visitor& v) {
    v(m.time_us), v(m.accelerometer_m_s2), v(m.gyro_rad_s), v(m.magnetometer_gauss), v(m.pressure_hpa);
    v(m.differential_pressure_hpa), v(m.pressure_altitude_m), v(m.temperature_c), v(m.updated), v(m.id);
  }
};

struct HilGps {
  static constexpr MavlinkMessage kMessage{113, 124, 39};
  std::uint64_t time_us = 0;
  std::int32_t latitude_e7_deg = 0, longitude_e7_deg = 0, altitude_mm = 0;
  std::uint16_t eph_cm = 0xFFFF, epv_cm = 0xFFFF, speed_cm_s = 0xFFFF;
  std::array<std::int16_t, 3> velocity_ned_cm_s{};
  std::uint16_t course_cdeg = 0xFFFF;  ///< over ground, clockwise from north
  std::uint8_t fix_type = 0, satellites = 255, id = 0;
  std::uint16_t yaw_cdeg = 0;  ///< 0: not available

  template <class Self, class Visitor>
  static void visit(Self& m, const Visitor& v) {
    v(m.time_us), v(m.latitude_e7_deg), v(m.longitude_e7_deg), v(m.altitude_mm), v(m.eph_cm), v(m.epv_cm);
    v(m.speed_cm_s), v(m.velocity_ned_cm_s), v(m.course_cdeg), v(m.fix_type), v(m.satellites), v(m.id), v(m.yaw_cdeg);
  }
};

/// The true state.
struct HilStateQuaternion {
  static constexpr MavlinkMessage kMessage{115, 4, 64};
  std::uint64_t time_us = 0;
  std::array<float, 4> attitude_wxyz{1, 0, 0, 0};  ///< body to NED
  std::array<float, 3> rates_rad_s{};
  std::int32_t latitude_e7_deg = 0, longitude_e7_deg = 0, altitude_mm = 0;
  std::array<std::int16_t, 3> velocity_ned_cm_s{};
  std::uint16_t indicated_airspeed_cm_s = 0, true_airspeed_cm_s = 0;
  std::array<std::int16_t, 3> acceleration_mg{};

  template <class Self, class Visitor>
  static void visit(Self& m, const Visitor& v) {
    v(m.time_us), v(m.attitude_wxyz), v(m.rates_rad_s), v(m.latitude_e7_deg), v(m.longitude_e7_deg), v(m.altitude_mm);
    v(m.velocity_ned_cm_s), v(m.indicated_airspeed_cm_s), v(m.true_airspeed_cm_s), v(m.acceleration_mg);
  }
};

/// Direction of a distance sensor, body axes (MAV_SENSOR_ORIENTATION); every eighth of a turn to the right of forward
/// adds 1 to kForward.
enum SensorOrientation : std::uint8_t {
  kForward = 0,
  kUp = 24,
  kDown = 25,
  kByQuaternion = 100,
};

/// One distance, along the sensor's x axis.
struct DistanceSensor {
  static constexpr MavlinkMessage kMessage{132, 85, 39};
  std::uint32_t time_ms = 0;
  std::uint16_t min_cm = 0, max_cm = 0, distance_cm = 0;
  std::uint8_t type = 0;  ///< MAV_DISTANCE_SENSOR; 0: laser
  std::uint8_t id = 0, orientation = kForward;
  std::uint8_t variance_cm2 = 255;  ///< 255: unknown
  float horizontal_fov_rad = 0, vertical_fov_rad = 0;
  std::array<float, 4> attitude_wxyz{};  ///< of kByQuaternion: sensor to body
  std::uint8_t signal_quality = 0;       ///< 0: unknown

  template <class Self, class Visitor>
  static void visit(Self& m, const Visitor& v) {
    v(m.time_ms), v(m.min_cm), v(m.max_cm), v(m.distance_cm), v(m.type), v(m.id), v(m.orientation);
    v(m.variance_cm2), v(m.horizontal_fov_rad), v(m.vertical_fov_rad), v(m.attitude_wxyz), v(m.signal_quality);
  }
};

/// Motion of the image of a camera that looks down, as angles, and the rotation that a gyro beside it measured
/// meanwhile. Axes forward, right, down. Turning about an axis makes its flow positive; so does moving forward for y,
/// and moving left for x.
struct HilOpticalFlow {
  static constexpr MavlinkMessage kMessage{114, 237, 44};
  std::uint64_t time_us = 0;
  std::uint32_t integration_us = 0;  ///< time over which flow and gyro are integrated
  std::array<float, 2> flow_rad{};   ///< about x, y
  std::array<float, 3> gyro_rad{};
  std::uint32_t distance_age_us = 0;
  float distance_m = -1;  ///< distance to the surface in the image's middle; negative: unknown
  std::int16_t temperature_cdeg = 0;
  std::uint8_t id = 0, quality = 0;  ///< 0: bad

  template <class Self, class Visitor>
  static void visit(Self& m, const Visitor& v) {
    v(m.time_us), v(m.integration_us), v(m.flow_rad), v(m.gyro_rad), v(m.distance_age_us), v(m.distance_m);
    v(m.temperature_cdeg), v(m.id), v(m.quality);
  }
};

/// Pose and velocity as an odometry estimates them.
struct Odometry {
  static constexpr MavlinkMessage kMessage{331, 91, 233};
  std::uint64_t time_us = 0;
  std::array<float, 3> position_m{};
  std::array<float, 4> attitude_wxyz{1, 0, 0, 0};  ///< body to the pose's frame
  std::array<float, 3> velocity_m_s{};             ///< body
  std::array<float, 3> rates_rad_s{};              ///< body
  /// Upper triangles of matrices of 6 x 6, row by row: of position and rotation, of velocity and rates.
  std::array<float, 21> pose_covariance{}, velocity_covariance{};
  std::uint8_t frame = 1, child_frame = 12;  ///< MAV_FRAME_LOCAL_NED, MAV_FRAME_BODY_FRD
  std::uint8_t resets = 0;
  std::uint8_t estimator = 2;  ///< MAV_ESTIMATOR_TYPE_VISION
  std::int8_t quality = 0;     ///< percent; 0: unknown

  template <class Self, class Visitor>
  static void visit(Self& m, const Visitor& v) {
    v(m.time_us), v(m.position_m), v(m.attitude_wxyz), v(m.velocity_m_s), v(m.rates_rad_s), v(m.pose_covariance);
    v(m.velocity_covariance), v(m.frame), v(m.child_frame), v(m.resets), v(m.estimator), v(m.quality);
  }
};

/// Returns checksum seed and length of one of the messages above; nullopt for others.
std::optional<MavlinkMessage> known_message(std::uint32_t number);

/// Encodes the payload of a message: its fields, little endian, without gaps.
template <class Message>
std::string encode_payload(const Message& message) {
  std::string bytes;
  Message::visit(message, [&](const auto& field) {
    bytes.append(reinterpret_cast<const char*>(&field), sizeof field);  // the machine is little endian
  });
  return bytes;
}

/// Decodes a payload. Missing bytes at its end are zero, and further bytes are ignored.
template <class Message>
Message decode_payload(std::string payload) {
  payload.resize(Message::kMessage.bytes, '\0');
  Message message;
  std::size_t at = 0;
  Message::visit(message, [&](auto& field) {
    std::memcpy(&field, payload.data() + at, sizeof field);
    at += sizeof field;
  });
  return message;
}

}  // namespace tileflight::autopilot
