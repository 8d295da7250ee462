#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>

#include "tileflight/autopilot/hil_messages.h"
#include "tileflight/simulator/sensor_readings.h"

namespace tileflight::simulator {

/// Noise of a vehicle's sensors, by the sensor's name.
using SensorNoises = std::map<std::string, SensorNoiseState>;

/// Inertial unit, magnetometer and barometer as the vehicle's first sensors of these kinds read them, with AirSim's
/// defaults where there are none. `slow`: magnetometer and barometer are new, too.
autopilot::HilSensor hil_sensor(const SensorContext& now, SensorNoises& noises, std::uint64_t time_us, bool slow);

/// Position and velocity as the vehicle's first receiver reads them; nullopt until it has started.
std::optional<autopilot::HilGps> hil_gps(const SensorContext& now, SensorNoises& noises, std::uint64_t time_us);

/// What one distance sensor reads. `distance_m`: to the nearest surface along its axis. `id`: its number on the
/// vehicle.
autopilot::DistanceSensor hil_distance(const SensorContext& now, SensorNoises& noises, const SensorSettings& sensor,
                                       double distance_m, std::uint8_t id, std::uint64_t time_us);

/// The true state.
autopilot::HilStateQuaternion hil_state(const SensorContext& now, std::uint64_t time_us);

}  // namespace tileflight::simulator
