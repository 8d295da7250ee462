#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

namespace tileflight::simulator {

// The structures of AirSim's interface as values, with its field names. Frames: NED (north, east, down), metres; body
// and camera axes x forward, y right, z down; quaternions rotate body to NED. Angles in structures are radians; in yaw
// modes, settings and fields of view they are degrees. Timestamps are nanoseconds of simulation time.

struct Vector2r {
  float x_val = 0.0F, y_val = 0.0F;
};

struct Vector3r {
  float x_val = 0.0F, y_val = 0.0F, z_val = 0.0F;
};

struct Quaternionr {
  float w_val = 1.0F, x_val = 0.0F, y_val = 0.0F, z_val = 0.0F;
};

struct Pose {
  Vector3r position;
  Quaternionr orientation;
};

struct GeoPoint {
  double latitude = 0.0, longitude = 0.0;  ///< degrees, WGS84
  float altitude = 0.0F;                   ///< metres above the ellipsoid
};

struct YawMode {
  bool is_rate = true;
  float yaw_or_rate = 0.0F;  ///< degrees clockwise from north, or degrees per second
};

struct KinematicsState {
  Vector3r position;
  Quaternionr orientation;
  Vector3r linear_velocity;       ///< NED, m/s
  Vector3r angular_velocity;      ///< body axes, rad/s
  Vector3r linear_acceleration;   ///< NED, m/s^2
  Vector3r angular_acceleration;  ///< body axes, rad/s^2
};

struct EnvironmentState {
  Vector3r position;
  GeoPoint geo_point;
  Vector3r gravity;
  float air_pressure = 0.0F;  ///< Pa
  float temperature = 0.0F;   ///< K
  float air_density = 0.0F;   ///< kg/m^3
};

struct CollisionInfo {
  bool has_collided = false;
  float penetration_depth = 0.0F;
  std::uint64_t time_stamp = 0;
  Vector3r normal;
  Vector3r impact_point;
  Vector3r position;
  std::string object_name;
  int object_id = -1;
};

/// Image types, with AirSim's numbers.
enum class ImageType : int {
  kScene = 0,
  kDepthPlanar = 1,
  kDepthPerspective = 2,
  kDepthVis = 3,
  kDisparityNormalized = 4,
  kSegmentation = 5,
  kSurfaceNormals = 6,
  kInfrared = 7,
  kOpticalFlow = 8,
  kOpticalFlowVis = 9,
  kLighting = 10,    ///< Cosys-AirSim's: what light falls on each surface
  kAnnotation = 11,  ///< Cosys-AirSim's: a layer of labels
};
inline constexpr int kImageTypeCount = 12;

struct ImageRequest {
  std::string camera_name;
  int image_type = 0;  ///< may be any number from a client; checked by the simulator
  bool pixels_as_float = false;
  bool compress = true;
  std::string annotation_name;  ///< Cosys-AirSim's: the layer of an image of type kAnnotation
};

struct ImageResponse {
  std::vector<std::uint8_t> image_data_uint8;  ///< PNG (RGBA), or rows of blue, green, red, top row first
  std::vector<float> image_data_float;         ///< top row first; only with pixels_as_float
  Vector3r camera_position;
  std::string camera_name;
  Quaternionr camera_orientation;
  std::uint64_t time_stamp = 0;
  std::string message;
  bool pixels_as_float = false;
  bool compress = true;
  int width = 0;
  int height = 0;
  int image_type = 0;
};

struct ProjectionMatrix {
  std::array<std::array<float, 4>, 4> matrix{};
};

struct CameraInfo {
  Pose pose;
  float fov = 0.0F;  ///< degrees
  ProjectionMatrix proj_mat;
};

struct LidarData {
  std::uint64_t time_stamp = 0;
  std::vector<float> point_cloud;  ///< x, y, z of each point
  Pose pose;                       ///< of the sensor, local NED
  std::vector<int> segmentation;   ///< one per point
};

/// Cosys-AirSim's.
struct GPULidarData {
  std::uint64_t time_stamp = 0;
  std::vector<float> point_cloud;  ///< x, y, z, segmentation colour (red * 2^16 + green * 2^8 + blue), intensity
  Pose pose;                       ///< of the sensor on the body
};

/// Cosys-AirSim's.
struct EchoData {
  std::uint64_t time_stamp = 0;
  std::vector<float> point_cloud;        ///< x, y, z (sensor axes), attenuation in dB, way in metres, reflections
  std::vector<std::string> groundtruth;  ///< the object of each point
  Pose pose;                             ///< of the sensor on the body
  std::vector<float> passive_beacons_point_cloud;  ///< always empty: there are no beacons
  std::vector<std::string> passive_beacons_groundtruth;
};

/// Cosys-AirSim's.
struct ComputerVisionState {
  KinematicsState kinematics_estimated;
  std::uint64_t timestamp = 0;
};

struct ImuData {
  std::uint64_t time_stamp = 0;
  Quaternionr orientation;
  Vector3r angular_velocity;     ///< body axes, rad/s
  Vector3r linear_acceleration;  ///< specific force, body axes, m/s^2
};

struct BarometerData {
  std::uint64_t time_stamp = 0;
  float altitude = 0.0F;  ///< metres
  float pressure = 0.0F;  ///< Pa
  float qnh = 0.0F;       ///< hPa
};

struct MagnetometerData {
  std::uint64_t time_stamp = 0;
  Vector3r magnetic_field_body;  ///< gauss
  std::vector<float> magnetic_field_covariance;
};

struct GnssReport {
  GeoPoint geo_point;
  float eph = 0.0F, epv = 0.0F;
  Vector3r velocity;  ///< NED, m/s
  int fix_type = 0;   ///< 0 none, 1 time only, 2 2D, 3 3D
  std::uint64_t time_utc = 0;
};

struct GpsData {
  std::uint64_t time_stamp = 0;
  GnssReport gnss;
  bool is_valid = false;
};

struct DistanceSensorData {
  std::uint64_t time_stamp = 0;
  float distance = 0.0F;  ///< metres
  float min_distance = 0.0F, max_distance = 0.0F;
  Pose relative_pose;  ///< of the sensor on the body
};

struct RCData {
  std::uint64_t timestamp = 0;
  float pitch = 0.0F, roll = 0.0F, throttle = 0.0F, yaw = 0.0F;
  float left_z = 0.0F, right_z = 0.0F;
  std::uint16_t switches = 0;
  std::string vendor_id;
  bool is_initialized = false;
  bool is_valid = false;
};

struct MultirotorState {
  CollisionInfo collision;
  KinematicsState kinematics_estimated;
  GeoPoint gps_location;
  std::uint64_t timestamp = 0;
  int landed_state = 0;  ///< 0 landed, 1 flying
  RCData rc_data;
};

struct RotorParameters {
  float thrust = 0.0F;         ///< N
  float torque_scaler = 0.0F;  ///< Nm
  float speed = 0.0F;          ///< rad/s, positive counter-clockwise from above
};

struct RotorStates {
  std::vector<RotorParameters> rotors;
  std::uint64_t timestamp = 0;
};

struct MeshPositionVertexBuffersResponse {
  Vector3r position;
  Quaternionr orientation;
  std::vector<float> vertices;         ///< x, y, z of each vertex
  std::vector<std::uint32_t> indices;  ///< three per triangle
  std::string name;
};

struct Box2D {
  Vector2r min, max;
};

struct Box3D {
  Vector3r min, max;
};

struct DetectionInfo {
  std::string name;
  GeoPoint geo_point;
  Box2D box2D;
  Box3D box3D;
  Pose relative_pose;
};

// Results of the calls that extend AirSim's interface (tf...). Field names are those of the messages.

/// State of the place's tiles currently in memory.
struct LoadedRegion {
  bool complete = false;  ///< every required tile was read
  int tiles_wanted = 0, tiles_loaded = 0, tiles_failed = 0;
  float geometric_error_max = 0.0F;  ///< metres, largest of the tiles in memory
  std::uint64_t triangles = 0;
  std::uint64_t bytes = 0;  ///< of decoded tiles
  std::vector<std::string> failures;
};

/// The part of a camera's view that is currently in memory.
struct Coverage {
  std::string camera_name;
  bool complete = false;       ///< nothing visible to the camera is missing
  float error_wanted = 0.0F;   ///< allowed error of a tile, pixels
  float error_max = 0.0F;      ///< pixels, of the visible surfaces; below error_wanted if possible
  float error_mean = 0.0F;     ///< pixels
  float surface_share = 0.0F;  ///< share of the pixels that see a surface
  int tiles_seen = 0;
  LoadedRegion loaded;
};

/// A georeferenced pose.
struct GeodeticPose {
  GeoPoint geo_point;
  double altitude = 0.0;  ///< metres above the ellipsoid, in double precision
  float heading = 0.0F;   ///< degrees clockwise from true north
  Quaternionr orientation;
  std::uint64_t time_stamp = 0;
  bool georeferenced = false;  ///< false: the place is not georeferenced; the settings' origin is used instead
};

/// Statistics of the simulator (tfStatistics).
struct Statistics {
  std::uint64_t time_stamp = 0;
  double sim_seconds = 0.0;   ///< simulation time since the start
  double wall_seconds = 0.0;  ///< wall-clock time since the start
  std::uint64_t images = 0;
  double image_seconds = 0.0;       ///< total time inside simGetImages
  double last_image_seconds = 0.0;  ///< of the latest call
  std::uint64_t scenes_built = 0;   ///< number of working sets built
  std::uint64_t tiles_read = 0;     ///< number of tiles decoded
  std::uint64_t memory_bytes = 0;   ///< of decoded tiles in memory
  std::uint64_t max_memory_bytes = 0;
  int tasks_running = 0;
  int vehicles = 0;
  float error_px = 0.0F;              ///< current allowed error of a tile, pixels
  std::string mode;                   ///< "region": all of it is in memory; "follow": the visible tiles
  std::vector<std::string> warnings;  ///< about settings and tiles
  std::vector<std::string> attribution;
};

/// Occupancy of a box: which cells are touched by a surface. Cell (i, j, k) is occupied[(i * dims[1] + j) * dims[2] +
/// k]; i grows to the north, j to the east, k down. Its minimum corner is origin + resolution * (i, j, k), global NED.
struct VoxelGridData {
  std::vector<int> dims;  ///< cells to the north, east, down
  Vector3r origin;
  float resolution = 0.0F;
  std::vector<std::uint8_t> occupied;  ///< 0 or 1
  std::uint64_t occupied_count = 0;
};

/// A complete scan; each array has one entry per point.
struct LidarScanData {
  std::uint64_t time_stamp = 0;
  Pose pose;                        ///< of the sensor, local NED
  std::vector<float> point_cloud;   ///< x, y, z in the frame given by the sensor's DataFrame
  std::vector<float> intensity;     ///< 0 to 1: albedo times cosine of the incidence
  std::vector<std::uint16_t> ring;  ///< channel, counted from the lowest
  std::vector<float> time_offset;   ///< seconds after time_stamp
  std::vector<int> segmentation;    ///< as in LidarData
};

/// A lens that is not limited to the pinhole model.
struct LensDescription {
  std::string model;              ///< "pinhole", "fisheye" (Kannala-Brandt) or "panorama"
  int width = 0, height = 0;      ///< 0: unchanged
  float fov_degrees = 0.0F;       ///< horizontal; 0: from the intrinsics
  std::vector<float> k;           ///< up to four Kannala-Brandt coefficients
  std::vector<float> intrinsics;  ///< empty, or fx, fy, cx, cy, pixels with centres at +0.5
};

/// Result of an extraction of ground truth.
struct GroundTruthReport {
  std::string folder;
  std::string extract_json;  ///< content of the folder's extract.json
};

/// Where a vehicle waits for its autopilot, and where it stands.
struct AutopilotEndpoint {
  std::string vehicle;
  std::string protocol;  ///< "ArduPilot JSON, UDP"
  std::string address;
  int port = 0;
  GeoPoint home;
  double home_heading_deg = 0.0;  ///< clockwise from north
};

}  // namespace tileflight::simulator
