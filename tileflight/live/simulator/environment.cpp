#include "tileflight/live/simulator/environment.h"

#include <algorithm>
#include <cmath>
#include <regex>

#include "tileflight/capture/render/solar_position.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/strict_section.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/live/simulator/frames.h"
#include "tileflight/live/simulator/world.h"

namespace tileflight::simulator {
namespace {

constexpr double kSecondsOfDay = 86400.0, kSecondsOfHour = 3600.0;
constexpr double kFirstSun_s = -2208988800.0 + kSecondsOfDay,
                 kLastSun_s = 4102444800.0 - kSecondsOfDay;  // 1900 to 2100
constexpr double kMostSpeed = 1e7;

/// A visibility between two, evenly in its logarithm; 0 (none) for 0.
double visibility_m(double value, double clearest_m, double thickest_m) {
  return value > 0.0 ? clearest_m * std::pow(thickest_m / clearest_m, value) : 0.0;
}

/// Scripts write 2019-6-17 7:5:0 and 24:00:00, too: seconds since 1970 if that were UTC; nullopt for anything else.
std::optional<double> loose_time_s(const std::string& text) {
  static const std::regex kForm(R"(\s*(\d{4})-(\d{1,2})-(\d{1,2})[ T]+(\d{1,2}):(\d{1,2}):(\d{1,2})\s*)");
  constexpr std::size_t kMostCharacters = 40;
  std::smatch parts;
  if (text.size() > kMostCharacters || !std::regex_match(text, parts, kForm)) return std::nullopt;
  const auto two = [&](std::size_t i) { return parts[i].length() == 1 ? "0" + parts[i].str() : parts[i].str(); };
  const bool is_midnight = parts[4] == "24";
  const auto time_s = base::parse_iso_time_s(parts[1].str() + "-" + two(2) + "-" + two(3) + " " +
                                             (is_midnight ? "00" : two(4)) + ":" + two(5) + ":" + two(6));
  return time_s && is_midnight ? *time_s + kSecondsOfDay : time_s;
}

/// A client's date and time in UTC. Without an offset of its own it is in the time zone of the longitude: AirSim takes
/// that of the computer, which would make pictures depend on it.
double start_utc_s(const std::string& text, bool is_summer_time, double longitude_deg) {
  constexpr std::size_t kMostCharacters = 100;
  std::optional<double> time_s = base::parse_iso_time_s(text);
  const bool has_offset = time_s && !base::parse_iso_time_s(text + "Z");
  if (!time_s) time_s = loose_time_s(text);
  if (!time_s)
    throw InputError("simSetTimeOfDay", "'" + text.substr(0, kMostCharacters) +
                                            "' is no date and time; give one such as 2018-02-12 15:20:00");
  if (has_offset) return *time_s;
  return *time_s - kSecondsOfHour * (std::round(longitude_deg / 15.0) + (is_summer_time ? 1.0 : 0.0));
}

}  // namespace

void Environment::set_wind(const Vector3r& wind) {
  const Vec3 wind_ned = checked_position(wind, "simSetWind");
  if (wind_ned.norm() > 100.0) throw InputError("simSetWind", "more than 100 m/s");
  const std::lock_guard lock(world_.state_mutex);
  world_.wind_ned_m_s = wind_ned;
  for (const auto& one : world_.vehicles) one->vehicle->set_wind(enu_from_ned(wind_ned));
}

render::WeatherOptions weather_of_parameters(double fog, double dust, double rain, double snow, double wetness) {
  constexpr double kClearest_m = 5000.0, kThickestFog_m = 20.0, kThickestDust_m = 50.0;
  constexpr double kMostRain_mm_per_h = 100.0, kMostSnow_mm_per_h = 10.0;
  render::WeatherOptions weather;
  weather.fog_visibility_m = visibility_m(fog, kClearest_m, kThickestFog_m);
  weather.dust_visibility_m = visibility_m(dust, kClearest_m, kThickestDust_m);
  weather.rain_mm_per_h = kMostRain_mm_per_h * rain * rain;
  weather.snow_mm_per_h = kMostSnow_mm_per_h * snow * snow;
  weather.wetness = wetness;
  return weather;
}

void Outdoors::set_time_of_day(const Sunlight& start, double clock_s, double speed, double interval_s) {
  celestial_clock_ = {start, clock_s, speed, interval_s};
}

void Outdoors::enable_weather(bool enable) {
  has_weather_ = enable;
  weather_.reset();
}

bool Outdoors::set_parameter(int parameter, double value) {
  if (parameter == kEnabled) {
    enable_weather(value > 0.0);
    return true;
  }
  values_.at(static_cast<std::size_t>(parameter)) = value;
  weather_.reset();
  return parameter == kRain || parameter == kRoadWetness || parameter == kSnow || parameter == kDust ||
         parameter == kFog;
}

Outlook Outdoors::outlook(double clock_s, const geometry::Vec3& wind_m_s) const {
  Outlook seen{clock_s, std::nullopt, nullptr};
  if (celestial_clock_) {
    const CelestialClock& clock = *celestial_clock_;
    double passed_s = clock_s - clock.clock_s;
    if (clock.interval_s > 0.0) passed_s = clock.interval_s * std::floor(passed_s / clock.interval_s + 1e-9);
    seen.sunlight = clock.start;
    seen.sunlight->utc_s = std::clamp(clock.start.utc_s + clock.speed * passed_s, kFirstSun_s, kLastSun_s);
  }
  if (!has_weather_) return seen;
  render::WeatherOptions weather =
      weather_of_parameters(values_[kFog], values_[kDust], values_[kRain], values_[kSnow], values_[kRoadWetness]);
  if (weather.is_clear()) return seen;
  weather.wind_m_s = wind_m_s;
  if (!weather_ || weather_->wind_m_s != wind_m_s) weather_ = std::make_shared<const render::WeatherOptions>(weather);
  seen.weather = weather_;
  return seen;
}

void Environment::set_time_of_day(bool is_enabled, const std::string& start_datetime, bool is_start_datetime_dst,
                                  float celestial_clock_speed, float update_interval_s, bool move_sun) {
  const char* call = "simSetTimeOfDay";
  if (is_enabled && move_sun) {
    base::require(std::abs(celestial_clock_speed) <= kMostSpeed, call,
                  "the clock's speed is not a number, or too large");
    base::require(update_interval_s >= 0.0F && update_interval_s <= kSecondsOfDay, call,
                  "the update interval must lie between 0 and 86400 s");
    if (!world_.geodetic_frame.georeferenced)
      return world_.tell_once(call, "the place has no georeference; give OriginGeopoint in the settings");
  }
  const std::lock_guard lock(world_.state_mutex);
  if (!is_enabled) return world_.outdoors.end_time_of_day();
  if (!move_sun) return;
  const geometry::Geodetic place = world_.geodetic_frame.local_frame.origin();
  Sunlight start{0.0, place.latitude_deg, place.longitude_deg, place.height.m};
  start.utc_s = start_datetime.empty() ? 1e-9 * static_cast<double>(world_.clock.time_ns())
                                       : start_utc_s(start_datetime, is_start_datetime_dst, place.longitude_deg);
  render::sun_position(start.utc_s, place, render::standard_air(place.height.m));  // throws for a time out of range
  world_.outdoors.set_time_of_day(start, world_.clock.time_s(), celestial_clock_speed, update_interval_s);
}

void Environment::enable_weather(bool enable) {
  const std::lock_guard lock(world_.state_mutex);
  world_.outdoors.enable_weather(enable);
}

void Environment::set_weather_parameter(int parameter, float value) {
  const char* call = "simSetWeatherParameter";
  base::require(parameter >= 0 && parameter <= Outdoors::kEnabled, call,
                "the parameter " + std::to_string(parameter) + " is unknown; use 0 (Rain) to 8 (Enabled)");
  base::require(std::isfinite(value), call, "the value is not a number");
  bool works = false;
  {
    const std::lock_guard lock(world_.state_mutex);
    works = world_.outdoors.set_parameter(parameter, std::clamp(static_cast<double>(value), 0.0, 1.0));
  }
  if (!works && value > 0.0F)
    world_.tell_once(call,
                     "snow and leaves on the ground and leaves in the air (parameters 3, 4 and 5) are not simulated");
}

}  // namespace tileflight::simulator
