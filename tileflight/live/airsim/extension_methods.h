#pragma once

#include <functional>

#include "tileflight/live/airsim/binder.h"
#include "tileflight/live/airsim/extension_fields.h"

// The calls that extend AirSim's interface; their names start with tf.
namespace tileflight::airsim {

/// RPC name of tfAuthenticate, which the server answers itself.
inline constexpr const char* kAuthenticateMethod = "tfAuthenticate";

/// `statistics`: returns those of the server that serves the table.
template <class Caller>
void add_extension_methods(MethodBinder<Caller>& bind, const std::function<rpc::ServerStatistics()>& statistics) {
  using S = simulator::Simulator;
  bind.template add<&S::tf_load_region>("tfLoadRegion");
  bind.template add<&S::tf_ground_truth>("tfGroundTruth");
  bind.template add<&S::tf_geodetic_pose>("tfGeodeticPose");
  bind.template add<&S::tf_create_voxel_grid>("tfCreateVoxelGrid");
  bind.template add<&S::tf_lidar_scan>("tfLidarScan");
  bind.template add_camera_method<&S::tf_coverage>("tfCoverage");
  bind.template add_camera_method<&S::tf_set_lens>("tfSetLens");
  bind.table().template add<StatisticsResponse>("tfStatistics", [caller = bind.caller(), statistics] {
    return StatisticsResponse{caller.template call<&S::tf_statistics, simulator::Statistics>(), statistics()};
  });
  // For a server without a token, any token is accepted.
  bind.table().template add<bool, std::string>(kAuthenticateMethod, [](const std::string&) { return true; });
}

}  // namespace tileflight::airsim
