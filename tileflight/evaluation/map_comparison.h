#pragma once

#include <array>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/evaluation/measured.h"
#include "tileflight/evaluation/metrics.h"
#include "tileflight/evaluation/missed_places.h"
#include "tileflight/evaluation/missing_parts.h"
#include "tileflight/geometry/doubt.h"

namespace tileflight::evaluation {

/// A scored map as far as it is compared with another of the same place.
struct ScoredMap {
  KeptDistances surface;             ///< of the points over the region to the exact surface, nothing cut off
  SeenSurface seen;                  ///< may be empty: completeness is not compared then
  std::optional<double> ate_rmse_m;  ///< where the true path is known
};

struct MapComparisonOptions {
  double cutoff_m = 1.0;           ///< RMS is of the points up to this; the share beyond is a number of its own
  double accuracy_within_m = 0.1;  ///< share of the map points this near to the surface
  /// Share of the surface with a point this near; the last decides.
  std::vector<double> completeness_within_m = {0.1, 0.2};
  // What counts as the same, and why.
  double ratio_margin = 1.25;        ///< of median and RMS: less than a quarter more or less changes no decision
  double share_margin = 0.05;        ///< of the shares of map points
  double completeness_margin = 1.1;  ///< ratio: a tenth more or fewer places with a point, as with more or fewer points
  double lacking_margin = 0.01;      ///< of the shares of the surface that a map lacks (MissingParts); 5 % is more
  double path_ratio_margin = 1.25;   ///< of the path error,
  double path_margin_m = 0.1;        ///< or this difference: the finest threshold at which maps are scored
  double wanted_blocks = 30;         ///< at least, of place_blocks()
  int resamples = 2000;
  std::uint64_t seed = 1;
};

/// What the intervals by blocks of a part rest on.
struct BlocksUsed {
  double edge_m = 0, effective = 0;
  std::size_t blocks = 0;
  std::array<std::size_t, 2> alone{};  ///< that only the simulated, only the real map reaches
};

/// The word for a verdict that doubts forbid.
inline constexpr const char* kWithheld = "withheld";

/// Two maps by numbers that tell them apart, and one verdict on all.
struct MapComparison {
  std::vector<Measured> measures;  ///< surface.…, completeness.…, path.ate
  std::optional<BlocksUsed> surface_blocks, completeness_blocks;
  std::optional<MissingParts> missing;  ///< of the first runs; "lacking" is of its shares, no verdict of its list
  Verdict verdict;
};

/// Every list holds a flight's runs, the first in front. By blocks of the place (PlaceBootstrap) of the first runs; by
/// runs (Welch) where both flights were tracked twice or more, not all alike. Path errors of one run each:
/// judge_one_path_each(). What one map lacks is a fact of this place; it is beyond its margin where the shares are, and
/// where maps of one kind, which lack this or that by chance, would seldom differ as much: exchange_p(). Fewer than
/// eight effective blocks give no interval. Throws InputError: no run, a run without
/// points, margins that are none.
MapComparison compare_maps(const std::vector<ScoredMap>& simulated, const std::vector<ScoredMap>& real,
                           const MapComparisonOptions& options = {});

/// The keys of the published measure's comparison, and beside them `surface {median, rms, within_T, beyond_T, blocks}`,
/// `completeness {within_T …, lacking, blocks}`, `path {ate}` and `missing_parts`, each null where it is not known,
/// `verdict`, `verdict_on` and `verdict_because` (lists of "part.key"). Without the second comparison, where there is
/// no exact surface, the verdict is that on the published measure. Where a doubt of either map forbids it (doubt.h), it
/// is "withheld": `verdict_withheld_by` lists those doubts, `verdict_without_doubts` is the word that the numbers give.
nlohmann::json to_json(const Comparison& published, const std::optional<MapComparison>& maps,
                       const Doubts& doubts = {});

}  // namespace tileflight::evaluation
