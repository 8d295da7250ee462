#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tileflight/live/simulator/airsim_types.h"

namespace tileflight::simulator {

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
