#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "tileflight/core/geometry/transform.h"

namespace tileflight::alignment {

/// Fits the similarity between paired poses in two frames: the rotation is the chordal mean of the rotations between
/// the paired orientations (Hartley et al., IJCV 103(3), 2013, section 5.3); scale and translation follow by least
/// squares of the positions. It is determined even for a straight path, whose positions alone do not determine the
/// rotation about it. The scale is 1 if all positions coincide. Throws InputError for empty lists or lists of different
/// lengths.
geometry::Sim3 fit_poses(const std::vector<geometry::SE3>& source, const std::vector<geometry::SE3>& target);

enum class ScaleMode { kFixed, kEstimated };

struct UmeyamaResult {
  geometry::Sim3 T_target_source;
  double rmse_m = 0.0;  ///< over the inliers
  std::size_t inliers = 0;
  bool well_conditioned = true;  ///< false: points on a line or coincident, rotation not determined
};

/// Fits the least-squares similarity of paired points. Umeyama, IEEE TPAMI 13(4), 1991. For collinear or coincident
/// points the smallest rotation that fits is returned (well_conditioned = false). Throws InputError for fewer than 3
/// pairs, lists of different lengths, or NaN.
UmeyamaResult umeyama(const std::vector<geometry::Vec3>& source, const std::vector<geometry::Vec3>& target,
                      ScaleMode scale = ScaleMode::kEstimated);

/// Fits as umeyama() with a weight (>= 0) for each pair; `inliers` counts the pairs of positive weight, `rmse_m` is
/// weighted.
UmeyamaResult weighted_umeyama(const std::vector<geometry::Vec3>& source, const std::vector<geometry::Vec3>& target,
                               const std::vector<double>& weights, ScaleMode scale = ScaleMode::kEstimated);

struct RobustUmeyamaOptions {
  double inlier_m = 3.0;    ///< largest residual of an inlier; also the Geman-McClure scale in the reweighting
  int max_iterations = 50;  ///< maximum iterations of the reweighting; it ends early when the transform no longer
                            ///< changes
  int samples = 500;        ///< number of triples sampled
  std::uint64_t seed = 1;   ///< seed of the triple sampling
};

/// Fits robustly: seeded RANSAC over triples (Fischler and Bolles, CACM 24(6), 1981), then reweighting with the
/// Geman-McClure kernel. Deterministic. Throws InputError as umeyama() does.
UmeyamaResult robust_umeyama(const std::vector<geometry::Vec3>& source, const std::vector<geometry::Vec3>& target,
                             ScaleMode scale, const RobustUmeyamaOptions& options);

/// Returns the mean of the Geman-McClure cost r^2 / (1 + r^2 / inlier_m^2) over the pairs, square metres; the objective
/// of the reweighting.
double robust_cost_m2(const geometry::Sim3& T_target_source, const std::vector<geometry::Vec3>& source,
                      const std::vector<geometry::Vec3>& target, double inlier_m);

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

/// Returns `scale` alone, or the scales within a factor of `max_change` of `center` (of `scale` if there is no center).
ScaleRange scale_range(ScaleMode mode, double scale, double center, double max_change);

struct SimilarityFit {
  geometry::Sim3 T_target_source;
  bool well_conditioned = true;  ///< the points spread along at least two directions
};

/// Finds the similarity that minimises sum w |q - (s R p + t)|^2 over rotations R, translations t and scales s in the
/// range. Umeyama 1991, equations (40) to (42); clamping s is exact, since for the best R the cost is a parabola in s.
SimilarityFit fit_similarity(const PointMoments& moments, const ScaleRange& range);

}  // namespace tileflight::alignment
