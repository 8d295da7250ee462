#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "tileflight/core/geometry/geodesy.h"
#include "tileflight/core/geometry/transform.h"

namespace tileflight::sensors {

/// Computes the earth's magnetic field by the World Magnetic Model 2025 (NOAA and British Geological Survey, public
/// domain), in the local frame (east, north, up), microtesla. `year`: a decimal year, 2025 to 2030; throws InputError
/// otherwise.
geometry::Vec3 geomagnetic_field_ut(const geometry::LocalFrame& frame, const geometry::Vec3& position_local,
                                    double year);

/// Computes the magnetic field vector (east, north, up, microtesla) from declination (clockwise from true north) and
/// inclination (below the horizon), degrees, and strength, microtesla.
geometry::Vec3 magnetic_field_from_angles_ut(double declination_deg, double inclination_deg, double strength_ut);

/// A magnetometer and its errors. Noise: the floor that Honeywell's data sheet gives for the HMC5883L (2 milligauss).
struct MagnetometerOptions {
  std::uint64_t seed = 1;
  double rate_hz = 50.0;
  geometry::SE3 T_camera_sensor;                          ///< only its rotation matters
  double noise_ut = 0.2;                                  ///< standard deviation of each axis and sample
  geometry::Vec3 hard_iron_ut = geometry::Vec3::Zero();   ///< the vehicle's own field, sensor axes
  geometry::Mat3 soft_iron = geometry::Mat3::Identity();  ///< matrix M: measured field = M * true field
};

/// Throws InputError for options out of range.
void check(const MagnetometerOptions& options);

/// A magnetometer reading.
struct MagnetometerSample {
  double time_s = 0.0;
  geometry::Vec3 field_ut;  ///< sensor axes, microtesla
};

/// Simulates samples at start, start + 1 / rate, ... up to end: M R_sensor_local b + hard iron + noise.
/// `T_local_camera_at` returns the camera's pose, `field_at` the earth's field at a position (local frame, microtesla).
/// Throws InputError for options out of range.
std::vector<MagnetometerSample> simulate_magnetometer(
    const std::function<geometry::SE3(double time_s)>& T_local_camera_at,
    const std::function<geometry::Vec3(const geometry::Vec3& position)>& field_at, double start_s, double end_s,
    const MagnetometerOptions& options = {});

}  // namespace tileflight::sensors
