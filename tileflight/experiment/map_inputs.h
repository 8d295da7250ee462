#pragma once

#include <filesystem>
#include <vector>

#include "tileflight/geometry/point_cloud.h"

namespace tileflight::experiment {

/// A map that is aligned and scored: an odometry folder (map.ply with trajectory.txt) or any cloud, and what is known
/// about its flight.
struct MapInputs {
  std::filesystem::path map;               ///< odometry folder, or .ply/.pcd/.xyz
  std::filesystem::path trajectory;        ///< estimated poses in the map's frame; empty: trajectory.txt of the folder
  std::filesystem::path truth_trajectory;  ///< true poses (TUM); empty: none
  std::filesystem::path gps;               ///< gps.csv; empty: none
  std::filesystem::path attitude;          ///< attitude.csv; empty: none
  std::filesystem::path dataset;           ///< folder of the flight's pictures; empty: none
  std::filesystem::path camera;            ///< calibration, for what the camera saw; empty: none
  std::vector<MapInputs> others{};  ///< of other flights, whose maps must have points of regions to align on, too
};

/// The inputs of a flight's folder (odometry/, dataset/).
MapInputs map_inputs(const std::filesystem::path& odometry_folder, const std::filesystem::path& dataset_folder);

/// The map's points. Throws InputError where there are none.
geometry::PointCloud read_map(const std::filesystem::path& map);

}  // namespace tileflight::experiment
