#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/core/geometry/transform.h"
#include "tileflight/core/imaging/camera.h"
#include "tileflight/core/imaging/textured_mesh.h"
#include "tileflight/live/simulator/airsim_types.h"

namespace tileflight::simulator {

struct World;

// State of the simulation for viewers. Body and lidar axes are x forward, y left, z up (REP 103), camera axes
// those of images (x right, y down, z forward); the local frame is the place's (east, north, up).

struct ObservedCamera {
  std::string name;
  geometry::SE3 T_body_camera;
  imaging::Camera scene_lens, depth_lens;  ///< of the image types Scene and DepthPlanar
};

struct ObservedLidar {
  std::string name;
  geometry::SE3 T_body_lidar;
};

/// Holds where a vehicle has located itself, in tiles of the place (live/simulator/place_vision.h).
struct ObservedLocation {
  std::uint64_t time_ns = 0;  ///< of the image
  geometry::SE3 T_local_body;
  geometry::Vec3 velocity_m_s = geometry::Vec3::Zero();            ///< body axes
  geometry::Vec3 angular_velocity_rad_s = geometry::Vec3::Zero();  ///< body axes
  geometry::Mat3 position_covariance_m2 = geometry::Mat3::Zero();  ///< local frame
  geometry::Mat3 rotation_covariance_rad2 = geometry::Mat3::Zero();
  geometry::Mat3 velocity_covariance_m2_s2 = geometry::Mat3::Zero();  ///< body axes
};

struct ObservedVehicle {
  std::string name;
  geometry::SE3 T_local_body;
  geometry::Vec3 velocity_m_s = geometry::Vec3::Zero();            ///< body axes
  geometry::Vec3 angular_velocity_rad_s = geometry::Vec3::Zero();  ///< body axes
  double latitude_deg = 0.0, longitude_deg = 0.0, height_m = 0.0;  ///< WGS84, above the ellipsoid
  std::vector<ObservedCamera> cameras;
  std::vector<ObservedLidar> lidars;
  std::vector<std::string> imus;             ///< at the body's origin, with its axes
  bool flies = false;                        ///< false: a camera without a vehicle
  bool locates_itself = false;               ///< in tiles of the place, as its autopilot's vision input
  std::optional<ObservedLocation> location;  ///< by its latest located image
};

/// The simulation at one time.
struct Observation {
  std::uint64_t time_ns = 0;
  std::vector<ObservedVehicle> vehicles;
};

/// Motion that an inertial unit measures, in body axes.
struct ObservedMotion {
  std::uint64_t time_ns = 0;
  geometry::Vec3 angular_rate_rad_s = geometry::Vec3::Zero();
  geometry::Vec3 specific_force_m_s2 = geometry::Vec3::Zero();  ///< at rest: gravity upwards
};

/// Points of a complete scan from one pose, in the lidar's axes.
struct ObservedScan {
  std::uint64_t time_ns = 0;
  std::vector<Eigen::Vector3f> points_m;
  std::vector<float> intensities;    ///< 0 to 1, one a point
  std::vector<float> times_s;        ///< after time_ns, one a point
  std::vector<std::uint16_t> rings;  ///< channel, one a point
};

/// The simulation as viewers see it, without effect on anything that a client reads.
class Viewer {
 public:
  explicit Viewer(World& world) : world_(world) {}

  /// Returns the present time and the state of all vehicles.
  Observation observe() const;
  /// Renders images as Cameras::get_images() does, without effect on optical flow.
  std::vector<ImageResponse> images(const std::vector<ImageRequest>& requests, const std::string& vehicle);
  /// Scans a full rotation of a lidar.
  ObservedScan scan(const std::string& lidar, const std::string& vehicle);
  /// Reads an inertial unit, with noise that is independent of what clients read. Throws InputError for an unknown
  /// name.
  ObservedMotion imu(const std::string& imu, const std::string& vehicle);
  /// Copies the meshes in memory, local frame. Returns nullopt if they have more than `max_triangles` triangles.
  std::optional<std::vector<imaging::TexturedMesh>> meshes(std::size_t max_triangles) const;

 private:
  World& world_;
};

}  // namespace tileflight::simulator
