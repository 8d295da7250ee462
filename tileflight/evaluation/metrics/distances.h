#pragma once

#include <limits>
#include <vector>

#include "tileflight/core/geometry/nearest.h"
#include "tileflight/core/geometry/triangle_index.h"
#include "tileflight/evaluation/metrics/metrics.h"

namespace tileflight::metrics {

// Distances of map points, measured once and scored in several ways. All are in metres, one per point, in the order of
// the points.

/// Requires a cloud with points that are all finite; else throws InputError, which calls the cloud `name`.
void require_scorable(const geometry::PointCloud& cloud, const char* name);

/// Returns the distance from each point to the nearest of `targets`; infinity if nothing lies within `radius_m`. Throws
/// InputError for empty or non-finite clouds (`what` names the points, `target_name` the targets).
std::vector<double> cloud_distances(const geometry::PointCloud& points, const geometry::PointCloud& targets,
                                    const char* what, const char* target_name,
                                    double radius_m = std::numeric_limits<double>::infinity());

/// Returns the distances with an existing index of the targets.
std::vector<double> cloud_distances(const geometry::PointCloud& points, const geometry::NearestIndex& targets,
                                    const char* what, double radius_m = std::numeric_limits<double>::infinity());

/// Returns the distance from each point to the nearest triangle.
std::vector<double> surface_distances(const geometry::PointCloud& points, const geometry::TriangleIndex& surface);

/// Returns the share of the distances up to the threshold; NaN if there are none.
double share_within(const std::vector<double>& distances, double threshold_m);

/// Returns the distances up to the cut-off, with their positions.
KeptDistances keep_within_cutoff(const std::vector<geometry::Vec3>& positions, const std::vector<double>& distances,
                                 double cutoff_m);

/// Computes the paper's metrics from the distances of all points and the quantisation floor of
/// compute_quantization_floor().
MapMetrics score_map(const std::vector<double>& distances, const DistanceStatistics& floor,
                     const MapMetricsOptions& options);

/// Computes the quantisation floor: statistics of the distances of samples of the true surface, with the same cut-off
/// as the map's.
DistanceStatistics compute_quantization_floor(const std::vector<double>& distances, double cutoff_m);

/// Computes accuracy from the map points' distances to the surface, and completeness from the distances of seen surface
/// samples to the map, which may be empty.
SurfaceMetrics score_surface(const std::vector<double>& distances, const std::vector<double>& sample_distances,
                             const std::vector<double>& thresholds_m);

}  // namespace tileflight::metrics
