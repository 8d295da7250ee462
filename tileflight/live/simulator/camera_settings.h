#pragma once

#include <string>
#include <vector>

#include "tileflight/core/base/strict_section.h"
#include "tileflight/live/simulator/settings.h"

namespace tileflight::simulator {

/// AirSim's default origin, for places without georeference if the settings give none.
inline constexpr geometry::Geodetic kDefaultOrigin{47.641468, -122.140165, {122.0}};

/// X, Y, Z of a section, metres; missing ones are taken from `fallback`. Throws InputError.
geometry::Vec3 read_position(base::StrictSection& section, const geometry::Vec3& fallback = geometry::Vec3::Zero());

/// Roll, Pitch, Yaw of a section, degrees; missing ones are 0. Throws InputError.
Eigen::Quaterniond read_orientation(base::StrictSection& section);

/// Reads a camera's entry of settings.json (or CameraDefaults): its pose and its capture settings per image type.
/// Missing keys are taken from `defaults`. Throws InputError.
CameraSettings read_camera(const std::string& name, base::StrictSection section, const CameraSettings& defaults);

/// Returns `sensors` with the additions, replacements and removals (by name) of a `Sensors` or `DefaultSensors` object.
/// `warnings`: gains a line for each sensor of a kind that is not simulated. Throws InputError.
std::vector<SensorSettings> read_sensors(base::StrictSection& parent, const std::string& key, bool flies,
                                         std::vector<SensorSettings> sensors, std::vector<std::string>& warnings);

/// Default sensors of a vehicle without sensor settings: imu, magnetometer, gps and barometer if it flies, else none.
std::vector<SensorSettings> default_sensors(bool flies);

/// The lens of a capture: a pinhole by its field of view, or as given by "Lens". Throws InputError.
imaging::Camera make_lens(const CaptureSettings& capture, const std::string& where);

}  // namespace tileflight::simulator
