#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/strict_section.h"
#include "tileflight/live/simulator/autopilot_ports.h"
#include "tileflight/live/simulator/detections.h"
#include "tileflight/live/simulator/image_renderer.h"
#include "tileflight/live/simulator/lockstep_vehicle.h"
#include "tileflight/live/simulator/object_labels.h"
#include "tileflight/live/simulator/range_sensors.h"
#include "tileflight/live/simulator/recorder.h"
#include "tileflight/live/simulator/sensor_readings.h"
#include "tileflight/live/simulator/settings.h"
#include "tileflight/live/simulator/sim_vehicle.h"
#include "tileflight/live/simulator/simulation_clock.h"
#include "tileflight/live/simulator/simulator_options.h"
#include "tileflight/live/simulator/vision_input.h"
#include "tileflight/live/simulator/working_set.h"
#include "tileflight/live/simulator/world_objects.h"

namespace tileflight::simulator {

/// Restricts the files that clients may write to one folder, or forbids writing.
class ClientFileAccess {
 public:
  explicit ClientFileAccess(std::optional<std::filesystem::path> root);

  /// The path for a client's file name; relative names are below the folder. Creates its parent folders. Throws
  /// InputError if writing is forbidden, or the name is invalid or leads out of the folder (links are followed).
  std::filesystem::path resolve_writable(const std::string& name) const;
  const std::optional<std::filesystem::path>& root() const { return root_; }

 private:
  std::optional<std::filesystem::path> root_;  ///< canonical
};

inline constexpr double kHistory_s = 0.5;  ///< length of each vehicle's history of states

/// Holds where a vehicle has located itself: in a world at its start with axes north, west, up.
struct VehicleLocation {
  std::uint64_t time_ns = 0;  ///< of the image
  odometry::MetricEstimate estimate;
  geometry::SE3 T_local_world;
};

/// A vehicle with its state history and sensor noise.
struct VehicleSlot {
  std::unique_ptr<SimVehicle> vehicle;
  StateHistory history;
  SensorNoises sensor_noises;
  SensorNoises view_noises;                 ///< for Viewer::imu()
  std::unique_ptr<VisionInput> vision;      ///< null without vision from images; used by the autopilot's thread
  std::optional<VehicleLocation> location;  ///< latest, of a vehicle that locates itself in tiles
};

/// Time of day and weather, as clients set them.
class Outdoors {
 public:
  /// The numbers of AirSim's WeatherParameter that have an effect: Rain, Roadwetness, Snow, Dust, Fog.
  enum Parameter { kRain = 0, kRoadWetness = 1, kSnow = 2, kDust = 6, kFog = 7, kEnabled = 8 };

  /// Lets the sun move from `start` on, which is at `clock_s` of the simulation, by `speed` seconds a second, in steps
  /// of `interval_s` (0: continuously).
  void set_time_of_day(const Sunlight& start, double clock_s, double speed, double interval_s);
  void end_time_of_day() { celestial_clock_.reset(); }
  void enable_weather(bool enable);
  /// Sets a parameter to a value from 0 to 1. Returns false for a parameter without effect.
  bool set_parameter(int parameter, double value);

  /// Returns the light and weather of images at a time of the simulation. `wind_m_s`: east, north, up.
  Outlook outlook(double clock_s, const geometry::Vec3& wind_m_s) const;

 private:
  struct CelestialClock {
    Sunlight start;
    double clock_s, speed, interval_s;
  };
  std::optional<CelestialClock> celestial_clock_;
  bool has_weather_ = false;
  std::array<double, 9> values_{};
  /// The weather of the latest outlook. It is kept as long as nothing changes, so that renderers can be reused.
  mutable std::shared_ptr<const render::WeatherOptions> weather_;
};

/// Converts AirSim's parameters (0 to 1 each, 0 is none) to weather: the visibility in fog is 5000 m (20 / 5000)^fog,
/// in dust 5000 m (50 / 5000)^dust; rain is 100 mm/h rain^2, snow 10 mm/h snow^2; wetness stays as it is.
render::WeatherOptions weather_of_parameters(double fog, double dust, double rain, double snow, double wetness);

/// A requested image, independent of the simulator's state.
struct PlannedImage {
  ImageRequest request;
  ImageType type = ImageType::kScene;
  CameraView view;
  std::vector<double> key;  ///< images with equal keys can be rendered in one pass
  Pose pose;                ///< camera pose, as returned to the client
};

/// All images of a call, at one time.
struct PlannedImages {
  std::vector<PlannedImage> images;
  std::vector<SensorViewpoint> viewpoints;
  std::map<std::string, geometry::SE3> camera_poses;  ///< by vehicle and camera: current pose, local frame
  std::uint64_t time_ns = 0;
  ObjectList objects;
  Outlook outlook;
};

/// Camera pose and objects at a camera's latest image, for optical flow.
struct LatestPicture {
  geometry::SE3 T_local_camera;
  ObjectList objects;
};

/// The simulator's state. One mutex guards all mutable state; rendering, scans and tile loading run without it, on
/// copies of the data they need.
struct World {
  /// Opens `options.source`, or uses `meshes` as the place if they are given.
  World(const SimulatorOptions& options, std::optional<std::vector<imaging::TexturedMesh>> meshes, SimulatorLog log,
        const Progress& progress);

  SimulatorOptions options;
  SimulatorLog log;
  Settings settings;
  WorkingSet working_set;
  WorldObjects world_objects;
  std::vector<std::string> warnings;
  GeodeticFrame geodetic_frame;
  geometry::SE3 T_local_ned;
  ClientFileAccess file_access;
  simulator::SegmentationIds segmentation_ids;
  simulator::AnnotationLayers annotation_layers;
  ImageRenderer renderer;
  std::chrono::steady_clock::time_point started = std::chrono::steady_clock::now();
  std::atomic<std::uint64_t> images{0};
  std::atomic<double> image_seconds{0.0}, last_image_seconds{0.0};

  std::mutex recording_mutex;      ///< held while recording files are written; locked before `state_mutex`
  mutable std::mutex state_mutex;  ///< guards the members below
  std::vector<std::unique_ptr<VehicleSlot>> vehicles;
  std::vector<SimCamera> external_cameras;
  std::map<std::string, LatestPicture> last_pictures;        ///< by vehicle and camera
  std::map<std::string, DetectionFilter> detection_filters;  ///< by vehicle, camera and image type
  std::shared_ptr<const ResidentScene> obstacle_scene;       ///< obstacles of the vehicles
  geometry::Vec3 wind_ned_m_s = geometry::Vec3::Zero();
  Outdoors outdoors;
  std::set<std::string> told_calls;  ///< calls without effect that were already logged
  std::unique_ptr<Recorder> recorder;
  double next_record_s = 0.0;
  LockstepTimes lockstep_times;
  SimulationClock clock;  ///< below the members that its thread uses, so that it ends first
  std::vector<std::unique_ptr<ArduPilotPort>> ardupilot_ports;  ///< stopped after the clock
  std::vector<std::unique_ptr<Px4Port>> px4_ports;              ///< the same
  std::map<std::string, LockstepVehicle> repeated_vehicles;     ///< by name; of a session that is repeated

  // Setup.
  void initialize();
  void set_frames();
  void add_vehicle(VehicleSettings vehicle, const geometry::SE3& T_ned_home);
  geometry::SE3 find_home_pose(const VehicleSettings& vehicle) const;
  /// Opens the tiles in which a vehicle locates its pictures; null: it does not.
  std::shared_ptr<WorkingSet> vision_tiles(const VehicleSettings& vehicle) const;
  vehicle::ObstacleQuery obstacle_query();
  SimulationClock::Hooks clock_hooks();
  void open_autopilot_ports();
  void log_line(const std::string& line) const;
  /// Logs once that a call has no effect, and why.
  void tell_once(const std::string& call, const std::string& reason);

  // Lookups; the mutex must be held. Throw InputError or std::runtime_error.
  VehicleSlot& slot(const std::string& name) const;
  SimVehicle& require_multirotor(const std::string& name, const char* call);
  SimCamera& camera(const std::string& name, const std::string& vehicle_name, bool external);
  geometry::SE3 T_ned_camera(const SimCamera& camera, const std::string& vehicle_name, bool external) const;
  /// Returns the origin of a vehicle's local NED in global NED; zero for external cameras.
  geometry::Vec3 ned_origin(const std::string& vehicle_name, bool external) const;
  std::vector<SensorViewpoint> viewpoints() const;
  /// Returns the context of a sensor reading at the clock's time.
  SensorContext sensor_context(const VehicleSlot& one) const;

  // These return the tiles with the objects of clients. The mutex must not be held.
  std::shared_ptr<const ResidentScene> place_for(std::span<const SensorViewpoint> viewpoints);
  std::shared_ptr<const ResidentScene> place_now();
  /// Makes the present objects obstacles of the vehicles.
  void update_obstacles();

  // Images (cameras.cpp).
  PlannedImages plan_images(const std::vector<ImageRequest>& requests, const std::string& vehicle, bool external);
  /// Stores the poses from which the next images' optical flow is computed.
  void remember_camera_poses(const PlannedImages& planned);
  std::vector<ImageResponse> render_images(const PlannedImages& planned);
  /// Renders the colours of the first planned image.
  imaging::RgbImage render_colours(const PlannedImages& planned);
  std::vector<imaging::Rgb8> annotation_colours(const ResidentScene& place, const std::string& layer) const;

  // Detections (detections.cpp).
  DetectionFilter& detection_filter(const std::string& camera, int image_type, const std::string& vehicle,
                                    bool external);

  // Flight (flight.cpp).
  bool run_command(const std::string& name, const char* call,
                   const std::function<vehicle::Command(SimVehicle&)>& command);
  std::shared_ptr<const vehicle::Task> begin_task(const std::string& name, const char* call,
                                                  const std::function<vehicle::Command(SimVehicle&)>& command);

  // Recording (recording.cpp).
  void begin_recording();
  void record_if_due(double time_s);
  std::vector<RecordingFrame> capture_recording_frames();
};

/// Throws InputError if a client's number is not finite or beyond 10000 km.
geometry::Vec3 checked_position(const Vector3r& position, const char* what);
/// Normalized rotation; throws InputError if its length is zero.
Eigen::Quaterniond checked_rotation(const Quaternionr& orientation, const char* what);
/// Converts a client's pose; components that are NaN keep those of `before`.
geometry::SE3 merge_pose(const Pose& pose, const geometry::SE3& before, const char* what);

}  // namespace tileflight::simulator
