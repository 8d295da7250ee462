#pragma once

#include <functional>

#include "tileflight/server/binder.h"
#include "tileflight/server/own_fields.h"

// The calls beyond AirSim's, which all begin with tf.
namespace tileflight::server {

/// What tfAuthenticate is called on the wire; it is the server's own to answer.
inline constexpr const char* kTokenMethod = "tfAuthenticate";

/// `statistics`: of the server that serves the table.
template <class Caller>
void add_own_methods(Binder<Caller>& bind, const std::function<rpc::ServerStatistics()>& statistics) {
  using S = simulator::Simulator;
  bind.template add<&S::tf_load_region>("tfLoadRegion");
  bind.template add<&S::tf_ground_truth>("tfGroundTruth");
  bind.template add<&S::tf_geodetic_pose>("tfGeodeticPose");
  bind.template add<&S::tf_create_voxel_grid>("tfCreateVoxelGrid");
  bind.template add<&S::tf_lidar_scan>("tfLidarScan");
  bind.template add_of_camera<&S::tf_coverage>("tfCoverage");
  bind.template add_of_camera<&S::tf_set_lens>("tfSetLens");
  bind.table().template add<AllStatistics>("tfStatistics", [caller = bind.caller(), statistics] {
    return AllStatistics{caller.template call<&S::tf_statistics, simulator::Statistics>(), statistics()};
  });
  // Of a server without a token: nothing to prove.
  bind.table().template add<bool, std::string>(kTokenMethod, [](const std::string&) { return true; });
}

}  // namespace tileflight::server
