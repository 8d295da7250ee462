#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>

#include "tileflight/evaluation/error_budget.h"
#include "tileflight/evaluation/map_entropy.h"
#include "tileflight/evaluation/metrics.h"
#include "tileflight/evaluation/region_scores.h"
#include "tileflight/geometry/doubt.h"

namespace tileflight::evaluation {

/// All that a scored map has in `metrics.json`.
struct Metrics {
  MapMetrics map;
  std::optional<SurfaceMetrics> surface;
  std::optional<TrajectoryMetrics> trajectory;  ///< null where there is no true trajectory
  std::optional<MapEntropy> entropy;
  std::optional<ErrorBudget> error_budget;
  std::optional<RegionScores> regions;  ///< where the alignment had regions; else the key is not there
  Doubts doubts;                        ///< what may make the scores wrong
};

nlohmann::json to_json(const Metrics& metrics);

/// The inverse. Throws InputError (`where`, key, cause) for a key that is missing, unknown or of the wrong type.
Metrics metrics_from_json(const nlohmann::json& json, const std::string& where);

/// Aligned map with each point's distances, metres; `surface_m` may be empty, and `over_region` where all are over it.
struct PointErrors {
  geometry::PointCloud aligned_map;
  std::vector<double> voxel_m, surface_m;
  std::vector<bool> over_region{};  ///< whether there is truth to measure the point's surface distance against
};

/// Writes `metrics.json` and beside it `errors.ply`: the aligned map with the scalars `voxel_distance`,
/// `surface_distance` and `over_region` (1 or 0). Floats of the scalars stay on the distance's side of the cut-off, so
/// that reading gives the same correspondences. Throws InputError.
void write_metrics(const std::filesystem::path& metrics_json, const Metrics& metrics, PointErrors errors);

/// What is needed to compare a run with another.
struct MetricsFile {
  Metrics metrics;
  KeptDistances voxel;  ///< within the cut-off
  /// Over the region, nothing cut off. None where there is no surface, and in older files that do not say what lies
  /// over the region.
  std::optional<KeptDistances> surface;
};

/// Reads both. Throws InputError: broken JSON, keys as above, errors.ply missing, without its scalars, or of another
/// run (its correspondences are not those of metrics.json).
MetricsFile read_metrics(const std::filesystem::path& metrics_json);

/// Where the errors of a metrics file lie.
std::filesystem::path errors_file(const std::filesystem::path& metrics_json);

}  // namespace tileflight::evaluation
