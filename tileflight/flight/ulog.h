#pragma once

#include <filesystem>

#include "tileflight/flight/telemetry.h"

namespace tileflight::flight {

/// PX4's log (.ulg): the first receiver's positions (`vehicle_gps_position`, else `sensor_gps`; only three-dimensional
/// fixes), or where there are none the estimator's (`vehicle_global_position`); seconds from the first. Heights are the
/// receiver's above the ellipsoid where it gives them, else those above sea level. The attitude is that of
/// `vehicle_attitude` next in time, at most 0.2 s away; turning rates
/// are `vehicle_angular_velocity`, else `sensor_combined`. Throws InputError (file, cause) when it is no ULog file or
/// holds no position.
Telemetry read_ulog(const std::filesystem::path& file);

}  // namespace tileflight::flight
