#pragma once

#include <cstddef>
#include <limits>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

namespace tileflight::base {
class StrictSection;
}

namespace tileflight::metrics {

/// One source of a map's error.
struct ErrorSource {
  std::optional<double> value_m;  ///< none: unknown
  std::string kind;  ///< "measured", "estimated", "bound" (upper bound), "stated" (by the data's producer), "remainder"
  std::string explanation;  ///< explanation in words
};

/// Sources of a map's error, as far as they can be separated; RMS unless stated otherwise. Sources in the ground truth
/// (voxels, tiles) are listed separately from those in the map (alignment, odometry).
struct ErrorBudget {
  ErrorSource voxel, tiles, alignment, path, odometry;
  std::optional<ErrorSource> reference;  ///< of a flight without true poses that was located in the tiles
  double within_m = 0;                   ///< the total includes distances to the surface up to this
  double share_within = 0;               ///< share of the map points over the region with ground truth
  std::optional<double> total_m;         ///< RMS of those distances
  std::vector<std::string> not_separated;
};

/// Inputs of the error budget.
struct ErrorBudgetInputs {
  double floor_rmse_m = std::numeric_limits<double>::quiet_NaN();  ///< RMS distance of a perfect map to the voxel
                                                                   ///< centres
  std::optional<double> geometric_error_m;                         ///< largest geometricError of the loaded tiles
  std::optional<double> alignment_sigma_m;  ///< RMS displacement of the points by alignment noise (transform.json)
  /// RMS distance between the aligned map points and the same points placed by the true poses.
  std::optional<double> rms_to_true_poses_m;
  /// RMS of the standard deviations of these poses' positions, if they were located in the tiles instead of known.
  std::optional<double> reference_sigma_m;
  std::vector<double> surface_m;  ///< distances of the map's points to the surface
  double within_m = 1.0;
};

/// Computes the budget. path: from the true poses; an upper bound of the alignment error, since it includes the
/// odometry's drift, and the reference's own error if there is a reference. odometry: total squared minus alignment
/// squared, not below zero.
ErrorBudget error_budget(const ErrorBudgetInputs& inputs);

/// Returns {voxel, tiles, alignment, path, odometry, each {metres | null, kind, how}; reference, the same or null;
/// total, within, share_within, not_separated}.
nlohmann::json to_json(const ErrorBudget& budget);

/// Reads the object that to_json() returns. Throws InputError as StrictSection does.
ErrorBudget read_error_budget(base::StrictSection section);

}  // namespace tileflight::metrics
