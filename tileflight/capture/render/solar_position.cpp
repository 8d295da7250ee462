#include "tileflight/capture/render/solar_position.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "tileflight/core/base/input_error.h"

// Notation of Meeus: T is in Julian centuries from J2000.0, angles in degrees except as arguments of sines.
namespace tileflight::render {
namespace {

constexpr double kRadians = std::numbers::pi / 180.0;
constexpr double kUnixEpoch_jd = 2440587.5;
constexpr double kJ2000_jd = 2451545.0;
constexpr double kSecondsPerDay = 86400.0;
/// Dynamical minus universal time. It was 24 s in 1950 and 69 s in 2020; the sun moves 0.0003 degrees in half a minute.
constexpr double kDeltaT_s = 69.0;

double sin_deg(double degrees) { return std::sin(degrees * kRadians); }
double cos_deg(double degrees) { return std::cos(degrees * kRadians); }

struct Equatorial {
  double right_ascension_rad = 0.0;
  double declination_rad = 0.0;
  double distance_au = 1.0;
  double sidereal_shift_deg = 0.0;  ///< apparent minus mean sidereal time
};

/// Chapter 25, low accuracy: 0.01 degrees. Apparent, true equinox of the date.
Equatorial apparent_sun(double T) {
  const double mean_longitude = 280.46646 + T * (36000.76983 + T * 0.0003032);     // (25.2)
  const double mean_anomaly = 357.52911 + T * (35999.05029 - T * 0.0001537);       // (25.3)
  const double eccentricity = 0.016708634 - T * (0.000042037 + T * 0.0000001267);  // (25.4)
  const double center = (1.914602 - T * (0.004817 + T * 0.000014)) * sin_deg(mean_anomaly) +
                        (0.019993 - T * 0.000101) * sin_deg(2.0 * mean_anomaly) +
                        0.000289 * sin_deg(3.0 * mean_anomaly);
  const double node = 125.04 - 1934.136 * T;
  const double nutation = -0.00478 * sin_deg(node);
  const double longitude = mean_longitude + center - 0.00569 + nutation;
  const double seconds_of_arc = 21.448 - T * (46.8150 + T * (0.00059 - T * 0.001813));              // (22.2)
  const double obliquity = 23.0 + 26.0 / 60.0 + seconds_of_arc / 3600.0 + 0.00256 * cos_deg(node);  // (25.8)
  Equatorial sun;
  sun.right_ascension_rad = std::atan2(cos_deg(obliquity) * sin_deg(longitude), cos_deg(longitude));  // (25.6)
  sun.declination_rad = std::asin(sin_deg(obliquity) * sin_deg(longitude));                           // (25.7)
  sun.distance_au = 1.000001018 * (1.0 - eccentricity * eccentricity) /
                    (1.0 + eccentricity * cos_deg(mean_anomaly + center));  // (25.5)
  sun.sidereal_shift_deg = nutation * cos_deg(obliquity);
  return sun;
}

/// (12.4), at Greenwich, degrees.
double mean_sidereal_time(double jd) {
  const double T = (jd - kJ2000_jd) / 36525.0;
  return 280.46061837 + 360.98564736629 * (jd - kJ2000_jd) + T * T * (0.000387933 - T / 38710000.0);
}

/// Hour angle (westwards) and declination as seen from the observer instead of the earth's centre.
struct Topocentric {
  double hour_angle_rad = 0.0;
  double declination_rad = 0.0;
};

/// Chapters 11 and 40.
Topocentric with_parallax(const Equatorial& sun, double hour_angle_rad, const geometry::Geodetic& place) {
  constexpr double kPolarAxis = 0.99664719;  // of the earth, relative to the equatorial radius
  constexpr double kEquatorialRadius_m = 6378140.0;
  const double latitude = place.latitude_deg * kRadians;
  const double reduced = std::atan(kPolarAxis * std::tan(latitude));
  const double height = place.height.m / kEquatorialRadius_m;
  const double rho_sin = kPolarAxis * std::sin(reduced) + height * std::sin(latitude);
  const double rho_cos = std::cos(reduced) + height * std::cos(latitude);
  const double sin_parallax = sin_deg(8.794 / 3600.0 / sun.distance_au);  // (40.1)
  const double east = -rho_cos * sin_parallax * std::sin(hour_angle_rad);
  const double away = std::cos(sun.declination_rad) - rho_cos * sin_parallax * std::cos(hour_angle_rad);
  const double shift = std::atan2(east, away);  // (40.2)
  const double up = std::sin(sun.declination_rad) - rho_sin * sin_parallax;
  return {hour_angle_rad - shift, std::atan2(up * std::cos(shift), away)};  // (40.3)
}

/// (16.4), with the factor for pressure and temperature; degrees.
double refraction_deg(double elevation_deg, const Air& air) {
  constexpr double kSunRadius_deg = 0.26667, kHorizonRefraction_deg = 0.5667;
  if (elevation_deg < -(kSunRadius_deg + kHorizonRefraction_deg)) return 0.0;
  const double minutes = 1.02 / std::tan((elevation_deg + 10.3 / (elevation_deg + 5.11)) * kRadians);
  return minutes / 60.0 * (air.pressure_hpa / 1010.0) * (283.0 / (273.0 + air.temperature_c));
}

void check(double utc_s, const geometry::Geodetic& place) {
  constexpr double k1900_s = -2208988800.0, k2100_s = 4102444800.0;
  if (!(utc_s >= k1900_s && utc_s < k2100_s)) throw InputError("sun", "its position is defined from 1900 to 2099 only");
  if (!(std::abs(place.latitude_deg) <= 90.0 && std::isfinite(place.longitude_deg) && std::isfinite(place.height.m)))
    throw InputError("sun", "the place is not georeferenced");
}

}  // namespace

Air standard_air(double height_m) {
  constexpr double kLapse_k_m = 0.0065, kSeaLevel_k = 288.15, kExponent = 5.25588;
  const double height = std::clamp(height_m, -1000.0, 11000.0);
  return {1013.25 * std::pow(1.0 - kLapse_k_m * height / kSeaLevel_k, kExponent), 15.0 - kLapse_k_m * height};
}

SunPosition sun_position(double utc_s, const geometry::Geodetic& place, const Air& air) {
  check(utc_s, place);
  const double jd = kUnixEpoch_jd + utc_s / kSecondsPerDay;
  const Equatorial sun = apparent_sun((jd + kDeltaT_s / kSecondsPerDay - kJ2000_jd) / 36525.0);
  const double sidereal_deg = std::fmod(mean_sidereal_time(jd) + sun.sidereal_shift_deg + place.longitude_deg, 360.0);
  const Topocentric seen = with_parallax(sun, sidereal_deg * kRadians - sun.right_ascension_rad, place);
  const double latitude = place.latitude_deg * kRadians;
  const double sin_declination = std::sin(seen.declination_rad), cos_declination = std::cos(seen.declination_rad);
  const double south_on_equator = cos_declination * std::cos(seen.hour_angle_rad);
  const double east = -cos_declination * std::sin(seen.hour_angle_rad);
  const double north = sin_declination * std::cos(latitude) - south_on_equator * std::sin(latitude);
  const double up = std::clamp(sin_declination * std::sin(latitude) + south_on_equator * std::cos(latitude), -1.0, 1.0);
  const double true_elevation_deg = std::asin(up) / kRadians;  // (13.6)
  SunPosition position;
  position.elevation_rad = (true_elevation_deg + refraction_deg(true_elevation_deg, air)) * kRadians;
  const double azimuth = std::atan2(east, north);  // (13.5)
  position.azimuth_rad = azimuth < 0.0 ? azimuth + 2.0 * std::numbers::pi : azimuth;
  position.distance_au = sun.distance_au;
  const double level = std::cos(position.elevation_rad);
  position.direction = {level * std::sin(azimuth), level * std::cos(azimuth), std::sin(position.elevation_rad)};
  return position;
}

}  // namespace tileflight::render
