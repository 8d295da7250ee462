#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <string>
#include <utility>

#include "tileflight/geometry/geodesy.h"
#include "tileflight/simulator/airsim_types.h"
#include "tileflight/simulator/craft.h"
#include "tileflight/simulator/sensor_settings.h"

namespace tileflight::simulator {

/// Where the place lies on the earth: its own frame, or that of the settings' origin.
struct EarthFrame {
  geometry::LocalFrame frame;
  geometry::SE3 T_local_ned;
  geometry::Vec3 field_ned_gauss = geometry::Vec3::Zero();  ///< of the earth, where NED has its origin
  bool georeferenced = false;

  geometry::Geodetic geodetic(const geometry::Vec3& ned) const { return frame.geodetic_from_local(T_local_ned * ned); }
  GeoPoint geo_point(const geometry::Vec3& ned) const;
  /// Throws InputError for what is no place on the earth.
  geometry::Vec3 ned(const GeoPoint& point) const;
};

/// Metres of the standard atmosphere, within which heights are kept.
double atmosphere_height_m(double height_m);

/// How a vehicle has moved lately, for sensors that tell it late.
class StateHistory {
 public:
  void add(double time_s, const CraftState& state, double keep_s);
  void clear() { states_.clear(); }
  /// The latest state that is not after the time, else the oldest; none: nothing.
  const CraftState* at(double time_s) const;

 private:
  std::deque<std::pair<double, CraftState>> states_;
};

/// A bias that wanders: a first-order Gauss-Markov process, advanced exactly over any time.
class WanderingBias {
 public:
  double advance(double sigma, double tau_s, double elapsed_s, double normal);
  double value() const { return value_; }

 private:
  double value_ = 0.0;
};

/// The noise of one sensor, a function of its seed and of when it was read.
struct SensorNoise {
  std::uint64_t seed = 1;
  double last_s = 0.0;
  std::array<WanderingBias, 6> biases;
};

/// What is read at a moment.
struct SensorMoment {
  const Craft& craft;
  const StateHistory& history;
  const EarthFrame& earth;
  double time_s = 0.0;  ///< of the simulation
  std::uint64_t time_ns = 0;
  bool moving = false;  ///< time goes on and the vehicle flies: readings are as late as the sensor's
};

ImuData read_imu(const ImuSettings& settings, const SensorMoment& now, SensorNoise& noise);
BarometerData read_barometer(const BarometerSettings& settings, const SensorMoment& now, SensorNoise& noise);
MagnetometerData read_magnetometer(const MagnetometerSettings& settings, const SensorMoment& now, SensorNoise& noise);
GpsData read_gps(const GpsSettings& settings, const SensorMoment& now, SensorNoise& noise);
/// `distance_m`: to the nearest surface along the sensor's axis, infinite where there is none.
DistanceSensorData read_distance(const DistanceSettings& settings, const SensorMoment& now, double distance_m,
                                 SensorNoise& noise);

}  // namespace tileflight::simulator
