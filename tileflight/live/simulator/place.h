#pragma once

#include <string>
#include <vector>

#include "tileflight/live/simulator/airsim_types.h"

namespace tileflight::simulator {

struct World;

/// Questions about the place's surface, and its tiles. Positions and sizes are metres in global NED.
class Place {
 public:
  explicit Place(World& world) : world_(world) {}

  /// Writes the occupancy of a box as a binvox file. Returns false if the file must not or cannot be written, as AirSim
  /// does; the log says why.
  bool create_voxel_grid(const Vector3r& position, int x, int y, int z, float resolution, const std::string& file);
  /// Returns whether nothing stands between a vehicle and a point.
  bool test_line_of_sight_to_point(const GeoPoint& point, const std::string& vehicle);
  /// Returns whether nothing stands between two points.
  bool test_line_of_sight_between_points(const GeoPoint& from, const GeoPoint& to);
  /// Returns the lowest and the highest corner of the place.
  std::vector<GeoPoint> get_world_extents();
  /// Keeps a region's tiles in memory from now on, up to a geometric error.
  LoadedRegion load_region(const Vector3r& center, const Vector3r& size, float error_m);
  /// Writes the ground truth of a region to a folder, as the command extract does.
  GroundTruthReport ground_truth(const Vector3r& center, const Vector3r& size, float error_m, float voxel_m,
                                 const std::string& folder);
  /// Returns the occupancy of a box.
  VoxelGridData voxel_grid(const Vector3r& center, const Vector3r& size, float resolution);

 private:
  World& world_;
};

}  // namespace tileflight::simulator
