#pragma once

#include "tileflight/live/airsim/airsim_fields.h"
#include "tileflight/live/rpc/server.h"
#include "tileflight/live/simulator/airsim_types.h"

namespace tileflight::airsim {

/// Result of tfStatistics.
struct StatisticsResponse {
  simulator::Statistics simulator;
  rpc::ServerStatistics server;
};

}  // namespace tileflight::airsim

// Serialization of the structures of calls that extend AirSim's interface (tf...).
namespace tileflight::rpc {

TILEFLIGHT_RPC_FIELDS(simulator::LoadedRegion, complete, tiles_wanted, tiles_loaded, tiles_failed, geometric_error_max,
                      triangles, bytes, failures);
TILEFLIGHT_RPC_FIELDS(simulator::Coverage, camera_name, complete, error_wanted, error_max, error_mean, surface_share,
                      tiles_seen, loaded);
TILEFLIGHT_RPC_FIELDS(simulator::GeodeticPose, geo_point, altitude, heading, orientation, time_stamp, georeferenced);
TILEFLIGHT_RPC_FIELDS(simulator::Statistics, time_stamp, sim_seconds, wall_seconds, images, image_seconds,
                      last_image_seconds, scenes_built, tiles_read, memory_bytes, max_memory_bytes, tasks_running,
                      vehicles, error_px, mode, warnings, attribution);
TILEFLIGHT_RPC_FIELDS(simulator::VoxelGridData, dims, origin, resolution, occupied, occupied_count);
TILEFLIGHT_RPC_FIELDS(simulator::LidarScanData, time_stamp, pose, point_cloud, intensity, ring, time_offset,
                      segmentation);
TILEFLIGHT_RPC_FIELDS(simulator::LensDescription, model, width, height, fov_degrees, k, intrinsics);
TILEFLIGHT_RPC_FIELDS(simulator::GroundTruthReport, folder, extract_json);
TILEFLIGHT_RPC_FIELDS(MethodStatistics, calls, errors, seconds);
TILEFLIGHT_RPC_FIELDS(ServerStatistics, connections, connections_accepted, connections_refused, connections_cut,
                      requests, answers, running, workers, held_bytes, methods);
TILEFLIGHT_RPC_FIELDS(airsim::StatisticsResponse, simulator, server);

}  // namespace tileflight::rpc
