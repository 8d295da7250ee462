#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <vector>

#include "tileflight/core/geometry/point_cloud.h"
#include "tileflight/evaluation/metrics/metrics_file.h"
#include "tileflight/evaluation/scoring/map_inputs.h"
#include "tileflight/world/ground_truth/truth_folder.h"
#include "tileflight/world/place/extract_result.h"

namespace tileflight::scoring {

/// Tells which of a map's points are on the actors of its flight.
struct PointsOnActors {
  std::vector<bool> is_on;   ///< for each point of the map
  std::size_t actors = 0;    ///< of the flight
  bool by_keyframe = false;  ///< see find_points_on_actors()
  metrics::BoxMargins margins;

  std::size_t count() const;
};

/// Returns whether there is a dataset with boxes of actors, so that find_points_on_actors() can search.
bool has_actor_boxes(const MapInputs& map);

/// Finds the points inside the boxes of a rendered dataset's actors (metrics::is_on()). A map of the built-in odometry
/// knows the keyframe in which a point was chosen, so the boxes of that image are used. In any other map, a point
/// counts if it is inside a box at any frame. `cloud`: the map with its scalars; `T_local_map` places it. Returns
/// nullopt without a dataset, or if it has no boxes. Throws InputError for boxes that cannot be read, and for keyframes
/// that are not of the dataset.
std::optional<PointsOnActors> find_points_on_actors(const MapInputs& map, const geometry::PointCloud& cloud,
                                                    const geometry::Sim3& T_local_map);

/// A map's points on actors, aligned and with their distances; all empty if there are none.
struct ApartPoints {
  metrics::PointErrors errors;
  std::vector<double> over_region_m;  ///< distances to the surface of those over the region
};

/// Takes the points on actors out of the map. Throws InputError if none remains.
geometry::PointCloud take_points_on_actors(const PointsOnActors& found, const MapInputs& map,
                                           geometry::PointCloud& cloud);

/// Measures the distances of the points `apart` (map frame, at least one) as evaluate() measures those of all others.
ApartPoints measure_apart(geometry::PointCloud apart, const geometry::Sim3& T_published_map,
                          const geometry::Sim3& T_surface_map, const ground_truth::TruthFolder& truth,
                          const place::TruthRegion& region);

/// Scores the points apart, and all points together. The distances of the others are `voxel_m` and, over the region,
/// `over_region_m` (nullopt: there is no true surface).
metrics::MovingPoints score_apart(const PointsOnActors& found, const ApartPoints& apart, std::vector<double> voxel_m,
                                  std::optional<std::vector<double>> over_region_m, double cutoff_m);

/// Writes the points apart, or removes what an earlier score left.
void write_apart_points(const std::filesystem::path& ply, const ApartPoints& apart, double cutoff_m);

}  // namespace tileflight::scoring
