#pragma once

#include "tileflight/rpc/server.h"
#include "tileflight/server/airsim_fields.h"
#include "tileflight/simulator/extension_types.h"

namespace tileflight::server {

/// Result of tfStatistics.
struct StatisticsResponse {
  simulator::Statistics simulator;
  rpc::ServerStatistics server;
};

}  // namespace tileflight::server

// Serialization of the structures of calls that extend AirSim's interface (tf...).
namespace tileflight::rpc {

template <>
struct Fields<simulator::LoadedRegion> {
  using T = simulator::LoadedRegion;
  static constexpr auto list = std::tuple(
      field("complete", &T::complete), field("tiles_wanted", &T::tiles_wanted), field("tiles_loaded", &T::tiles_loaded),
      field("tiles_failed", &T::tiles_failed), field("geometric_error_max", &T::geometric_error_max),
      field("triangles", &T::triangles), field("bytes", &T::bytes), field("failures", &T::failures));
};

template <>
struct Fields<simulator::Coverage> {
  using T = simulator::Coverage;
  static constexpr auto list = std::tuple(
      field("camera_name", &T::camera_name), field("complete", &T::complete), field("error_wanted", &T::error_wanted),
      field("error_max", &T::error_max), field("error_mean", &T::error_mean), field("surface_share", &T::surface_share),
      field("tiles_seen", &T::tiles_seen), field("loaded", &T::loaded));
};

template <>
struct Fields<simulator::GeodeticPose> {
  using T = simulator::GeodeticPose;
  static constexpr auto list =
      std::tuple(field("geo_point", &T::geo_point), field("altitude", &T::altitude), field("heading", &T::heading),
                 field("orientation", &T::orientation), field("time_stamp", &T::time_stamp),
                 field("georeferenced", &T::georeferenced));
};

template <>
struct Fields<simulator::Statistics> {
  using T = simulator::Statistics;
  static constexpr auto list = std::tuple(
      field("time_stamp", &T::time_stamp), field("sim_seconds", &T::sim_seconds),
      field("wall_seconds", &T::wall_seconds), field("images", &T::images), field("image_seconds", &T::image_seconds),
      field("last_image_seconds", &T::last_image_seconds), field("scenes_built", &T::scenes_built),
      field("tiles_read", &T::tiles_read), field("memory_bytes", &T::memory_bytes),
      field("max_memory_bytes", &T::max_memory_bytes), field("tasks_running", &T::tasks_running),
      field("vehicles", &T::vehicles), field("error_px", &T::error_px), field("mode", &T::mode),
      field("warnings", &T::warnings), field("attribution", &T::attribution));
};

template <>
struct Fields<simulator::VoxelGridData> {
  using T = simulator::VoxelGridData;
  static constexpr auto list =
      std::tuple(field("dims", &T::dims), field("origin", &T::origin), field("resolution", &T::resolution),
                 field("occupied", &T::occupied), field("occupied_count", &T::occupied_count));
};

template <>
struct Fields<simulator::LidarScanData> {
  using T = simulator::LidarScanData;
  static constexpr auto list =
      std::tuple(field("time_stamp", &T::time_stamp), field("pose", &T::pose), field("point_cloud", &T::point_cloud),
                 field("intensity", &T::intensity), field("ring", &T::ring), field("time_offset", &T::time_offset),
                 field("segmentation", &T::segmentation));
};

template <>
struct Fields<simulator::LensDescription> {
  using T = simulator::LensDescription;
  static constexpr auto list =
      std::tuple(field("model", &T::model), field("width", &T::width), field("height", &T::height),
                 field("fov_degrees", &T::fov_degrees), field("k", &T::k), field("intrinsics", &T::intrinsics));
};

template <>
struct Fields<simulator::GroundTruthReport> {
  using T = simulator::GroundTruthReport;
  static constexpr auto list = std::tuple(field("folder", &T::folder), field("extract_json", &T::extract_json));
};

template <>
struct Fields<MethodStatistics> {
  using T = MethodStatistics;
  static constexpr auto list =
      std::tuple(field("calls", &T::calls), field("errors", &T::errors), field("seconds", &T::seconds));
};

template <>
struct Fields<ServerStatistics> {
  using T = ServerStatistics;
  static constexpr auto list =
      std::tuple(field("connections", &T::connections), field("connections_accepted", &T::connections_accepted),
                 field("connections_refused", &T::connections_refused), field("connections_cut", &T::connections_cut),
                 field("requests", &T::requests), field("answers", &T::answers), field("running", &T::running),
                 field("workers", &T::workers), field("held_bytes", &T::held_bytes), field("methods", &T::methods));
};

template <>
struct Fields<server::StatisticsResponse> {
  using T = server::StatisticsResponse;
  static constexpr auto list = std::tuple(field("simulator", &T::simulator), field("server", &T::server));
};

}  // namespace tileflight::rpc
