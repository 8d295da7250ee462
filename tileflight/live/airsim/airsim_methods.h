#pragma once

#include <functional>

#include "tileflight/live/airsim/airsim_fields.h"
#include "tileflight/live/airsim/binder.h"
#include "tileflight/live/airsim/method_table.h"

// Every method that clients may call, under its RPC name: those of AirSim's multirotor and computer-vision interface,
// those that clients of Cosys-AirSim (API version 4) call beyond, and the extensions, whose names start with tf.
namespace tileflight::airsim {

using simulator::Cameras;
using simulator::Clock;
using simulator::Detections;
using simulator::Environment;
using simulator::Flight;
using simulator::Labels;
using simulator::Objects;
using simulator::Place;
using simulator::Recording;
using simulator::Sensors;
using simulator::Simulator;
using simulator::Vehicles;

template <class Caller>
void add_general_methods(MethodBinder<Caller>& bind) {
  bind.template add<&Simulator::ping>("ping");
  bind.template add<&Simulator::get_server_version>("getServerVersion");
  bind.template add<&Simulator::get_min_required_client_version>("getMinRequiredClientVersion");
  bind.template add<&Simulator::reset>("reset");
  bind.template add<&Vehicles::enable_api_control>("enableApiControl");
  bind.template add<&Vehicles::is_api_control_enabled>("isApiControlEnabled");
  bind.template add<&Vehicles::arm_disarm>("armDisarm");
  bind.template add<&Clock::pause>("simPause");
  bind.template add<&Clock::is_paused>("simIsPaused");
  bind.template add_waiting<&Clock::continue_for_time>("simContinueForTime");
  bind.template add_waiting<&Clock::continue_for_frames>("simContinueForFrames");
  bind.template add<&Vehicles::get_home_geo_point>("getHomeGeoPoint");
  bind.template add<&Vehicles::list_vehicles>("listVehicles");
  bind.template add<&Simulator::get_settings_string>("getSettingsString");
  bind.template add<&Recording::start>("startRecording");
  bind.template add<&Recording::stop>("stopRecording");
  bind.template add<&Recording::is_recording>("isRecording");
  bind.template add<&Vehicles::add_vehicle>("simAddVehicle");
  bind.template add<&Simulator::run_console_command>("simRunConsoleCommand");
  bind.template add<&Simulator::print_log_message>("simPrintLogMessage");
}

template <class Caller>
void add_camera_methods(MethodBinder<Caller>& bind) {
  bind.template add_camera_method<&Cameras::get_images>("simGetImages");
  bind.template add_camera_method<&Cameras::get_camera_info>("simGetCameraInfo");
  bind.template add_camera_method<&Cameras::get_focal_length>("simGetFocalLength");
  bind.template add_camera_method<&Cameras::get_filmback_settings>("simGetFilmbackSettings");
  bind.template add_camera_method<&Cameras::get_current_field_of_view>("simGetCurrentFieldOfView");
  bind.template add_camera_method<&Cameras::set_camera_pose>("simSetCameraPose");
  bind.template add_camera_method<&Cameras::set_camera_fov>("simSetCameraFov");
  bind.template add_camera_method<&Cameras::get_distortion_params>("simGetDistortionParams");
  bind.template add_camera_method<&Cameras::set_distortion_param>("simSetDistortionParam");
  bind.template add_camera_method<&Detections::add_detection_filter_mesh_name>("simAddDetectionFilterMeshName");
  bind.template add_camera_method<&Detections::set_detection_filter_radius>("simSetDetectionFilterRadius");
  bind.template add_camera_method<&Detections::clear_detection_mesh_names>("simClearDetectionMeshNames");
  bind.template add_camera_method<&Detections::get_detections>("simGetDetections");
}

template <class Caller>
void add_state_methods(MethodBinder<Caller>& bind) {
  bind.template add<&Vehicles::set_vehicle_pose>("simSetVehiclePose");
  bind.template add<&Vehicles::get_vehicle_pose>("simGetVehiclePose");
  bind.template add<&Vehicles::get_ground_truth_kinematics>("simGetGroundTruthKinematics");
  bind.template add<&Vehicles::set_kinematics>("simSetKinematics");
  bind.template add<&Vehicles::get_ground_truth_environment>("simGetGroundTruthEnvironment");
  bind.template add<&Vehicles::get_collision_info>("simGetCollisionInfo");
  bind.template add<&Vehicles::get_multirotor_state>("getMultirotorState");
  bind.template add<&Vehicles::get_rotor_states>("getRotorStates");
  bind.template add<&Sensors::get_lidar_data>("getLidarData");
  bind.template add<&Sensors::get_lidar_segmentation>("simGetLidarSegmentation");
  bind.template add<&Sensors::get_imu_data>("getImuData");
  bind.template add<&Sensors::get_barometer_data>("getBarometerData");
  bind.template add<&Sensors::get_magnetometer_data>("getMagnetometerData");
  bind.template add<&Sensors::get_gps_data>("getGpsData");
  bind.template add<&Sensors::get_distance_sensor_data>("getDistanceSensorData");
}

template <class Caller>
void add_scene_methods(MethodBinder<Caller>& bind) {
  bind.template add<&Objects::list_scene_objects>("simListSceneObjects");
  bind.template add<&Labels::set_segmentation_object_id>("simSetSegmentationObjectID");
  bind.template add<&Labels::get_segmentation_object_id>("simGetSegmentationObjectID");
  bind.template add<&Objects::get_mesh_position_vertex_buffers>("simGetMeshPositionVertexBuffers");
  bind.template add<&Objects::get_object_pose>("simGetObjectPose");
  bind.template add<&Objects::set_object_pose>("simSetObjectPose");
  bind.template add<&Objects::get_object_scale>("simGetObjectScale");
  bind.template add<&Objects::set_object_scale>("simSetObjectScale");
  bind.template add<&Objects::spawn_object>("simSpawnObject");
  bind.template add<&Objects::destroy_object>("simDestroyObject");
  bind.template add<&Objects::list_assets>("simListAssets");
  bind.template add<&Place::create_voxel_grid>("simCreateVoxelGrid");
  bind.template add<&Place::test_line_of_sight_to_point>("simTestLineOfSightToPoint");
  bind.template add<&Place::test_line_of_sight_between_points>("simTestLineOfSightBetweenPoints");
  bind.template add<&Place::get_world_extents>("simGetWorldExtents");
  bind.template add<&Environment::set_wind>("simSetWind");
  bind.template add<&Environment::set_time_of_day>("simSetTimeOfDay");
  bind.template add<&Environment::enable_weather>("simEnableWeather");
  bind.template add<&Environment::set_weather_parameter>("simSetWeatherParameter");
  bind.table().template add<bool, std::string>(
      "simLoadLevel", [caller = bind.caller()](const std::string& name) { return caller.load_level(name); });
}

template <class Caller>
void add_flight_methods(MethodBinder<Caller>& bind) {
  bind.template add<&Flight::cancel_last_task>("cancelLastTask");
  bind.template add_waiting<&Flight::takeoff>("takeoff");
  bind.template add_waiting<&Flight::land>("land");
  bind.template add_waiting<&Flight::go_home>("goHome");
  bind.template add_waiting<&Flight::hover>("hover");
  bind.template add_waiting<&Flight::move_to_position>("moveToPosition");
  bind.template add_waiting<&Flight::move_on_path>("moveOnPath");
  bind.template add_waiting<&Flight::move_by_velocity>("moveByVelocity");
  bind.template add_waiting<&Flight::move_by_velocity_z>("moveByVelocityZ");
  bind.template add_waiting<&Flight::move_by_velocity_body_frame>("moveByVelocityBodyFrame");
  bind.template add_waiting<&Flight::move_by_velocity_z_body_frame>("moveByVelocityZBodyFrame");
  bind.template add_waiting<&Flight::move_to_z>("moveToZ");
  bind.template add_waiting<&Flight::move_to_gps>("moveToGPS");
  bind.template add_waiting<&Flight::move_by_roll_pitch_yaw_z>("moveByRollPitchYawZ");
  bind.template add_waiting<&Flight::move_by_roll_pitch_yaw_throttle>("moveByRollPitchYawThrottle");
  bind.template add_waiting<&Flight::move_by_roll_pitch_yawrate_z>("moveByRollPitchYawrateZ");
  bind.template add_waiting<&Flight::move_by_roll_pitch_yawrate_throttle>("moveByRollPitchYawrateThrottle");
  bind.template add_waiting<&Flight::move_by_angle_rates_z>("moveByAngleRatesZ");
  bind.template add_waiting<&Flight::move_by_angle_rates_throttle>("moveByAngleRatesThrottle");
  bind.template add_waiting<&Flight::rotate_to_yaw>("rotateToYaw");
  bind.template add_waiting<&Flight::rotate_by_yaw_rate>("rotateByYawRate");
}

/// Adds the calls that are accepted without effect, and those that are refused.
template <class Caller>
void add_ignored_and_unsupported_methods(MethodBinder<Caller>& bind) {
  for (const char* name : {"simFlushPersistentMarkers", "simPlotPoints", "simPlotLineStrip", "simPlotLineList",
                           "simPlotArrows", "simPlotStrings", "simPlotTransforms", "simPlotTransformsWithNames",
                           "simSetTraceLine", "setAngleRateControllerGains", "setAngleLevelControllerGains",
                           "setVelocityControllerGains", "setPositionControllerGains"}) {
    bind.accept(name);
  }
  for (const char* name : {"simSetLightIntensity", "simSetObjectMaterial", "simSetObjectMaterialFromTexture"})
    bind.accept(name, false);
  bind.accept("simSwapTextures", std::vector<std::string>());
  for (const char* name : {"simSetExtForce",
                           "simGetPresetLensSettings",
                           "simGetLensSettings",
                           "simSetPresetLensSettings",
                           "simGetPresetFilmbackSettings",
                           "simSetPresetFilmbackSettings",
                           "simSetFilmbackSettings",
                           "simSetFocalLength",
                           "simEnableManualFocus",
                           "simGetFocusDistance",
                           "simSetFocusDistance",
                           "simGetFocusAperture",
                           "simSetFocusAperture",
                           "simEnableFocusPlane",
                           "moveByRC",
                           "moveByManual",
                           "moveByMotorPWMs",
                           "moveByAngleZ",
                           "moveByAngleThrottle",
                           "setSafety",
                           "setCarControls",
                           "getCarControls",
                           "getCarState"}) {
    bind.refuse(name);
  }
  for (const char* name : {"moveByManual", "moveByMotorPWMs", "moveByAngleZ", "moveByAngleThrottle"})
    bind.table().mark_waiting(name);  // for the log
}

/// Adds simGetImage, whose last argument is the flag for external cameras or the layer of an annotation image.
template <class Caller>
void add_get_image(MethodBinder<Caller>& bind) {
  using Bytes = std::vector<std::uint8_t>;
  bind.table().template add<Bytes, std::string, int, std::string, ExternalFlag>(
      "simGetImage", [caller = bind.caller()](const std::string& camera, int image_type, const std::string& vehicle,
                                              const ExternalFlag& last) {
        return caller.template call<&Cameras::get_image, Bytes>(camera, image_type, vehicle, last.value,
                                                                last.annotation_name);
      });
}

template <class Caller>
void add_annotation_methods(MethodBinder<Caller>& bind) {
  bind.template add<&Labels::list_annotation_objects>("simListAnnotationObjects");
  bind.template add<&Labels::list_annotation_poses>("simListAnnotationPoses");
  bind.template add<&Labels::set_annotation_object_id>("simSetAnnotationObjectID");
  bind.template add<&Labels::get_annotation_object_id>("simGetAnnotationObjectID");
  bind.template add<&Labels::set_annotation_object_color>("simSetAnnotationObjectColor");
  bind.template add<&Labels::get_annotation_object_color>("simGetAnnotationObjectColor");
  bind.template add<&Labels::set_annotation_object_value>("simSetAnnotationObjectValue");
  bind.template add<&Labels::get_annotation_object_value>("simGetAnnotationObjectValue");
  bind.accept("simSetAnnotationObjectTextureByPath", false);
  bind.accept("simEnableAnnotationObjectTextureByPath", false);
  bind.table().template add<std::string, std::string, std::string>(
      "simGetAnnotationObjectTexturePath", [](const std::string&, const std::string&) { return std::string(); });
}

template <class Caller>
void add_cosys_methods(MethodBinder<Caller>& bind) {
  add_get_image(bind);
  add_annotation_methods(bind);
  bind.table().template add<simulator::Pose, std::string, bool>(
      "simGetObjectPose", [caller = bind.caller()](const std::string& name, bool /*ned*/) {
        return caller.template call<&Objects::get_object_pose, simulator::Pose>(name);
      });
  bind.template add<&Objects::list_scene_objects_tags>("simListSceneObjectsTags");
  bind.template add<&Labels::list_instance_segmentation_objects>("simListInstanceSegmentationObjects");
  bind.template add<&Labels::list_instance_segmentation_poses>("simListInstanceSegmentationPoses");
  bind.template add<&Labels::get_instance_segmentation_color_map>("simGetInstanceSegmentationColorMap");
  bind.template add<&Sensors::get_gpu_lidar_data>("getGPULidarData");
  bind.template add<&Sensors::get_echo_data>("getEchoData");
  bind.template add<&Vehicles::get_computer_vision_state>("getComputerVisionState");
  bind.template add<&Vehicles::get_ground_truth_kinematics>("simGetPhysicsRawKinematics");
  bind.accept("setEchoData");
  for (const char* name : {"simSetWorldLightVisibility", "simSetWorldLightIntensity", "simSetVehicleLightVisibility",
                           "simSetVehicleLightIntensity"})
    bind.accept(name, false);
  for (const char* name :
       {"simSetPhysicsRawKinematics", "getUWBData", "getUWBSensorData", "getWifiData", "getWifiSensorData"})
    bind.refuse(name);
}

/// Marks the methods that render, cast rays through the place, or read tiles or meshes.
inline void mark_slow_methods(rpc::MethodTable& table) {
  for (const char* name : {"simGetImages",
                           "simGetImage",
                           "simGetDetections",
                           "getLidarData",
                           "simGetLidarSegmentation",
                           "getGPULidarData",
                           "getEchoData",
                           "getDistanceSensorData",
                           "simSpawnObject",
                           "simGetMeshPositionVertexBuffers",
                           "simListSceneObjects",
                           "simListInstanceSegmentationObjects",
                           "simListInstanceSegmentationPoses",
                           "simListAnnotationObjects",
                           "simListAnnotationPoses",
                           "simCreateVoxelGrid",
                           "simTestLineOfSightToPoint",
                           "simTestLineOfSightBetweenPoints",
                           "simLoadLevel",
                           "tfLoadRegion",
                           "tfGroundTruth",
                           "tfCreateVoxelGrid",
                           "tfLidarScan",
                           "tfCoverage"})
    table.mark_slow(name);
}

template <class Caller>
void add_airsim_methods(MethodBinder<Caller>& bind) {
  add_general_methods(bind);
  add_camera_methods(bind);
  add_state_methods(bind);
  add_scene_methods(bind);
  add_flight_methods(bind);
  add_ignored_and_unsupported_methods(bind);
  add_cosys_methods(bind);
}

/// Adds the extensions. `statistics` returns those of the server that serves the table.
template <class Caller>
void add_extension_methods(MethodBinder<Caller>& bind, const std::function<rpc::ServerStatistics()>& statistics) {
  bind.template add<&Place::load_region>("tfLoadRegion");
  bind.template add<&Place::ground_truth>("tfGroundTruth");
  bind.template add<&Vehicles::geodetic_pose>("tfGeodeticPose");
  bind.template add<&Place::voxel_grid>("tfCreateVoxelGrid");
  bind.template add<&Sensors::lidar_scan>("tfLidarScan");
  bind.template add_camera_method<&Cameras::coverage>("tfCoverage");
  bind.template add_camera_method<&Cameras::set_lens>("tfSetLens");
  bind.table().template add<StatisticsResponse>("tfStatistics", [caller = bind.caller(), statistics] {
    return StatisticsResponse{caller.template call<&Simulator::statistics, simulator::Statistics>(), statistics()};
  });
  // For a server without a token, any token is accepted.
  bind.table().template add<bool, std::string>(kAuthenticateMethod, [](const std::string&) { return true; });
}

}  // namespace tileflight::airsim
