#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>

#include "tileflight/live/autopilot/mavlink.h"
#include "tileflight/live/simulator/sensor_readings.h"

namespace tileflight::simulator {

/// Noise of a vehicle's sensors, by the sensor's name.
using SensorNoises = std::map<std::string, SensorNoiseState>;

/// Inertial unit, magnetometer and barometer as the vehicle's first sensors of these kinds read them, with AirSim's
/// defaults where there are none. `slow`: with new readings of magnetometer and barometer.
autopilot::HilSensor hil_sensor(const SensorContext& now, SensorNoises& noises, std::uint64_t time_us, bool slow);

/// Position and velocity as the vehicle's first receiver reads them; nullopt until it has started, or without one.
std::optional<autopilot::HilGps> hil_gps(const SensorContext& now, SensorNoises& noises, std::uint64_t time_us);

/// Reading of one distance sensor. `distance_m`: to the nearest surface along its axis. `id`: its number on the
/// vehicle.
autopilot::DistanceSensor hil_distance(const SensorContext& now, SensorNoises& noises, const SensorSettings& sensor,
                                       double distance_m, std::uint8_t id, std::uint64_t time_us);

/// Image motion and turning of a camera at the vehicle's centre that looks along its z axis, summed up step by step.
struct FlowIntegral {
  Eigen::Vector2d flow_rad = Eigen::Vector2d::Zero();
  geometry::Vec3 gyro_rad = geometry::Vec3::Zero();
  double duration_s = 0.0;
  bool sees_surface = true;  ///< at each step

  /// `distance_m`: along the axis to the surface in the image's middle; nullopt: there is none in sight.
  void add(const VehicleState& state, std::optional<double> distance_m, double step_s);
};

/// The flow as a sensor measures it, with white noise of 0.02 rad/s. Quality 0 where no surface was in sight.
autopilot::HilOpticalFlow hil_flow(const SensorContext& now, SensorNoises& noises, const FlowIntegral& flow,
                                   std::optional<double> distance_m, std::uint64_t time_us);

/// A substitute for odometry: the true pose relative to the start and the true velocity, with white noise (5 cm, 0.01
/// rad, 5 cm/s) and covariances that state it.
autopilot::Odometry hil_odometry(const SensorContext& now, SensorNoises& noises, std::uint64_t time_us);

/// The true state.
autopilot::HilStateQuaternion hil_state(const SensorContext& now, std::uint64_t time_us);

}  // namespace tileflight::simulator
