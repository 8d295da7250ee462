#include "tileflight/evaluation/metrics/evaluate.h"

#include <algorithm>
#include <utility>

#include "tileflight/core/base/input_error.h"
#include "tileflight/evaluation/metrics/distances.h"

namespace tileflight::metrics {

using geometry::PointCloud;

namespace {

bool has_points(const PointCloud* cloud) { return cloud && !cloud->empty(); }

DistanceStatistics floor_against(const EvaluationInputs& against, double cutoff_m) {
  if (against.floor) return *against.floor;
  if (!has_points(against.surface_samples)) return {};
  return compute_quantization_floor(
      cloud_distances(*against.surface_samples, *against.voxel_centers, "surface samples", "voxel centres"), cutoff_m);
}

std::vector<double> sample_distances(const PointCloud& aligned_map, const EvaluationInputs& against,
                                     const EvaluationOptions& options) {
  if (!has_points(against.seen_samples) || options.thresholds_m.empty()) return {};
  const double farthest = std::max(*std::max_element(options.thresholds_m.begin(), options.thresholds_m.end()),
                                   cumulative_curve({}).thresholds_m.back());
  return cloud_distances(*against.seen_samples, aligned_map, "surface samples", "map", farthest);
}

}  // namespace

MapEvaluation evaluate(PointCloud given_map, EvaluationInputs against, const EvaluationOptions& options,
                       const Progress& progress) {
  if (!against.voxel_centers && !(against.voxel_m && against.floor))
    throw InputError("ground truth", "has no voxel centres");
  constexpr std::int64_t kParts = 4;
  MapEvaluation score;
  score.errors.aligned_map = std::move(given_map);
  const PointCloud& aligned_map = score.errors.aligned_map;
  report_progress(progress, 0, kParts, "distances to voxel centres");
  score.errors.voxel_m = against.voxel_m ? std::move(*against.voxel_m)
                                         : cloud_distances(aligned_map, *against.voxel_centers, "map", "voxel centres");
  score.metrics.map = score_map(score.errors.voxel_m, floor_against(against, options.map.cutoff_m), options.map);
  if (against.surface && !against.surface->triangles.empty()) {
    report_progress(progress, 1, kParts, "distances to the surface");
    score.errors.surface_m = surface_distances(aligned_map, geometry::TriangleIndex(*against.surface));
    report_progress(progress, 2, kParts, "completeness");
    score.metrics.surface =
        score_surface(score.errors.surface_m, sample_distances(aligned_map, against, options), options.thresholds_m);
  }
  report_progress(progress, 3, kParts, "trajectory");
  if (against.estimate && against.truth) {
    score.metrics.trajectory = evaluate_trajectory(*against.estimate, *against.truth, options.trajectory);
  }
  report_progress(progress, kParts, kParts, "scored");
  return score;
}

}  // namespace tileflight::metrics
