#pragma once

#include <optional>

#include "tileflight/core/geometry/transform.h"

namespace tileflight::flight_path {

/// A waypoint of a mission, in the local frame.
struct Waypoint {
  geometry::Vec3 position;                ///< camera position, metres, east north up
  std::optional<geometry::Vec3> look_at;  ///< point to look at; without it yaw and pitch apply
  double yaw_deg = 0.0;                   ///< heading clockwise from north
  double pitch_deg = 0.0;                 ///< of the optical axis, positive up; -90 is straight down
  double roll_deg = 0.0;
};

/// Limits of a flight through waypoints.
struct SpeedLimits {
  double speed_m_s = 8.0;
  double acceleration_m_s2 = 4.0;
  double yaw_rate_deg_s = 60.0;
};

}  // namespace tileflight::flight_path
