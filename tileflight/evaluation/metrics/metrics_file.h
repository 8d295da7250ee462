#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>

#include "tileflight/core/base/warning.h"
#include "tileflight/evaluation/metrics/error_budget.h"
#include "tileflight/evaluation/metrics/map_entropy.h"
#include "tileflight/evaluation/metrics/metrics.h"
#include "tileflight/evaluation/metrics/moving_points.h"
#include "tileflight/evaluation/metrics/region_scores.h"
#include "tileflight/evaluation/metrics/voxel_wasserstein.h"

namespace tileflight::metrics {

/// Contents of `metrics.json`.
struct Metrics {
  MapMetrics map;
  std::optional<SurfaceMetrics> surface;
  std::optional<TrajectoryMetrics> trajectory;  ///< null if there is no true trajectory
  std::optional<MapEntropy> entropy;
  std::optional<VoxelWasserstein> wasserstein;
  std::optional<ErrorBudget> error_budget;
  std::optional<RegionScores> regions;  ///< if the alignment had regions; else the key is absent
  std::optional<MovingPoints> moving;   ///< if the flight's moving things are known; else the key is absent
  Warnings warnings;                    ///< warnings about possible errors in the scores
};

nlohmann::json to_json(const Metrics& metrics);

/// Reads the object that to_json() returns. Throws InputError (`where`, key, cause) for a key that is missing, unknown
/// or of the wrong type.
Metrics metrics_from_json(const nlohmann::json& json, const std::string& where);

/// Aligned map with the distances of each point, metres. `surface_m` may be empty, and so may `over_region` if all
/// points are over it.
struct PointErrors {
  geometry::PointCloud aligned_map;
  std::vector<double> voxel_m, surface_m;
  std::vector<bool> over_region{};  ///< per point: whether there is ground truth for its surface distance
};

/// Returns the aligned map with the scalars `voxel_distance`, `surface_distance` and `over_region` (1 or 0). Distances
/// rounded to float stay on the same side of the cut-off, so that reading them gives the same correspondences.
geometry::PointCloud cloud_with_errors(PointErrors errors, double cutoff_m);

/// Writes `metrics.json` and, in the same folder, `errors.ply`: cloud_with_errors(). Throws InputError.
void write_metrics(const std::filesystem::path& metrics_json, const Metrics& metrics, PointErrors errors);

/// Writes `metrics.json` alone. Throws InputError.
void write_metrics(const std::filesystem::path& metrics_json, const Metrics& metrics);

/// Writes the cloud of cloud_with_errors() to a file. Throws InputError.
void write_point_errors(const std::filesystem::path& ply, PointErrors errors, double cutoff_m);

/// Data needed to compare a run with another.
struct MetricsFile {
  Metrics metrics;
  KeptDistances voxel;  ///< within the cut-off
  /// Distances to the surface over the region, without cut-off. None if there is no surface, and for older files
  /// without `over_region`.
  std::optional<KeptDistances> surface;
};

/// Reads both files. Throws InputError for invalid JSON or keys, and if errors.ply is missing, lacks its scalars, or
/// belongs to another run (its correspondences differ from those of metrics.json).
MetricsFile read_metrics(const std::filesystem::path& metrics_json);

/// Path of errors.ply for a metrics file.
std::filesystem::path errors_file(const std::filesystem::path& metrics_json);

}  // namespace tileflight::metrics
