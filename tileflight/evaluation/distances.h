#pragma once

#include <limits>
#include <vector>

#include "tileflight/evaluation/metrics.h"
#include "tileflight/geometry/nearest.h"
#include "tileflight/geometry/triangle_index.h"

namespace tileflight::evaluation {

// Distances are measured once and scored in more than one way. All are metres, one a point, in the points' order.

/// Distance from each point to the nearest of `targets`; infinity where nothing lies within `radius_m`. Throws
/// InputError: empty or not finite
/// (`what` names the points, `target_name` the targets).
std::vector<double> cloud_distances(const geometry::PointCloud& points, const geometry::PointCloud& targets,
                                    const char* what, const char* target_name,
                                    double radius_m = std::numeric_limits<double>::infinity());

/// The same with an index of the targets that is there already.
std::vector<double> cloud_distances(const geometry::PointCloud& points, const geometry::NearestIndex& targets,
                                    const char* what, double radius_m = std::numeric_limits<double>::infinity());

/// Distance from each point to the nearest triangle.
std::vector<double> surface_distances(const geometry::PointCloud& points, const geometry::TriangleIndex& surface);

/// Where a distance lies: the distances up to the cut-off, with their positions.
KeptDistances keep(const std::vector<geometry::Vec3>& positions, const std::vector<double>& distances, double cutoff_m);

/// The paper's numbers from measured distances (all points) and the score of samples of the true surface, as
/// floor_of() gives it.
MapMetrics score_map(const std::vector<double>& distances, const DistanceStatistics& floor,
                     const MapMetricsOptions& options);

/// The floor from the distances of samples of the true surface, cut off as the map's are.
DistanceStatistics floor_of(const std::vector<double>& distances, double cutoff_m);

/// Accuracy from the map points' distances to the surface, completeness from the seen samples' distances to the map
/// (may be empty).
SurfaceMetrics score_surface(const std::vector<double>& distances, const std::vector<double>& sample_distances,
                             const std::vector<double>& thresholds_m);

}  // namespace tileflight::evaluation
