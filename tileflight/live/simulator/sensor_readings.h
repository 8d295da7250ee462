#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <string>
#include <utility>

#include "tileflight/core/geometry/geodesy.h"
#include "tileflight/live/simulator/airsim_types.h"
#include "tileflight/live/simulator/sensor_settings.h"
#include "tileflight/live/simulator/sim_vehicle.h"

namespace tileflight::simulator {

/// The place's geographic reference: its own frame, or that of the settings' origin.
struct GeodeticFrame {
  geometry::LocalFrame local_frame;
  geometry::SE3 T_local_ned;
  geometry::Vec3 magnetic_field_ned_gauss = geometry::Vec3::Zero();  ///< earth's field at NED's origin
  bool georeferenced = false;

  geometry::Geodetic to_geodetic(const geometry::Vec3& ned) const {
    return local_frame.geodetic_from_local(T_local_ned * ned);
  }
  GeoPoint to_geo_point(const geometry::Vec3& ned) const;
  /// Throws InputError for an invalid geographic position.
  geometry::Vec3 to_ned(const GeoPoint& point) const;
};

/// Clamps a height to the range of the standard atmosphere, metres.
double clamp_atmosphere_height_m(double height_m);

/// A vehicle's recent states, for sensors with latency.
class StateHistory {
 public:
  void add(double time_s, const VehicleState& state, double keep_s);
  void clear() { states_.clear(); }
  /// Returns the latest state that is not after the time, else the oldest; nullptr if there are none.
  const VehicleState* at(double time_s) const;

 private:
  std::deque<std::pair<double, VehicleState>> states_;
};

/// Noise state of one sensor, determined by its seed and its reading times.
struct SensorNoiseState {
  std::uint64_t seed = 1;
  double last_read_s = 0.0;
  std::array<double, 6> biases{};  ///< first-order Gauss-Markov processes
};

/// Noise of a vehicle's sensors, by the sensor's name.
using SensorNoises = std::map<std::string, SensorNoiseState>;

/// Computes a distinct seed for each sensor of each vehicle, the same in every run.
std::uint64_t sensor_seed(const std::string& vehicle, const std::string& sensor);

/// Returns the noise state of a vehicle's sensor, which starts with the sensor's seed.
SensorNoiseState& noise_of(SensorNoises& noises, const std::string& vehicle, const std::string& sensor);

/// Context of a sensor reading.
struct SensorContext {
  const SimVehicle& vehicle;
  const StateHistory& history;
  const GeodeticFrame& geodetic_frame;
  double time_s = 0.0;  ///< simulation time
  std::uint64_t time_ns = 0;
  bool moving = false;  ///< the clock is running and the vehicle flies: readings have the sensor's latency
};

/// Reads a sensor at the context's time and advances its noise state.
ImuData read_imu(const ImuSettings& settings, const SensorContext& now, SensorNoiseState& noise);
BarometerData read_barometer(const BarometerSettings& settings, const SensorContext& now, SensorNoiseState& noise);
MagnetometerData read_magnetometer(const MagnetometerSettings& settings, const SensorContext& now,
                                   SensorNoiseState& noise);
GpsData read_gps(const GpsSettings& settings, const SensorContext& now, SensorNoiseState& noise);
/// `distance_m`: distance to the nearest surface along the sensor's axis, infinite if there is none.
DistanceSensorData read_distance(const DistanceSensorSettings& settings, const SensorContext& now, double distance_m,
                                 SensorNoiseState& noise);

}  // namespace tileflight::simulator
