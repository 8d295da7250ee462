#pragma once

#include "tileflight/rpc/codec.h"
#include "tileflight/simulator/airsim_types.h"

// Serialization of AirSim's structures: a map for each, with the fields in AirSim's order.
namespace tileflight::rpc {

template <>
struct Fields<simulator::Vector2r> {
  using T = simulator::Vector2r;
  static constexpr auto list = std::tuple(field("x_val", &T::x_val), field("y_val", &T::y_val));
};

template <>
struct Fields<simulator::Vector3r> {
  using T = simulator::Vector3r;
  static constexpr auto list =
      std::tuple(field("x_val", &T::x_val), field("y_val", &T::y_val), field("z_val", &T::z_val));
};

template <>
struct Fields<simulator::Quaternionr> {
  using T = simulator::Quaternionr;
  static constexpr auto list = std::tuple(field("w_val", &T::w_val), field("x_val", &T::x_val),
                                          field("y_val", &T::y_val), field("z_val", &T::z_val));
};

template <>
struct Fields<simulator::Pose> {
  using T = simulator::Pose;
  static constexpr auto list = std::tuple(field("position", &T::position), field("orientation", &T::orientation));
};

template <>
struct Fields<simulator::GeoPoint> {
  using T = simulator::GeoPoint;
  static constexpr auto list =
      std::tuple(field("latitude", &T::latitude), field("longitude", &T::longitude), field("altitude", &T::altitude));
};

template <>
struct Fields<simulator::YawMode> {
  using T = simulator::YawMode;
  static constexpr auto list = std::tuple(field("is_rate", &T::is_rate), field("yaw_or_rate", &T::yaw_or_rate));
};

template <>
struct Fields<simulator::KinematicsState> {
  using T = simulator::KinematicsState;
  static constexpr auto list = std::tuple(
      field("position", &T::position), field("orientation", &T::orientation),
      field("linear_velocity", &T::linear_velocity), field("angular_velocity", &T::angular_velocity),
      field("linear_acceleration", &T::linear_acceleration), field("angular_acceleration", &T::angular_acceleration));
};

template <>
struct Fields<simulator::EnvironmentState> {
  using T = simulator::EnvironmentState;
  static constexpr auto list = std::tuple(field("position", &T::position), field("geo_point", &T::geo_point),
                                          field("gravity", &T::gravity), field("air_pressure", &T::air_pressure),
                                          field("temperature", &T::temperature), field("air_density", &T::air_density));
};

template <>
struct Fields<simulator::CollisionInfo> {
  using T = simulator::CollisionInfo;
  static constexpr auto list = std::tuple(
      field("has_collided", &T::has_collided), field("penetration_depth", &T::penetration_depth),
      field("time_stamp", &T::time_stamp), field("normal", &T::normal), field("impact_point", &T::impact_point),
      field("position", &T::position), field("object_name", &T::object_name), field("object_id", &T::object_id));
};

template <>
struct Fields<simulator::ImageRequest> {
  using T = simulator::ImageRequest;
  static constexpr auto list =
      std::tuple(field("camera_name", &T::camera_name), field("image_type", &T::image_type),
                 field("pixels_as_float", &T::pixels_as_float), field("compress", &T::compress),
                 field("annotation_name", &T::annotation_name));
};

template <>
struct Fields<simulator::ImageResponse> {
  using T = simulator::ImageResponse;
  static constexpr auto list = std::tuple(
      field("image_data_uint8", &T::image_data_uint8), field("image_data_float", &T::image_data_float),
      field("camera_position", &T::camera_position), field("camera_name", &T::camera_name),
      field("camera_orientation", &T::camera_orientation), field("time_stamp", &T::time_stamp),
      field("message", &T::message), field("pixels_as_float", &T::pixels_as_float), field("compress", &T::compress),
      field("width", &T::width), field("height", &T::height), field("image_type", &T::image_type));
};

template <>
struct Fields<simulator::ProjectionMatrix> {
  using T = simulator::ProjectionMatrix;
  static constexpr auto list = std::tuple(field("matrix", &T::matrix));
};

template <>
struct Fields<simulator::CameraInfo> {
  using T = simulator::CameraInfo;
  static constexpr auto list =
      std::tuple(field("pose", &T::pose), field("fov", &T::fov), field("proj_mat", &T::proj_mat));
};

template <>
struct Fields<simulator::LidarData> {
  using T = simulator::LidarData;
  static constexpr auto list = std::tuple(field("time_stamp", &T::time_stamp), field("point_cloud", &T::point_cloud),
                                          field("pose", &T::pose), field("segmentation", &T::segmentation));
};

template <>
struct Fields<simulator::ImuData> {
  using T = simulator::ImuData;
  static constexpr auto list = std::tuple(field("time_stamp", &T::time_stamp), field("orientation", &T::orientation),
                                          field("angular_velocity", &T::angular_velocity),
                                          field("linear_acceleration", &T::linear_acceleration));
};

template <>
struct Fields<simulator::BarometerData> {
  using T = simulator::BarometerData;
  static constexpr auto list = std::tuple(field("time_stamp", &T::time_stamp), field("altitude", &T::altitude),
                                          field("pressure", &T::pressure), field("qnh", &T::qnh));
};

template <>
struct Fields<simulator::MagnetometerData> {
  using T = simulator::MagnetometerData;
  static constexpr auto list =
      std::tuple(field("time_stamp", &T::time_stamp), field("magnetic_field_body", &T::magnetic_field_body),
                 field("magnetic_field_covariance", &T::magnetic_field_covariance));
};

template <>
struct Fields<simulator::GnssReport> {
  using T = simulator::GnssReport;
  static constexpr auto list =
      std::tuple(field("geo_point", &T::geo_point), field("eph", &T::eph), field("epv", &T::epv),
                 field("velocity", &T::velocity), field("fix_type", &T::fix_type), field("time_utc", &T::time_utc));
};

template <>
struct Fields<simulator::GpsData> {
  using T = simulator::GpsData;
  static constexpr auto list =
      std::tuple(field("time_stamp", &T::time_stamp), field("gnss", &T::gnss), field("is_valid", &T::is_valid));
};

template <>
struct Fields<simulator::DistanceSensorData> {
  using T = simulator::DistanceSensorData;
  static constexpr auto list = std::tuple(
      field("time_stamp", &T::time_stamp), field("distance", &T::distance), field("min_distance", &T::min_distance),
      field("max_distance", &T::max_distance), field("relative_pose", &T::relative_pose));
};

template <>
struct Fields<simulator::RCData> {
  using T = simulator::RCData;
  static constexpr auto list =
      std::tuple(field("timestamp", &T::timestamp), field("pitch", &T::pitch), field("roll", &T::roll),
                 field("throttle", &T::throttle), field("yaw", &T::yaw), field("left_z", &T::left_z),
                 field("right_z", &T::right_z), field("switches", &T::switches), field("vendor_id", &T::vendor_id),
                 field("is_initialized", &T::is_initialized), field("is_valid", &T::is_valid));
};

template <>
struct Fields<simulator::MultirotorState> {
  using T = simulator::MultirotorState;
  static constexpr auto list =
      std::tuple(field("collision", &T::collision), field("kinematics_estimated", &T::kinematics_estimated),
                 field("gps_location", &T::gps_location), field("timestamp", &T::timestamp),
                 field("landed_state", &T::landed_state), field("rc_data", &T::rc_data));
};

template <>
struct Fields<simulator::RotorParameters> {
  using T = simulator::RotorParameters;
  static constexpr auto list =
      std::tuple(field("thrust", &T::thrust), field("torque_scaler", &T::torque_scaler), field("speed", &T::speed));
};

template <>
struct Fields<simulator::RotorStates> {
  using T = simulator::RotorStates;
  static constexpr auto list = std::tuple(field("rotors", &T::rotors), field("timestamp", &T::timestamp));
};

template <>
struct Fields<simulator::MeshPositionVertexBuffersResponse> {
  using T = simulator::MeshPositionVertexBuffersResponse;
  static constexpr auto list =
      std::tuple(field("position", &T::position), field("orientation", &T::orientation),
                 field("vertices", &T::vertices), field("indices", &T::indices), field("name", &T::name));
};

template <>
struct Fields<simulator::Box2D> {
  using T = simulator::Box2D;
  static constexpr auto list = std::tuple(field("min", &T::min), field("max", &T::max));
};

template <>
struct Fields<simulator::Box3D> {
  using T = simulator::Box3D;
  static constexpr auto list = std::tuple(field("min", &T::min), field("max", &T::max));
};

template <>
struct Fields<simulator::DetectionInfo> {
  using T = simulator::DetectionInfo;
  static constexpr auto list =
      std::tuple(field("name", &T::name), field("geo_point", &T::geo_point), field("box2D", &T::box2D),
                 field("box3D", &T::box3D), field("relative_pose", &T::relative_pose));
};

}  // namespace tileflight::rpc
