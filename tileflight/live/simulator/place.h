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

  /// False where the file must not or cannot be written (AirSim's answer); the log says why.
  bool create_voxel_grid(const Vector3r& position, int x, int y, int z, float resolution, const std::string& file);
  bool test_line_of_sight_to_point(const GeoPoint& point, const std::string& vehicle);
  bool test_line_of_sight_between_points(const GeoPoint& from, const GeoPoint& to);
  std::vector<GeoPoint> get_world_extents();
  LoadedRegion load_region(const Vector3r& center, const Vector3r& size, float error_m);  ///< global NED
  GroundTruthReport ground_truth(const Vector3r& center, const Vector3r& size, float error_m, float voxel_m,
                                 const std::string& folder);
  VoxelGridData voxel_grid(const Vector3r& center, const Vector3r& size, float resolution);

 private:
  World& world_;
};

}  // namespace tileflight::simulator
