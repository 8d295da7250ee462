#pragma once

#include <array>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/geometry/geodesy.h"
#include "tileflight/imaging/camera.h"
#include "tileflight/simulator/airsim_types.h"
#include "tileflight/simulator/sensor_settings.h"

namespace tileflight::simulator {

/// How a camera takes one kind of picture. Of an image with more rows than columns `fov_deg` is the vertical angle.
struct CaptureSettings {
  int width = 256, height = 144;
  double fov_deg = 90.0;
  std::optional<LensDescription> lens;  ///< own key "Lens": in place of the pinhole
};

struct CameraSettings {
  std::string name;
  geometry::SE3 T_body_camera;  ///< camera axes forward, right, down; of an external camera: on global NED
  std::array<CaptureSettings, kImageTypes> captures{};
};

struct VehicleSettings {
  std::string name;
  bool flies = true;                                  ///< else it goes where it is put
  geometry::Vec3 start_ned = geometry::Vec3::Zero();  ///< global NED, metres
  Eigen::Quaterniond R_ned_body = Eigen::Quaterniond::Identity();
  bool armed = false;       ///< DefaultVehicleState "Armed"
  bool api_always = false;  ///< AllowAPIAlways: needs no enableApiControl
  bool collides = true;     ///< EnableCollisions and no EnableCollisionPassthrogh
  std::vector<CameraSettings> cameras;
  std::vector<SensorSettings> sensors;
};

/// One kind of picture that a recording takes.
struct RecordedCamera {
  std::string camera;
  int image_type = 0;
  bool pixels_as_float = false;
  bool compress = true;
  std::string vehicle;  ///< empty: every vehicle
};

struct RecordingSettings {
  bool enabled = false;
  bool on_move = false;
  double interval_s = 0.05;
  std::string folder;    ///< empty: none given
  bool dataset = false;  ///< own key "Dataset": a dataset folder beside AirSim's files
  std::vector<RecordedCamera> cameras{{"", 0, false, true, ""}};
};

struct ClockSettings {
  double speed = 1.0;      ///< seconds of simulation in one of the wall's
  bool on_demand = false;  ///< own key "StepOnDemand": time passes only while something is under way, as fast as it can
};

/// A settings.json, with AirSim's defaults where it says nothing.
struct Settings {
  bool computer_vision = false;  ///< SimMode "ComputerVision"; else "Multirotor"
  ClockSettings clock;
  std::optional<geometry::Geodetic> origin;  ///< OriginGeopoint
  bool start_on_surface = true;              ///< own key "StartOnSurface": NED's origin is put on the surface
  std::optional<int> port;
  std::optional<std::string> address;
  geometry::Vec3 wind_ned_m_s = geometry::Vec3::Zero();
  RecordingSettings recording;
  bool random_ids = true;                 ///< SegmentationSettings.InitMethod: ids by the names' letters, else all 0
  bool inverted_voxel_scale = false;      ///< own key "InvertedVoxelScale": 1 / x in binvox files, as AirSim writes
  std::vector<VehicleSettings> vehicles;  ///< at least one; the first is that of the name ""
  std::vector<CameraSettings> external_cameras;
  CameraSettings camera_defaults;     ///< for vehicles that are added
  std::vector<std::string> warnings;  ///< keys that are not known or have no effect here, one line each
};

/// Reads the text of a settings.json (comments allowed; empty: all defaults). `name` is for messages. Throws InputError
/// (name, key, what is wrong).
Settings read_settings(const std::string& text, const std::string& name);

/// The cameras that every vehicle has: front_center, front_right, front_left, bottom_center, back_center.
std::vector<CameraSettings> default_cameras(const CameraSettings& defaults);

/// "0", "", "fpv" and so on: what they stand for; other names as they are.
std::string camera_of_alias(const std::string& name);

/// A vehicle as if only its name and kind had been written down.
VehicleSettings default_vehicle(const std::string& name, bool flies, const CameraSettings& camera_defaults);

}  // namespace tileflight::simulator
