#pragma once

#include <string>

#include "tileflight/live/simulator/airsim_types.h"

namespace tileflight::simulator {

struct World;

/// Wind, time of day and weather.
class Environment {
 public:
  explicit Environment(World& world) : world_(world) {}

  /// Sets the mean wind, m/s in NED axes, 100 m/s at most.
  void set_wind(const Vector3r& wind);
  /// Lights images by sun and sky at `start_datetime` (YYYY-MM-DD hh:mm:ss in the time zone of the place's longitude,
  /// an hour less in summer time; empty: the simulation's time stamp). The time then advances with the simulation's
  /// clock times `celestial_clock_speed`, in steps of `update_interval_s`. If it is not enabled, images show the light
  /// of the textures again. Without `move_sun` nothing changes. A place without a georeference stays as it is, and the
  /// log says so.
  void set_time_of_day(bool is_enabled, const std::string& start_datetime, bool is_start_datetime_dst,
                       float celestial_clock_speed, float update_interval_s, bool move_sun);
  /// Turns the weather parameters on or off.
  void enable_weather(bool enable);
  /// Sets AirSim's WeatherParameter to a value, which is clamped to 0 to 1; see weather_of_parameters().
  void set_weather_parameter(int parameter, float value);

 private:
  World& world_;
};

}  // namespace tileflight::simulator
