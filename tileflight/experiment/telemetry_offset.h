#pragma once

#include <string>

#include "tileflight/alignment/time_offset.h"
#include "tileflight/flight/telemetry.h"
#include "tileflight/geometry/trajectory.h"

namespace tileflight::experiment {

struct TelemetryOffset {
  alignment::TimeOffset offset;  ///< the camera's time minus the log's
  std::string source;            ///< "gyroscope", "gimbal", "attitude" or "track": what of the log told it
};

/// The offset between a video's clock and its flight log's, by the motion that both have seen: the camera's path as
/// odometry found it (any frame and scale), smoothed, and of the log the first of these that tells it: turning rates of
/// the gyroscope, those of the gimbal's angles, those of the vehicle's attitude (each against the camera's), velocity
/// along the receiver's track (against the camera's; it includes the receiver's lag). Where none does, `offset` is not
/// determined and its reason names each.
TelemetryOffset telemetry_offset(const geometry::Trajectory& T_map_camera, const flight::Telemetry& telemetry);

}  // namespace tileflight::experiment
