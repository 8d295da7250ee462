#pragma once

#include <filesystem>
#include <functional>
#include <optional>

#include "tileflight/capture/sensors/attitude.h"
#include "tileflight/capture/sensors/barometer.h"
#include "tileflight/capture/sensors/gnss.h"
#include "tileflight/capture/sensors/imu.h"
#include "tileflight/capture/sensors/lidar.h"
#include "tileflight/capture/sensors/magnetometer.h"
#include "tileflight/capture/sensors/range_finder.h"
#include "tileflight/core/geometry/geodesy.h"

namespace tileflight::base {
class StrictSection;
}

namespace tileflight::sensors {

/// The magnetic field around a magnetometer: a fixed one, or the World Magnetic Model's if the place is georeferenced.
struct MagneticField {
  std::optional<geometry::Vec3> fixed_field_ut;  ///< east, north, up
  double year = 2025.0;                          ///< for the model
};

/// The sensors of a drone besides its camera; each is present only if configured.
struct SensorSuite {
  std::optional<ImuOptions> imu;
  std::optional<GnssOptions> gnss;
  std::optional<AttitudeOptions> attitude;  ///< of the camera, as measured by a gimbal
  std::optional<BarometerOptions> barometer;
  double origin_above_sea_m = 0.0;  ///< of the local frame's origin, if it is not georeferenced
  std::optional<MagnetometerOptions> magnetometer;
  MagneticField magnetic_field;
  std::optional<RangeFinderOptions> range_finder;
  std::optional<LidarOptions> lidar;
  bool kitti_scans = false;  ///< lidar/000000.bin instead of .ply

  /// Whether any sensor casts rays into the scene.
  bool needs_scene() const { return range_finder || lidar; }
};

/// Reads `sensors:` of a FLIGHT file, or the file named by its `sensors_file:`, which has the same keys at its top
/// level: imu, gnss, attitude, barometer, magnetometer, range_finder, lidar, each a map of keys named as the options
/// (docs/sensors.md). A file without either gives an empty suite. `seed` applies to every sensor without its own,
/// `T_camera_imu` is the mounting pose of the IMU and the magnetometer. Throws InputError (file, line, key): unknown
/// keys, both sections, values out of range.
SensorSuite read_sensor_suite(const std::filesystem::path& flight_file, std::uint64_t seed,
                              const geometry::SE3& T_camera_imu);
/// Reads the same keys from a section that is already loaded.
SensorSuite read_sensor_suite(base::StrictSection section, std::uint64_t seed, const geometry::SE3& T_camera_imu);

/// Returns the height above mean sea level, metres, as a function of the position in the local frame. The geoid (EGM96)
/// below `near` is treated as level over such a small place. Without a frame the suite's `origin_above_sea_m` is used.
std::function<double(const geometry::Vec3&)> height_above_sea(const SensorSuite& suite,
                                                              const std::optional<geometry::LocalFrame>& frame,
                                                              const geometry::Vec3& near);

/// Returns the earth's field, microtesla, as a function of the position in the local frame. Throws InputError if it is
/// neither fixed nor follows from a frame.
std::function<geometry::Vec3(const geometry::Vec3&)> magnetic_field_at(
    const MagneticField& field, const std::optional<geometry::LocalFrame>& frame);

}  // namespace tileflight::sensors
