#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/capture/vehicle/airframe.h"
#include "tileflight/core/base/strict_section.h"
#include "tileflight/core/geometry/geodesy.h"
#include "tileflight/core/imaging/camera.h"
#include "tileflight/live/simulator/airsim_types.h"
#include "tileflight/live/simulator/object_labels.h"
#include "tileflight/live/simulator/sensor_settings.h"

namespace tileflight::simulator {

/// The interfaces of autopilots that fly vehicles.
enum class AutopilotKind {
  kArduPilot,  ///< VehicleType ArduCopter: ArduPilot's JSON interface, UDP
  kPx4,        ///< VehicleType PX4Multirotor: PX4's simulator interface, MAVLink over TCP
};

/// Source of an autopilot's vision input, the message ODOMETRY.
enum class VisionSource {
  kNone,
  kTruth,     ///< the true pose and velocity with white noise
  kPictures,  ///< the built-in odometry, on a camera's pictures and the inertial unit's readings
  kPlace,     ///< the same pictures located in tiles of the place
};

struct VisionSettings {
  VisionSource source = VisionSource::kNone;
  std::string place;  ///< of kPlace: SOURCE of the tiles to locate pictures in; empty: those that are flown over
  // The following hold for kPictures and kPlace:
  std::string camera = "bottom_center";  ///< name of the vehicle's camera
  double rate_hz = 15.0;                 ///< rate of images; their interval is rounded to whole steps of the autopilot
  double latency_s = 0.1;                ///< time from the exposure to the message

  bool uses_camera() const { return source == VisionSource::kPictures || source == VisionSource::kPlace; }
};

/// An autopilot that flies a vehicle: its interface, and properties of the vehicle.
struct AutopilotSettings {
  AutopilotKind kind = AutopilotKind::kArduPilot;
  int port = 9002;       ///< ControlPort or TcpPort, on which the simulator listens; 0: any free port
  bool lockstep = true;  ///< PX4 only: LockStep
  vehicle::AirframeKind airframe = vehicle::AirframeKind::kQuadX;
  bool optical_flow = false;  ///< PX4 only: own key OpticalFlow, sends HIL_OPTICAL_FLOW
  VisionSettings vision;      ///< PX4 only: own keys VisionOdometry, VisionPlace, VisionCamera, VisionRate,
                              ///< VisionLatency
  double thrust_expo = 0.65;  ///< own key ThrustExpo of the motors; the default is that of the autopilot's parameters
};

/// Reads a vehicle's autopilot keys; nullopt for a VehicleType without an autopilot. Throws InputError.
std::optional<AutopilotSettings> read_autopilot(const std::string& vehicle_type, base::StrictSection& vehicle);

inline constexpr std::size_t kMaxVehicles = 64;

/// Capture settings of one image type. `fov_deg` is horizontal, or vertical if the image has more rows than columns.
struct CaptureSettings {
  int width = 256, height = 144;
  double fov_deg = 90.0;
  std::optional<LensDescription> lens;  ///< own key "Lens": replaces the pinhole
};

/// A camera: its pose on the vehicle and its capture settings by image type.
struct CameraSettings {
  std::string name;
  geometry::SE3 T_body_camera;  ///< camera axes forward, right, down; for external cameras relative to global NED
  std::array<CaptureSettings, kImageTypeCount> captures{};
};

/// A vehicle: its start pose, its cameras and its sensors.
struct VehicleSettings {
  std::string name;
  bool flies = true;                                  ///< false: it stays where it is placed
  geometry::Vec3 start_ned = geometry::Vec3::Zero();  ///< global NED, metres
  Eigen::Quaterniond R_ned_body = Eigen::Quaterniond::Identity();
  bool armed = true;              ///< at start and after reset: DefaultVehicleState is neither Disarmed nor Inactive
  bool allow_api_always = false;  ///< AllowAPIAlways: needs no enableApiControl
  bool enable_collisions = true;  ///< EnableCollisions and no EnableCollisionPassthrogh
  std::optional<AutopilotSettings> autopilot;  ///< flies the vehicle in place of clients
  std::vector<CameraSettings> cameras;
  std::vector<SensorSettings> sensors;
};

/// One image type that a recording stores.
struct RecordingCamera {
  std::string camera;
  int image_type = 0;
  bool pixels_as_float = false;
  bool compress = true;
  std::string vehicle;     ///< empty: every vehicle
  std::string annotation;  ///< the layer of images of type Annotation
};

/// Recording settings.
struct RecordingSettings {
  bool enabled = false;
  bool on_move = false;
  double interval_s = 0.05;
  std::string folder;    ///< empty: not given
  bool dataset = false;  ///< own key "Dataset": also write a dataset folder
  std::vector<RecordingCamera> cameras{{"", 0, false, true, ""}};
};

/// Settings of the simulation clock.
struct ClockSettings {
  double speed = 1.0;          ///< seconds of simulation time per wall-clock second
  bool on_demand = false;      ///< own key "StepOnDemand": time advances only while a task runs, as fast as possible
  bool by_autopilots = false;  ///< autopilots' packets advance time; there is a vehicle with one
  /// Time advances only where SimulationClock::drive_to() says so, as fast as possible: a recorded session is repeated.
  bool driven = false;
  std::optional<std::uint64_t> start_ns;  ///< time stamp of the start; nullopt: the machine's clock
};

/// Contents of a settings.json, with AirSim's defaults for missing keys.
struct Settings {
  bool computer_vision = false;  ///< SimMode "ComputerVision"; else "Multirotor"
  ClockSettings clock;
  std::optional<geometry::Geodetic> origin;  ///< OriginGeopoint
  bool start_on_surface = true;              ///< own key "StartOnSurface": NED's origin is placed on the surface
  std::optional<int> port;
  std::optional<std::string> address;
  geometry::Vec3 wind_ned_m_s = geometry::Vec3::Zero();
  RecordingSettings recording;
  std::vector<simulator::AnnotationSettings> annotation_layers;  ///< Cosys-AirSim's "Annotation"
  bool random_ids = true;             ///< SegmentationSettings.InitMethod: ids from the names, else all 0
  bool inverted_voxel_scale = false;  ///< own key "InvertedVoxelScale": write 1 / x in binvox files, as AirSim does
  /// Own key "Assets": files of models that clients may spawn, by name.
  std::map<std::string, std::filesystem::path> assets;
  std::vector<VehicleSettings> vehicles;  ///< at least one; the first one also has the name ""
  std::vector<CameraSettings> external_cameras;
  CameraSettings camera_defaults;     ///< for vehicles added later
  std::vector<std::string> warnings;  ///< keys that are unknown or have no effect, one line each
};

/// Parses a settings.json (comments allowed; empty: all defaults). `name` appears in messages. Throws InputError (name,
/// key, cause).
Settings read_settings(const std::string& text, const std::string& name);

/// Returns whether the text of a settings.json is blank.
bool is_blank(const std::string& settings_text);

/// Returns the default settings as a settings.json, from which clients (AirSim's ROS wrapper) read SimMode and
/// Vehicles.
std::string default_settings_text();

/// The default cameras of every vehicle: front_center, front_right, front_left, bottom_center, back_center.
std::vector<CameraSettings> default_cameras(const CameraSettings& defaults);

/// Resolves AirSim's camera aliases "0", "", "fpv" and so on; other names are returned unchanged.
std::string resolve_camera_alias(const std::string& name);

/// Returns the settings of a vehicle for which only name and kind are given.
VehicleSettings default_vehicle(const std::string& name, bool flies, const CameraSettings& camera_defaults);

/// AirSim's default origin, for places without georeference if the settings give none.
inline constexpr geometry::Geodetic kDefaultOrigin{47.641468, -122.140165, {122.0}};

/// X, Y, Z of a section, metres; missing ones are taken from `fallback`. Throws InputError.
geometry::Vec3 read_position(base::StrictSection& section, const geometry::Vec3& fallback = geometry::Vec3::Zero());

/// Roll, Pitch, Yaw of a section, degrees; missing ones are 0. Throws InputError.
Eigen::Quaterniond read_orientation(base::StrictSection& section);

/// Reads a camera's entry of settings.json (or CameraDefaults): its pose and its capture settings per image type.
/// Missing keys are taken from `defaults`. Throws InputError.
CameraSettings read_camera(const std::string& name, base::StrictSection section, const CameraSettings& defaults);

/// Returns `sensors` with the additions, replacements and removals (by name) of a `Sensors` or `DefaultSensors` object.
/// `warnings`: gains a line for each sensor of a kind that is not simulated. Throws InputError.
std::vector<SensorSettings> read_sensors(base::StrictSection& parent, const std::string& key, bool flies,
                                         std::vector<SensorSettings> sensors, std::vector<std::string>& warnings);

/// Default sensors of a vehicle without sensor settings: imu, magnetometer, gps and barometer if it flies, else none.
std::vector<SensorSettings> default_sensors(bool flies);

/// The lens of a capture: a pinhole by its field of view, or as given by "Lens". Throws InputError.
imaging::Camera make_lens(const CaptureSettings& capture, const std::string& where);

}  // namespace tileflight::simulator
