#pragma once

#include <algorithm>
#include <vector>

#include "tileflight/evaluation/metrics/distances.h"

namespace tileflight::metrics {

/// Scores of a whole map. `surface_samples`: points evenly distributed on the true surface, for the quantisation floor;
/// empty: no floor.
inline MapMetrics evaluate_map(const geometry::PointCloud& aligned_map, const geometry::PointCloud& voxel_centers,
                               const geometry::PointCloud& surface_samples, const MapMetricsOptions& options = {}) {
  const auto distances = cloud_distances(aligned_map, voxel_centers, "map", "voxel centres");
  std::vector<double> floor;
  if (!surface_samples.empty())
    floor = cloud_distances(surface_samples, voxel_centers, "surface samples", "voxel centres");
  return score_map(distances, compute_quantization_floor(floor, options.cutoff_m), options);
}

/// `seen_samples`: samples of the true surface that the flight's camera saw, for completeness; empty: no completeness.
inline SurfaceMetrics evaluate_surface(const geometry::PointCloud& aligned_map, const geometry::TriangleMesh& surface,
                                       const geometry::PointCloud& seen_samples,
                                       const std::vector<double>& thresholds_m = {0.1, 0.2, 0.5, 1.0}) {
  const auto distances = surface_distances(aligned_map, geometry::TriangleIndex(surface));
  std::vector<double> samples;
  if (!seen_samples.empty()) {
    const double farthest = thresholds_m.empty() ? 0.0 : *std::max_element(thresholds_m.begin(), thresholds_m.end());
    samples = cloud_distances(seen_samples, aligned_map, "surface samples", "map", farthest);
  }
  return score_surface(distances, samples, thresholds_m);
}

}  // namespace tileflight::metrics
