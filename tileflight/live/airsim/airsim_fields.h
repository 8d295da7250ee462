#pragma once

#include "tileflight/live/rpc/codec.h"
#include "tileflight/live/rpc/server.h"
#include "tileflight/live/simulator/airsim_types.h"

namespace tileflight::airsim {

/// Result of tfStatistics.
struct StatisticsResponse {
  simulator::Statistics simulator;
  rpc::ServerStatistics server;
};

}  // namespace tileflight::airsim

// Serialization of the structures in calls: a map for each, with the fields in AirSim's order.
namespace tileflight::rpc {

TILEFLIGHT_RPC_FIELDS(simulator::Vector2r, x_val, y_val);
TILEFLIGHT_RPC_FIELDS(simulator::Vector3r, x_val, y_val, z_val);
TILEFLIGHT_RPC_FIELDS(simulator::Quaternionr, w_val, x_val, y_val, z_val);
TILEFLIGHT_RPC_FIELDS(simulator::Pose, position, orientation);
TILEFLIGHT_RPC_FIELDS(simulator::GeoPoint, latitude, longitude, altitude);
TILEFLIGHT_RPC_FIELDS(simulator::YawMode, is_rate, yaw_or_rate);
TILEFLIGHT_RPC_FIELDS(simulator::KinematicsState, position, orientation, linear_velocity, angular_velocity,
                      linear_acceleration, angular_acceleration);
TILEFLIGHT_RPC_FIELDS(simulator::EnvironmentState, position, geo_point, gravity, air_pressure, temperature,
                      air_density);
TILEFLIGHT_RPC_FIELDS(simulator::CollisionInfo, has_collided, penetration_depth, time_stamp, normal, impact_point,
                      position, object_name, object_id);
TILEFLIGHT_RPC_FIELDS(simulator::ImageRequest, camera_name, image_type, pixels_as_float, compress, annotation_name);
TILEFLIGHT_RPC_FIELDS(simulator::ImageResponse, image_data_uint8, image_data_float, camera_position, camera_name,
                      camera_orientation, time_stamp, message, pixels_as_float, compress, width, height, image_type);
TILEFLIGHT_RPC_FIELDS(simulator::ProjectionMatrix, matrix);
TILEFLIGHT_RPC_FIELDS(simulator::CameraInfo, pose, fov, proj_mat);
TILEFLIGHT_RPC_FIELDS(simulator::LidarData, time_stamp, point_cloud, pose, segmentation);
TILEFLIGHT_RPC_FIELDS(simulator::ImuData, time_stamp, orientation, angular_velocity, linear_acceleration);
TILEFLIGHT_RPC_FIELDS(simulator::BarometerData, time_stamp, altitude, pressure, qnh);
TILEFLIGHT_RPC_FIELDS(simulator::MagnetometerData, time_stamp, magnetic_field_body, magnetic_field_covariance);
TILEFLIGHT_RPC_FIELDS(simulator::GnssReport, geo_point, eph, epv, velocity, fix_type, time_utc);
TILEFLIGHT_RPC_FIELDS(simulator::GpsData, time_stamp, gnss, is_valid);
TILEFLIGHT_RPC_FIELDS(simulator::DistanceSensorData, time_stamp, distance, min_distance, max_distance, relative_pose);
TILEFLIGHT_RPC_FIELDS(simulator::RCData, timestamp, pitch, roll, throttle, yaw, left_z, right_z, switches, vendor_id,
                      is_initialized, is_valid);
TILEFLIGHT_RPC_FIELDS(simulator::MultirotorState, collision, kinematics_estimated, gps_location, timestamp,
                      landed_state, rc_data);
TILEFLIGHT_RPC_FIELDS(simulator::RotorParameters, thrust, torque_scaler, speed);
TILEFLIGHT_RPC_FIELDS(simulator::RotorStates, rotors, timestamp);
TILEFLIGHT_RPC_FIELDS(simulator::MeshPositionVertexBuffersResponse, position, orientation, vertices, indices, name);
TILEFLIGHT_RPC_FIELDS(simulator::Box2D, min, max);
TILEFLIGHT_RPC_FIELDS(simulator::Box3D, min, max);
TILEFLIGHT_RPC_FIELDS(simulator::DetectionInfo, name, geo_point, box2D, box3D, relative_pose);

// Structures that Cosys-AirSim adds.
TILEFLIGHT_RPC_FIELDS(simulator::GPULidarData, time_stamp, point_cloud, pose);
TILEFLIGHT_RPC_FIELDS(simulator::EchoData, time_stamp, point_cloud, groundtruth, pose, passive_beacons_point_cloud,
                      passive_beacons_groundtruth);
TILEFLIGHT_RPC_FIELDS(simulator::ComputerVisionState, kinematics_estimated, timestamp);

// Structures of the calls that extend AirSim's interface (tf...).
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
