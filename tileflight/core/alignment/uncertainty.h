#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <functional>
#include <optional>
#include <vector>

#include "tileflight/core/alignment/similarity_chart.h"
#include "tileflight/core/geometry/transform.h"

namespace tileflight::alignment {

/// Estimates the standard deviation of an estimated similarity, measured as displacement of the points (RMS over points
/// and noise), by leaving out one of `groups` parts of the data at a time (delete-a-group jackknife: Kott, J. Official
/// Statistics 17(4), 2001): (g - 1) / g sum over the groups of the squared motion between the estimate without the
/// group and the mean of all such, the latter approximated by `whole`. If the groups are intervals of time, errors
/// correlated in time are accounted for. `without(group)` estimates from the rest. NaN for fewer than two groups.
double jackknife_sigma_m(const geometry::Sim3& whole, std::size_t groups, const PointSpread& points,
                         const std::function<geometry::Sim3(std::size_t group)>& without);

/// A transformed source point and the plane it was matched with.
struct MatchedPlane {
  geometry::Vec3 point;   ///< relative to the centre of the transformed points, metres
  geometry::Vec3 normal;  ///< unit length
  double residual_m = 0.0;
};

/// Uncertainty of an estimated transform due to noise. Motions are about the centre of the transformed points, in the
/// target's axes.
struct AlignmentUncertainty {
  Eigen::Matrix<double, 7, 7> covariance;  ///< of translation (m), rotation vector (rad) and logarithm of the scale
  geometry::Vec3 translation_sigma_m, rotation_sigma_rad;
  double scale_sigma = 0.0;         ///< relative, of the scale; 0 if the scale was fixed
  double rms_motion_sigma_m = 0.0;  ///< RMS displacement of the points, over points and noise
};

struct UncertaintyOptions {
  double length_m = 1.0;              ///< by which the unknowns are scaled (see plane_jacobian())
  double sampled_share = 1.0;         ///< `matches` are this share of all matches used in the fit
  double correlation_length_m = 5.0;  ///< residuals closer than this may be correlated
  bool with_scale = true;
};

/// Estimates the covariance of the least-squares estimate with spatially correlated residuals, as those of a map's
/// points are: H^-1 (sum over cubes of g g^T) H^-1 with g the sum of the gradients in a cube (Liang and Zeger,
/// Biometrika 73(1), 1986), instead of treating all points as independent. `spread`: second moment of the transformed
/// points about their centre. nullopt if the planes leave a motion unconstrained. It covers the noise in the residuals,
/// not errors common to all of them: a ground truth that is a decimetre too high moves the map by a decimetre.
std::optional<AlignmentUncertainty> estimate_uncertainty(const std::vector<MatchedPlane>& matches,
                                                         const PointSpread& spread, const UncertaintyOptions& options);

}  // namespace tileflight::alignment
