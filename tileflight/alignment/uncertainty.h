#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "tileflight/alignment/similarity_chart.h"
#include "tileflight/geometry/transform.h"

namespace tileflight::alignment {

/// A moved source point and the plane that it was matched with.
struct MatchedPlane {
  geometry::Vec3 point;   ///< about the centre of the moved points, metres
  geometry::Vec3 normal;  ///< unit length
  double residual_m = 0.0;
};

/// How far noise may have moved an aligned transform. Motions are about the centre of the moved points, in the target's
/// axes.
struct AlignmentUncertainty {
  Eigen::Matrix<double, 7, 7> covariance;  ///< of translation (m), rotation vector (rad) and logarithm of the scale
  geometry::Vec3 translation_sigma_m, rotation_sigma_rad;
  double scale_sigma = 0.0;         ///< of the scale's factor; 0 where the scale was fixed
  double rms_motion_sigma_m = 0.0;  ///< root mean square over points and noise of how far it moves the points
};

struct UncertaintyOptions {
  double length_m = 1.0;       ///< that the unknowns are scaled by (see plane_jacobian())
  double sampled_share = 1.0;  ///< `matches` are this share of all that the transform was fitted to
  double block_m = 5.0;        ///< residuals nearer than this may hang together
  bool with_scale = true;
};

/// Covariance of the least-squares estimate when residuals of neighbours hang together, as those of a map's points do:
/// H^-1 (sum over cubes of g g^T) H^-1 with g the sum of the gradients in a cube (Liang and Zeger, Biometrika 73(1),
/// 1986), instead of taking every point for a witness of its own. `spread`: second moment of the moved points about
/// their centre. nullopt where the planes leave a motion open. It knows the noise that is in the residuals, not what
/// all of them have in common: a truth that is a decimetre too high moves the map by a decimetre.
std::optional<AlignmentUncertainty> uncertainty_of(const std::vector<MatchedPlane>& matches, const PointSpread& spread,
                                                   const UncertaintyOptions& options);

}  // namespace tileflight::alignment
