#pragma once

#include "tileflight/geometry/geodesy.h"

namespace tileflight::sensors {

/// The earth's magnetic field by the World Magnetic Model 2025 (NOAA and British Geological Survey, public domain), in
/// the local frame (east, north, up), microtesla. `year`: a decimal year, 2025 to 2030. Throws InputError outside.
geometry::Vec3 earth_field_ut(const geometry::LocalFrame& frame, const geometry::Vec3& position_local, double year);

/// A field by what a compass user knows of it: declination (clockwise from true north) and inclination (below the
/// horizon), degrees, and strength, microtesla. East, north, up.
geometry::Vec3 field_of_angles_ut(double declination_deg, double inclination_deg, double strength_ut);

}  // namespace tileflight::sensors
