#pragma once

#include <filesystem>
#include <vector>

#include "tileflight/geometry/point_cloud.h"

namespace tileflight::scoring {

/// A map to align and score: an odometry folder (map.ply with trajectory.txt) or any point cloud, with the known data
/// of its flight.
struct MapInputs {
  std::filesystem::path map;               ///< odometry folder, or .ply/.pcd/.xyz
  std::filesystem::path trajectory;        ///< estimated poses in the map's frame; empty: the folder's trajectory.txt
  std::filesystem::path truth_trajectory;  ///< true poses (TUM); empty: none
  std::filesystem::path gps;               ///< gps.csv; empty: none
  std::filesystem::path attitude;          ///< attitude.csv; empty: none
  std::filesystem::path dataset;           ///< folder of the flight's images; empty: none
  std::filesystem::path camera;            ///< calibration, for the visible part of the surface; empty: none
  std::vector<MapInputs> others{};         ///< other flights, whose maps must have points in the regions used
};

/// The inputs of a flight's folder (odometry/, dataset/).
MapInputs find_map_inputs(const std::filesystem::path& odometry_folder, const std::filesystem::path& dataset_folder);

/// Reads the map's points. Throws InputError if there are none.
geometry::PointCloud read_map(const std::filesystem::path& map);

}  // namespace tileflight::scoring
