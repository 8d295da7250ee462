#pragma once

#include <filesystem>
#include <vector>

#include "tileflight/evaluation/scoring/map_points.h"

namespace tileflight::scoring {

/// Distances of a map's points to the true surface, metres. All empty if there is no surface.
struct SurfaceDistances {
  std::vector<double> over_m, off_m;  ///< of the points that are over the region, and of the others, in order
  std::vector<bool> is_over;          ///< of each point of the map
};

/// Needs no second copy of the distances.
SurfaceDistances split_by_region(std::vector<double> distances_m, std::vector<bool> is_over);

/// metrics::write_point_errors() of the aligned map, block by block. `voxel_m`: of each point, to the voxel centres.
/// Throws InputError.
void write_errors(const std::filesystem::path& ply, const MapPoints& map, const geometry::Sim3& T_local_map,
                  const std::vector<double>& voxel_m, const SurfaceDistances& surface, double cutoff_m);

}  // namespace tileflight::scoring
