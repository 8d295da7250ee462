#pragma once

#include <vector>

namespace tileflight::scoring {

/// Section `evaluation:`. Keys: cutoff, thresholds, equivalence_margin, ratio_margin, share_margin,
/// completeness_margin, lacking_margin, path_margin, completeness_samples_per_m2, entropy_radius, wasserstein_voxel,
/// wasserstein_min_points, agreement_cell.
struct EvaluationSettings {
  double cutoff_m = 1.0;
  std::vector<double> thresholds_m{0.1, 0.2, 0.5, 1.0};
  double equivalence_margin_m = 0.05;  ///< for the published measure
  // Equivalence margins of the comparison of two maps; metrics::MapComparisonOptions gives the reasons.
  double ratio_margin = 1.25;        ///< of median and RMS distance to the surface
  double share_margin = 0.05;        ///< of the shares of map points
  double completeness_margin = 1.1;  ///< ratio
  double lacking_margin = 0.01;      ///< for the share that one map lacks of what the other covers
  double path_margin_m = 0.1;
  double completeness_samples_per_m2 = 4.0;
  double entropy_radius_m = 2.0;     ///< radius of the neighbourhoods used for the map's entropy
  double wasserstein_voxel_m = 3.0;  ///< edge of the voxels of AWD and SCS
  int wasserstein_min_points = 10;   ///< of map and of truth in a voxel that is scored by them, at least 2
  double agreement_cell_m = 2.0;     ///< edge of the cells in which both flights' maps are compared
};

}  // namespace tileflight::scoring
