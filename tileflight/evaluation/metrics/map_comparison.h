#pragma once

#include <array>
#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/core/base/warning.h"
#include "tileflight/evaluation/metrics/compared_metric.h"
#include "tileflight/evaluation/metrics/metrics.h"
#include "tileflight/evaluation/metrics/missed_places.h"
#include "tileflight/evaluation/metrics/missing_parts.h"

namespace tileflight::metrics {

/// The data of a scored map that enter a comparison with another map of the same place.
struct ScoredMap {
  KeptDistances surface;             ///< distances of the points over the region to the exact surface, without cut-off
  SeenSurface seen;                  ///< if empty, completeness is not compared
  std::optional<double> ate_rmse_m;  ///< if the true path is known
};

struct MapComparisonOptions {
  double cutoff_m = 1.0;           ///< the RMS includes points up to this distance; the share beyond it is a separate
                                   ///< metric
  double accuracy_within_m = 0.1;  ///< metric: share of the map points within this distance of the surface
  /// Metric: share of the surface with a map point within this distance; the last one is decisive.
  std::vector<double> completeness_within_m = {0.1, 0.2};
  // Equivalence margins, with their reasons.
  double ratio_margin = 1.25;        ///< for median and RMS: less than a quarter more or less changes no decision
  double share_margin = 0.05;        ///< for the shares of map points
  double completeness_margin = 1.1;  ///< ratio: a tenth more or less of the surface with a point, as a denser or
                                     ///< sparser map of it gives
  double lacking_margin = 0.01;      ///< for the share of the surface that a map lacks (MissingParts); 5 % lacking
                                     ///< exceeds it
  double path_ratio_margin = 1.25;   ///< for the path error
  double path_margin_m = 0.1;        ///< alternatively this difference in the path error: the finest threshold at which
                                     ///< maps are scored
  double min_effective_blocks = 30;  ///< minimum number, for choose_block_grid()
  int resamples = 2000;
  std::uint64_t seed = 1;
};

/// Blocks from which the intervals of a part were computed.
struct BlockSummary {
  double edge_m = 0, effective = 0;
  std::size_t blocks = 0;
  std::array<std::size_t, 2> exclusive{};  ///< blocks reached only by the simulated map, only by the real map
};

/// Verdict used if warnings do not allow one.
inline constexpr const char* kWithheld = "withheld";

/// Comparison of two maps by several metrics, with one overall verdict.
struct MapComparison {
  std::vector<ComparedMetric> metrics;  ///< surface.…, completeness.…, path.ate
  std::optional<BlockSummary> surface_blocks, completeness_blocks;
  std::optional<MissingParts> missing;  ///< of the first runs; the metric "lacking" uses its shares, its list has no
                                        ///< verdict
  Verdict verdict;
};

/// Compares two flights; each list holds the runs of one flight, in order. Intervals are by runs (Welch) if both
/// flights were tracked at least twice with differing results, else by blocks of the place (BlockBootstrap) of the
/// first runs. Path errors of one run each: judge_single_paths(). What a map lacks is specific to this place: the
/// metric is beyond its margin if the shares differ by more than the margin and a random exchange of blocks between the
/// maps seldom gives such a difference (exchange_p()). Fewer than eight effective blocks give no interval. Throws
/// InputError if there is no run, a run has no points, or a margin is invalid.
MapComparison compare_maps(const std::vector<ScoredMap>& simulated, const std::vector<ScoredMap>& real,
                           const MapComparisonOptions& options = {});

/// The keys of the comparison by the published metric, and `surface {median, rms, within_T, beyond_T, blocks}`,
/// `completeness {within_T …, lacking, blocks}`, `path {ate}` and `missing_parts`, each null if unknown, `verdict`,
/// `verdict_on` and `verdict_because` (lists of "part.key"). Without the second comparison (no exact surface) the
/// verdict is that of the published metric. If a warning of either map forbids a verdict (warning.h), it is "withheld":
/// `verdict_withheld_by` lists those warnings, `verdict_without_warnings` is the verdict from the numbers alone.
nlohmann::json to_json(const DistanceComparison& published, const std::optional<MapComparison>& maps,
                       const Warnings& warnings = {});

}  // namespace tileflight::metrics
