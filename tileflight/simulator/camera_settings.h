#pragma once

#include <string>
#include <vector>

#include "tileflight/simulator/settings.h"
#include "tileflight/simulator/settings_section.h"

namespace tileflight::simulator {

/// AirSim's, where a place has no position of its own and the settings give none.
inline constexpr geometry::Geodetic kDefaultOrigin{47.641468, -122.140165, {122.0}};

/// A camera's entry of a settings.json (or CameraDefaults): where it is and how it takes each kind of picture. What it
/// does not say is as in `defaults`. Throws InputError.
CameraSettings read_camera(const std::string& name, SettingsSection section, const CameraSettings& defaults);

/// `sensors`, and what a `Sensors` or `DefaultSensors` object adds, replaces and switches off by name. Throws
/// InputError.
std::vector<SensorSettings> read_sensors(SettingsSection& parent, const char* key, bool flies,
                                         std::vector<SensorSettings> sensors);

/// Those of a vehicle that nothing is said of: of one that flies imu, magnetometer, gps and barometer; of others none.
std::vector<SensorSettings> default_sensors(bool flies);

/// The lens of a capture: pinhole by its field of view, or what "Lens" says. Throws InputError.
imaging::Camera lens_of(const CaptureSettings& capture, const std::string& where);

}  // namespace tileflight::simulator
