#pragma once

#include "tileflight/core/geometry/geodesy.h"

namespace tileflight::render {

/// Position of the sun as seen from a place.
struct SunPosition {
  double elevation_rad = 0.0;  ///< apparent (with refraction), disc's centre above the ellipsoid's tangent plane
  double azimuth_rad = 0.0;    ///< clockwise from north, 0 to 2 pi
  double distance_au = 1.0;    ///< earth-sun distance, astronomical units
  geometry::Vec3 direction = geometry::Vec3::UnitZ();  ///< unit vector towards the sun, east north up at the place
};

/// State of the air, for refraction near the horizon.
struct Air {
  double pressure_hpa = 1013.25;
  double temperature_c = 15.0;
};

/// Returns the international standard atmosphere (ISO 2533) at a height above sea level, metres; up to 11 km.
Air standard_air(double height_m);

/// Computes the position of the sun at `utc_s` (seconds since 1970 in UTC, leap seconds not counted) from 1900 to 2100,
/// by Meeus, "Astronomical Algorithms" (2nd ed. 1998), chapters 12, 13, 25 and 40: accurate to 0.01 degrees. Refraction
/// by Saemundsson's formula (chapter 16) if the sun's upper limb is above the horizon. Throws InputError for a time
/// outside this range or a latitude beyond the poles.
SunPosition sun_position(double utc_s, const geometry::Geodetic& place, const Air& air);

}  // namespace tileflight::render
