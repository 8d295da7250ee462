#pragma once

#include <filesystem>

#include "tileflight/flight/telemetry.h"

namespace tileflight::flight {

/// ArduPilot's log (.bin): the positions of one receiver (GPS: the lowest instance with a three-dimensional fix), or
/// where there are none the estimator's (POS); seconds from the first. Heights are the receiver's above the ellipsoid
/// where every fix has one (GPA's AEl), else above sea level; above take-off they are POS's above home, else the
/// barometer's. The attitude is that of ATT (else AHR2) next in time, at most 0.2 s away; turning rates are IMU's, of
/// the lowest instance. UTC comes from the receiver's week. Throws InputError (file, cause) when it is no such log or
/// holds no position.
Telemetry read_dataflash(const std::filesystem::path& file);

}  // namespace tileflight::flight
