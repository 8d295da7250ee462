#pragma once

#include "tileflight/live/airsim/airsim_fields.h"
#include "tileflight/live/airsim/binder.h"
#include "tileflight/live/airsim/cosys_methods.h"

// Every method of AirSim's multirotor and computer-vision interface, under its RPC name; simGetImage, whose last
// argument differs between versions: cosys_methods.h.
namespace tileflight::airsim {

template <class Caller>
void add_general_methods(MethodBinder<Caller>& bind) {
  using S = simulator::Simulator;
  bind.template add<&S::ping>("ping");
  bind.template add<&S::get_server_version>("getServerVersion");
  bind.template add<&S::get_min_required_client_version>("getMinRequiredClientVersion");
  bind.template add<&S::reset>("reset");
  bind.template add<&S::enable_api_control>("enableApiControl");
  bind.template add<&S::is_api_control_enabled>("isApiControlEnabled");
  bind.template add<&S::arm_disarm>("armDisarm");
  bind.template add<&S::sim_pause>("simPause");
  bind.template add<&S::sim_is_paused>("simIsPaused");
  bind.template add<&S::sim_continue_for_time>("simContinueForTime");
  bind.template add<&S::sim_continue_for_frames>("simContinueForFrames");
  bind.template add<&S::get_home_geo_point>("getHomeGeoPoint");
  bind.template add<&S::list_vehicles>("listVehicles");
  bind.template add<&S::get_settings_string>("getSettingsString");
  bind.template add<&S::start_recording>("startRecording");
  bind.template add<&S::stop_recording>("stopRecording");
  bind.template add<&S::is_recording>("isRecording");
  bind.template add<&S::sim_add_vehicle>("simAddVehicle");
  bind.template add<&S::sim_run_console_command>("simRunConsoleCommand");
  bind.template add<&S::sim_print_log_message>("simPrintLogMessage");
}

template <class Caller>
void add_camera_methods(MethodBinder<Caller>& bind) {
  using S = simulator::Simulator;
  bind.template add_camera_method<&S::sim_get_images>("simGetImages");
  bind.template add_camera_method<&S::sim_get_camera_info>("simGetCameraInfo");
  bind.template add_camera_method<&S::sim_set_camera_pose>("simSetCameraPose");
  bind.template add_camera_method<&S::sim_set_camera_fov>("simSetCameraFov");
  bind.template add_camera_method<&S::sim_get_distortion_params>("simGetDistortionParams");
  bind.template add_camera_method<&S::sim_set_distortion_param>("simSetDistortionParam");
  bind.template add_camera_method<&S::sim_add_detection_filter_mesh_name>("simAddDetectionFilterMeshName");
  bind.template add_camera_method<&S::sim_set_detection_filter_radius>("simSetDetectionFilterRadius");
  bind.template add_camera_method<&S::sim_clear_detection_mesh_names>("simClearDetectionMeshNames");
  bind.template add_camera_method<&S::sim_get_detections>("simGetDetections");
}

template <class Caller>
void add_state_methods(MethodBinder<Caller>& bind) {
  using S = simulator::Simulator;
  bind.template add<&S::sim_set_vehicle_pose>("simSetVehiclePose");
  bind.template add<&S::sim_get_vehicle_pose>("simGetVehiclePose");
  bind.template add<&S::sim_get_ground_truth_kinematics>("simGetGroundTruthKinematics");
  bind.template add<&S::sim_set_kinematics>("simSetKinematics");
  bind.template add<&S::sim_get_ground_truth_environment>("simGetGroundTruthEnvironment");
  bind.template add<&S::sim_get_collision_info>("simGetCollisionInfo");
  bind.template add<&S::get_multirotor_state>("getMultirotorState");
  bind.template add<&S::get_rotor_states>("getRotorStates");
  bind.template add<&S::get_lidar_data>("getLidarData");
  bind.template add<&S::get_imu_data>("getImuData");
  bind.template add<&S::get_barometer_data>("getBarometerData");
  bind.template add<&S::get_magnetometer_data>("getMagnetometerData");
  bind.template add<&S::get_gps_data>("getGpsData");
  bind.template add<&S::get_distance_sensor_data>("getDistanceSensorData");
}

template <class Caller>
void add_scene_methods(MethodBinder<Caller>& bind) {
  using S = simulator::Simulator;
  bind.template add<&S::sim_list_scene_objects>("simListSceneObjects");
  bind.template add<&S::sim_set_segmentation_object_id>("simSetSegmentationObjectID");
  bind.template add<&S::sim_get_segmentation_object_id>("simGetSegmentationObjectID");
  bind.template add<&S::sim_get_mesh_position_vertex_buffers>("simGetMeshPositionVertexBuffers");
  bind.template add<&S::sim_get_object_pose>("simGetObjectPose");
  bind.template add<&S::sim_set_object_pose>("simSetObjectPose");
  bind.template add<&S::sim_get_object_scale>("simGetObjectScale");
  bind.template add<&S::sim_set_object_scale>("simSetObjectScale");
  bind.template add<&S::sim_spawn_object>("simSpawnObject");
  bind.template add<&S::sim_destroy_object>("simDestroyObject");
  bind.template add<&S::sim_list_assets>("simListAssets");
  bind.template add<&S::sim_create_voxel_grid>("simCreateVoxelGrid");
  bind.template add<&S::sim_test_line_of_sight_to_point>("simTestLineOfSightToPoint");
  bind.template add<&S::sim_test_line_of_sight_between_points>("simTestLineOfSightBetweenPoints");
  bind.template add<&S::sim_get_world_extents>("simGetWorldExtents");
  bind.template add<&S::sim_set_wind>("simSetWind");
  bind.template add<&S::sim_set_time_of_day>("simSetTimeOfDay");
  bind.template add<&S::sim_enable_weather>("simEnableWeather");
  bind.template add<&S::sim_set_weather_parameter>("simSetWeatherParameter");
  bind.table().template add<bool, std::string>(
      "simLoadLevel", [caller = bind.caller()](const std::string& name) { return caller.load_level(name); });
}

template <class Caller>
void add_flight_methods(MethodBinder<Caller>& bind) {
  using S = simulator::Simulator;
  bind.template add<&S::cancel_last_task>("cancelLastTask");
  bind.template add<&S::takeoff>("takeoff");
  bind.template add<&S::land>("land");
  bind.template add<&S::go_home>("goHome");
  bind.template add<&S::hover>("hover");
  bind.template add<&S::move_to_position>("moveToPosition");
  bind.template add<&S::move_on_path>("moveOnPath");
  bind.template add<&S::move_by_velocity>("moveByVelocity");
  bind.template add<&S::move_by_velocity_z>("moveByVelocityZ");
  bind.template add<&S::move_by_velocity_body_frame>("moveByVelocityBodyFrame");
  bind.template add<&S::move_by_velocity_z_body_frame>("moveByVelocityZBodyFrame");
  bind.template add<&S::move_to_z>("moveToZ");
  bind.template add<&S::move_to_gps>("moveToGPS");
  bind.template add<&S::move_by_roll_pitch_yaw_z>("moveByRollPitchYawZ");
  bind.template add<&S::move_by_roll_pitch_yaw_throttle>("moveByRollPitchYawThrottle");
  bind.template add<&S::move_by_roll_pitch_yawrate_z>("moveByRollPitchYawrateZ");
  bind.template add<&S::move_by_roll_pitch_yawrate_throttle>("moveByRollPitchYawrateThrottle");
  bind.template add<&S::move_by_angle_rates_z>("moveByAngleRatesZ");
  bind.template add<&S::move_by_angle_rates_throttle>("moveByAngleRatesThrottle");
  bind.template add<&S::rotate_to_yaw>("rotateToYaw");
  bind.template add<&S::rotate_by_yaw_rate>("rotateByYawRate");
}

/// Calls without an observable effect here, and calls that are not supported.
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
                           "simGetFilmbackSettings",
                           "simSetFilmbackSettings",
                           "simGetFocalLength",
                           "simSetFocalLength",
                           "simEnableManualFocus",
                           "simGetFocusDistance",
                           "simSetFocusDistance",
                           "simGetFocusAperture",
                           "simSetFocusAperture",
                           "simEnableFocusPlane",
                           "simGetCurrentFieldOfView",
                           "moveByRC",
                           "moveByManual",
                           "moveByMotorPWMs",
                           "setSafety",
                           "setCarControls",
                           "getCarControls",
                           "getCarState"}) {
    bind.refuse(name);
  }
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

}  // namespace tileflight::airsim
