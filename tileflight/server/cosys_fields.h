#pragma once

#include "tileflight/server/airsim_fields.h"

// Serialization of the structures that Cosys-AirSim adds.
namespace tileflight::rpc {

template <>
struct Fields<simulator::GPULidarData> {
  using T = simulator::GPULidarData;
  static constexpr auto list =
      std::tuple(field("time_stamp", &T::time_stamp), field("point_cloud", &T::point_cloud), field("pose", &T::pose));
};

template <>
struct Fields<simulator::EchoData> {
  using T = simulator::EchoData;
  static constexpr auto list = std::tuple(field("time_stamp", &T::time_stamp), field("point_cloud", &T::point_cloud),
                                          field("groundtruth", &T::groundtruth), field("pose", &T::pose),
                                          field("passive_beacons_point_cloud", &T::passive_beacons_point_cloud),
                                          field("passive_beacons_groundtruth", &T::passive_beacons_groundtruth));
};

template <>
struct Fields<simulator::ComputerVisionState> {
  using T = simulator::ComputerVisionState;
  static constexpr auto list =
      std::tuple(field("kinematics_estimated", &T::kinematics_estimated), field("timestamp", &T::timestamp));
};

}  // namespace tileflight::rpc
