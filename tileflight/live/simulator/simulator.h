#pragma once

#include <array>
#include <chrono>
#include <filesystem>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/core/base/progress.h"
#include "tileflight/live/autopilot/autopilot_event.h"
#include "tileflight/live/simulator/airsim_types.h"
#include "tileflight/live/simulator/observation.h"
#include "tileflight/tiles/tileset/load.h"

namespace tileflight::autopilot {
class SharedPorts;
}

namespace tileflight::simulator {

// Types of another room that appear in this interface.
using autopilot::AutopilotEvent;
using autopilot::AutopilotJournal;

/// Policy for loading tiles.
enum class TileResidency {
  kAuto,    ///< the region if it fits into half of the memory limit, else the visible tiles
  kRegion,  ///< the whole region (or tileset), loaded once
  kFollow,  ///< everything visible to any sensor of any vehicle
};

/// Place, settings and limits of a simulator.
struct SimulatorOptions {
  std::string source;  ///< SOURCE of the command line
  tileset::LoadOptions
      load;              ///< region, geometric error, origin (the settings' origin takes precedence), source options
  std::string settings;  ///< text of a settings.json; empty: none
  std::string settings_name = "settings.json";  ///< used in messages
  TileResidency residency = TileResidency::kAuto;
  double error_px = 1.0;  ///< allowed error of a tile in any image, if tiles follow the sensors
  std::uintmax_t max_memory_bytes = std::uintmax_t{2} << 30;  ///< for decoded tiles
  /// Tiles farther from every sensor are left out, if tiles follow the sensors.
  double max_distance_m = std::numeric_limits<double>::infinity();
  /// Tiles that could not be read are requested again after this time, if tiles follow the sensors.
  std::chrono::milliseconds retry_after{10'000};
  std::string autopilot_address = "127.0.0.1";  ///< on which ports of autopilots are opened
  bool prefetch = true;                         ///< read tiles ahead in the background; no result depends on it
  /// Root of clients' file names. nullopt: calls that write files are refused.
  std::optional<std::filesystem::path> output_root;
  /// Models that clients may spawn beside the built-in ones, by their names (--asset; the settings may name more).
  std::map<std::string, std::filesystem::path> assets;
  /// Origin of NED in the local frame (east, north, up); a z of NaN: on the surface. Default: on the surface at the
  /// local frame's origin, or if there is none, at the centre of the place.
  std::optional<geometry::Vec3> ned_origin_local;
  /// Ports of autopilots that several worlds use, one after another; nullptr: its own.
  std::shared_ptr<autopilot::SharedPorts> autopilot_ports;
  AutopilotJournal journal;  ///< of a session that is recorded
  /// A recorded session is repeated: advance_to() moves the time, and apply() replaces the autopilots, whose ports are
  /// not opened.
  bool repeats_session = false;
  std::optional<std::uint64_t> clock_start_ns;  ///< time stamp of the start; nullopt: as the settings have it
};

/// Receives one-line messages about events not visible to a caller (tiles that fail, ignored commands). Called from any
/// thread.
using SimulatorLog = std::function<void(const std::string& line)>;

/// The world behind AirSim's interface: one method for each of its calls, named after it (simGetImages:
/// sim_get_images), with the same arguments in the same order. All methods are thread-safe. Calls that move a vehicle
/// (takeoff, moveToPosition, ...) block until they are finished (true), cancelled or timed out (false). Every call
/// throws InputError or std::runtime_error with a one-line message on failure.
class Simulator {
 public:
  /// Reads settings and tileset and starts the clock. Throws InputError.
  explicit Simulator(const SimulatorOptions& options, SimulatorLog log = {}, const Progress& progress = {});
  /// Simulates a place given as meshes (local frame, east, north, up); `options.source` is ignored.
  Simulator(const SimulatorOptions& options, std::vector<imaging::TexturedMesh> meshes, SimulatorLog log = {});
  ~Simulator();
  Simulator(const Simulator&) = delete;
  Simulator& operator=(const Simulator&) = delete;

  /// Cancels all tasks and unblocks all waiting calls; moving calls then return false.
  void stop();
  /// Port and address in the settings (ApiServerPort, LocalHostIp), if given.
  std::optional<int> settings_port() const;
  std::optional<std::string> settings_address() const;
  /// Warnings about settings and place for the user, one line each.
  std::vector<std::string> warnings() const;
  /// Ports at which autopilots are expected.
  std::vector<AutopilotEndpoint> autopilots() const;

  /// Exclusive access to the world for one call of a recorded session: simulation time stands still and other turns
  /// wait until it is destroyed, or until the call waits for the simulation (which ends the turn). For one thread.
  class Turn {
   public:
    /// Waits for the turn.
    explicit Turn(Simulator& simulator);
    ~Turn();
    Turn(const Turn&) = delete;
    Turn& operator=(const Turn&) = delete;
    std::int64_t tick() const { return tick_; }  ///< steps that the clock had made when it began

   private:
    Simulator& simulator_;
    std::int64_t tick_ = 0;
  };
  std::int64_t tick() const;  ///< steps that the clock has made
  std::uint64_t clock_start_ns() const;
  /// With SimulatorOptions::repeats_session: advances to that step, as fast as possible.
  void advance_to(std::int64_t tick);
  /// The same: repeats what an autopilot did, at the present step. What is sent to it: kSensors. Throws InputError for
  /// a vehicle without an autopilot.
  std::string apply(const AutopilotEvent& event);

  // General.
  bool ping() const;
  int get_server_version() const;               ///< 1
  int get_min_required_client_version() const;  ///< 1
  void reset();
  void enable_api_control(bool is_enabled, const std::string& vehicle);
  bool is_api_control_enabled(const std::string& vehicle) const;
  /// False, and nothing changes: without API control (AirSim's answer), or to disarm a vehicle in the air.
  bool arm_disarm(bool arm, const std::string& vehicle);
  void sim_pause(bool is_paused);
  bool sim_is_paused() const;
  void sim_continue_for_time(double seconds);          ///< simulation time; blocks, then pauses
  void sim_continue_for_frames(std::uint32_t frames);  ///< clock steps; blocks, then pauses
  GeoPoint get_home_geo_point(const std::string& vehicle) const;
  std::vector<std::string> list_vehicles() const;
  std::string get_settings_string() const;  ///< as given; without any, default_settings_text()

  // Images and cameras.
  std::vector<ImageResponse> sim_get_images(const std::vector<ImageRequest>& requests, const std::string& vehicle,
                                            bool external);
  std::vector<std::uint8_t> sim_get_image(const std::string& camera, int image_type, const std::string& vehicle,
                                          bool external, const std::string& annotation_name = "");
  void sim_set_vehicle_pose(const Pose& pose, bool ignore_collision, const std::string& vehicle);
  Pose sim_get_vehicle_pose(const std::string& vehicle) const;
  CameraInfo sim_get_camera_info(const std::string& camera, const std::string& vehicle, bool external) const;
  void sim_set_camera_pose(const std::string& camera, const Pose& pose, const std::string& vehicle, bool external);
  void sim_set_camera_fov(const std::string& camera, float fov_degrees, const std::string& vehicle, bool external);
  std::vector<float> sim_get_distortion_params(const std::string& camera, const std::string& vehicle,
                                               bool external) const;
  void sim_set_distortion_param(const std::string& camera, const std::string& name, float value,
                                const std::string& vehicle, bool external);

  // State of the vehicles.
  KinematicsState sim_get_ground_truth_kinematics(const std::string& vehicle) const;
  void sim_set_kinematics(const KinematicsState& state, bool ignore_collision, const std::string& vehicle);
  EnvironmentState sim_get_ground_truth_environment(const std::string& vehicle) const;
  CollisionInfo sim_get_collision_info(const std::string& vehicle);
  MultirotorState get_multirotor_state(const std::string& vehicle) const;
  RotorStates get_rotor_states(const std::string& vehicle) const;

  // Sensors.
  LidarData get_lidar_data(const std::string& lidar, const std::string& vehicle);
  ImuData get_imu_data(const std::string& imu, const std::string& vehicle);
  BarometerData get_barometer_data(const std::string& barometer, const std::string& vehicle);
  MagnetometerData get_magnetometer_data(const std::string& magnetometer, const std::string& vehicle);
  GpsData get_gps_data(const std::string& gps, const std::string& vehicle);
  DistanceSensorData get_distance_sensor_data(const std::string& distance_sensor, const std::string& vehicle);

  // Objects of the scene.
  std::vector<std::string> sim_list_scene_objects(const std::string& name_regex);
  bool sim_set_segmentation_object_id(const std::string& mesh_name, int object_id, bool is_name_regex);
  int sim_get_segmentation_object_id(const std::string& mesh_name);
  std::vector<MeshPositionVertexBuffersResponse> sim_get_mesh_position_vertex_buffers();
  Pose sim_get_object_pose(const std::string& name);
  /// Of objects that clients spawned; false for others. Objects are moved at once, with and without `teleport`.
  bool sim_set_object_pose(const std::string& name, const Pose& pose, bool teleport);
  Vector3r sim_get_object_scale(const std::string& name);
  bool sim_set_object_scale(const std::string& name, const Vector3r& scale);
  std::string sim_spawn_object(const std::string& name, const std::string& asset, const Pose& pose,
                               const Vector3r& scale, bool physics, bool is_blueprint);
  bool sim_destroy_object(const std::string& name);
  std::vector<std::string> sim_list_assets() const;
  /// False where the file must not or cannot be written (AirSim's answer); the log says why.
  bool sim_create_voxel_grid(const Vector3r& position, int x, int y, int z, float resolution, const std::string& file);
  bool sim_test_line_of_sight_to_point(const GeoPoint& point, const std::string& vehicle);
  bool sim_test_line_of_sight_between_points(const GeoPoint& from, const GeoPoint& to);
  std::vector<GeoPoint> sim_get_world_extents();

  // Detections: objects of the scene in a camera's image.
  void sim_add_detection_filter_mesh_name(const std::string& camera, int image_type, const std::string& mesh_name,
                                          const std::string& vehicle, bool external);
  void sim_set_detection_filter_radius(const std::string& camera, int image_type, float radius_cm,
                                       const std::string& vehicle, bool external);
  void sim_clear_detection_mesh_names(const std::string& camera, int image_type, const std::string& vehicle,
                                      bool external);
  std::vector<DetectionInfo> sim_get_detections(const std::string& camera, int image_type, const std::string& vehicle,
                                                bool external);

  // Flight. Blocking.
  void cancel_last_task(const std::string& vehicle);
  bool takeoff(float timeout_s, const std::string& vehicle);
  bool land(float timeout_s, const std::string& vehicle);
  bool go_home(float timeout_s, const std::string& vehicle);
  bool hover(const std::string& vehicle);
  bool move_to_position(float x, float y, float z, float velocity, float timeout_s, int drivetrain,
                        const YawMode& yaw_mode, float lookahead, float adaptive_lookahead, const std::string& vehicle);
  bool move_on_path(const std::vector<Vector3r>& path, float velocity, float timeout_s, int drivetrain,
                    const YawMode& yaw_mode, float lookahead, float adaptive_lookahead, const std::string& vehicle);
  bool move_by_velocity(float vx, float vy, float vz, float duration_s, int drivetrain, const YawMode& yaw_mode,
                        const std::string& vehicle);
  bool move_by_velocity_z(float vx, float vy, float z, float duration_s, int drivetrain, const YawMode& yaw_mode,
                          const std::string& vehicle);
  bool move_by_velocity_body_frame(float vx, float vy, float vz, float duration_s, int drivetrain,
                                   const YawMode& yaw_mode, const std::string& vehicle);
  bool move_by_velocity_z_body_frame(float vx, float vy, float z, float duration_s, int drivetrain,
                                     const YawMode& yaw_mode, const std::string& vehicle);
  bool move_to_z(float z, float velocity, float timeout_s, const YawMode& yaw_mode, float lookahead,
                 float adaptive_lookahead, const std::string& vehicle);
  bool move_to_gps(float latitude, float longitude, float altitude, float velocity, float timeout_s, int drivetrain,
                   const YawMode& yaw_mode, float lookahead, float adaptive_lookahead, const std::string& vehicle);
  /// Angles in radians: roll right side down, pitch nose up, yaw clockwise from north. Throttle 1: full thrust of the
  /// rotors.
  bool move_by_roll_pitch_yaw_z(float roll, float pitch, float yaw, float z, float duration_s,
                                const std::string& vehicle);
  bool move_by_roll_pitch_yaw_throttle(float roll, float pitch, float yaw, float throttle, float duration_s,
                                       const std::string& vehicle);
  bool move_by_roll_pitch_yawrate_z(float roll, float pitch, float yaw_rate, float z, float duration_s,
                                    const std::string& vehicle);
  bool move_by_roll_pitch_yawrate_throttle(float roll, float pitch, float yaw_rate, float throttle, float duration_s,
                                           const std::string& vehicle);
  bool move_by_angle_rates_z(float roll_rate, float pitch_rate, float yaw_rate, float z, float duration_s,
                             const std::string& vehicle);
  bool move_by_angle_rates_throttle(float roll_rate, float pitch_rate, float yaw_rate, float throttle, float duration_s,
                                    const std::string& vehicle);
  bool rotate_to_yaw(float yaw_degrees, float timeout_s, float margin_degrees, const std::string& vehicle);
  bool rotate_by_yaw_rate(float yaw_rate_degrees_s, float duration_s, const std::string& vehicle);

  // Recording.
  void start_recording();
  void stop_recording();
  bool is_recording() const;

  // Calls that Cosys-AirSim adds. What is in memory is listed, whatever `only_visible`; poses are global NED with and
  // without `ned`: there is no other world frame.
  GPULidarData get_gpu_lidar_data(const std::string& lidar, const std::string& vehicle);
  EchoData get_echo_data(const std::string& echo, const std::string& vehicle);
  ComputerVisionState get_computer_vision_state(const std::string& vehicle) const;
  std::vector<std::array<std::string, 2>> sim_list_scene_objects_tags(const std::string& name_regex);  ///< without tags
  std::vector<std::string> sim_list_instance_segmentation_objects();
  /// In the order of the objects.
  std::vector<Pose> sim_list_instance_segmentation_poses(bool ned, bool only_visible);
  /// Red, green, blue (0 to 255) of the ids from 0 to 255.
  std::vector<Vector3r> sim_get_instance_segmentation_color_map() const;
  std::vector<std::string> sim_list_annotation_objects(const std::string& layer);  ///< none for an unknown layer
  std::vector<Pose> sim_list_annotation_poses(const std::string& layer, bool ned, bool only_visible);
  // Labels of objects, see AnnotationLayers.
  bool sim_set_annotation_object_id(const std::string& layer, const std::string& name, int id, bool is_name_regex);
  int sim_get_annotation_object_id(const std::string& layer, const std::string& name) const;
  bool sim_set_annotation_object_color(const std::string& layer, const std::string& name, int red, int green, int blue,
                                       bool is_name_regex);
  std::string sim_get_annotation_object_color(const std::string& layer, const std::string& name) const;
  bool sim_set_annotation_object_value(const std::string& layer, const std::string& name, float value,
                                       bool is_name_regex);
  float sim_get_annotation_object_value(const std::string& layer, const std::string& name) const;

  // Remaining AirSim calls.
  void sim_set_wind(const Vector3r& wind);
  /// Pictures by the light of sun and sky at `start_datetime` (YYYY-MM-DD hh:mm:ss in the time zone of the place's
  /// longitude, an hour less in summer time; empty: the simulation's time stamp), which then advances with the
  /// simulation's clock times `celestial_clock_speed`, in steps of `update_interval_s`. Not enabled: the light of the
  /// tiles' textures again. Enabled without `move_sun`: nothing changes. A place without a georeference stays as it is;
  /// the log says so.
  void sim_set_time_of_day(bool is_enabled, const std::string& start_datetime, bool is_start_datetime_dst,
                           float celestial_clock_speed, float update_interval_s, bool move_sun);
  void sim_enable_weather(bool enable);
  /// `parameter`: AirSim's WeatherParameter; `value`: 0 to 1 (values beyond count as these), see
  /// weather_of_parameters().
  void sim_set_weather_parameter(int parameter, float value);
  bool sim_add_vehicle(const std::string& name, const std::string& type, const Pose& pose,
                       const std::string& pawn_path);
  bool sim_run_console_command(const std::string& command);
  void sim_print_log_message(const std::string& message, const std::string& parameter, int severity);
  /// Accepts calls without effect here or on anything a client reads (simPlot..., weather, light, controller gains), so
  /// that scripts run on; the log warns of each once. `name`: the call's name in AirSim's interface.
  void accept_without_effect(const std::string& name);
  /// Throws std::runtime_error that states why this AirSim call is not supported.
  [[noreturn]] void refuse(const std::string& name) const;

  // Extensions of AirSim's interface.
  LoadedRegion tf_load_region(const Vector3r& center, const Vector3r& size, float error_m);  ///< global NED
  Coverage tf_coverage(const std::string& camera, const std::string& vehicle, bool external);
  GroundTruthReport tf_ground_truth(const Vector3r& center, const Vector3r& size, float error_m, float voxel_m,
                                    const std::string& folder);
  GeodeticPose tf_geodetic_pose(const std::string& vehicle) const;
  Statistics tf_statistics() const;
  VoxelGridData tf_create_voxel_grid(const Vector3r& center, const Vector3r& size, float resolution);
  LidarScanData tf_lidar_scan(const std::string& lidar, const std::string& vehicle);
  void tf_set_lens(const std::string& camera, const LensDescription& lens, const std::string& vehicle, bool external);

  // For viewers; without effect on anything that a client reads.
  Observation observe() const;
  /// As sim_get_images(), without effect on optical flow.
  std::vector<ImageResponse> view_images(const std::vector<ImageRequest>& requests, const std::string& vehicle);
  ObservedScan view_scan(const std::string& lidar, const std::string& vehicle);
  /// With noise of its own.
  ObservedMotion view_imu(const std::string& imu, const std::string& vehicle);
  /// Copies of the meshes in memory, local frame. nullopt: they have more triangles than `max_triangles`.
  std::optional<std::vector<imaging::TexturedMesh>> view_meshes(std::size_t max_triangles) const;

  // For nodes that command without waiting. The vehicle is put under API control and armed; its current task is
  // cancelled. Throw InputError for a vehicle that cannot do that, or values out of range.
  /// Flies with this velocity (x along the heading, y left, z up) and turn (counter-clockwise) for this time of the
  /// simulation, then hovers.
  void start_velocity(const geometry::Vec3& velocity_m_s, double yaw_rate_rad_s, double duration_s,
                      const std::string& vehicle);
  /// A vehicle that flies starts flying there, at 5 m/s at most, and turns to the pose's heading; a camera without a
  /// vehicle is moved at once. Body axes x forward, y left, z up.
  void start_pose(const geometry::SE3& T_local_body, const std::string& vehicle);

  struct Impl;

 private:
  /// Logs that a call has no effect, and why, once.
  void tell_once(const std::string& call, const std::string& reason);

  std::unique_ptr<Impl> impl_;
};

}  // namespace tileflight::simulator
