#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "tileflight/evaluation/metrics/map_entropy.h"
#include "tileflight/evaluation/scoring/map_tiles.h"
#include "tileflight/evaluation/scoring/truth_surface.h"

// Scores that need the neighbours of a map's points, computed tile by tile. They equal those of the whole map to the
// last digit.

namespace tileflight::scoring {

/// Returns the distance of each of the map's points to the nearest voxel centre, metres, by its number. `points`:
/// number of points of the map. Throws InputError as VoxelCenters does.
std::vector<double> distances_to_voxels(const MapTiles& map, std::size_t points,
                                        const ground_truth::TruthFolder& truth);

/// Returns the result of TruthSurface::match() by the points' numbers. `chosen`: numbers of points; `points`: number of
/// points of the map.
SurfaceMatch match_tiles(const MapTiles& map, std::size_t points, TruthSurface& surface,
                         const std::vector<std::uint32_t>& chosen, double within_m);

/// Computes the metrics::map_entropy() of a map in tiles. An index of a tile's points and of those within the radius
/// around it is held in memory.
metrics::MapEntropy map_entropy(const MapTiles& map, const metrics::MapEntropyOptions& options);

/// Position at which most of a map's points coincide.
struct CommonPlace {
  geometry::Vec3 position = geometry::Vec3::Zero();  ///< local frame
  std::size_t points = 0;                            ///< that lie exactly there
};

/// Finds the most common position; among equally common ones the first along the Morton curve.
CommonPlace most_common_place(const MapTiles& map);

/// Distances and normals that find_neighbors() computes from the map's points.
struct MapNeighbors {
  std::vector<double> distances_m;       ///< of each point asked, to the nearest point of the map
  std::vector<Eigen::Vector3f> normals;  ///< alignment::estimate_normal() at each of `at`
};

/// Computes the distance from each of `points` to the map, and the normal of the plane through the `neighbors` nearest
/// map points of each place in `at`. An index of one tile is held in memory at a time.
MapNeighbors find_neighbors(const MapTiles& map, const std::vector<geometry::Vec3>& points,
                            const std::vector<geometry::Vec3>& at, std::size_t neighbors);

}  // namespace tileflight::scoring
