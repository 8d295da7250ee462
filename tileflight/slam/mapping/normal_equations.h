#pragma once

// Gauss-Newton system of the window: DSO, section 2.3, eq. 10. Unknowns: 8 per keyframe (left twist of T_camera_map, a,
// b), 4 intrinsics if they are estimated, one inverse distance per point. A residual depends on host and target only
// through their relative pose and brightness, so sums are kept per pair and transformed to both keyframes' unknowns
// once:
//   x_rel = x_target + M x_host,   M = diag(-Ad(T_target_host), -1, -gain).
// A residual of a point in its host's stereo picture (static stereo) depends on the inverse distance and on the
// brightness of that picture only, since the cameras are fixed to each other: it has no part in the poses but through
// the elimination of the point.

#include <vector>

#include "tileflight/slam/keyframes/keyframe.h"
#include "tileflight/slam/mapping/host_target_pairs.h"

namespace tileflight::mapping {

/// H x = -b over the unknowns of keyframes and of intrinsics or stereo pictures, with the points eliminated (Schur
/// complement). b = J^T W r, the negative of DSO's b in eq. 10.
struct NormalEquations {
  Eigen::MatrixXd H;
  Eigen::VectorXd b;
};

/// A point of the window, by host slot and index.
struct PointRef {
  int host = 0;
  int index = 0;
};
std::vector<PointRef> all_points(const keyframes::Window& window);

/// Sums over the good observations of the points. In the elimination H_rho_rho is multiplied by 1 + `rho_damping`. Also
/// sets each point's information. Fixed chunks are added in order, so the result does not depend on the number of
/// threads.
NormalEquations build_normal_equations(keyframes::Window& window, const std::vector<HostTargetPair>& pairs,
                                       const std::vector<PointRef>& points, double rho_damping);

/// Steps of the points' inverse distances for the step x of the other unknowns, written to ActivePoint::step.
void back_substitute(keyframes::Window& window, const std::vector<HostTargetPair>& pairs,
                     const std::vector<PointRef>& points, const Eigen::VectorXd& x, double rho_damping);

/// Stacked deltas of all keyframes, and of the intrinsics or stereo pictures, from their linearisation points.
Eigen::VectorXd stacked_delta(const keyframes::Window& window);

}  // namespace tileflight::mapping
