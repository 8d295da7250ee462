#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "tileflight/capture/ingest/ingest_stage.h"
#include "tileflight/core/geometry/geodesy.h"
#include "tileflight/data/dataset/dataset.h"
#include "tileflight/data/dataset/sensor_files.h"
#include "tileflight/data/flight_logs/telemetry.h"

namespace tileflight::ingest {

/// Determines the height of a log's take-off point, for logs whose heights are relative to it: the ground truth's
/// surface at the earliest position at which the vehicle is on the ground (at most 2 m above the log's zero). The
/// median over a radius of 2 m reduces the effect of receiver errors and foliage. `truth`: a folder written by
/// extract(). Throws InputError: truth without georeference or surface, a log that starts in the air or outside the
/// region.
geometry::EllipsoidalHeight estimate_takeoff_height(const flight_logs::Telemetry& telemetry,
                                                    const std::filesystem::path& log,
                                                    const std::filesystem::path& truth);

/// Converts a flight log's positions to those of gps.csv: heights above the ellipsoid, converted from the log's height
/// reference (`telemetry_height`; without it the log must state it), times on the log's clock, standard deviations as
/// the log states them, else 1 m and 2 m. Positions without such a height are dropped and counted in `warnings`. Throws
/// InputError if the height reference is unknown (references are never mixed silently) or no position has such a
/// height.
std::vector<dataset::GpsFix> to_gps_fixes(const flight_logs::Telemetry& telemetry, const IngestedFlightConfig& flight,
                                          std::vector<std::string>& warnings);

/// Returns the reference of the heights that to_gps_fixes() takes: "ellipsoid", "sea-level" or "takeoff". Throws as it.
std::string height_reference_name(const flight_logs::Telemetry& telemetry, const IngestedFlightConfig& flight);

/// Describes the flight of at least one fix, in order of time.
LoggedFlight describe_flight(const std::vector<dataset::GpsFix>& fixes);

/// Returns what no drone's flight is like: speeds, heights and lengths that point at a wrong unit or column.
std::vector<std::string> find_implausible(const LoggedFlight& flight, const std::vector<dataset::GpsFix>& fixes);

/// The camera's attitude from its gimbal angles, if the log has yaw and pitch (a missing roll is 0: gimbals keep the
/// camera level), with error sigmas typical of consumer drones' gimbals and compasses.
std::vector<dataset::CameraAttitude> to_camera_attitudes(const flight_logs::Telemetry& telemetry);

/// Positions in the local frame, in the order of the fixes.
std::vector<geometry::Vec3> to_local_positions(const std::vector<dataset::GpsFix>& fixes,
                                               const geometry::LocalFrame& frame);

}  // namespace tileflight::ingest
