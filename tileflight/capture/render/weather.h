#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "tileflight/core/geometry/transform.h"

namespace tileflight::base {
class StrictSection;
}

namespace tileflight::render {

/// Fog, dust, rain, snow and wet ground, as they form images. All off by default; constant during a flight.
struct WeatherOptions {
  std::uint64_t seed = 1;  ///< of the drops and flakes; deterministic
  /// Visibility in fog alone: the distance at which contrast has fallen to 2 % (Koschmieder 1924), metres; 0: none.
  double fog_visibility_m = 0.0;
  double dust_visibility_m = 0.0;  ///< visibility in dust alone, metres; 0: none
  /// Fog and dust thin out with the height: by a factor of e over this height, metres; 0: uniform.
  double scale_height_m = 0.0;
  double base_height_m = 0.0;  ///< height (z of the local frame) at which the visibilities hold
  double rain_mm_per_h = 0.0;
  double snow_mm_per_h = 0.0;  ///< as water
  double wetness = 0.0;        ///< of surfaces that face upwards, 0 (dry) to 1
  /// Drift of drops and flakes: east, north, up.
  geometry::Vec3 wind_m_s = geometry::Vec3::Zero();
  /// Exposure time of drops and flakes for a camera without one (ImageFormation::exposure_time_s), s.
  double streak_exposure_s = 0.01;

  /// Tells whether anything is in the air.
  bool has_air() const { return fog_visibility_m > 0.0 || dust_visibility_m > 0.0 || has_precipitation(); }
  bool has_precipitation() const { return rain_mm_per_h > 0.0 || snow_mm_per_h > 0.0; }
  /// Tells whether images are as without weather.
  bool is_clear() const { return !has_air() && wetness == 0.0; }
};

/// Throws InputError (option, cause) if a value is out of range.
void validate_weather(const WeatherOptions& weather);

/// Reads the section `weather:` of a FLIGHT file; nullopt without one. Its keys are named as the options, without
/// `seed`, which is the flight's; `wind_m_s: [east, north]`. Throws InputError (file, line, key).
std::optional<WeatherOptions> read_weather(base::StrictSection& flight);
std::optional<WeatherOptions> read_weather(const std::filesystem::path& flight_file);

/// Describes the options that differ from their defaults, for a dataset's metadata: "fog_visibility_m: 200,
/// rain_mm_per_h: 5".
std::string describe_weather(const WeatherOptions& weather);

/// Returns the extinction coefficient at a visibility, 1/m: -ln 0.02 / visibility (Koschmieder 1924); 0 for visibility
/// 0 (none).
double extinction_at_visibility(double visibility_m);

/// Returns the extinction coefficient of rain, 1/m: twice the drops' cross-section (geometric optics; van de Hulst
/// 1957, section 8.22) in the size distribution of Marshall and Palmer (1948), which is 3.65e-4 R^0.63: 1.58 R^0.63
/// dB/km, as measured (Atlas, "Optical extinction by rainfall", J. Meteorology 10, 1953; Recommendation ITU-R P.1814,
/// section 3.2).
double rain_extinction_per_m(double rain_mm_per_h);

/// Returns the extinction coefficient of dry snow, 1/m: a S^1.38 dB/km with a = 5.42e-5 lambda + 5.4958776, lambda =
/// 550 nm (Recommendation ITU-R P.1814, section 3.3).
double snow_extinction_per_m(double snow_mm_per_h);

}  // namespace tileflight::render
