#pragma once

#include <string>
#include <variant>
#include <vector>

#include "tileflight/core/geometry/transform.h"
#include "tileflight/live/simulator/airsim_types.h"

namespace tileflight::simulator {

// Settings of AirSim's sensors with its keys and defaults.

/// Timing of sensors with an update rate: age of a reading, and time of the first one.
struct SensorTiming {
  double latency_s = 0.0;
  double frequency_hz = 50.0;
  double startup_delay_s = 0.0;
};

struct BarometerSettings {
  SensorTiming timing;
  double pressure_factor_sigma = 0.001825;  ///< relative variation of the pressure by the weather
  double pressure_factor_tau_s = 3600.0;
  double noise_sigma_pa = 2.7;
  double qnh_hpa = 1013.25;
};

struct ImuSettings {
  double angular_random_walk_deg_sqrt_h = 0.3;
  double gyro_bias_stability_deg_h = 4.6;
  double gyro_bias_tau_s = 500.0;
  double velocity_random_walk_m_s_sqrt_h = 0.24;
  double accel_bias_stability_ug = 36.0;
  double accel_bias_tau_s = 800.0;
};

struct GpsSettings {
  SensorTiming timing{0.2, 50.0, 1.0};
  double eph_initial = 100.0, eph_final = 0.1, eph_min_3d = 3.0, eph_min_2d = 4.0, eph_tau_s = 0.9;
  double epv_initial = 100.0, epv_final = 0.1, epv_tau_s = 0.9;
};

struct MagnetometerSettings {
  SensorTiming timing;
  double noise_sigma_gauss = 0.005;
  double scale_factor = 1.0;
  double bias_gauss = 0.0;
};

struct DistanceSensorSettings {
  geometry::SE3 T_body_sensor;  ///< measures along x
  double min_m = 0.2, max_m = 40.0;
  double noise_sigma_m = 0.2;  ///< AirSim's, which has no key for it; own key "NoiseSigma"
};

struct LidarSettings {
  geometry::SE3 T_body_sensor;
  int channels = 16;
  double range_m = 100.0;
  double points_per_second = 100000.0;
  double rotations_per_second = 10.0;
  double horizontal_from_deg = 0.0, horizontal_to_deg = 359.0;  ///< clockwise from x, seen from above
  double upper_deg = -15.0, lower_deg = -45.0;                  ///< positive is up
  bool in_sensor_frame = false;                                 ///< DataFrame "SensorLocalFrame"
};

/// A sonar or radar of Cosys-AirSim, with its keys and defaults.
struct EchoSettings {
  geometry::SE3 T_body_sensor;
  int traces = 1000;  ///< rays; below 0: that many in the sensor's horizontal plane
  double azimuth_from_deg = -90.0, azimuth_to_deg = 90.0;      ///< clockwise from x, seen from above
  double elevation_from_deg = -90.0, elevation_to_deg = 90.0;  ///< positive is up
  double opening_angle_deg = 10.0;                             ///< scattered around the mirrored direction
  double attenuation_db_m = 0.0;                               ///< per metre of the way
  double attenuation_db_reflection = 0.0;
  double attenuation_limit_db = -100.0;
  double max_distance_m = 10.0;  ///< of the whole way
  int max_reflections = 3;
  double max_reflection_distance_m = 0.4;  ///< between two reflections
};

using SensorKind = std::variant<BarometerSettings, ImuSettings, GpsSettings, MagnetometerSettings,
                                DistanceSensorSettings, LidarSettings, EchoSettings>;

struct SensorSettings {
  std::string name;
  SensorKind kind;
};

}  // namespace tileflight::simulator
