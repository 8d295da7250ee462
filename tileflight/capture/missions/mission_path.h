#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/capture/flight_path/path.h"
#include "tileflight/capture/missions/mission.h"
#include "tileflight/core/base/strict_section.h"
#include "tileflight/core/geometry/geodesy.h"

namespace tileflight::missions {

/// Holds what the user states about a mission beside its file.
struct MissionOptions {
  std::optional<double> takeoff_height_m;       ///< of the take-off place above the ellipsoid
  std::optional<Takeoff> takeoff;               ///< in place of the file's
  std::optional<double> pitch_deg;              ///< of the camera where the file leaves it open
  std::optional<double> height_above_ground_m;  ///< of waypoints without a height
};

/// Reads the keys takeoff_height, takeoff ([latitude, longitude]), pitch_deg and height_above_ground_m. Throws
/// InputError (file, line, key).
MissionOptions read_mission_options(base::StrictSection& section);

/// A horizontal position, degrees.
struct GroundPoint {
  double latitude_deg = 0.0, longitude_deg = 0.0;
};

/// The place above which a mission is flown.
struct MissionPlace {
  geometry::LocalFrame frame;
  /// Heights above the ellipsoid of the place's uppermost surface at these points, metres; nullopt where there is none.
  std::function<std::vector<std::optional<double>>(const std::vector<GroundPoint>&)> ground_heights;
};

/// A mission in the local frame of a place.
struct PlacedMission {
  std::vector<flight_path::Waypoint> waypoints;  ///< those of the mission, and more where the path must stay straight
  std::vector<std::string> notes;                ///< assumptions and doubts; a sentence each
};

/// Puts a mission into a place: heights are counted from what the file says, corners are rounded or flown as stops, and
/// the camera is turned as the mission says at every waypoint and between them. `speed_m_s`: where the file states
/// none. Throws InputError (`where`, cause, remedy) for heights that cannot be known, and for a mission that stays in
/// one place.
PlacedMission place_mission(const Mission& mission, const MissionOptions& options, const MissionPlace& place,
                            double speed_m_s, const std::string& where);

}  // namespace tileflight::missions
