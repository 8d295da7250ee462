#pragma once

#include <string>
#include <vector>

#include "tileflight/dataset/attitude_csv.h"
#include "tileflight/dataset/dataset.h"
#include "tileflight/experiment/experiment_file.h"
#include "tileflight/flight/telemetry.h"
#include "tileflight/geometry/geodesy.h"

namespace tileflight::experiment {

/// A flight log's positions as gps.csv has them: heights above the ellipsoid, converted from what the log's are above
/// (`telemetry_height`; without it the log must say so itself), times on the log's clock. Positions without a height of
/// that kind are left out, counted in `warnings`. Throws InputError where a height's datum is not known (heights are
/// never mixed in silence) or no position has such a height.
std::vector<dataset::GpsFix> gps_fixes(const flight::Telemetry& telemetry, const IngestFlight& flight,
                                       std::vector<std::string>& warnings);

/// The camera's attitude by the angles of its gimbal, where the log has yaw and pitch (a roll that is missing is 0:
/// gimbals hold the camera level), with the errors that gimbals and compasses of consumer drones have.
std::vector<dataset::CameraAttitude> camera_attitudes(const flight::Telemetry& telemetry);

/// Positions in the local frame, with their times.
std::vector<geometry::Vec3> local_positions(const std::vector<dataset::GpsFix>& fixes,
                                            const geometry::LocalFrame& frame);

}  // namespace tileflight::experiment
