#pragma once

#include "tileflight/core/alignment/umeyama.h"
#include "tileflight/core/geometry/transform.h"

namespace tileflight::alignment {

/// Sums over weighted pairs (source p, target q) from which the least-squares similarity follows in closed form.
/// Coordinates should be near zero (subtract a common centre first), since second moments are formed from raw sums.
struct PointMoments {
  double weight = 0.0;
  geometry::Vec3 source = geometry::Vec3::Zero();         ///< sum of w p
  geometry::Vec3 target = geometry::Vec3::Zero();         ///< sum of w q
  geometry::Mat3 target_source = geometry::Mat3::Zero();  ///< sum of w q p^T
  double source_squared = 0.0;                            ///< sum of w |p|^2

  void add(const geometry::Vec3& p, const geometry::Vec3& q, double w = 1.0);
  PointMoments& operator+=(const PointMoments& other);
};

/// Bounds on the scale of a fit.
struct ScaleRange {
  double min = 1.0;
  double max = 1.0;
};

/// `scale` alone, or the scales within a factor of `max_change` of `center` (of `scale` if there is no center).
ScaleRange scale_range(ScaleMode mode, double scale, double center, double max_change);

struct SimilarityFit {
  geometry::Sim3 T_target_source;
  bool well_conditioned = true;  ///< the points spread along at least two directions
};

/// Minimises sum w |q - (s R p + t)|^2 over rotations R, translations t and scales s in the range. Umeyama 1991,
/// equations (40) to (42); clamping s is exact, since for the best R the cost is a parabola in s.
SimilarityFit fit_similarity(const PointMoments& moments, const ScaleRange& range);

}  // namespace tileflight::alignment
