#pragma once

#include "tileflight/core/geometry/geodesy.h"

namespace tileflight::sensors {

/// The earth's magnetic field by the World Magnetic Model 2025 (NOAA and British Geological Survey, public domain), in
/// the local frame (east, north, up), microtesla. `year`: a decimal year, 2025 to 2030; throws InputError otherwise.
geometry::Vec3 geomagnetic_field_ut(const geometry::LocalFrame& frame, const geometry::Vec3& position_local,
                                    double year);

/// Magnetic field vector (east, north, up, microtesla) from declination (clockwise from true north) and inclination
/// (below the horizon), degrees, and strength, microtesla.
geometry::Vec3 magnetic_field_from_angles_ut(double declination_deg, double inclination_deg, double strength_ut);

}  // namespace tileflight::sensors
