#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tileflight/simulator/airsim_types.h"

namespace tileflight::simulator {

// What the calls beyond AirSim's (tf...) give. Field names are those of the answers.

/// What the place's tiles are like, for what is in memory now.
struct LoadedRegion {
  bool complete = false;  ///< every tile that is wanted was read
  int tiles_wanted = 0, tiles_loaded = 0, tiles_failed = 0;
  float geometric_error_max = 0.0F;  ///< metres, of the tiles in memory
  std::uint64_t triangles = 0;
  std::uint64_t bytes = 0;  ///< of decoded tiles
  std::vector<std::string> failures;
};

/// What of a camera's view is in memory, now.
struct Coverage {
  std::string camera_name;
  bool complete = false;       ///< nothing that the camera can see is missing
  float error_wanted = 0.0F;   ///< pixels that a tile may err by
  float error_max = 0.0F;      ///< pixels, of the surfaces that the camera sees; below error_wanted if it was to be had
  float error_mean = 0.0F;     ///< pixels
  float surface_share = 0.0F;  ///< of the pixels: those that see a surface
  int tiles_seen = 0;
  LoadedRegion loaded;
};

/// A pose on the earth.
struct GeodeticPose {
  GeoPoint geo_point;
  double altitude = 0.0;  ///< metres above the ellipsoid, in double precision
  float heading = 0.0F;   ///< degrees clockwise from true north
  Quaternionr orientation;
  std::uint64_t time_stamp = 0;
  bool georeferenced = false;  ///< false: the place has no position of its own; the settings' origin stands in
};

struct Statistics {
  std::uint64_t time_stamp = 0;
  double sim_seconds = 0.0;   ///< since the start
  double wall_seconds = 0.0;  ///< the same
  std::uint64_t images = 0;
  double image_seconds = 0.0;       ///< inside simGetImages, all calls together
  double last_image_seconds = 0.0;  ///< of the latest call
  std::uint64_t scenes_built = 0;   ///< working sets so far
  std::uint64_t tiles_read = 0;     ///< decoded so far
  std::uint64_t memory_bytes = 0;   ///< of decoded tiles in memory
  std::uint64_t max_memory_bytes = 0;
  int tasks_running = 0;
  int vehicles = 0;
  float error_px = 0.0F;              ///< pixels that a tile may err by, now
  std::string mode;                   ///< "region": all of it in memory; "follow": what can be seen
  std::vector<std::string> warnings;  ///< of settings and tiles
  std::vector<std::string> attribution;
};

/// Which cells of a box any surface touches. Cell (i, j, k) is occupied[(i * dims[1] + j) * dims[2] + k]; i grows to
/// the north, j to the east, k down. Its minimum corner is origin + resolution * (i, j, k), global NED.
struct VoxelGridData {
  std::vector<int> dims;  ///< cells to the north, east, down
  Vector3r origin;
  float resolution = 0.0F;
  std::vector<std::uint8_t> occupied;  ///< 0 or 1
  std::uint64_t occupied_count = 0;
};

/// A whole scan, one entry of each array a point.
struct LidarScanData {
  std::uint64_t time_stamp = 0;
  Pose pose;                        ///< of the sensor, local NED
  std::vector<float> point_cloud;   ///< x, y, z in the frame that the sensor's DataFrame says
  std::vector<float> intensity;     ///< 0 to 1: albedo times cosine of the incidence
  std::vector<std::uint16_t> ring;  ///< channel, counted from the lowest
  std::vector<float> time_offset;   ///< seconds after time_stamp
  std::vector<int> segmentation;    ///< as in LidarData
};

/// A lens beyond the pinhole.
struct LensDescription {
  std::string model;              ///< "pinhole", "fisheye" (Kannala-Brandt) or "panorama"
  int width = 0, height = 0;      ///< 0: as they are
  float fov_degrees = 0.0F;       ///< horizontal; 0: from the intrinsics
  std::vector<float> k;           ///< up to four of Kannala-Brandt's coefficients
  std::vector<float> intrinsics;  ///< empty, or fx, fy, cx, cy, pixels with centres at +0.5
};

/// Where a ground truth was written.
struct GroundTruthReport {
  std::string folder;
  std::string extract_json;  ///< what the folder's extract.json says
};

}  // namespace tileflight::simulator
