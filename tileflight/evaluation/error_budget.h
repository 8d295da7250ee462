#pragma once

#include <cstddef>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

namespace tileflight::evaluation {

/// One source of a map's error.
struct BudgetPart {
  std::optional<double> metres;  ///< none: not known
  std::string kind;  ///< "measured", "estimated", "bound" (at most that), "stated" (by who made the data), "remainder"
  std::string how;   ///< in words
};

/// Where a map's error comes from, as far as it can be told; RMS where not said otherwise. What belongs to the truth
/// (voxels, tiles) is apart from what belongs to the map (alignment, odometry).
struct ErrorBudget {
  BudgetPart voxel, tiles, alignment, path, odometry;
  double within_m = 0;            ///< distances to the surface up to this make the total
  double share_within = 0;        ///< of the map points over the truth
  std::optional<double> total_m;  ///< RMS of those distances
  std::vector<std::string> not_separated;
};

/// What the budget is made from.
struct BudgetInputs {
  double floor_rmse_m = std::numeric_limits<double>::quiet_NaN();  ///< of a perfect map, to voxel centres
  std::optional<double> geometric_error_m;                         ///< the tiles' own, largest of those loaded
  std::optional<double> alignment_sigma_m;  ///< how far noise may have moved the points (transform.json), RMS
  /// RMS distance between the map's points as they were aligned and as the true poses would have put them.
  std::optional<double> to_true_poses_m;
  std::vector<double> surface_m;  ///< distances of the map's points to the surface
  double within_m = 1.0;
};

/// path: against the true poses, which bounds the alignment from above, since the odometry's own drift is in it.
/// odometry: what is left of the total's square beyond the alignment, never below zero.
ErrorBudget error_budget(const BudgetInputs& inputs);

/// {voxel, tiles, alignment, path, odometry, each {metres | null, kind, how}; total, within, share_within,
/// not_separated}.
nlohmann::json to_json(const ErrorBudget& budget);

/// The inverse; throws InputError (`where`, key, cause).
ErrorBudget error_budget_from_json(const nlohmann::json& json, const std::string& where);

}  // namespace tileflight::evaluation
