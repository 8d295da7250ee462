#pragma once

#include <string>

#include "tileflight/core/alignment/time_offset.h"
#include "tileflight/core/geometry/trajectory.h"
#include "tileflight/data/flight_logs/telemetry.h"

namespace tileflight::ingest {

/// Estimated offset between the camera's clock and the log's.
struct TelemetryOffset {
  alignment::TimeOffset offset;  ///< the camera's time minus the log's
  std::string source;            ///< its data source: "gyroscope", "gimbal", "attitude" or "track"
};

/// Estimates the offset between a video's clock and its flight log's from the motion in both: the camera path estimated
/// by odometry (any frame and scale), smoothed, against the first of these log data that determines it: angular rates
/// of the gyroscope, of the gimbal's angles, of the vehicle's attitude, or the velocity along the receiver's track
/// (which includes the receiver's latency). If none does, `offset` is undetermined and its reason names each.
TelemetryOffset estimate_telemetry_offset(const geometry::Trajectory& T_map_camera,
                                          const flight_logs::Telemetry& telemetry);

}  // namespace tileflight::ingest
