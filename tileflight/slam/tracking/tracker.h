#pragma once

// Direct image alignment of a new image to a keyframe: DSO, section 3.1, step 1. Eight unknowns (pose, affine
// brightness), coarse to fine.

#include <limits>
#include <vector>

#include "tileflight/core/geometry/transform.h"
#include "tileflight/slam/keyframes/options.h"
#include "tileflight/slam/keyframes/pyramid.h"
#include "tileflight/slam/keyframes/rolling_shutter.h"
#include "tileflight/slam/tracking/tracking_reference.h"

namespace tileflight::tracking {

/// Candidate poses T_camera_reference of the next image, most probable first (DSO, section 3.1, step 1): constant,
/// double, half and zero velocity since the last image, the keyframe's own pose, then small rotations about the first.
/// `T_last_before_last`: last motion; `turns`: number of rotation magnitudes tried, each twice the one before.
std::vector<geometry::SE3> motion_hypotheses(const geometry::SE3& T_last_reference,
                                             const geometry::SE3& T_last_before_last, int turns);

/// Unknowns of the alignment: I_target = e^a I_reference + b (DSO, eq. 4 relative to the reference).
struct ImageAlignmentState {
  geometry::SE3 T_target_reference;
  double a = 0.0;
  double b = 0.0;
};

struct ImageAlignment {
  ImageAlignmentState state;
  bool converged = false;        ///< enough pixels visible, RMSE below lost_rmse, gain within limits
  std::vector<double> rmse;      ///< grey values, by level; infinite on levels not reached
  double inside_share = 0.0;     ///< share of the reference's pixels inside the target (level 0)
  double saturated_share = 0.0;  ///< share of those with a residual above the cut-off
  Eigen::Matrix<double, 8, 8> information = Eigen::Matrix<double, 8, 8>::Zero();  ///< Gauss-Newton matrix H of the
                                                                                  ///< finest level

  double finest_rmse() const { return rmse.empty() ? std::numeric_limits<double>::infinity() : rmse.front(); }
};

/// Covariance of the left twist of T_target_reference, translation first, if the residuals' errors were independent of
/// each other.
Eigen::Matrix<double, 6, 6> pose_covariance(const ImageAlignment& alignment);

/// Aligns from `start`. Gives up early (not converged) if a level's RMSE exceeds `give_up_rmse` of that level (may be
/// empty). Stops at `finest_level`; above level 0 the shares are of that level and `converged` stays false. With a
/// rolling shutter each row of the target has its own pose; the middle row's is estimated, and the velocity changes
/// with it. The reference is a global-shutter image.
ImageAlignment align_image(const keyframes::LensPyramid& lens, const TrackingReference& reference,
                           const keyframes::Pyramid& target, const ImageAlignmentState& start,
                           const keyframes::TrackingOptions& options, const std::vector<double>& give_up_rmse = {},
                           int finest_level = 0, const keyframes::RollingShutter& shutter = {});

/// Root mean square optical flow between reference and target, pixels of level 0: by translation alone, and by all
/// motion.
struct OpticalFlow {
  double translation_px = 0.0;
  double full_px = 0.0;
};
OpticalFlow optical_flow(const keyframes::LensPyramid& lens, const TrackingReference& reference,
                         const geometry::SE3& T_target_reference);

}  // namespace tileflight::tracking
