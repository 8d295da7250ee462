#pragma once

#include <filesystem>
#include <vector>

#include "tileflight/core/geometry/point_cloud.h"
#include "tileflight/core/geometry/trajectory.h"
#include "tileflight/core/imaging/camera.h"

namespace tileflight::scoring {

/// A map to align and score: an odometry folder (map.ply with trajectory.txt) or any point cloud, with the known data
/// of its flight.
struct MapInputs {
  std::filesystem::path map;               ///< odometry folder, or .ply/.pcd/.xyz
  std::filesystem::path trajectory;        ///< estimated poses in the map's frame; empty: the folder's trajectory.txt
  std::filesystem::path truth_trajectory;  ///< true poses, for read_true_poses(); empty: none
  std::filesystem::path gps;               ///< gps.csv; empty: none
  std::filesystem::path attitude;          ///< attitude.csv; empty: none
  std::filesystem::path dataset;           ///< folder of the flight's images; empty: none
  std::filesystem::path reference{};       ///< folder that localize() wrote, to which the path is compared; empty: none
  std::filesystem::path camera;     ///< for read_flight_camera(), for the visible part of the surface; empty: none
  std::vector<MapInputs> others{};  ///< other flights, whose maps must have points in the regions used
};

/// Finds the inputs of a flight's folder (odometry/, dataset/). The dataset may be in any layout of
/// dataset::read_dataset(). Throws InputError.
MapInputs find_map_inputs(const std::filesystem::path& odometry_folder, const std::filesystem::path& dataset_folder);

/// Reads the poses of a TUM file, or the true ones of a dataset folder in any layout. Throws InputError, also for a
/// dataset without true poses.
geometry::Trajectory read_true_poses(const std::filesystem::path& file_or_dataset);

/// Reads the camera of a calibration file, or of a dataset folder in any layout. Throws InputError.
imaging::Camera read_flight_camera(const std::filesystem::path& file_or_dataset);

/// Reads the map's points. Throws InputError if there are none.
geometry::PointCloud read_map(const std::filesystem::path& map);

}  // namespace tileflight::scoring
