#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace tileflight::missions {

/// Surface above which a mission's height is counted.
enum class HeightAbove { kEllipsoid, kSeaLevel, kTakeoff, kGround };

/// A position as a mission file states it, on WGS84.
struct MissionPosition {
  double latitude_deg = 0.0;
  double longitude_deg = 0.0;
  std::optional<double> height_m;  ///< nullopt: the file states none
  HeightAbove above = HeightAbove::kTakeoff;
};

/// Selects how a vehicle passes a waypoint.
struct Passing {
  enum class Kind {
    kRounded,  ///< cuts the corner between two straight legs from `distance_m` before to `distance_m` behind it
    kStop,     ///< comes to rest at it, between two straight legs
    kCurve,    ///< passes through it on a smooth curve
  };
  Kind kind = Kind::kRounded;
  double distance_m = 2.0;
  double hold_s = 0.0;  ///< time at rest
};

/// Heading of the camera on the leg that begins at a waypoint.
struct Heading {
  enum class Kind {
    kAlong,   ///< `deg` to the right of the direction of flight
    kFixed,   ///< `deg` on the whole leg
    kBlend,   ///< from `deg` to that of the next waypoint, the shorter way round
    kTarget,  ///< towards MissionWaypoint::target
  };
  Kind kind = Kind::kAlong;
  double deg = 0.0;  ///< clockwise from north (kAlong: from the direction of flight)
};

/// Elevation of the camera's optical axis on the leg that begins at a waypoint.
struct Pitch {
  enum class Kind {
    kOpen,    ///< the file does not say
    kNadir,   ///< the file does not say, but surveys an area: straight down
    kFixed,   ///< `deg` on the whole leg
    kBlend,   ///< from `deg` to that of the next waypoint
    kTarget,  ///< towards MissionWaypoint::target
  };
  Kind kind = Kind::kOpen;
  double deg = 0.0;  ///< positive up; -90 is straight down
};

/// A waypoint, and the leg from it to the next one.
struct MissionWaypoint {
  MissionPosition position;
  Passing passing;
  std::optional<double> speed_m_s;  ///< of the leg; nullopt: the file does not say
  Heading heading;
  Pitch pitch;
  std::optional<MissionPosition> target;  ///< of heading and pitch; a height that is not stated is on the ground
};

/// The place where the mission expects the vehicle to take off.
struct Takeoff {
  double latitude_deg = 0.0;
  double longitude_deg = 0.0;
  std::optional<double> height_above_sea_m;
};

/// The lens for which a survey was planned.
struct SurveyCamera {
  int width = 0, height = 0;  ///< pixels
  double fov_deg = 0.0;       ///< across the width
};

/// A planned flight, as the file of another program states it.
struct Mission {
  std::string format;  ///< for messages: "a QGroundControl plan"
  std::vector<MissionWaypoint> waypoints;
  std::optional<Takeoff> takeoff;
  std::optional<SurveyCamera> camera;
  std::vector<std::string> notes;  ///< what of the file is not simulated, and what was assumed; a sentence each
};

/// Returns whether a file is one that read_mission() reads, by its first bytes. A file that cannot be read is none.
bool is_mission_file(const std::filesystem::path& file);

/// Reads a mission: a QGroundControl plan (.plan) or plain text ("QGC WPL"), DJI's WPML (.kmz, .kml, .wpml), Litchi's
/// CSV, or a route in KML or KMZ. docs/formats.md (Missions) lists what is read of each. Throws InputError (file,
/// cause) for a file of another kind, one that is damaged, and one whose path is not in it.
Mission read_mission(const std::filesystem::path& file);

/// Reads a QGroundControl plan: JSON whose `fileType` is "Plan".
Mission read_plan(std::string_view text, const std::string& where);
/// Reads the plain text of ground stations: "QGC WPL 110" and a line for each item, separated by tabs.
Mission read_waypoint_list(std::string_view text, const std::string& where);
/// Reads a table of Litchi: "latitude,longitude,altitude(m),…".
Mission read_litchi(std::string_view text, const std::string& where);
/// Reads KML: DJI's WPML where the document has its elements, else the route of its LineStrings or Points.
Mission read_kml_mission(std::string_view text, const std::string& where);

/// Throws InputError (where, cause) unless latitude and longitude are those of a place on the Earth.
void require_on_earth(double latitude_deg, double longitude_deg, const std::string& where);

}  // namespace tileflight::missions
