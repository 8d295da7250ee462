#pragma once

#include "tileflight/live/airsim/airsim_fields.h"

// Serialization of the structures that Cosys-AirSim adds.
namespace tileflight::rpc {

TILEFLIGHT_RPC_FIELDS(simulator::GPULidarData, time_stamp, point_cloud, pose);
TILEFLIGHT_RPC_FIELDS(simulator::EchoData, time_stamp, point_cloud, groundtruth, pose, passive_beacons_point_cloud,
                      passive_beacons_groundtruth);
TILEFLIGHT_RPC_FIELDS(simulator::ComputerVisionState, kinematics_estimated, timestamp);

}  // namespace tileflight::rpc
