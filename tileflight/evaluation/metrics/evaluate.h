#pragma once

#include <optional>

#include "tileflight/core/base/progress.h"
#include "tileflight/evaluation/metrics/metrics_file.h"

namespace tileflight::metrics {

/// Ground truth to score an aligned map against, local frame. Parts that are null or empty are not scored.
struct EvaluationInputs {
  const geometry::PointCloud* voxel_centers = nullptr;    ///< required, unless the distances to them are given
  const geometry::PointCloud* surface_samples = nullptr;  ///< evenly distributed on the true surface, for the
                                                          ///< quantisation floor
  const geometry::TriangleMesh* surface = nullptr;
  const geometry::PointCloud* seen_samples = nullptr;  ///< samples of the surface that the camera saw
  const geometry::Trajectory* estimate = nullptr;      ///< in any frame; it is aligned again
  const geometry::Trajectory* truth = nullptr;
  std::optional<DistanceStatistics> floor = {};     ///< if known already; else computed from the surface samples
  std::optional<std::vector<double>> voxel_m = {};  ///< distance of each map point to the voxel centres, if measured
                                                    ///< already; then the floor is required
};

struct EvaluationOptions {
  MapMetricsOptions map{};
  std::vector<double> thresholds_m = {0.1, 0.2, 0.5, 1.0};
  TrajectoryOptions trajectory{};
};

struct MapEvaluation {
  Metrics metrics;
  PointErrors errors;  ///< for write_metrics()
};

/// Computes all metrics of a map, measuring each distance once. Throws InputError as the individual functions do.
MapEvaluation evaluate(geometry::PointCloud aligned_map, EvaluationInputs against,
                       const EvaluationOptions& options = {}, const Progress& progress = {});

}  // namespace tileflight::metrics
