#pragma once

#include <filesystem>

#include "tileflight/data/flight_logs/telemetry.h"

namespace tileflight::flight_logs {

/// Reads PX4's log (.ulg). Positions are those of the first receiver (`vehicle_gps_position`, else `sensor_gps`; 3D
/// fixes only), or if there are none those of the estimator (`vehicle_global_position`); times are seconds from the
/// first. Heights are the receiver's above the ellipsoid if present, else above sea level. The attitude is the nearest
/// `vehicle_attitude` in time, at most 0.2 s away; angular rates are those of `vehicle_angular_velocity`, else
/// `sensor_combined`. Throws InputError (file, cause) if the file is not a ULog file or holds no position.
Telemetry read_ulog(const std::filesystem::path& file);

}  // namespace tileflight::flight_logs
