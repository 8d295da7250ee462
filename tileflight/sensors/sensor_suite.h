#pragma once

#include <filesystem>
#include <optional>

#include "tileflight/sensors/attitude.h"
#include "tileflight/sensors/barometer.h"
#include "tileflight/sensors/gps.h"
#include "tileflight/sensors/imu.h"
#include "tileflight/sensors/lidar.h"
#include "tileflight/sensors/magnetometer.h"
#include "tileflight/sensors/range_finder.h"

namespace tileflight::sensors {

/// The earth's field that a magnetometer is in: given, or the World Magnetic Model's where the place is on the earth.
struct MagneticField {
  std::optional<geometry::Vec3> given_ut;  ///< east, north, up
  double year = 2025.0;                    ///< of the model
};

/// What a drone carries beside its camera; none of it unless asked for.
struct SensorSuite {
  std::optional<ImuOptions> imu;
  std::optional<GnssOptions> gnss;
  std::optional<AttitudeOptions> attitude;  ///< of the camera, as a gimbal says it
  std::optional<BarometerOptions> barometer;
  double origin_above_sea_m = 0.0;  ///< height of the local frame's origin, where the place is not on the earth
  std::optional<MagnetometerOptions> magnetometer;
  MagneticField magnetic_field;
  std::optional<RangeFinderOptions> range_finder;
  std::optional<LidarOptions> lidar;
  bool kitti_scans = false;  ///< lidar/000000.bin instead of .ply

  /// Whether any of them casts rays into the scene.
  bool needs_scene() const { return range_finder || lidar; }
};

/// The `sensors:` of a FLIGHT file, or the file that its `sensors_file:` names, which has the same keys at its top:
/// imu, gnss, attitude, barometer, magnetometer, range_finder, lidar, each a map of keys named as the options are
/// (docs/sensors.md). A file without either gives an empty suite. `seed` is that of every sensor which has none of its
/// own, and `T_camera_imu` where the IMU and the magnetometer sit. Throws InputError (file, line, key): unknown keys,
/// both sections, values out of range.
SensorSuite read_sensor_suite(const std::filesystem::path& flight_file, std::uint64_t seed,
                              const geometry::SE3& T_camera_imu);

}  // namespace tileflight::sensors
