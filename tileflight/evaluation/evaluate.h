#pragma once

#include <optional>

#include "tileflight/evaluation/metrics_file.h"
#include "tileflight/geometry/progress.h"

namespace tileflight::evaluation {

/// Everything that one aligned map is scored against, local frame. What is null or empty is not scored.
struct ScoreInputs {
  const geometry::PointCloud* voxel_centers = nullptr;    ///< needed
  const geometry::PointCloud* surface_samples = nullptr;  ///< evenly on the true surface, for the floor
  const geometry::TriangleMesh* surface = nullptr;
  const geometry::PointCloud* seen_samples = nullptr;  ///< of the surface that the camera saw
  const geometry::Trajectory* estimate = nullptr;      ///< map frame or local, it is aligned anew
  const geometry::Trajectory* truth = nullptr;
  std::optional<DistanceStatistics> floor = {};  ///< where it is known already; else from the surface samples
};

struct ScoreOptions {
  MapMetricsOptions map{};
  std::vector<double> thresholds_m = {0.1, 0.2, 0.5, 1.0};
  TrajectoryAlignment trajectory_alignment = TrajectoryAlignment::kSim3;
  std::vector<double> rpe_deltas_m = {1, 10, 50};
};

struct Score {
  Metrics metrics;
  PointErrors errors;  ///< for write_metrics()
};

/// All metrics of a map with each distance measured once. Throws InputError as the parts do.
Score evaluate(geometry::PointCloud aligned_map, const ScoreInputs& against, const ScoreOptions& options = {},
               const Progress& progress = {});

}  // namespace tileflight::evaluation
