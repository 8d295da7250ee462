#pragma once

#include <utility>
#include <vector>

#include "tileflight/geometry/transform.h"

namespace tileflight::alignment {

enum class ScaleMode { kFixed, kEstimated };

struct UmeyamaResult {
  geometry::Sim3 T_target_source;
  double rmse_m = 0.0;           ///< over the inliers
  std::size_t inliers = 0;
  bool well_conditioned = true;  ///< false: points on a line or at one place, rotation not determined
};

/// Least-squares similarity from paired points. Umeyama, IEEE TPAMI 13(4), 1991. Throws InputError for fewer than 3 pairs or NaN.
UmeyamaResult umeyama(const std::vector<geometry::Vec3>& source, const std::vector<geometry::Vec3>& target,
                      ScaleMode scale = ScaleMode::kEstimated);

struct RobustOptions {
  double inlier_m = 3.0;   ///< residual up to which a pair counts fully (then Geman-McClure by iteratively reweighted least squares)
  int iterations = 50;
};

/// The same against outliers: seeded RANSAC over triples, then iterative reweighting. Deterministic.
UmeyamaResult robust_umeyama(const std::vector<geometry::Vec3>& source, const std::vector<geometry::Vec3>& target,
                             ScaleMode scale, const RobustOptions& options);

}  // namespace tileflight::alignment
