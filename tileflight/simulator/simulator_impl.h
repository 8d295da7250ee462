#pragma once

#include <atomic>
#include <chrono>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "tileflight/simulator/craft.h"
#include "tileflight/simulator/detection.h"
#include "tileflight/simulator/engine.h"
#include "tileflight/simulator/file_access.h"
#include "tileflight/simulator/lidar_scanner.h"
#include "tileflight/simulator/picture.h"
#include "tileflight/simulator/recorder.h"
#include "tileflight/simulator/segmentation_ids.h"
#include "tileflight/simulator/sensor_unit.h"
#include "tileflight/simulator/settings.h"
#include "tileflight/simulator/simulator.h"
#include "tileflight/simulator/working_set.h"

namespace tileflight::simulator {

/// A vehicle with what belongs to it.
struct Fleet {
  std::unique_ptr<Craft> craft;
  StateHistory history;
  std::map<std::string, SensorNoise> noises;  ///< by the sensor's name
};

/// A picture that was asked for, cut loose from the simulator's state.
struct PlannedPicture {
  ImageRequest request;
  ImageType type = ImageType::kScene;
  Shot shot;
  std::vector<double> key;  ///< equal for what one pass can render
  Pose pose;                ///< of the camera, as answered
};

/// All pictures of a call, at one moment.
struct PlannedPictures {
  std::vector<PlannedPicture> pictures;
  std::vector<Look> looks;
  std::map<std::string, geometry::SE3> cameras;  ///< by vehicle and camera: where it is, local
  std::uint64_t time_ns = 0;
};

/// The simulator's state. One mutex guards all that moves; rendering, scans and reading of tiles happen without it,
/// from copies of what they need.
struct Simulator::Impl {
  Impl(const SimulatorOptions& options, SimulatorLog log, const Progress& progress);
  Impl(const SimulatorOptions& options, std::vector<imaging::TexturedMesh> meshes, SimulatorLog log);

  SimulatorOptions options;
  SimulatorLog log;
  Settings settings;
  WorkingSet world;
  std::vector<std::string> warnings;
  EarthFrame earth;
  geometry::SE3 T_local_ned;
  FileAccess files;
  SegmentationIds ids;
  PictureRenderer renderer;
  std::chrono::steady_clock::time_point started = std::chrono::steady_clock::now();
  std::atomic<std::uint64_t> images{0};
  std::atomic<double> image_seconds{0.0}, last_image_seconds{0.0};

  std::mutex recording;      ///< held while files of a recording are written; before `state` where both are
  mutable std::mutex state;  ///< guards what follows
  std::vector<std::unique_ptr<Fleet>> fleet;
  std::vector<SimCamera> external_cameras;
  std::map<std::string, geometry::SE3> last_pictures;  ///< by vehicle and camera: where the camera was, local
  std::map<std::string, DetectionFilter> detections;   ///< by vehicle, camera and kind of picture
  std::shared_ptr<const Place> obstacles_place;        ///< what vehicles run into
  geometry::Vec3 wind_ned_m_s = geometry::Vec3::Zero();
  std::unique_ptr<Recorder> recorder;
  double next_record_s = 0.0;
  Engine engine;  ///< last: its thread ends first

  // Setting up (simulator.cpp).
  void begin();
  void set_frames();
  void add_vehicle(VehicleSettings vehicle, const geometry::SE3& T_ned_home);
  geometry::SE3 home_of(const VehicleSettings& vehicle) const;
  flight::Obstacles obstacles();
  Engine::Hooks hooks();
  void say(const std::string& line) const;

  // Lookups, with the mutex held. Throw InputError or std::runtime_error.
  Fleet& vehicle(const std::string& name);
  const Fleet& vehicle(const std::string& name) const;
  Craft& flying(const std::string& name, const char* call);
  SimCamera& camera(const std::string& camera, const std::string& vehicle, bool external);
  const SimCamera& camera(const std::string& camera, const std::string& vehicle, bool external) const;
  geometry::SE3 T_ned_camera(const SimCamera& camera, const std::string& vehicle, bool external) const;
  /// Of a pose in a vehicle's local NED, and back.
  geometry::Vec3 origin_of(const std::string& vehicle, bool external) const;
  std::vector<Look> looks() const;

  // Pictures (pictures.cpp).
  PlannedPictures plan(const std::vector<ImageRequest>& requests, const std::string& vehicle, bool external) const;
  /// Flow in the next pictures is from these.
  void note_taken(const PlannedPictures& planned);
  std::vector<ImageResponse> take(const PlannedPictures& planned);

  // Detections (detecting.cpp).
  DetectionFilter& detection_filter(const std::string& camera, int image_type, const std::string& vehicle,
                                    bool external);

  // Flight (flight.cpp).
  bool fly(const std::string& vehicle, const char* call, const std::function<flight::Command(Craft&)>& command);

  // Recording (recording.cpp).
  void begin_recording();
  void record_if_due(double time_s);
  std::vector<RecordedMoment> recorded_moments();
};

/// Throws InputError where a number of a client's is not finite or farther than 10000 km.
geometry::Vec3 checked_position(const Vector3r& position, const char* what);
/// Unit length; throws InputError where it has none.
Eigen::Quaterniond checked_rotation(const Quaternionr& orientation, const char* what);
/// A pose in which what is not a number leaves `before` as it is.
geometry::SE3 merged_pose(const Pose& pose, const geometry::SE3& before, const char* what);

}  // namespace tileflight::simulator
